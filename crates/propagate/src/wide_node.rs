//! Eight boxes that a ray meets, or misses, in one go.

use crate::lanes::Lanes;

/// Least size of a component of the direction where it is divided by: keeps 0 times infinity out of the box test.
const LEAST_COMPONENT: f32 = 1e-30;
/// Planes of boxes lie on a grid of so many steps across the node.
const STEPS: f32 = 255.0;

/// A ray in single precision. Its origin lies near the boxes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalRay {
    origin: [f32; 3],
    inverse: [f32; 3],
    /// For each axis the row of [`WideNode::planes`] through which the ray enters: 0 the lower plane, 1 the upper.
    entry: [usize; 3],
}

impl LocalRay {
    #[inline(always)]
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let divisor =
            direction.map(|d| if d.abs() < LEAST_COMPONENT { LEAST_COMPONENT.copysign(d) } else { d });
        Self { origin, inverse: divisor.map(|d| 1.0 / d), entry: divisor.map(|d| usize::from(d < 0.0)) }
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

/// Eight boxes, one to a lane, and what stands behind each: 108 bytes in two cache lines, fetched together.
///
/// Planes of boxes are counted in steps from the lowest corner of the node, rounded outward.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(128))]
pub(crate) struct WideNode {
    /// Lower and upper x, lower and upper y, lower and upper z, in steps.
    planes: [[u8; Self::WIDTH]; 6],
    corner: [f32; 3],
    step: [f32; 3],
    /// Lanes that hold a box, as bits.
    held: u32,
    /// Shifted left by one; the lowest bit says that it is a pack.
    children: [u32; Self::WIDTH],
}

impl WideNode {
    /// Number of lanes.
    pub const WIDTH: usize = 8;

    /// Eight children at most; the lanes that are left hold nothing.
    pub fn new(children: &[(Bounds, Child)]) -> Self {
        let around = children.iter().fold(Bounds::EMPTY, |around, (bounds, _)| around.joined(*bounds));
        let mut node = Self {
            planes: [[0; Self::WIDTH]; 6],
            corner: around.low,
            // Rounded up, so that the last step reaches the uppermost plane.
            step: std::array::from_fn(|k| ((around.high[k] - around.low[k]) / STEPS).next_up()),
            held: 0,
            children: [0; Self::WIDTH],
        };
        for (lane, (bounds, child)) in children.iter().take(Self::WIDTH).enumerate() {
            for axis in 0..3 {
                // Doubles, so that the distances are exact; conversion saturates.
                let steps =
                    |to: f32| (f64::from(to) - f64::from(around.low[axis])) / f64::from(node.step[axis]);
                node.planes[2 * axis][lane] = steps(bounds.low[axis]).floor() as u8;
                node.planes[2 * axis + 1][lane] = steps(bounds.high[axis]).ceil() as u8;
            }
            node.held |= 1 << lane;
            node.children[lane] = match child {
                Child::Node(i) => i << 1,
                Child::Pack(i) => i << 1 | 1,
            };
        }
        node
    }

    /// Which boxes the ray meets between its origin and `limit`, as bits, and where it enters each.
    ///
    /// A box may be met that the ray misses by rounding, or the reverse: by less than 1e-6 of the largest distance between the ray's origin
    /// and a plane.
    #[inline(always)]
    pub fn entries<L: Lanes>(&self, lanes: L, ray: &LocalRay, limit: f32) -> (u32, [f32; Self::WIDTH]) {
        let (enter_x, leave_x) = self.slab(lanes, ray, 0);
        let (enter_y, leave_y) = self.slab(lanes, ray, 1);
        let (enter_z, leave_z) = self.slab(lanes, ray, 2);
        // The second operand counts where the first is NaN: 0 and the limit stand last.
        let enter = lanes.most(enter_x, lanes.most(enter_y, lanes.most(enter_z, lanes.singles(0.0))));
        let leave = lanes.least(leave_x, lanes.least(leave_y, lanes.least(leave_z, lanes.singles(limit))));
        (lanes.at_most_bits(enter, leave) & self.held, lanes.to_array(enter))
    }

    /// Where the ray enters and leaves the boxes between their planes across one axis.
    #[inline(always)]
    fn slab<L: Lanes>(&self, lanes: L, ray: &LocalRay, axis: usize) -> (L::Singles, L::Singles) {
        let side = ray.entry[axis] & 1;
        let first = lanes.singles((self.corner[axis] - ray.origin[axis]) * ray.inverse[axis]);
        let step = lanes.singles(self.step[axis] * ray.inverse[axis]);
        let at = |row: usize| lanes.mul_add(lanes.of_bytes(&self.planes[row]), step, first);
        (at(2 * axis + side), at(2 * axis + (side ^ 1)))
    }

    /// Square of the distance of a point from each box; infinite for a lane that holds nothing.
    pub fn squared_distances(&self, point: [f32; 3]) -> [f32; Self::WIDTH] {
        std::array::from_fn(|lane| {
            if self.held >> lane & 1 == 0 {
                return f32::INFINITY;
            }
            (0..3)
                .map(|axis| {
                    let plane =
                        |row: usize| self.corner[axis] + f32::from(self.planes[row][lane]) * self.step[axis];
                    let (low, high) = (plane(2 * axis), plane(2 * axis + 1));
                    let outside = (low - point[axis]).max(point[axis] - high).max(0.0);
                    outside * outside
                })
                .sum()
        })
    }

    /// What stands behind a lane, as a number that fits beside a distance in 64 bits.
    #[inline(always)]
    pub fn code(&self, lane: usize) -> u32 {
        self.children[lane % Self::WIDTH]
    }

    #[inline(always)]
    pub fn decode(code: u32) -> Child {
        if code & 1 == 1 { Child::Pack(code >> 1) } else { Child::Node(code >> 1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instructions::{Instructions, Work};
    use proptest::prelude::*;

    struct Entries<'a>(&'a WideNode, &'a LocalRay, f32);

    impl Work for Entries<'_> {
        type Output = (u32, [f32; WideNode::WIDTH]);

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) -> Self::Output {
            self.0.entries(lanes, self.1, self.2)
        }
    }

    /// Of all instructions, which must agree on the boxes that are met.
    fn entries(node: &WideNode, ray: &LocalRay, limit: f32) -> (u32, [f32; WideNode::WIDTH]) {
        let all = Instructions::all();
        let found: Vec<_> = all.into_iter().map(|by| by.run(Entries(node, ray, limit))).collect();
        assert!(found.iter().all(|(met, _)| *met == found[0].0), "{found:?}");
        found[0]
    }

    #[test]
    fn a_ray_meets_the_boxes_in_front_of_it_up_to_the_limit() {
        let at = |x: f32| Bounds { low: [x, -1.0, -1.0], high: [x + 1.0, 1.0, 1.0] };
        // Ahead, behind, around the origin, and a flat one.
        let flat = Bounds { low: [5.0, -1.0, -1.0], high: [5.0, 1.0, 1.0] };
        let boxes = [at(2.0), at(-3.0), at(-0.5), flat].map(|bounds| (bounds, Child::Node(1)));
        let node = WideNode::new(&boxes);
        let (met, enter) = entries(&node, &LocalRay::new([0.0; 3], [1.0, 0.0, 0.0]), 10.0);
        assert_eq!(met, 0b1101); // not the one behind, nor any of the empty lanes
        // Boxes are up to a step of 8/255 larger.
        for (lane, x) in [(0, 2.0), (2, 0.0), (3, 5.0)] {
            assert!(enter[lane] <= x && enter[lane] > x - 0.04, "{enter:?}");
        }
        assert_eq!(entries(&node, &LocalRay::new([0.0; 3], [1.0, 0.0, 0.0]), 4.9).0, 0b0101);
        assert_eq!(entries(&node, &LocalRay::new([0.0; 3], [-1.0, -0.0, 0.0]), 10.0).0, 0b0110);
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
                    let met = |origin| entries(&node, &LocalRay::new(origin, direction), 10.0).0;
                    assert_eq!(met(origin), 1, "{origin:?} {direction:?}");
                    origin[(axis + 1) % 3] = 2.5;
                    assert_eq!(met(origin), 0, "{origin:?} {direction:?}");
                }
            }
        }
    }

    #[test]
    fn distances_of_boxes_are_those_to_their_faces_edges_and_corners() {
        let node = WideNode::new(&[(Bounds { low: [0.0; 3], high: [1.0; 3] }, Child::Pack(3))]);
        for (point, expected) in [([0.5, 0.5, 0.5], 0.0), ([0.5, 0.5, 3.0], 4.0), ([-1.0, 2.0, -1.0], 3.0)] {
            let squares = node.squared_distances(point);
            // The upper planes are rounded up, by less than 1e-6.
            assert!((squares[0] - expected).abs() < 1e-5, "{squares:?}");
            assert!(squares[1..].iter().all(|s| s.is_infinite()));
        }
        assert_eq!(WideNode::decode(node.code(0)), Child::Pack(3));
    }

    proptest! {
        /// Boxes only grow by being counted in steps: a ray to any point of a box meets it, even a flat one, before that point.
        #[test]
        fn a_ray_to_a_point_of_a_box_meets_it(
            boxes in prop::collection::vec(
                (prop::array::uniform3(-10.0f32..10.0), prop::array::uniform3(prop::sample::select(vec![0.0f32, 1e-3, 0.1, 7.0]))),
                1..=8,
            ),
            within in prop::array::uniform3(0.0f32..=1.0),
            origin in prop::array::uniform3(-20.0f32..20.0),
        ) {
            // The margin of a hierarchy over a scene of this size.
            let margin = 4e-6 * 40.0;
            let bounds = |(low, size): &([f32; 3], [f32; 3])| Bounds {
                low: low.map(|c| c - margin),
                high: std::array::from_fn(|k| low[k] + size[k] + margin),
            };
            let children: Vec<_> = boxes.iter().map(|b| (bounds(b), Child::Pack(0))).collect();
            let node = WideNode::new(&children);
            for (lane, (low, size)) in boxes.iter().enumerate() {
                let line: [f64; 3] =
                    std::array::from_fn(|k| f64::from(low[k] + within[k] * size[k]) - f64::from(origin[k]));
                let distance = line.iter().map(|c| c * c).sum::<f64>().sqrt();
                prop_assume!(distance > 1e-3);
                let ray = LocalRay::new(origin, line.map(|c| (c / distance) as f32));
                let (met, enter) = entries(&node, &ray, distance as f32);
                prop_assert!(met >> lane & 1 == 1, "lane {lane} of {met:b}");
                prop_assert!(enter[lane] <= distance as f32);
            }
        }
    }
}
