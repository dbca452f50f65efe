//! A bounding volume hierarchy with eight children to a node.

use crate::hierarchy_builder::{Builder, MAX_SPLITS};
use crate::triangle_pack::TrianglePack;
use crate::vector::Vec3;
use crate::wide_node::{Child, LocalRay, WideNode};
use std::ops::ControlFlow;

/// Boxes are wider than their triangles by this share of the size of the scene: more than single precision can be wrong
/// by for a ray that starts within three sizes of the centre (about 1e-6).
const MARGIN: f64 = 4e-6;
/// The rough test of triangles is as generous: its errors stay below 5e-6.
const TOLERANCE: f64 = 8e-6;

/// Children that can be left behind on the way down, at most.
const STACK_LIMIT: usize = 512;
const _: () = assert!((WideNode::WIDTH - 1) * (MAX_SPLITS as usize + 1) < STACK_LIMIT);

/// Triangles in boxes in boxes, in single precision: finds the few triangles that a ray may meet, nearest box first.
pub(crate) struct Hierarchy {
    /// The first is the root; a child stands behind its parent.
    nodes: Vec<WideNode>,
    packs: Vec<TrianglePack>,
    /// Nodes on the longest way down.
    levels: usize,
    tolerance_m: f32,
}

impl Hierarchy {
    /// Takes triangles as index, first corner and the two edges from it, near the origin of coordinates. `size_m` is the
    /// diagonal of the box around all.
    pub fn new(triangles: &[(u32, [Vec3; 3])], size_m: f64) -> Self {
        let (nodes, packs, levels) = Builder::new(triangles, MARGIN * size_m).build();
        Self { nodes, packs, levels, tolerance_m: (TOLERANCE * size_m) as f32 }
    }

    /// Calls `test` with every triangle that the ray may meet no further than `limit`, roughly from near to far. `test`
    /// returns the new limit, or breaks.
    ///
    /// The way back is kept in an array no larger than the hierarchy needs: clearing it is part of the cost of a ray.
    #[inline]
    pub fn visit(&self, ray: &LocalRay, limit: f32, test: impl FnMut(u32) -> ControlFlow<(), f32>) {
        // Each level leaves all children but one behind; the last one may leave all.
        match (WideNode::WIDTH - 1) * self.levels + 1 {
            ..=16 => self.walk::<16>(ray, limit, test),
            17..=64 => self.walk::<64>(ray, limit, test),
            _ => self.walk::<{ STACK_LIMIT }>(ray, limit, test),
        }
    }

    #[inline]
    fn walk<const STACK: usize>(
        &self,
        ray: &LocalRay,
        mut limit: f32,
        mut test: impl FnMut(u32) -> ControlFlow<(), f32>,
    ) {
        // Distance of entry in the upper half, child in the lower: such numbers sort by distance.
        let mut stack = [0u64; STACK];
        let mut height = 0;
        let mut code = 0;
        loop {
            match WideNode::decode(code) {
                Child::Node(index) => {
                    let node = &self.nodes[index as usize];
                    let (mut met, enter) = node.entries(ray, limit);
                    let siblings = height;
                    while met != 0 {
                        let lane = met.trailing_zeros() as usize;
                        met &= met - 1;
                        let entry = u64::from(enter[lane / 4 % 2][lane % 4].to_bits()) << 32
                            | u64::from(node.code(lane));
                        // Sorted in among its siblings, so that the nearest comes out first.
                        let mut at = height;
                        while at > siblings && stack[(at - 1) % STACK] < entry {
                            stack[at % STACK] = stack[(at - 1) % STACK];
                            at -= 1;
                        }
                        stack[at % STACK] = entry;
                        height += 1;
                    }
                }
                Child::Pack(index) => {
                    let pack = &self.packs[index as usize];
                    let mut lanes = pack.candidates(ray, limit, self.tolerance_m);
                    while lanes != 0 {
                        match test(pack.triangle(lanes.trailing_zeros())) {
                            ControlFlow::Continue(new) => limit = new,
                            ControlFlow::Break(()) => return,
                        }
                        lanes &= lanes - 1;
                    }
                }
            }
            loop {
                if height == 0 {
                    return;
                }
                height -= 1;
                let entry = stack[height % STACK];
                if f32::from_bits((entry >> 32) as u32) <= limit {
                    code = entry as u32;
                    break;
                }
            }
        }
    }

    /// The triangle nearest to a point and its distance (m), if one is nearer than `limit`; the first of several.
    /// `distance` tells that of a triangle, and the number under which to report it.
    pub fn nearest(
        &self,
        point: [f32; 3],
        limit: (u32, f64),
        distance: impl Fn(u32) -> (u32, f64),
    ) -> (u32, f64) {
        // Rounding moves the distance of a box by about 1e-7 of the largest coordinate: boxes are wider than that unless
        // the point is far away.
        let slack = 1e-6 * point.iter().fold(0.0f32, |largest, c| largest.max(c.abs()));
        let (mut index, mut least) = limit;
        let mut stack = vec![(0.0f32, Child::Node(0))];
        while let Some((bound, child)) = stack.pop() {
            if f64::from(bound - slack) > least {
                continue;
            }
            match child {
                Child::Node(node) => {
                    let node = &self.nodes[node as usize];
                    let squares = node.squared_distances(point);
                    let mut lanes: [usize; WideNode::WIDTH] = std::array::from_fn(|lane| lane);
                    lanes.sort_by(|&i, &j| squares[j].total_cmp(&squares[i]));
                    let finite = lanes.into_iter().filter(|&lane| squares[lane].is_finite());
                    stack
                        .extend(finite.map(|lane| (squares[lane].sqrt(), WideNode::decode(node.code(lane)))));
                }
                Child::Pack(pack) => {
                    for triangle in self.packs[pack as usize].triangles() {
                        let (triangle, found) = distance(triangle);
                        if found < least || (found == least && triangle < index) {
                            (index, least) = (triangle, found);
                        }
                    }
                }
            }
        }
        (index, least)
    }
}
