//! Which triangles make a flat wall of one material.

use super::half_edges::HalfEdges;
use crate::surfaces::Surface;
use crate::vector::{Vec3, add, cross, dot, norm, scale, sub, unit};

/// No partner, or no patch.
const NONE: u32 = u32::MAX;
/// Least cosine between the normal of a triangle and that of its patch: so no triangle of a patch lies on its back.
const LEAST_COSINE: f64 = 0.9;

/// Triangles that hang together by edges, lie in one plane, face one way and have one material.
pub(super) struct FlatPatches {
    /// Patch of each triangle.
    of: Vec<u32>,
    /// Triangles, patch by patch.
    order: Vec<u32>,
    /// Where each patch ends in `order`.
    ends: Vec<u32>,
    /// For each half-edge the opposite one in the same patch.
    partner: Vec<u32>,
}

impl FlatPatches {
    /// All patches, each flat to `flat_m`; triangles that belong to no other are patches of their own.
    pub fn find(edges: &HalfEdges, surfaces: &[Surface], flat_m: f64) -> Self {
        let surface = |triangle: u32| &surfaces[edges.triangles[triangle as usize] as usize];
        let mut patches = Self {
            of: vec![NONE; edges.corners.len()],
            order: Vec::with_capacity(edges.corners.len()),
            ends: Vec::new(),
            partner: (0..edges.len() as u32).map(|half_edge| partner(edges, half_edge, surface)).collect(),
        };
        let mut group = Vec::new();
        for seed in 0..edges.corners.len() as u32 {
            if patches.of[seed as usize] != NONE {
                continue;
            }
            // A group belongs together by the wide limits of mirror planes; it becomes a patch if it is flat.
            patches.flood(seed, |_| true, &mut group);
            let plane = MeanPlane::of(&group, edges);
            let fits =
                |&t: &u32| plane.holds(edges.corners[t as usize].map(|v| edges.points[v as usize]), flat_m);
            if group.len() < 2 || group.iter().all(fits) {
                patches.close(&group);
                continue;
            }
            for &t in &group {
                patches.of[t as usize] = NONE;
            }
            let mut part = Vec::new();
            for &t in &group {
                if patches.of[t as usize] == NONE {
                    if fits(&t) {
                        patches.flood(t, |t| fits(&t), &mut part);
                    } else {
                        patches.of[t as usize] = patches.len() as u32;
                        part = vec![t];
                    }
                    patches.close(&part);
                }
            }
        }
        patches
    }

    /// Gathers the triangles about a seed that are in no patch yet.
    fn flood(&mut self, seed: u32, admits: impl Fn(u32) -> bool, found: &mut Vec<u32>) {
        let patch = self.ends.len() as u32;
        found.clear();
        found.push(seed);
        self.of[seed as usize] = patch;
        let mut next = 0;
        while let Some(&triangle) = found.get(next) {
            next += 1;
            for half_edge in 3 * triangle..3 * triangle + 3 {
                let partner = self.partner[half_edge as usize];
                if partner != NONE && self.of[partner as usize / 3] == NONE && admits(partner / 3) {
                    self.of[partner as usize / 3] = patch;
                    found.push(partner / 3);
                }
            }
        }
    }

    fn close(&mut self, members: &[u32]) {
        self.order.extend(members);
        self.ends.push(self.order.len() as u32);
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Triangles of a patch.
    pub fn members(&self, patch: usize) -> &[u32] {
        let start = if patch == 0 { 0 } else { self.ends[patch - 1] as usize };
        &self.order[start..self.ends[patch] as usize]
    }

    /// The largest triangle of a patch, by its index in the scene: its normal is the most exact.
    pub fn representative(&self, patch: usize, edges: &HalfEdges, surfaces: &[Surface]) -> usize {
        let own = self.members(patch).iter().map(|&t| edges.triangles[t as usize] as usize);
        let larger = |best: usize, i: usize| {
            let order = surfaces[i].area_m2.total_cmp(&surfaces[best].area_m2).then(best.cmp(&i));
            if order.is_gt() { i } else { best }
        };
        own.reduce(larger).unwrap_or(0)
    }

    /// Whether the patch ends at a half-edge.
    pub fn is_border(&self, half_edge: u32) -> bool {
        let partner = self.partner[half_edge as usize];
        partner == NONE || self.of[partner as usize / 3] != self.of[half_edge as usize / 3]
    }
}

/// The half-edge of the one triangle of the same plane and material on the other side; where there are several, nobody can say
/// which belongs to which. Triangles of other planes may end in the same edge: a partition does not cut the floor on which
/// it stands.
fn partner<'a>(edges: &HalfEdges, half_edge: u32, surface: impl Fn(u32) -> &'a Surface) -> u32 {
    let own = surface(half_edge / 3);
    let same_wall = |other: &u32| {
        let other = surface(other / 3);
        other.plane == own.plane && other.material == own.material
    };
    let only = |ends: [u32; 2]| {
        let mut found = edges.between(ends).filter(same_wall);
        found.next().filter(|_| found.next().is_none())
    };
    let [from, to] = edges.ends(half_edge);
    let opposite = only([from, to]).and_then(|_| only([to, from]));
    opposite.filter(|o| dot(surface(o / 3).normal, own.normal) > 0.0).unwrap_or(NONE)
}

/// The plane through the middle of triangles, along their mean normal, each by its area.
struct MeanPlane {
    normal: Vec3,
    point: Vec3,
}

impl MeanPlane {
    fn of(triangles: &[u32], edges: &HalfEdges) -> Self {
        let (mut normal, mut point, mut total) = ([0.0; 3], [0.0; 3], 0.0);
        for &t in triangles {
            let [a, b, c] = edges.corners[t as usize].map(|v| edges.points[v as usize]);
            let product = cross(sub(b, a), sub(c, a));
            let weight = norm(product);
            normal = add(normal, product);
            point = add(point, scale(add(add(a, b), c), weight / 3.0));
            total += weight;
        }
        Self { normal: unit(normal), point: scale(point, 1.0 / total) }
    }

    fn holds(&self, corners: [Vec3; 3], flat_m: f64) -> bool {
        let [a, b, c] = corners;
        let product = cross(sub(b, a), sub(c, a));
        corners.iter().all(|&corner| dot(self.normal, sub(corner, self.point)).abs() <= flat_m)
            && dot(self.normal, product) >= LEAST_COSINE * norm(product)
    }
}
