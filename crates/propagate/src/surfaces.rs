//! The triangles as a tracer needs them: edges, normals, materials, and the planes that they share.

use crate::Error;
use crate::vector::{Vec3, cross, dot, norm, scale, sub};
use sabine_scene::{Scene, Triangle};
use std::collections::HashMap;

/// Triangles smaller than this have no usable normal (m2).
const LEAST_AREA_M2: f64 = 1e-12;
/// Overlap of neighbouring triangles, as a share of their sides: closes the gap that rounding opens along shared edges.
pub(crate) const OVERLAP: f64 = 1e-8;
/// The two ways to compute where a ray meets a triangle, along the ray and across the triangle, agree to this share of the
/// size of the scene. They always do, but for rays so nearly in the plane of a sliver that the distance is noise; a point
/// far from its triangle would be found or not, depending on who looks for it.
const AGREEMENT: f64 = 1e-6;
/// Triangles within this distance of a common plane mirror as one (m) ...
const COPLANAR_M: f64 = 1e-4;
/// ... if their normals agree to this angle (rad).
const COPLANAR_RAD: f64 = 2e-3;

/// One triangle, two-sided: two cache lines, which is what a ray that meets it waits for.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(crate) struct Surface {
    pub corner: Vec3,
    pub edge1: Vec3,
    pub edge2: Vec3,
    /// Unit normal; zero where the triangle is degenerate.
    pub normal: Vec3,
    pub area_m2: f64,
    pub material: u32,
    /// Index of the plane that it shares with its coplanar neighbours.
    pub plane: u32,
    /// Index of the scene's triangle that a hit reports: this one, or the largest of those that were merged into this one.
    pub triangle: u32,
    /// [`AGREEMENT`] in metres.
    pub agreement_m: f64,
    /// Twice the area times the least cosine of incidence: rays in the plane miss.
    pub least_determinant: f32,
}

impl Surface {
    /// The triangle between three points, as yet without plane, number and scene.
    pub fn new([a, b, c]: [Vec3; 3], material: u32) -> Self {
        let (edge1, edge2) = (sub(b, a), sub(c, a));
        let normal = cross(edge1, edge2);
        let length = norm(normal);
        let area_m2 = 0.5 * length;
        let normal = if area_m2 < LEAST_AREA_M2 { [0.0; 3] } else { scale(normal, 1.0 / length) };
        Self {
            corner: a,
            edge1,
            edge2,
            normal,
            area_m2,
            material,
            plane: 0,
            triangle: 0,
            agreement_m: 0.0,
            least_determinant: (2e-12 * area_m2) as f32,
        }
    }

    pub fn is_degenerate(&self) -> bool {
        self.area_m2 < LEAST_AREA_M2
    }

    /// Distance along a unit direction to the triangle, from either side (Moeller and Trumbore 1997).
    pub fn intersect(&self, origin: Vec3, direction: Vec3) -> Option<f64> {
        let p = cross(direction, self.edge2);
        let determinant = dot(self.edge1, p);
        if determinant.abs() <= f64::from(self.least_determinant) || self.is_degenerate() {
            return None;
        }
        let inverse = 1.0 / determinant;
        let s = sub(origin, self.corner);
        let u = dot(s, p) * inverse;
        if !(-OVERLAP..=1.0 + OVERLAP).contains(&u) {
            return None;
        }
        let q = cross(s, self.edge1);
        let v = dot(direction, q) * inverse;
        if v < -OVERLAP || u + v > 1.0 + OVERLAP {
            return None;
        }
        let distance = dot(self.edge2, q) * inverse;
        let agrees = |axis: usize| {
            let apart = s[axis] + distance * direction[axis] - u * self.edge1[axis] - v * self.edge2[axis];
            apart.abs() <= self.agreement_m
        };
        (distance > 0.0 && agrees(0) && agrees(1) && agrees(2)).then_some(distance)
    }

    pub fn corners(&self) -> [Vec3; 3] {
        let [a, e1, e2] = [self.corner, self.edge1, self.edge2];
        [a, [a[0] + e1[0], a[1] + e1[1], a[2] + e1[2]], [a[0] + e2[0], a[1] + e2[1], a[2] + e2[2]]]
    }

    /// The normal on the side from which `direction` comes.
    pub fn normal_against(&self, direction: Vec3) -> Vec3 {
        if dot(self.normal, direction) > 0.0 { scale(self.normal, -1.0) } else { self.normal }
    }
}

/// A mirror plane: the points x with `normal . x == offset_m`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    pub normal: Vec3,
    pub offset_m: f64,
}

impl Plane {
    pub fn height(&self, point: Vec3) -> f64 {
        dot(self.normal, point) - self.offset_m
    }
}

/// All triangles and the planes in which they lie.
#[derive(Clone, Debug)]
pub(crate) struct Surfaces {
    pub triangles: Vec<Surface>,
    pub planes: Vec<Plane>,
    /// Middle of the box around all triangles that have an area.
    pub centre_m: Vec3,
    /// Diagonal of that box.
    pub size_m: f64,
    /// [`AGREEMENT`] in metres, as in each triangle.
    pub agreement_m: f64,
}

impl Surfaces {
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        let surface = |(i, triangle): (usize, &Triangle)| Surface {
            triangle: i as u32,
            ..Surface::new(scene.corners_m(i), triangle.material)
        };
        let mut triangles: Vec<Surface> = scene.triangles().iter().enumerate().map(surface).collect();
        if triangles.iter().all(Surface::is_degenerate) {
            return Err(Error::NoSurface { triangles: triangles.len() });
        }
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for corner in triangles.iter().filter(|s| !s.is_degenerate()).flat_map(Surface::corners) {
            low = std::array::from_fn(|axis| low[axis].min(corner[axis]));
            high = std::array::from_fn(|axis| high[axis].max(corner[axis]));
        }
        let size_m = norm(sub(high, low));
        let agreement_m = AGREEMENT * size_m;
        for triangle in &mut triangles {
            triangle.agreement_m = agreement_m;
        }
        let planes = merge_coplanar(&mut triangles);
        let centre_m = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        Ok(Self { triangles, planes, centre_m, size_m, agreement_m })
    }
}

/// Gives each triangle its plane. Larger triangles define planes, smaller ones join them: their normals are less exact.
fn merge_coplanar(triangles: &mut [Surface]) -> Vec<Plane> {
    let mut order: Vec<usize> = (0..triangles.len()).filter(|&i| !triangles[i].is_degenerate()).collect();
    order.sort_by(|&i, &j| triangles[j].area_m2.total_cmp(&triangles[i].area_m2).then(i.cmp(&j)));
    let mut planes: Vec<Plane> = Vec::new();
    // Planes by normal and distance from the middle, under both signs. A triangle of the same plane differs by less than half
    // a cell in the normal, and therefore in the distance by less than half a slot.
    let mut cells: HashMap<[i64; 4], Vec<u32>> = HashMap::new();
    let corners = || order.iter().flat_map(|&i| triangles[i].corners());
    let bound = |k: usize, pick: fn(f64, f64) -> f64| corners().map(|c| c[k]).reduce(pick).unwrap_or(0.0);
    let middle: Vec3 = std::array::from_fn(|k| 0.5 * (bound(k, f64::min) + bound(k, f64::max)));
    let reach_m = corners().map(|c| norm(sub(c, middle))).fold(0.0, f64::max);
    // Sines stand for angles.
    let half_cell = 1.01 * COPLANAR_RAD;
    let half_slot_m = half_cell * reach_m + COPLANAR_M;
    let key = |normal: Vec3, on: Vec3, shift: f64| -> [i64; 4] {
        let [x, y, z] = normal.map(|c| (0.5 * (c / half_cell + shift)).floor() as i64);
        [x, y, z, (0.5 * (dot(normal, sub(on, middle)) / half_slot_m + shift)).floor() as i64]
    };
    for &i in &order {
        let triangle = &triangles[i];
        let corners = triangle.corners();
        let (low, high) =
            (key(triangle.normal, triangle.corner, -1.0), key(triangle.normal, triangle.corner, 1.0));
        let near = (0..16)
            .filter(|n| (0..4).all(|k| n >> k & 1 == 0 || low[k] != high[k]))
            .map(|n| std::array::from_fn(|k| if n >> k & 1 == 0 { low[k] } else { high[k] }));
        let fits = |p: &u32| {
            let plane = &planes[*p as usize];
            norm(cross(plane.normal, triangle.normal)) < COPLANAR_RAD
                && corners.iter().all(|&c| plane.height(c).abs() < COPLANAR_M)
        };
        let same = near.filter_map(|cell| cells.get(&cell)?.iter().copied().find(fits)).min();
        let plane = same.unwrap_or_else(|| {
            let (normal, id) = (triangle.normal, planes.len() as u32);
            planes.push(Plane { normal, offset_m: dot(normal, triangle.corner) });
            for facing in [normal, scale(normal, -1.0)] {
                cells.entry(key(facing, triangle.corner, 0.0)).or_default().push(id);
            }
            id
        });
        triangles[i].plane = plane;
    }
    planes
}

/// Distance from a point to a triangle (Ericson 2005, Real-Time Collision Detection, 5.1.5).
pub(crate) fn distance_to(surface: &Surface, point: Vec3) -> f64 {
    let [a, b, c] = surface.corners();
    let segment = |p: Vec3, q: Vec3| {
        let (d, s) = (sub(q, p), sub(point, p));
        let length2 = dot(d, d);
        let t = if length2 > 0.0 { (dot(s, d) / length2).clamp(0.0, 1.0) } else { 0.0 };
        norm(sub(s, scale(d, t)))
    };
    let to_edges = segment(a, b).min(segment(b, c)).min(segment(c, a));
    if surface.is_degenerate() {
        return to_edges;
    }
    let n = surface.normal;
    let within = |p: Vec3, q: Vec3| dot(cross(sub(q, p), sub(point, p)), n) >= 0.0;
    if within(a, b) && within(b, c) && within(c, a) { dot(n, sub(point, a)).abs() } else { to_edges }
}
