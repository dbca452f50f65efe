//! A bounding volume hierarchy with eight children to a node.

use crate::hierarchy_builder::{Builder, MAX_SPLITS};
use crate::instructions::{Instructions, Work};
use crate::lanes::Lanes;
use crate::surfaces::Surface;
use crate::triangle_pack::{ExactRay, TrianglePack};
use crate::vector::{Vec3, sub};
use crate::wide_node::{Child, LocalRay, WideNode};
use sabine_paths::RayHit;

/// Boxes are wider than their triangles by this share of the size of the scene: more than single precision can be wrong by for a
/// ray that starts within three sizes of the centre (about 1e-6), and the exact test is generous by (1e-6).
const MARGIN: f64 = 4e-6;

/// Children that can be left behind on the way down, at most.
const STACK_LIMIT: usize = 512;
const _: () = assert!((WideNode::WIDTH - 1) * (MAX_SPLITS as usize + 1) < STACK_LIMIT);

/// Triangles in boxes in boxes, the boxes in single precision and the triangles in double. It finds hits, nearest box first.
pub(crate) struct Hierarchy {
    /// The first is the root; a child stands behind its parent.
    nodes: Vec<WideNode>,
    packs: Vec<TrianglePack>,
    /// Indices of the triangles in each pack; `u32::MAX` for a lane without one.
    members: Vec<[u32; TrianglePack::LANES]>,
    /// Nodes on the longest way down.
    levels: usize,
    instructions: Instructions,
}

/// A ray in search of a hit.
#[derive(Clone, Copy)]
pub(crate) struct Query {
    pub exact: ExactRay,
    /// The same ray as boxes see it: it begins `skipped_m` further on.
    pub local: LocalRay,
    pub skipped_m: f64,
    /// No surface is further than this from the beginning of the local ray.
    pub furthest_m: f64,
    /// Nor does a hit beyond this distance count.
    pub max_distance: f64,
}

impl Query {
    /// A distance as boxes see it.
    #[inline(always)]
    fn local_limit(&self, distance: f64) -> f32 {
        (distance - self.skipped_m).min(self.furthest_m) as f32
    }
}

impl Hierarchy {
    /// Over all faces that have an area. `size_m` is the diagonal of the box around all, `centre_m` its middle.
    pub fn new(faces: &[Surface], centre_m: Vec3, size_m: f64, instructions: Instructions) -> Self {
        let triangles: Vec<(u32, [Vec3; 3])> = (0..)
            .zip(faces)
            .filter(|(_, face)| !face.is_degenerate())
            .map(|(i, face)| (i, [sub(face.corner, centre_m), face.edge1, face.edge2]))
            .collect();
        let (nodes, members, levels) = Builder::new(&triangles, MARGIN * size_m).build();
        let pack = |members: &[u32; TrianglePack::LANES]| {
            TrianglePack::new(members.iter().filter_map(|&i| faces.get(i as usize)))
        };
        let packs = members.iter().map(pack).collect();
        Self { nodes, packs, members, levels, instructions }
    }

    /// The nearest hit; of several at the same distance the one that reports the least number.
    #[inline]
    pub fn closest(&self, query: &Query) -> Option<RayHit> {
        self.instructions.run(Search::<false> { hierarchy: self, query })
    }

    /// Whether there is a hit.
    #[inline]
    pub fn any(&self, query: &Query) -> bool {
        self.instructions.run(Search::<true> { hierarchy: self, query }).is_some()
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
                    for &triangle in self.members[pack as usize].iter().filter(|&&i| i != u32::MAX) {
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

/// The search for the nearest hit or, if `ANY`, for one.
struct Search<'a, const ANY: bool> {
    hierarchy: &'a Hierarchy,
    query: &'a Query,
}

impl<const ANY: bool> Work for Search<'_, ANY> {
    type Output = Option<RayHit>;

    /// The way back is kept in an array no larger than the hierarchy needs: clearing it is part of the cost of a ray.
    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Option<RayHit> {
        // Each level leaves all children but one behind; the last one may leave all.
        match (WideNode::WIDTH - 1) * self.hierarchy.levels + 1 {
            ..=16 => self.walk::<L, 16>(lanes),
            17..=64 => self.walk::<L, 64>(lanes),
            _ => self.walk::<L, { STACK_LIMIT }>(lanes),
        }
    }
}

impl<const ANY: bool> Search<'_, ANY> {
    #[inline(always)]
    fn walk<L: Lanes, const STACK: usize>(&self, lanes: L) -> Option<RayHit> {
        let (hierarchy, query) = (self.hierarchy, self.query);
        let mut nearest = RayHit { distance: query.max_distance, triangle: u32::MAX };
        let mut limit = query.local_limit(query.max_distance);
        // Distance of entry in the upper half, child in the lower: such numbers sort by distance.
        let mut stack = [0u64; STACK];
        let mut height = 0;
        let mut code = 0;
        loop {
            match WideNode::decode(code) {
                Child::Node(index) => {
                    let node = &hierarchy.nodes[index as usize];
                    let (mut met, enter) = node.entries(lanes, &query.local, limit);
                    let entry = |met: u32| {
                        let lane = met.trailing_zeros() as usize % WideNode::WIDTH;
                        u64::from(enter[lane].to_bits()) << 32 | u64::from(node.code(lane))
                    };
                    if met != 0 {
                        if met & (met - 1) == 0 {
                            // One alone, most often: nothing waits for its distance.
                            code = node.code(met.trailing_zeros() as usize);
                            continue;
                        }
                        let siblings = height;
                        let mut next = entry(met);
                        met &= met - 1;
                        // The nearest is next; the others wait, sorted so that the nearest of them comes out first.
                        while met != 0 {
                            let mut other = entry(met);
                            met &= met - 1;
                            if other < next {
                                (next, other) = (other, next);
                            }
                            let mut at = height;
                            while at > siblings && stack[(at - 1) % STACK] < other {
                                stack[at % STACK] = stack[(at - 1) % STACK];
                                at -= 1;
                            }
                            stack[at % STACK] = other;
                            height += 1;
                        }
                        code = next as u32;
                        continue;
                    }
                }
                Child::Pack(index) => {
                    let pack = &hierarchy.packs[index as usize];
                    let (mut hits, distances) = pack.hits(lanes, &query.exact, nearest.distance);
                    if hits != 0 {
                        while hits != 0 {
                            let lane = hits.trailing_zeros() as usize % TrianglePack::LANES;
                            hits &= hits - 1;
                            let hit = RayHit { distance: distances[lane], triangle: pack.reported(lane) };
                            if hit.distance < nearest.distance
                                || (hit.distance == nearest.distance && hit.triangle < nearest.triangle)
                            {
                                nearest = hit;
                            }
                        }
                        if ANY {
                            return Some(nearest);
                        }
                        limit = query.local_limit(nearest.distance);
                    }
                }
            }
            loop {
                if height == 0 {
                    return (nearest.triangle != u32::MAX).then_some(nearest);
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
}
