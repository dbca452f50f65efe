//! Eight boxes that a ray meets, or misses, in one go.

use wide::f32x4;

/// Least size of a component of the direction where it is divided by: keeps 0 times infinity out of the box test.
const LEAST_COMPONENT: f32 = 1e-30;

/// A ray in single precision, each number in four lanes. Its origin lies near the boxes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalRay {
    pub origin: [f32x4; 3],
    pub direction: [f32x4; 3],
    inverse: [f32x4; 3],
    /// For each axis the row of [`WideNode::planes`] through which the ray enters: 0 the lower plane, 1 the upper.
    entry: [usize; 3],
}

impl LocalRay {
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let divisor =
            direction.map(|d| if d.abs() < LEAST_COMPONENT { LEAST_COMPONENT.copysign(d) } else { d });
        Self {
            origin: origin.map(f32x4::splat),
            direction: direction.map(f32x4::splat),
            inverse: divisor.map(|d| f32x4::splat(1.0 / d)),
            entry: divisor.map(|d| usize::from(d < 0.0)),
        }
    }
}

/// An axis-parallel box in single precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub low: [f32; 3],
    pub high: [f32; 3],
}

impl Bounds {
    /// Holds nothing: a ray that meets it does not exist.
    pub const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    pub fn joined(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|i| least(self.low[i], other.low[i])),
            high: std::array::from_fn(|i| most(self.high[i], other.high[i])),
        }
    }

    /// Half of the surface, which the chance of a random line to meet the box is proportional to.
    pub fn half_area(&self) -> f32 {
        let [x, y, z] = std::array::from_fn(|i| most(self.high[i] - self.low[i], 0.0));
        x * y + y * z + z * x
    }
}

/// `min` without the care for NaN that costs `f32::min` three instructions.
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// What stands behind a box: another node or a pack of triangles, by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Child {
    Node(u32),
    Pack(u32),
}

/// Vectors of four lanes in a node.
const VECTORS: usize = WideNode::WIDTH / 4;

/// Eight boxes, one to a lane, and what stands behind each: 224 bytes in four cache lines, fetched together.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct WideNode {
    /// Lower and upper x, lower and upper y, lower and upper z.
    planes: [[f32x4; VECTORS]; 6],
    /// Shifted left by one; the lowest bit says that it is a pack.
    children: [u32; Self::WIDTH],
}

impl WideNode {
    /// Number of lanes. Four would do with as much arithmetic; eight wait less for memory, for the way down is shorter.
    pub const WIDTH: usize = 8;

    /// Eight children at most; the lanes that are left hold nothing. What stands behind them is a pack all the same: a ray
    /// of NaN meets every box, and must come to an end.
    pub fn new(children: &[(Bounds, Child)]) -> Self {
        let mut planes = [[0.0f32; Self::WIDTH]; 6];
        let mut codes = [0u32; Self::WIDTH];
        for lane in 0..Self::WIDTH {
            let (bounds, child) = children.get(lane).copied().unwrap_or((Bounds::EMPTY, Child::Pack(0)));
            for axis in 0..3 {
                planes[2 * axis][lane] = bounds.low[axis];
                planes[2 * axis + 1][lane] = bounds.high[axis];
            }
            codes[lane] = match child {
                Child::Node(i) => i << 1,
                Child::Pack(i) => i << 1 | 1,
            };
        }
        let vectors = |row: [f32; Self::WIDTH]| {
            std::array::from_fn(|k| f32x4::new(std::array::from_fn(|lane| row[4 * k + lane])))
        };
        Self { planes: planes.map(vectors), children: codes }
    }

    /// Which boxes the ray meets between its origin and `limit`, as bits, and where it enters each.
    #[inline]
    pub fn entries(&self, ray: &LocalRay, limit: f32) -> (u32, [[f32; 4]; VECTORS]) {
        let mut met = 0;
        let mut entries = [[0.0; 4]; VECTORS];
        for (k, entry) in entries.iter_mut().enumerate() {
            let mut enter = f32x4::ZERO;
            let mut leave = f32x4::splat(limit);
            for axis in 0..3 {
                let side = ray.entry[axis] & 1;
                let at = |row: usize| (self.planes[row][k] - ray.origin[axis]) * ray.inverse[axis];
                enter = at(2 * axis + side).fast_max(enter);
                leave = at(2 * axis + (side ^ 1)).fast_min(leave);
            }
            met |= enter.simd_le(leave).to_bitmask() << (4 * k);
            *entry = enter.to_array();
        }
        (met, entries)
    }

    /// Square of the distance of a point from each box; infinite for a lane that holds nothing.
    pub fn squared_distances(&self, point: [f32; 3]) -> [f32; Self::WIDTH] {
        let squares: [[f32; 4]; VECTORS] = std::array::from_fn(|k| {
            let mut sum = f32x4::ZERO;
            for (axis, &coordinate) in point.iter().enumerate() {
                let p = f32x4::splat(coordinate);
                let (low, high) = (self.planes[2 * axis][k], self.planes[2 * axis + 1][k]);
                let outside = (low - p).fast_max(p - high).fast_max(f32x4::ZERO);
                sum += outside * outside;
            }
            sum.to_array()
        });
        std::array::from_fn(|lane| squares[lane / 4][lane % 4])
    }

    /// What stands behind a lane, as a number that fits beside a distance in 64 bits.
    #[inline]
    pub fn code(&self, lane: usize) -> u32 {
        self.children[lane % Self::WIDTH]
    }

    #[inline]
    pub fn decode(code: u32) -> Child {
        if code & 1 == 1 { Child::Pack(code >> 1) } else { Child::Node(code >> 1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_the_boxes_in_front_of_it_up_to_the_limit() {
        let at = |x: f32| Bounds { low: [x, -1.0, -1.0], high: [x + 1.0, 1.0, 1.0] };
        // Ahead, behind, around the origin, and a flat one.
        let flat = Bounds { low: [5.0, -1.0, -1.0], high: [5.0, 1.0, 1.0] };
        let boxes = [at(2.0), at(-3.0), at(-0.5), flat].map(|bounds| (bounds, Child::Node(1)));
        let node = WideNode::new(&boxes);
        let (met, enter) = node.entries(&LocalRay::new([0.0; 3], [1.0, 0.0, 0.0]), 10.0);
        assert_eq!(met, 0b1101); // not the one behind, nor any of the empty lanes
        assert_eq!([enter[0][0], enter[0][2], enter[0][3]], [2.0, 0.0, 5.0]);
        assert_eq!(node.entries(&LocalRay::new([0.0; 3], [1.0, 0.0, 0.0]), 4.9).0, 0b0101);
        assert_eq!(node.entries(&LocalRay::new([0.0; 3], [-1.0, -0.0, 0.0]), 10.0).0, 0b0110);
    }

    /// 0 times infinity: a ray within the plane of a face, along an axis. (The upper face is not part of a box; boxes are
    /// wider than what they hold.)
    #[test]
    fn a_ray_along_a_face_meets_the_box() {
        let node = WideNode::new(&[(Bounds { low: [1.0; 3], high: [2.0; 3] }, Child::Node(1))]);
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                for on in [1.0, 1.5, 2f32.next_down()] {
                    let (mut origin, mut direction) = ([on; 3], [0.0; 3]);
                    (origin[axis], direction[axis]) = (1.5 - 3.0 * sign, sign);
                    assert_eq!(
                        node.entries(&LocalRay::new(origin, direction), 10.0).0,
                        1,
                        "{origin:?} {direction:?}"
                    );
                    origin[(axis + 1) % 3] = 2.5;
                    assert_eq!(
                        node.entries(&LocalRay::new(origin, direction), 10.0).0,
                        0,
                        "{origin:?} {direction:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn distances_of_boxes_are_those_to_their_faces_edges_and_corners() {
        let node = WideNode::new(&[(Bounds { low: [0.0; 3], high: [1.0; 3] }, Child::Pack(3))]);
        for (point, expected) in [([0.5, 0.5, 0.5], 0.0), ([0.5, 0.5, 3.0], 4.0), ([-1.0, 2.0, -1.0], 3.0)] {
            let squares = node.squared_distances(point);
            assert_eq!(squares[0], expected);
            assert!(squares[1..].iter().all(|s| s.is_infinite()));
        }
        assert_eq!(WideNode::decode(node.code(0)), Child::Pack(3));
    }
}
