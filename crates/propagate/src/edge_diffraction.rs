//! Sound that bends around one edge into the shadow.

use crate::edge_wedges::{Wedge, find_wedges};
use crate::mesh_scene::MeshScene;
use crate::vector::{Vec3, along, norm, scale, sub};
use crate::walk::visible;
use rayon::prelude::*;
use sabine_paths::{EdgeDiffraction, EdgePoint, PathSet};
use sabine_scene::Scene;

/// The legs of a path end this far beside the edge (m), clear of its faces. A slit narrower than this, as between a screen and a
/// wall that it should touch, is closed.
const OFF_M: f64 = 1e-3;
/// Ends this close to an edge's line do not bend around it (m).
const LEAST_RADIUS_M: f64 = 1e-2;
/// Steps in which the sight of an edge is sampled, in units of the nearer end's distance close by, growing with distance ...
const SIGHT_STEP: f64 = 0.2;
/// ... and how many at most.
const MOST_STEPS: usize = 64;
/// How exactly the ends of the visible parts are found (m).
const SIGHT_END_M: f64 = 1e-3;

/// The edges of a scene around which sound bends: where a sheet ends, and where the surfaces of a body or a room turn away from
/// each other by at least 1 degree. Found once, they serve any source and receiver.
///
/// [`DiffractingEdges::add_paths`] adds, where the straight line is blocked, every path over one edge whose wedge itself casts
/// the shadow and whose legs are free, with the exact diffraction of a rigid wedge over the visible part of the edge
/// ([`EdgeDiffraction`]).
///
/// # What it leaves out
/// - Ways over more than one edge. Behind a body there may be no edge that both ends see, be it a screen 5 cm thick with both
///   ends below its top: then nothing is added. Model thin screens as sheets.
/// - Reflections before or after the edge, other than in the faces of its own wedge.
/// - The lit side. Where the source is in sight the direct sound stays as it is, so that the level jumps by 6 dB at the border
///   of the shadow. The true field rises from -6 dB there to -1 dB at 33, 13 and 4.5 degrees from the border at 125 Hz, 1 and
///   8 kHz (both ends 3 m from the edge of a screen), and swings about 0 dB by 1 dB beyond. The diffracted field weakens the
///   direct one there; to add its energy would raise the level by 1 dB where it should fall by 6.
/// - Interference between edges in energies, which add up. In a rendered pressure they interfere, for each has its arrival.
/// - Absorption of the faces; and obstacles that hide less of an edge than the steps in which its sight is sampled (a fifth of
///   the nearer end's distance).
///
/// # Cost
/// Finding the 3,748 edges of the 5,160 triangles of BRAS CR4 takes 26 ms; the paths over them between two points at most 10 ms
/// on two cores (100 random pairs, `tests/it/diffraction.rs`).
///
/// ```
/// use sabine_acoustics::*;
/// use sabine_paths::*;
/// use sabine_scene::*;
/// use sabine_propagate::{DiffractingEdges, MeshScene};
/// // A screen 1.5 m wide and 2 m high stands in the open; 1 m behind it the sound arrives over all four edges.
/// let vertices = vec![[0.0, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 1.5, 2.0], [0.0, 0.0, 2.0]];
/// let triangles = [[0, 1, 2], [0, 2, 3]].map(|vertices| Triangle { vertices, material: 0 });
/// let wood = NamedMaterial { name: "wood".into(), material: Material::uniform(Bands::T60, 0.1, 0.1)? };
/// let scene = Scene::new(vertices, triangles.to_vec(), vec![wood.clone()])?;
/// let mut paths = PathSet::new(1, 100.0);
/// let mesh = MeshScene::new(&scene)?;
/// let edges = DiffractingEdges::find(&scene, &mesh);
/// edges.add_paths(&mut paths, &mesh, [-1.0, 0.75, 1.2], [1.0, 0.75, 1.2]);
/// assert_eq!((edges.len(), paths.len()), (4, 4));
/// // The low octaves pass, the high ones do not.
/// let energy = paths.energies(&Conditions::new(&[wood.material], &Air::default()))?;
/// let level_db = |band: usize| 10.0 * (4.0 * energy[band].iter().sum::<f32>()).log10();
/// assert!(level_db(0) > -6.0 && level_db(6) < -15.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct DiffractingEdges {
    wedges: Vec<Wedge>,
}

impl DiffractingEdges {
    /// Looks for the edges; `mesh` must be of the same scene.
    pub fn find(scene: &Scene, mesh: &MeshScene) -> Self {
        Self { wedges: find_wedges(scene, &mesh.surfaces) }
    }

    /// Number of straight edges. It includes those that turn away from each other only seen from outside a room: no source in
    /// it sees them.
    pub fn len(&self) -> usize {
        self.wedges.len()
    }

    /// Whether nothing in the scene bends sound.
    pub fn is_empty(&self) -> bool {
        self.wedges.is_empty()
    }

    /// The edges, as pairs of points in metres.
    pub fn edges_m(&self) -> Vec<[[f64; 3]; 2]> {
        self.wedges.iter().map(|w| [w.start, along(w.start, w.axis, w.length_m)]).collect()
    }

    /// Adds all paths over one edge between two points that do not see each other. `mesh` must be of the same scene.
    pub fn add_paths(&self, paths: &mut PathSet, mesh: &MeshScene, source_m: Vec3, receiver_m: Vec3) {
        // In one order, so that exchanging source and receiver changes nothing.
        let swapped = source_m > receiver_m;
        let ends = if swapped { [receiver_m, source_m] } else { [source_m, receiver_m] };
        if visible(mesh, ends[0], ends[1]) {
            return;
        }
        let max_length_m = paths.max_length_m();
        let bent: Vec<(Vec3, EdgeDiffraction)> =
            self.wedges.par_iter().filter_map(|wedge| around(wedge, mesh, ends, max_length_m)).collect();
        for (bend, diffraction) in bent {
            let towards = |from: Vec3| {
                let line = sub(bend, from);
                scale(line, 1.0 / norm(line))
            };
            paths.push_diffracted(towards(source_m), towards(receiver_m), diffraction);
        }
    }
}

/// The path over one edge, and where it bends.
fn around(
    wedge: &Wedge,
    mesh: &MeshScene,
    ends: [Vec3; 2],
    max_length_m: f64,
) -> Option<(Vec3, EdgeDiffraction)> {
    let at = ends.map(|end| wedge.locate(end));
    let within = |end: &EdgePoint| end.radius_m > LEAST_RADIUS_M && end.angle_rad <= wedge.open_angle_rad;
    let in_shadow = (at[0].angle_rad - at[1].angle_rad).abs() > std::f64::consts::PI;
    if !at.iter().all(within) || !in_shadow {
        return None;
    }
    // No way over the line is shorter than the straight one over it.
    let shortest_m = (at[0].radius_m + at[1].radius_m).hypot(at[0].along_m - at[1].along_m);
    if shortest_m > max_length_m {
        return None;
    }
    let parts = visible_parts(wedge, mesh, ends, at);
    if parts.is_empty() {
        return None;
    }
    // What remains to be refused are ends on the border of the shadow, to rounding: they are lit.
    let diffraction = EdgeDiffraction::new(wedge.open_angle_rad, at[0], at[1], &parts).ok()?;
    let bend = along(wedge.start, wedge.axis, diffraction.bend_m());
    (diffraction.length_m() <= max_length_m).then_some((bend, diffraction))
}

/// Parts of the edge that both ends see.
fn visible_parts(wedge: &Wedge, mesh: &MeshScene, ends: [Vec3; 2], at: [EdgePoint; 2]) -> Vec<[f64; 2]> {
    let seen = |along_m: f64| {
        // Where the edge ends in a wall, the wall is not in the way.
        let inner = along_m
            .clamp(OFF_M.min(0.5 * wedge.length_m), (wedge.length_m - OFF_M).max(0.5 * wedge.length_m));
        let target = wedge.beside(inner, OFF_M);
        ends.iter().all(|&end| visible(mesh, end, target))
    };
    // Dense where the path bends, wider apart with distance from there.
    let [a, b] = at;
    let straight_m = (a.along_m * b.radius_m + b.along_m * a.radius_m) / (a.radius_m + b.radius_m);
    let scale_m = a.radius_m.min(b.radius_m);
    let stretched = |along_m: f64| ((along_m - straight_m) / scale_m).asinh();
    let (first, last) = (stretched(0.0), stretched(wedge.length_m));
    let steps = (((last - first) / SIGHT_STEP).ceil() as usize).clamp(4, MOST_STEPS);
    let sample = |i: usize| match i {
        0 => 0.0,
        i if i == steps => wedge.length_m,
        i => straight_m + scale_m * (first + (last - first) * i as f64 / steps as f64).sinh(),
    };
    let mut parts = Vec::new();
    let (mut previous, mut was_seen) = (0.0, seen(0.0));
    let mut begin = 0.0;
    for i in 1..=steps {
        let (here, is_seen) = (sample(i), seen(sample(i)));
        if is_seen != was_seen {
            let (mut before, mut after) = (previous, here);
            while after - before > SIGHT_END_M {
                let middle = 0.5 * (before + after);
                if seen(middle) == was_seen { before = middle } else { after = middle }
            }
            let border = 0.5 * (before + after);
            if was_seen {
                parts.push([begin, border]);
            }
            begin = border;
        }
        (previous, was_seen) = (here, is_seen);
    }
    if was_seen {
        parts.push([begin, wedge.length_m]);
    }
    parts
}
