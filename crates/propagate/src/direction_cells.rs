//! The sphere of directions, cut into cells whose centres represent it evenly.

use crate::vector::{Vec3, dot, unit};

/// A first point of the improved snub cube, whose 24 corners integrate polynomials of up to seventh degree exactly
/// (McLaren 1963; Hardin and Sloane 1996): the zero of their means of degree 4 and 6.
const SNUB_CUBE: Vec3 = [0.866_246_818_107_820_6, 0.422_518_653_761_111_5, 0.266_635_401_516_704_8];

/// The seed whose Voronoi cell, among its images, has the corner of [`SNUB_CUBE`] for its centroid: as the cells lack mirror
/// symmetry, the corner itself is 0.4 degrees off the centroid of its own cell.
const SNUB_CUBE_SEED: Vec3 = [0.904_306_369_350_257_8, 0.361_534_088_266_966_9, 0.226_986_989_436_681_6];

/// Cells of equal size whose centroids are a spherical design: independent sounds from the centroids, of equal energy, have the
/// channel energies of a diffuse field exactly.
#[derive(Clone, Debug)]
pub(crate) struct DirectionCells {
    /// A direction belongs to the nearest of these.
    seeds: Vec<Vec3>,
    centres: Vec<Vec3>,
}

impl DirectionCells {
    /// As many cells as an ambisonic order needs: design of degree twice the order at least.
    pub fn for_order(order: usize) -> Self {
        let (seeds, centres) = match order {
            0 => (vec![[0.0, 0.0, 1.0]], vec![[0.0, 0.0, 1.0]]),
            1 | 2 => (icosahedron(), icosahedron()),
            _ => (turned_by_cube(SNUB_CUBE_SEED), turned_by_cube(SNUB_CUBE)),
        };
        Self { seeds, centres }
    }

    pub fn len(&self) -> usize {
        self.centres.len()
    }

    /// Directions of the centroids.
    pub fn centres(&self) -> &[Vec3] {
        &self.centres
    }

    /// The cell that a direction lies in.
    pub fn of(&self, direction: Vec3) -> usize {
        let nearness = self.seeds.iter().map(|&seed| dot(seed, direction)).enumerate();
        nearness.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(cell, _)| cell)
    }
}

/// Twelve corners: a design of degree 5.
fn icosahedron() -> Vec<Vec3> {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let mut corners = Vec::with_capacity(12);
    for axis in 0..3 {
        for (a, b) in [(1.0, golden), (1.0, -golden), (-1.0, golden), (-1.0, -golden)] {
            let mut corner = [0.0; 3];
            corner[(axis + 1) % 3] = a;
            corner[(axis + 2) % 3] = b;
            corners.push(unit(corner));
        }
    }
    corners
}

/// All images of one point under the rotations of the cube.
fn turned_by_cube(point: Vec3) -> Vec<Vec3> {
    let [a, b, c] = unit(point);
    let even = [[a, b, c], [b, c, a], [c, a, b]];
    let odd = [[a, c, b], [c, b, a], [b, a, c]];
    let mut corners = Vec::with_capacity(24);
    for signs in 0..8u32 {
        let sign = |axis: u32| if signs >> axis & 1 == 1 { -1.0 } else { 1.0 };
        let permutations = if signs.count_ones() % 2 == 0 { even } else { odd };
        corners.extend(permutations.map(|[x, y, z]| [sign(0) * x, sign(1) * y, sign(2) * z]));
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of monomials against their closed form: 0 for odd powers, else the product of (power - 1)!! over (sum + 1)!!.
    #[test]
    fn centres_integrate_polynomials_exactly() {
        let double_factorial = |n: i32| (1..=n).rev().step_by(2).map(f64::from).product::<f64>();
        for (order, degree) in [(1, 5), (3, 7)] {
            let cells = DirectionCells::for_order(order);
            for i in 0..=degree {
                for j in 0..=degree - i {
                    for k in 0..=degree - i - j {
                        let power = |p: &Vec3| p[0].powi(i) * p[1].powi(j) * p[2].powi(k);
                        let mean = cells.centres().iter().map(power).sum::<f64>() / cells.len() as f64;
                        let odd = i % 2 + j % 2 + k % 2 > 0;
                        let closed = [i, j, k].map(|n| double_factorial(n - 1)).iter().product::<f64>()
                            / double_factorial(i + j + k + 1);
                        assert!((mean - if odd { 0.0 } else { closed }).abs() < 1e-13, "{i} {j} {k}");
                    }
                }
            }
        }
    }

    #[test]
    fn centres_are_the_centroids_of_their_cells() {
        for order in [1, 3] {
            let cells = DirectionCells::for_order(order);
            let mut sums = vec![[0.0; 3]; cells.len()];
            // Points of a spiral, evenly spread (Saff and Kuijlaars 1997).
            let points = 400_000;
            for i in 0..points {
                let z: f64 = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(points);
                let (sine, cosine) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
                let direction = [(1.0 - z * z).sqrt() * cosine, (1.0 - z * z).sqrt() * sine, z];
                let sum = &mut sums[cells.of(direction)];
                *sum = crate::vector::add(*sum, direction);
            }
            for (sum, &centre) in sums.into_iter().zip(cells.centres()) {
                assert!(dot(unit(sum), centre) > (0.02f64).to_radians().cos(), "order {order}: {sum:?}");
            }
        }
    }
}
