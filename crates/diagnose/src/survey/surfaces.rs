//! The planar surfaces of a mesh, whatever they are made of: what stands, and is moved, as a whole.

use crate::survey::planes::{ByNormal, STEP_M, TILT, cross, dot};
use sabine_scene::Scene;
use std::collections::BTreeMap;

/// Positions nearer to each other than this are one, in metres: faces that meet need not share their vertices.
pub(crate) const WELD_M: f64 = 1e-3;
/// Triangles with a smaller area are left out, in square metres.
const MIN_TRIANGLE_M2: f64 = 1e-9;

/// A planar surface of the mesh: faces in one plane that touch each other, of one material or of several.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Surface {
    /// Unit normal, out of the room (away from where early reflections meet it), and the two unit vectors of
    /// [`DisplacedSurface`](crate::DisplacedSurface).
    pub axes: [[f64; 3]; 3],
    /// Its point nearest to the centre of its area, in metres.
    pub centre_m: [f64; 3],
    /// Its area in square metres.
    pub area_m2: f64,
    /// Indices of its materials, the largest area first.
    pub materials: Vec<usize>,
    /// How often early predicted reflections meet it, over all responses.
    pub reflections: usize,
    /// How far it can be moved along its normal, inwards (negative) and outwards, in metres: less than this would turn faces over or pass
    /// a source or receiver. Zero where nothing asks.
    pub range_m: [f64; 2],
}

/// The two unit vectors in a plane along which its tilts are counted: the coordinate axis that lies most nearly in it (x before y before
/// z), projected, and the one across, turned so that its largest component is positive.
pub(crate) fn axes_of(normal: [f64; 3]) -> [[f64; 3]; 3] {
    let least = (0..3).min_by(|&i, &j| normal[i].abs().total_cmp(&normal[j].abs())).unwrap_or(0);
    let along: [f64; 3] =
        std::array::from_fn(|k| f64::from(u8::from(k == least)) - normal[least] * normal[k]);
    let along = unit(along);
    let across = cross(normal, along);
    let sign = across[largest(across)].signum();
    [normal, along, across.map(|c| sign * c)]
}

/// The component of the largest size.
pub(crate) fn largest(v: [f64; 3]) -> usize {
    (0..3).max_by(|&i, &j| v[i].abs().total_cmp(&v[j].abs())).unwrap_or(0)
}

pub(crate) fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt().max(1e-300);
    v.map(|c| c / length)
}

pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

/// The mirror image of a place in the plane through a point.
pub(crate) fn mirrored_in(place: [f64; 3], normal: [f64; 3], point: [f64; 3]) -> [f64; 3] {
    let far = dot(normal, minus(place, point));
    std::array::from_fn(|k| place[k] - 2.0 * far * normal[k])
}

/// Corners of a triangle.
pub(crate) type Corners = [[f64; 3]; 3];

/// The point of a triangle nearest to a place (C. Ericson, *Real-Time Collision Detection*, 2005, 5.1.5).
pub(crate) fn nearest_on([a, b, c]: Corners, place: [f64; 3]) -> [f64; 3] {
    let at = |from: [f64; 3], way: [f64; 3], share: f64| -> [f64; 3] {
        std::array::from_fn(|k| from[k] + share * way[k])
    };
    let (ab, ac) = (minus(b, a), minus(c, a));
    let from_a = minus(place, a);
    let (d1, d2) = (dot(ab, from_a), dot(ac, from_a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let from_b = minus(place, b);
    let (d3, d4) = (dot(ab, from_b), dot(ac, from_b));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return at(a, ab, d1 / (d1 - d3));
    }
    let from_c = minus(place, c);
    let (d5, d6) = (dot(ab, from_c), dot(ac, from_c));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return at(a, ac, d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return at(b, minus(c, b), (d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    at(at(a, ab, vb / sum), ac, vc / sum)
}

/// Whether a place lies on a triangle, within [`WELD_M`].
pub(crate) fn lies_on(corners: Corners, place: [f64; 3]) -> bool {
    let near = |k: usize| {
        let along = corners.map(|c| c[k]);
        let (low, high) = (along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2]));
        (low - WELD_M..=high + WELD_M).contains(&place[k])
    };
    if !(0..3).all(near) {
        return false;
    }
    let off = minus(nearest_on(corners, place), place);
    dot(off, off) <= WELD_M * WELD_M
}

/// The surfaces of a mesh, in the order of their first triangles, and which triangle belongs to which.
pub(crate) struct Surfaces {
    /// Surface of each triangle; none of those without area.
    pub of_triangle: Vec<Option<usize>>,
    /// Unit normal (that of the first triangle) and a point of each plane.
    pub planes: Vec<([f64; 3], [f64; 3])>,
    /// Triangles of each surface.
    members: Vec<Vec<usize>>,
}

/// Least and greatest coordinates, in metres.
pub(crate) type Bounds = [[f64; 2]; 3];

/// Those of some points.
pub(crate) fn bounds_of(points: impl Iterator<Item = [f64; 3]>) -> Bounds {
    points.fold([[f64::INFINITY, f64::NEG_INFINITY]; 3], |all, p| {
        std::array::from_fn(|k| [all[k][0].min(p[k]), all[k][1].max(p[k])])
    })
}

/// Whether two boxes meet, within [`WELD_M`].
pub(crate) fn are_near(a: &Bounds, b: &Bounds) -> bool {
    (0..3).all(|k| a[k][0] <= b[k][1] + WELD_M && b[k][0] <= a[k][1] + WELD_M)
}

pub(crate) fn corners(scene: &Scene, triangle: usize) -> Corners {
    scene.triangles()[triangle].vertices.map(|v| scene.vertices()[v as usize])
}

/// Normal of a triangle, twice its area long.
pub(crate) fn normal_of([a, b, c]: Corners) -> [f64; 3] {
    cross(minus(b, a), minus(c, a))
}

impl Surfaces {
    /// Finds the surfaces of a mesh: faces in one plane, joined where they touch.
    pub fn of(scene: &Scene) -> Self {
        let count = scene.triangles().len();
        // Planes first, then what hangs together within each.
        let mut planes: Vec<([f64; 3], [f64; 3], Vec<usize>)> = Vec::new();
        let mut by_normal = ByNormal::default();
        for triangle in 0..count {
            let own = corners(scene, triangle);
            let normal = normal_of(own);
            if dot(normal, normal).sqrt() < 2.0 * MIN_TRIANGLE_M2 {
                continue;
            }
            let normal = unit(normal);
            let lies_in = |index: usize| {
                let (plane, point) = (planes[index].0, planes[index].1);
                dot(plane, normal).abs() > 1.0 - TILT
                    && own.iter().all(|c| dot(plane, minus(*c, point)).abs() < STEP_M)
            };
            match by_normal.first(normal, lies_in) {
                Some(index) => planes[index].2.push(triangle),
                None => {
                    by_normal.insert(normal, planes.len());
                    planes.push((normal, own[0], vec![triangle]));
                }
            }
        }
        let mut found: Vec<Vec<usize>> =
            planes.iter().flat_map(|(_, _, members)| connected(scene, members)).collect();
        found.sort_by_key(|members| members[0]);
        let mut of_triangle = vec![None; count];
        for (surface, members) in found.iter().enumerate() {
            members.iter().for_each(|&t| of_triangle[t] = Some(surface));
        }
        let mut all = Self { of_triangle, planes: Vec::new(), members: found };
        all.planes = (0..all.members.len()).map(|surface| all.plane(scene, surface)).collect();
        all
    }

    /// Triangles of a surface.
    pub fn triangles(&self, surface: usize) -> impl Iterator<Item = usize> + '_ {
        self.members[surface].iter().copied()
    }

    /// The box around each surface, in a mesh with the same triangles.
    pub fn bounds(&self, scene: &Scene) -> Vec<Bounds> {
        let around = |members: &Vec<usize>| bounds_of(members.iter().flat_map(|&t| corners(scene, t)));
        self.members.iter().map(around).collect()
    }

    /// The plane of a surface in a mesh with the same triangles: the mean of its normals, and the centre of its area.
    pub fn plane(&self, scene: &Scene, surface: usize) -> ([f64; 3], [f64; 3]) {
        let (mut sum, mut first) = ([0.0; 3], None);
        let (mut centre, mut area) = ([0.0; 3], 0.0);
        for triangle in self.triangles(surface) {
            let own = corners(scene, triangle);
            let normal = normal_of(own);
            let size = dot(normal, normal).sqrt();
            let sign = first.map_or(1.0, |f| dot(f, normal).signum());
            first = first.or(Some(normal));
            area += size;
            for k in 0..3 {
                sum[k] += sign * normal[k];
                centre[k] += size * (own[0][k] + own[1][k] + own[2][k]) / 3.0;
            }
        }
        (unit(sum), centre.map(|c| c / area.max(1e-300)))
    }

    /// Each surface as a survey shows it. Which side is the room's, and how many reflections meet it, is not known yet.
    pub fn described(&self, scene: &Scene) -> Vec<Surface> {
        let one = |surface: usize| {
            let (normal, centre) = self.planes[surface];
            let mut areas: BTreeMap<usize, f64> = BTreeMap::new();
            let mut nearest: Option<(f64, [f64; 3])> = None;
            for triangle in self.triangles(surface) {
                let own = corners(scene, triangle);
                let twice = normal_of(own);
                *areas.entry(scene.triangles()[triangle].material as usize).or_default() +=
                    0.5 * dot(twice, twice).sqrt();
                let point = nearest_on(own, centre);
                let off = minus(point, centre);
                let far = dot(off, off);
                if nearest.is_none_or(|(least, _)| far < least) {
                    nearest = Some((far, point));
                }
            }
            let mut materials: Vec<(usize, f64)> = areas.into_iter().collect();
            materials.sort_by(|a, b| b.1.total_cmp(&a.1));
            Surface {
                axes: axes_of(normal),
                centre_m: nearest.map_or(centre, |(_, point)| point),
                area_m2: materials.iter().map(|(_, area)| area).sum(),
                materials: materials.into_iter().map(|(material, _)| material).collect(),
                reflections: 0,
                range_m: [0.0; 2],
            }
        };
        (0..self.planes.len()).map(one).collect()
    }
}

/// Triangles of one plane in groups that touch.
fn connected(scene: &Scene, members: &[usize]) -> Vec<Vec<usize>> {
    // Those that share a corner, by its position.
    let mut parent: Vec<usize> = (0..members.len()).collect();
    let mut at: BTreeMap<[i64; 3], usize> = BTreeMap::new();
    for (index, &triangle) in members.iter().enumerate() {
        for corner in corners(scene, triangle) {
            let cell = corner.map(|c| (c / WELD_M).round() as i64);
            let other = *at.entry(cell).or_insert(index);
            join(&mut parent, index, other);
        }
    }
    // Those of which one has a corner on the other: where a face ends at the middle of another's side.
    let groups = in_groups(&mut parent);
    let around =
        |group: &Vec<usize>| bounds_of(group.iter().flat_map(|&index| corners(scene, members[index])));
    let bounds: Vec<Bounds> = groups.iter().map(around).collect();
    for (one, group) in groups.iter().enumerate() {
        for (other, theirs) in groups.iter().enumerate() {
            let is_joined = |parent: &mut Vec<usize>| root(parent, group[0]) == root(parent, theirs[0]);
            if one == other || !are_near(&bounds[one], &bounds[other]) || is_joined(&mut parent) {
                continue;
            }
            let touches = group.iter().any(|&index| {
                let own = corners(scene, members[index]);
                theirs.iter().any(|&t| corners(scene, members[t]).iter().any(|c| lies_on(own, *c)))
            });
            if touches {
                join(&mut parent, group[0], theirs[0]);
            }
        }
    }
    let joined = in_groups(&mut parent).into_iter();
    joined.map(|group| group.into_iter().map(|index| members[index]).collect()).collect()
}

/// Indices by their roots.
fn in_groups(parent: &mut [usize]) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for index in 0..parent.len() {
        groups.entry(root(parent, index)).or_default().push(index);
    }
    groups.into_values().collect()
}

fn root(parent: &mut [usize], mut index: usize) -> usize {
    while parent[index] != index {
        parent[index] = parent[parent[index]];
        index = parent[index];
    }
    index
}

fn join(parent: &mut [usize], a: usize, b: usize) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b)] = a.min(b);
}

/// Counts how often paths (where they leave, and the surfaces that they meet, in their order) meet each surface, and turns each surface's
/// normal away from the side on which most of them do.
pub(crate) fn count_reflections<'a>(
    surfaces: &mut [Surface],
    paths: impl Iterator<Item = ([f64; 3], &'a [usize])>,
) {
    let mut sides = vec![[0usize; 2]; surfaces.len()];
    for (departure, met) in paths {
        let mut direction = departure;
        for &surface in met {
            let normal = surfaces[surface].axes[0];
            let towards = dot(normal, direction);
            sides[surface][usize::from(towards > 0.0)] += 1;
            direction = std::array::from_fn(|k| direction[k] - 2.0 * towards * normal[k]);
        }
    }
    for (surface, [against, along]) in surfaces.iter_mut().zip(sides) {
        surface.reflections = against + along;
        if against > along {
            surface.axes = axes_of(surface.axes[0].map(|c| -c));
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine_acoustics::{Bands, Material};
    use sabine_scene::{NamedMaterial, Triangle};

    fn named(count: usize) -> Vec<NamedMaterial> {
        let hard = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        (0..count).map(|i| NamedMaterial { name: format!("m{i}"), material: hard.clone() }).collect()
    }

    fn rectangle(vertices: &mut Vec<[f64; 3]>, corners: [[f64; 3]; 4], material: u32) -> [Triangle; 2] {
        let first = vertices.len() as u32;
        vertices.extend(corners);
        [[0, 1, 2], [0, 2, 3]].map(|c| Triangle { vertices: c.map(|v| first + v), material })
    }

    #[test]
    fn faces_of_several_materials_that_touch_are_one_surface_and_those_apart_are_two() {
        // Two rectangles side by side, whose corners do not meet, and a third one in the same plane half a metre away.
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        let at = |y0: f64, y1: f64, z1: f64| [[1.0, y0, 0.0], [1.0, y1, 0.0], [1.0, y1, z1], [1.0, y0, z1]];
        triangles.extend(rectangle(&mut vertices, at(0.0, 2.0, 3.0), 0));
        triangles.extend(rectangle(&mut vertices, at(2.0, 3.0, 1.0), 1));
        triangles.extend(rectangle(&mut vertices, at(3.5, 4.0, 1.0), 1));
        let scene = Scene::new(vertices, triangles, named(2)).unwrap();
        let surfaces = Surfaces::of(&scene);
        assert_eq!(surfaces.of_triangle, [0, 0, 0, 0, 1, 1].map(Some));
        let described = surfaces.described(&scene);
        assert!((described[0].area_m2 - 7.0).abs() < 1e-12 && described[0].materials == [0, 1]);
        assert!((described[1].area_m2 - 0.5).abs() < 1e-12 && described[1].materials == [1]);
        // Along y and along z, both towards greater coordinates, on whichever side the room is.
        for normal in [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]] {
            assert_eq!(axes_of(normal)[1..], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        }
    }

    #[test]
    fn the_centre_of_a_bent_surface_lies_on_it() {
        // An L of three squares: the centre of its area is on it or not, its nearest point always is.
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        for [x0, y0, x1, y1] in [[0.0, 0.0, 6.0, 0.5], [0.0, 0.5, 0.5, 6.0]] {
            let own = [[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]];
            triangles.extend(rectangle(&mut vertices, own, 0));
        }
        let scene = Scene::new(vertices, triangles, named(1)).unwrap();
        let found = Surfaces::of(&scene).described(&scene);
        assert_eq!(found.len(), 1);
        let [x, y, _] = found[0].centre_m;
        assert!((0.0..=0.5 + 1e-9).contains(&x) || (0.0..=0.5 + 1e-9).contains(&y), "{x} {y}");
    }

    #[test]
    fn the_nearest_point_of_a_triangle_is_that_of_a_fine_grid() {
        let own = [[0.2, 0.1, 0.0], [2.0, 0.4, 0.3], [0.5, 1.7, 1.1]];
        for place in [
            [1.0, 0.5, 2.0],
            [-1.0, -1.0, 0.0],
            [3.0, 0.0, 0.0],
            [0.0, 3.0, 1.0],
            [2.0, 2.0, 0.0],
            [0.1, 1.0, -0.5],
        ] {
            let far = |p: [f64; 3]| dot(minus(p, place), minus(p, place)).sqrt();
            let mut least = f64::INFINITY;
            for i in 0..=300 {
                for j in 0..=300 - i {
                    let (s, t) = (f64::from(i) / 300.0, f64::from(j) / 300.0);
                    let point = std::array::from_fn(|k| {
                        own[0][k] + s * (own[1][k] - own[0][k]) + t * (own[2][k] - own[0][k])
                    });
                    least = least.min(far(point));
                }
            }
            let found = far(nearest_on(own, place));
            assert!(found <= least + 1e-12 && least - found < 0.01, "{found} {least}");
        }
    }
}
