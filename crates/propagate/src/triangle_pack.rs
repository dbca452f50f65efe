//! Four triangles that a ray is tested against at once.

use crate::lanes::Lanes;
use crate::surfaces::{OVERLAP, Surface};
use crate::vector::Vec3;

/// Four triangles, one to a lane: all that a hit needs, in five cache lines, and nothing else to wait for.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct TrianglePack {
    corner: [[f64; 4]; 3],
    edge1: [[f64; 4]; 3],
    edge2: [[f64; 4]; 3],
    /// As of [`Surface`]; infinite for a lane without a triangle, which nothing hits.
    least_determinant: [f32; 4],
    /// Numbers that hits report.
    reported: [u32; 4],
}

/// A ray as packs see it.
#[derive(Clone, Copy)]
pub(crate) struct ExactRay {
    pub origin: Vec3,
    pub direction: Vec3,
    /// As of [`Surface`], which is the same for all of a mesh.
    pub agreement_m: f64,
}

impl TrianglePack {
    /// Size of a pack.
    pub const LANES: usize = 4;

    /// Takes at most four triangles.
    pub fn new<'a>(faces: impl IntoIterator<Item = &'a Surface>) -> Self {
        let mut pack = Self {
            corner: [[0.0; 4]; 3],
            edge1: [[0.0; 4]; 3],
            edge2: [[0.0; 4]; 3],
            least_determinant: [f32::INFINITY; 4],
            reported: [u32::MAX; 4],
        };
        for (lane, face) in faces.into_iter().take(Self::LANES).enumerate() {
            for axis in 0..3 {
                pack.corner[axis][lane] = face.corner[axis];
                pack.edge1[axis][lane] = face.edge1[axis];
                pack.edge2[axis][lane] = face.edge2[axis];
            }
            pack.least_determinant[lane] = face.least_determinant;
            pack.reported[lane] = face.triangle;
        }
        pack
    }

    /// The number that a hit of a lane reports.
    #[inline(always)]
    pub fn reported(&self, lane: usize) -> u32 {
        self.reported[lane % Self::LANES]
    }

    /// Lanes whose triangles the ray hits no further than `limit`, as bits, and at what distance.
    ///
    /// The same operations in the same order as [`Surface::intersect`], hence the same bits.
    #[inline(always)]
    pub fn hits<L: Lanes>(&self, lanes: L, ray: &ExactRay, limit: f64) -> (u32, [f64; 4]) {
        let l = lanes;
        // No `map` over arrays of vectors: the compiler may leave it outside, where the machine has no wide instructions.
        let splat = |v: &Vec3| [l.doubles(v[0]), l.doubles(v[1]), l.doubles(v[2])];
        let minus = |a: [L::Doubles; 3], b: [L::Doubles; 3]| {
            [l.sub(a[0], b[0]), l.sub(a[1], b[1]), l.sub(a[2], b[2])]
        };
        let direction = splat(&ray.direction);
        let row = |rows: &[[f64; 4]; 3]| [l.load(&rows[0]), l.load(&rows[1]), l.load(&rows[2])];
        let (corner, edge1, edge2) = (row(&self.corner), row(&self.edge1), row(&self.edge2));
        let p = cross(l, direction, edge2);
        let determinant = dot(l, edge1, p);
        let inverse = l.div(l.doubles(1.0), determinant);
        let s = minus(splat(&ray.origin), corner);
        let u = l.mul(dot(l, s, p), inverse);
        let q = cross(l, s, edge1);
        let v = l.mul(dot(l, direction, q), inverse);
        let (low, high) = (l.doubles(-OVERLAP), l.doubles(1.0 + OVERLAP));
        let inside = l.both(
            l.both(l.at_most(low, u), l.at_most(u, high)),
            l.both(l.at_most(low, v), l.at_most(l.add(u, v), high)),
        );
        let inside = l.both(inside, l.below(l.widened(&self.least_determinant), l.abs(determinant)));
        let distance = l.mul(dot(l, edge2, q), inverse);
        let on_the_way = l.both(l.below(l.doubles(0.0), distance), l.at_most(distance, l.doubles(limit)));
        let mut hit = l.both(inside, on_the_way);
        if l.bits(hit) == 0 {
            return (0, [0.0; 4]);
        }
        let agreement = l.doubles(ray.agreement_m);
        for k in 0..3 {
            let along = l.add(s[k], l.mul(distance, direction[k]));
            let apart = l.sub(l.sub(along, l.mul(u, edge1[k])), l.mul(v, edge2[k]));
            hit = l.both(hit, l.at_most(l.abs(apart), agreement));
        }
        (l.bits(hit), l.store(distance))
    }
}

#[inline(always)]
fn cross<L: Lanes>(l: L, a: [L::Doubles; 3], b: [L::Doubles; 3]) -> [L::Doubles; 3] {
    let minor = |i: usize, j: usize| l.sub(l.mul(a[i], b[j]), l.mul(a[j], b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

#[inline(always)]
fn dot<L: Lanes>(l: L, a: [L::Doubles; 3], b: [L::Doubles; 3]) -> L::Doubles {
    l.add(l.add(l.mul(a[0], b[0]), l.mul(a[1], b[1])), l.mul(a[2], b[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instructions::{Instructions, Work};
    use crate::random::{direction, generator};
    use crate::vector::{along, norm, scale, sub, unit};
    use rand::Rng;

    struct Hits<'a>(&'a TrianglePack, &'a ExactRay, f64);

    impl Work for Hits<'_> {
        type Output = (u32, [f64; TrianglePack::LANES]);

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) -> Self::Output {
            self.0.hits(lanes, self.1, self.2)
        }
    }

    /// Each lane, of any instructions, answers as the triangle by itself does, to the bit: at edges, at vertices and in its plane, too.
    #[test]
    fn lanes_answer_as_single_triangles_do() {
        let mut random = generator(5, 0);
        let agreement_m = 1e-5;
        let mut hits = 0;
        for round in 0..20_000 {
            let count = 1 + round % TrianglePack::LANES;
            let faces: Vec<Surface> = (0..count as u32)
                .map(|triangle| {
                    let at = scale(direction(&mut random), 2.0);
                    let corners =
                        [at, along(at, direction(&mut random), 1.0), along(at, direction(&mut random), 1.0)];
                    Surface { triangle: 7 + triangle, agreement_m, ..Surface::new(corners, 0) }
                })
                .collect();
            let origin = scale(direction(&mut random), 3.0);
            let aimed_at = &faces[round % count];
            let (u, v) = [(0.0, 0.0), (0.3, 0.0), (0.5, 0.5), (0.2, 0.3), (1.0, 0.0)][round % 5];
            let target = along(along(aimed_at.corner, aimed_at.edge1, u), aimed_at.edge2, v);
            let origin = if round % 7 == 0 { along(target, aimed_at.edge1, 2.0) } else { origin };
            let ray = ExactRay { origin, direction: unit(sub(target, origin)), agreement_m };
            let limit = norm(sub(target, origin)) * random.random_range(0.9..1.5);
            let pack = TrianglePack::new(&faces);
            for by in Instructions::all() {
                let (met, distances) = by.run(Hits(&pack, &ray, limit));
                for (lane, &distance) in distances.iter().enumerate() {
                    let alone = faces.get(lane).and_then(|face| face.intersect(origin, ray.direction));
                    let expected = alone.filter(|&d| d <= limit);
                    let found = (met >> lane & 1 == 1).then_some(distance);
                    assert_eq!(found, expected, "round {round}, lane {lane}, {by:?}");
                    hits += usize::from(found.is_some());
                }
            }
            assert_eq!(pack.reported(count - 1), 6 + count as u32);
        }
        assert!(hits > 20_000, "{hits}");
    }
}
