//! Four triangles that a ray is tested against at once, roughly.

use crate::vector::Vec3;
use crate::wide_node::LocalRay;
use wide::f32x4;

/// Four triangles in single precision, one to a lane: 176 bytes in three cache lines.
///
/// The test tells which of them deserve the exact one. It errs on one side only: it never drops a triangle that the exact
/// test accepts.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct TrianglePack {
    corner: [f32x4; 3],
    edge1: [f32x4; 3],
    edge2: [f32x4; 3],
    /// Longer of the two edges; negative for a lane without a triangle, which makes its tolerance negative too.
    reach: f32x4,
    triangles: [u32; 4],
}

impl TrianglePack {
    /// Size of a pack.
    pub const LANES: usize = 4;

    /// Takes at most four triangles: index, first corner and the two edges from it.
    pub fn new(triangles: &[(u32, [Vec3; 3])]) -> Self {
        let mut rows = [[0.0f32; 4]; 9];
        let mut reach = [-1.0f32; 4];
        let mut indices = [0u32; 4];
        for (lane, (index, vectors)) in triangles.iter().take(Self::LANES).enumerate() {
            for (row, &value) in rows.iter_mut().zip(vectors.as_flattened()) {
                row[lane] = value as f32;
            }
            let length = |v: Vec3| crate::vector::norm(v) as f32;
            reach[lane] = length(vectors[1]).max(length(vectors[2]));
            indices[lane] = *index;
        }
        let vector = |first: usize| std::array::from_fn(|i| f32x4::new(rows[first + i]));
        Self {
            corner: vector(0),
            edge1: vector(3),
            edge2: vector(6),
            reach: f32x4::new(reach),
            triangles: indices,
        }
    }

    /// Index of the triangle in a lane.
    #[inline]
    pub fn triangle(&self, lane: u32) -> u32 {
        self.triangles[lane as usize & 3]
    }

    /// Indices of all triangles.
    pub fn triangles(&self) -> impl Iterator<Item = u32> {
        let reach = self.reach.to_array();
        (0..Self::LANES).filter(move |&lane| reach[lane] >= 0.0).map(|lane| self.triangles[lane])
    }

    /// Lanes whose triangles the ray may meet no further than `limit`, as bits.
    ///
    /// This is the test of Moeller and Trumbore (1997) without its division: u, v and the distance stay multiplied by the
    /// determinant. Rounding moves the first two by a few units in the last place of the size of the scene times the edge,
    /// the third by as much times the edge once more, and `tolerance_m` is the size of the scene times what is more than
    /// these few units. A determinant so small that its sign is wrong is smaller than the tolerance as well.
    #[inline]
    pub fn candidates(&self, ray: &LocalRay, limit: f32, tolerance_m: f32) -> u32 {
        let p = cross(ray.direction, self.edge2);
        let determinant = dot(self.edge1, p);
        let sign = determinant & f32x4::splat(-0.0);
        let size = determinant ^ sign;
        let s = std::array::from_fn(|i| ray.origin[i] - self.corner[i]);
        let u = dot(s, p) ^ sign;
        let q = cross(s, self.edge1);
        let v = dot(ray.direction, q) ^ sign;
        let distance = dot(self.edge2, q) ^ sign;
        let tolerance = self.reach * f32x4::splat(tolerance_m);
        let inside = u.fast_min(v).fast_min(size - u - v).simd_ge(-tolerance);
        let on_the_way = distance.fast_min(f32x4::splat(limit) * size - distance);
        (inside & on_the_way.simd_ge(-tolerance * self.reach)).to_bitmask()
    }
}

#[inline]
fn cross(a: [f32x4; 3], b: [f32x4; 3]) -> [f32x4; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
fn dot(a: [f32x4; 3], b: [f32x4; 3]) -> f32x4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candidates_are_what_the_ray_may_meet() {
        let at = |x: f64| [[x, -1.0, -1.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0]];
        let pack = TrianglePack::new(&[(7, at(1.0)), (3, at(4.0)), (5, at(-2.0))]);
        let mask = |direction: [f32; 3], limit: f32| {
            pack.candidates(&LocalRay::new([0.0; 3], direction), limit, 1e-4)
        };
        assert_eq!(mask([1.0, 0.0, 0.0], 10.0), 0b011); // the empty lane never
        assert_eq!(mask([1.0, 0.0, 0.0], 2.0), 0b001);
        assert_eq!(mask([-1.0, 0.0, 0.0], 10.0), 0b100);
        assert_eq!(mask([0.0, 1.0, 0.0], 10.0), 0);
        assert_eq!((pack.triangle(0), pack.triangle(1), pack.triangle(2)), (7, 3, 5));
        assert_eq!(pack.triangles().collect::<Vec<_>>(), [7, 3, 5]);
    }
}
