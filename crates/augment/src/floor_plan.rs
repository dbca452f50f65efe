//! The ground that a room stands on.

use rand::Rng;
use rand_pcg::Pcg64;
use std::f64::consts::{PI, TAU};

/// A simple polygon, its corners in metres, counter-clockwise.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FloorPlan {
    corners_m: Vec<[f64; 2]>,
}

impl FloorPlan {
    /// A plan of this area: four walls none of which need be parallel, five to eight walls about an ellipse, or an L with
    /// oblique corners. Each kind is as likely as the others; all are turned at random.
    pub(crate) fn draw(rng: &mut Pcg64, area_m2: f64) -> Self {
        let aspect = rng.random_range(1.0..2.2);
        let unit: Vec<[f64; 2]> = match rng.random_range(0..3) {
            0 => [[0.0, 0.0], [aspect, 0.0], [aspect, 1.0], [0.0, 1.0]]
                .iter()
                .map(|corner| corner.map(|c: f64| c + rng.random_range(-0.12..0.12)))
                .collect(),
            1 => {
                // Points of an ellipse in order make a convex polygon whatever their angles.
                let count = rng.random_range(5..=8);
                (0..count)
                    .map(|i| TAU * (f64::from(i) + rng.random_range(-0.25..0.25)) / f64::from(count))
                    .map(|angle| [aspect * angle.cos(), angle.sin()])
                    .collect()
            }
            _ => {
                let (u, v) = (aspect * rng.random_range(0.4..0.7), rng.random_range(0.4..0.7));
                // A shear keeps an L simple and makes its corners oblique.
                let shear = rng.random_range(-0.25..0.25);
                [[0.0, 0.0], [aspect, 0.0], [aspect, v], [u, v], [u, 1.0], [0.0, 1.0]]
                    .map(|[x, y]| [x + shear * y, y])
                    .to_vec()
            }
        };
        let scale = (area_m2 / signed_area(&unit)).sqrt();
        let (sin, cos) = rng.random_range(-PI..PI).sin_cos();
        let corners_m = unit
            .into_iter()
            .map(|[x, y]| [scale * (cos * x - sin * y), scale * (sin * x + cos * y)])
            .collect();
        Self { corners_m }
    }

    pub(crate) fn corners_m(&self) -> &[[f64; 2]] {
        &self.corners_m
    }

    /// A point in the rectangle about the plan.
    pub(crate) fn point_about(&self, rng: &mut Pcg64) -> [f64; 2] {
        std::array::from_fn(|axis| {
            let along = || self.corners_m.iter().map(|c| c[axis]);
            let (low, high) =
                (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max));
            rng.random_range(low..=high)
        })
    }

    /// Distance of a point from the nearest wall, negative outside.
    pub(crate) fn clearance_m(&self, point: [f64; 2]) -> f64 {
        let mut inside = false;
        let mut nearest = f64::INFINITY;
        for (a, b) in self.edges() {
            let t = (dot(sub(point, a), sub(b, a)) / dot(sub(b, a), sub(b, a))).clamp(0.0, 1.0);
            let foot = [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
            nearest = nearest.min(dot(sub(point, foot), sub(point, foot)).sqrt());
            // A ray along x crosses the walls an odd number of times from inside.
            if (a[1] > point[1]) != (b[1] > point[1])
                && point[0] < a[0] + (point[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            {
                inside = !inside;
            }
        }
        if inside { nearest } else { -nearest }
    }

    /// Walls, each from corner to corner.
    fn edges(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        let n = self.corners_m.len();
        (0..n).map(move |i| (self.corners_m[i], self.corners_m[(i + 1) % n]))
    }

    /// Triangles that cover the plan, as indices of corners, counter-clockwise: ears are cut off one by one.
    pub(crate) fn triangles(&self) -> Vec<[usize; 3]> {
        let mut left: Vec<usize> = (0..self.corners_m.len()).collect();
        let mut triangles = Vec::new();
        while left.len() > 3 {
            let n = left.len();
            let ear = (0..n)
                .find(|&i| {
                    let corner = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
                    let [a, b, c] = corner.map(|k| self.corners_m[k]);
                    cross(sub(b, a), sub(c, b)) > 0.0
                        && left.iter().filter(|k| !corner.contains(k)).all(|&k| {
                            let p = self.corners_m[k];
                            [(a, b), (b, c), (c, a)].iter().any(|&(u, v)| cross(sub(v, u), sub(p, u)) <= 0.0)
                        })
                })
                // Every simple polygon has an ear (Meisters 1975).
                .unwrap_or(0);
            triangles.push([left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]]);
            left.remove(ear);
        }
        triangles.push([left[0], left[1], left[2]]);
        triangles
    }
}

fn signed_area(corners: &[[f64; 2]]) -> f64 {
    (0..corners.len()).map(|i| 0.5 * cross(corners[i], corners[(i + 1) % corners.len()])).sum()
}

fn sub(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::generator;

    #[test]
    fn the_area_is_what_was_asked_for_and_triangles_cover_it() {
        for seed in 0..200 {
            let plan = FloorPlan::draw(&mut generator(seed), 30.0);
            let triangles = plan.triangles();
            assert_eq!(triangles.len(), plan.corners_m().len() - 2);
            let areas: Vec<f64> =
                triangles.iter().map(|t| signed_area(&t.map(|i| plan.corners_m()[i]))).collect();
            assert!(areas.iter().all(|&a| a > 0.0), "seed {seed}: {areas:?}");
            assert!((areas.iter().sum::<f64>() - 30.0).abs() < 1e-9, "seed {seed}");
        }
    }

    #[test]
    fn clearance_tells_inside_from_outside() {
        let l = FloorPlan {
            corners_m: vec![[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [2.0, 1.0], [2.0, 3.0], [0.0, 3.0]],
        };
        assert!((l.clearance_m([1.0, 2.0]) - 1.0).abs() < 1e-12);
        assert!((l.clearance_m([3.0, 0.75]) - 0.25).abs() < 1e-12);
        assert!((l.clearance_m([3.0, 2.0]) + 1.0).abs() < 1e-12);
    }
}
