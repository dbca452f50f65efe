//! Edges of a mesh around which sound may bend.

use crate::surfaces::Surfaces;
use crate::vector::{Vec3, along, cross, dot, norm, scale, sub, unit};
use sabine_paths::EdgePoint;
use sabine_scene::Scene;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Surfaces that bend by less do not count as an edge (rad): 1 degree.
const LEAST_BEND_RAD: f64 = 0.0175;
/// Edges on one line touch or overlap if they are this close to it and to each other (m): models are rounded.
const SAME_LINE_M: f64 = 1e-4;
/// Faces of one direction (rad).
const SAME_FACE_RAD: f64 = 2e-3;

/// A straight edge and the wedge of air about it, wider than pi. All vectors are unit vectors, perpendicular to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wedge {
    pub start: Vec3,
    pub length_m: f64,
    pub axis: Vec3,
    /// From the edge along the face at angle 0.
    pub face: Vec3,
    /// Off that face, into the air.
    pub normal: Vec3,
    /// Above pi; two pi for a sheet that ends.
    pub open_angle_rad: f64,
}

impl Wedge {
    /// Where a point lies, as seen from the edge; its angle may be beyond the open one, within the solid.
    pub fn locate(&self, point: Vec3) -> EdgePoint {
        let from = sub(point, self.start);
        let (x, y) = (dot(from, self.face), dot(from, self.normal));
        EdgePoint {
            radius_m: x.hypot(y),
            angle_rad: y.atan2(x).rem_euclid(TAU),
            along_m: dot(from, self.axis),
        }
    }

    /// A point by the edge, `off_m` away from it into the middle of the air.
    pub fn beside(&self, along_m: f64, off_m: f64) -> Vec3 {
        let (sine, cosine) = (0.5 * self.open_angle_rad).sin_cos();
        let on_edge = along(self.start, self.axis, along_m);
        along(along(on_edge, self.face, off_m * cosine), self.normal, off_m * sine)
    }

    /// Whether this one continues where the other ends, between the same faces.
    fn continues(&self, other: &Self) -> bool {
        norm(sub(self.start, along(other.start, other.axis, other.length_m))) < 2.0 * SAME_LINE_M
            && norm(sub(self.face, other.face)) < SAME_FACE_RAD
            && (self.open_angle_rad - other.open_angle_rad).abs() < SAME_FACE_RAD
    }
}

/// A side of triangles: two welded points, and one point of each triangle off it.
struct Side {
    ends: [Vec3; 2],
    tips: Vec<Vec3>,
}

/// All convex edges of bodies and all free edges of sheets, whichever side of the surfaces is air. Triangles belong together by
/// the positions of their corners; where a corner lies on the side of another triangle, the side is cut there. Pieces of one
/// straight edge become one again.
pub(crate) fn find_wedges(scene: &Scene, surfaces: &Surfaces) -> Vec<Wedge> {
    // Only a tolerance out of range is refused; this one is not.
    let alone = |_| (0..scene.vertices().len()).collect();
    let welded: Vec<usize> = scene.vertex_twins(Scene::WELD_TOLERANCE_M).unwrap_or_else(alone);
    let mut tips: BTreeMap<[usize; 2], Vec<Vec3>> = BTreeMap::new();
    for (triangle, surface) in scene.triangles().iter().zip(&surfaces.triangles) {
        let [a, b, c] = triangle.vertices.map(|v| welded[v as usize]);
        let longest_m =
            norm(surface.edge1).max(norm(surface.edge2)).max(norm(sub(surface.edge2, surface.edge1)));
        // A needle has no face to speak of; what it joins lies on one line, and is joined below.
        if a == b || b == c || c == a || 2.0 * surface.area_m2 < SAME_LINE_M * longest_m {
            continue;
        }
        for [p, q, tip] in [[a, b, c], [b, c, a], [c, a, b]] {
            tips.entry([p.min(q), p.max(q)]).or_default().push(scene.vertices()[tip]);
        }
    }
    let sides: Vec<Side> = tips
        .into_iter()
        .map(|(ends, tips)| Side { ends: ends.map(|v| scene.vertices()[v]), tips })
        .filter(|side| open_wedge(side.ends, &side.tips).is_some())
        .collect();
    lines(&sides).iter().flat_map(|group| wedges_on_line(&sides, group)).collect()
}

/// The widest wedge of air about an edge, if it is wider than pi.
fn open_wedge([start, end]: [Vec3; 2], tips: &[Vec3]) -> Option<Wedge> {
    let line = sub(end, start);
    let length_m = norm(line);
    let axis = unit(line);
    let off_axis = |tip: Vec3| {
        let to_tip = sub(tip, start);
        along(to_tip, axis, -dot(to_tip, axis))
    };
    // Closer to the line than its tolerance, a tip has no direction.
    let off_line = |&&tip: &&Vec3| norm(off_axis(tip)) > 0.1 * SAME_LINE_M;
    let face = unit(off_axis(*tips.iter().find(off_line)?));
    let normal = cross(axis, face);
    let reference = Wedge { start, length_m, axis, face, normal, open_angle_rad: TAU };
    let mut angles: Vec<f64> =
        tips.iter().filter(off_line).map(|&tip| reference.locate(tip).angle_rad).collect();
    angles.sort_by(f64::total_cmp);
    let next = |i: usize| angles.get(i + 1).copied().unwrap_or(angles[0] + TAU);
    let gaps = (0..angles.len()).map(|i| (angles[i], next(i) - angles[i]));
    let (from, open_angle_rad) = gaps.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let (sine, cosine) = from.sin_cos();
    let turned = |x: f64, y: f64| along(scale(face, x), normal, y);
    (open_angle_rad > PI + LEAST_BEND_RAD).then(|| Wedge {
        face: turned(cosine, sine),
        normal: turned(-sine, cosine),
        open_angle_rad,
        ..reference
    })
}

/// Groups of sides that lie on one line and touch, each in rising order.
fn lines(sides: &[Side]) -> Vec<Vec<usize>> {
    let mut group: Vec<usize> = (0..sides.len()).collect();
    fn root(group: &mut [usize], mut i: usize) -> usize {
        while group[i] != i {
            group[i] = group[group[i]];
            i = group[i];
        }
        i
    }
    let low = |i: usize, axis: usize| sides[i].ends[0][axis].min(sides[i].ends[1][axis]) - SAME_LINE_M;
    let high = |i: usize, axis: usize| sides[i].ends[0][axis].max(sides[i].ends[1][axis]) + SAME_LINE_M;
    // Sides of like direction are swept across it, so that only those next to each other are compared.
    let runs_along = |i: usize, axis: usize| {
        let line = sub(sides[i].ends[1], sides[i].ends[0]).map(f64::abs);
        line[axis] >= 0.9 * line[0].max(line[1]).max(line[2])
    };
    for along_axis in 0..3 {
        let swept = (along_axis + 1) % 3;
        let mut order: Vec<usize> = (0..sides.len()).filter(|&i| runs_along(i, along_axis)).collect();
        order.sort_by(|&i, &j| low(i, swept).total_cmp(&low(j, swept)));
        let mut active: Vec<usize> = Vec::new();
        for i in order {
            active.retain(|&j| high(j, swept) >= low(i, swept));
            for &j in &active {
                let apart = (0..3).any(|axis| low(i, axis) > high(j, axis) || low(j, axis) > high(i, axis));
                if !apart && on_one_line(&sides[i], &sides[j]) {
                    let (a, b) = (root(&mut group, i), root(&mut group, j));
                    group[a.max(b)] = a.min(b);
                }
            }
            active.push(i);
        }
    }
    let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for i in 0..sides.len() {
        members.entry(root(&mut group, i)).or_default().push(i);
    }
    members.into_values().collect()
}

/// Whether two sides lie on one line and touch.
fn on_one_line(a: &Side, b: &Side) -> bool {
    let length_m = |side: &Side| norm(sub(side.ends[1], side.ends[0]));
    let (long, short) = if length_m(a) >= length_m(b) { (a, b) } else { (b, a) };
    let axis = unit(sub(long.ends[1], long.ends[0]));
    let off = short.ends.map(|p| norm(cross(sub(p, long.ends[0]), axis)));
    let at = short.ends.map(|p| dot(sub(p, long.ends[0]), axis));
    off.iter().all(|&distance_m| distance_m < SAME_LINE_M)
        && at[0].max(at[1]) > -SAME_LINE_M
        && at[0].min(at[1]) < length_m(long) + SAME_LINE_M
}

/// Cuts a line where sides on it end, sees what stands about each piece, and joins what is alike.
fn wedges_on_line(sides: &[Side], group: &[usize]) -> Vec<Wedge> {
    let length_m = |i: usize| norm(sub(sides[i].ends[1], sides[i].ends[0]));
    let Some(&longest) = group.iter().max_by(|&&i, &&j| length_m(i).total_cmp(&length_m(j)).then(j.cmp(&i)))
    else {
        return Vec::new();
    };
    let origin = sides[longest].ends[0];
    let axis = unit(sub(sides[longest].ends[1], origin));
    let reach = |i: usize| {
        let [a, b] = sides[i].ends.map(|p| dot(sub(p, origin), axis));
        (a.min(b), a.max(b))
    };
    let mut cuts: Vec<f64> = group.iter().flat_map(|&i| <[f64; 2]>::from(reach(i))).collect();
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|later, earlier| *later - *earlier < SAME_LINE_M);
    let mut wedges: Vec<Wedge> = Vec::new();
    for piece in cuts.windows(2) {
        let middle = 0.5 * (piece[0] + piece[1]);
        let covers = |&&i: &&usize| reach(i).0 < middle && middle < reach(i).1;
        let tips: Vec<Vec3> =
            group.iter().filter(covers).flat_map(|&i| sides[i].tips.iter().copied()).collect();
        let ends = [piece[0], piece[1]].map(|at| along(origin, axis, at));
        let Some(wedge) = open_wedge(ends, &tips) else { continue };
        match wedges.last_mut().filter(|last| wedge.continues(last)) {
            Some(last) => last.length_m += wedge.length_m,
            None => wedges.push(wedge),
        }
    }
    wedges
}
