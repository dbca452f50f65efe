//! Is the mesh fit to hold sound?

use crate::Error;
use crate::mesh_edges::{MeshEdge, odd_edges};
use crate::mesh_scene::MeshScene;
use crate::random::{direction, generator};
use crate::vector::Vec3;
use crate::walk::{before_hit, next_hit, reflected};
use sabine_paths::Reflection;
use sabine_scene::Scene;
use std::fmt;

/// Rays that look for leaks ...
const RAYS: u64 = 2_048;
/// ... and the surfaces that each visits.
const LEGS: usize = 8;
/// Share of escaping rays above which a mesh is refused: at 1 in 1,000 a wall of absorption 0.05 seems 2 % softer.
const MAX_ESCAPE_RATE: f64 = 1e-3;

/// Edges of each kind that [`MeshReport`] lists when it is printed.
const LISTED: usize = 5;

/// What is odd about a mesh, and whether sound gets out of it.
///
/// Edges tell little about leaks. In models of real rooms many belong to one triangle although nothing gets out: a
/// neighbour has a vertex in the middle of them (a T-junction), furniture stands on a floor that is not cut to its shape, a
/// screen ends freely in the room. Others belong to three or more, where a partition meets a wall. Rays decide whether a
/// mesh holds sound; the edges say where to look if it does not.
///
/// ```
/// use sabine_acoustics::{Bands, Material};
/// use sabine_scene::Scene;
/// use sabine_propagate::MeshReport;
/// let plaster = Material::uniform(Bands::SIMULATION, 0.1, 0.1)?;
/// let room = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| plaster.clone()))?;
/// let report = MeshReport::inspect(&room, [2.0, 3.0, 1.5])?;
/// assert!(report.is_closed() && (report.volume_m3 - 210.0).abs() < 1e-9);
/// assert!(report.to_string().starts_with("12 triangles in 6 planes around 210.0 m3.\nHolds sound"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct MeshReport {
    /// Number of triangles.
    pub triangles: usize,
    /// Edges that belong to one triangle only, and that nothing else closes, longest first: the rim of a hole, or that of a
    /// screen without thickness.
    pub open_edges: Vec<MeshEdge>,
    /// Edges that belong to one triangle only, but touch other triangles along their whole length: T-junctions, and bodies
    /// that stand on a face. Nothing passes there.
    pub resting_edges: Vec<MeshEdge>,
    /// Edges that three or more triangles share.
    pub crowded_edges: Vec<MeshEdge>,
    /// Number of edges whose two triangles are turned against each other: the volume is then wrong, the tracing is not.
    pub flipped_edges: usize,
    /// Triangles without area, by index.
    pub degenerate_triangles: Vec<usize>,
    /// Triangles on the same three corners as an earlier one, by index.
    pub duplicate_triangles: Vec<usize>,
    /// Number of planes in which the triangles lie.
    pub planes: usize,
    /// Volume that the mesh encloses, in m3, if it is closed and its triangles are turned alike.
    pub volume_m3: f64,
    /// Rays sent from surface to surface, from the point on.
    pub rays: u64,
    /// How many of them met nothing.
    pub escaped_rays: u64,
}

impl MeshReport {
    /// Looks at the edges, and sends rays from a point in the room.
    ///
    /// # Errors
    /// [`Error::NoSurface`] if all triangles have zero area.
    pub fn inspect(scene: &Scene, point_m: [f64; 3]) -> Result<Self, Error> {
        Self::new(scene, &MeshScene::new(scene)?, point_m)
    }

    pub(crate) fn new(scene: &Scene, mesh: &MeshScene, point_m: Vec3) -> Result<Self, Error> {
        let degenerate = |i: usize| mesh.surfaces.triangles[i].is_degenerate();
        let twins = scene.vertex_twins(Scene::WELD_TOLERANCE_M)?;
        let edges = odd_edges(scene, &twins, degenerate);
        let (rays, escaped_rays) = escaped(mesh, point_m);
        Ok(Self {
            triangles: scene.triangles().len(),
            open_edges: edges.open,
            resting_edges: edges.resting,
            crowded_edges: edges.crowded,
            flipped_edges: edges.flipped,
            degenerate_triangles: (0..scene.triangles().len()).filter(|&i| degenerate(i)).collect(),
            duplicate_triangles: edges.duplicates,
            planes: mesh.surfaces.planes.len(),
            volume_m3: scene.volume_m3(),
            rays,
            escaped_rays,
        })
    }

    /// Whether hardly any ray from this point escapes.
    pub(crate) fn holds(mesh: &MeshScene, point_m: Vec3) -> bool {
        let (rays, escaped_rays) = escaped(mesh, point_m);
        escaped_rays as f64 <= MAX_ESCAPE_RATE * rays as f64
    }

    /// Whether every edge joins two triangles, or touches others along its whole length.
    pub fn is_closed(&self) -> bool {
        self.open_edges.is_empty() && self.crowded_edges.is_empty()
    }

    /// Share of rays from surface to surface that meet nothing.
    pub fn escape_rate(&self) -> f64 {
        self.escaped_rays as f64 / self.rays.max(1) as f64
    }

    /// What is worth telling, in words; empty for a sound mesh.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.escaped_rays > 0 {
            warnings.push(format!("{:.3} % of rays between surfaces escape", 100.0 * self.escape_rate()));
        }
        for (edges, what) in [
            (&self.open_edges, "edges belong to one triangle only"),
            (&self.crowded_edges, "edges are shared by three or more triangles"),
        ] {
            if let Some(longest) = edges.first() {
                warnings.push(format!("{} {what}, the longest {longest}", edges.len()));
            }
        }
        for (what, list) in
            [("have no area", &self.degenerate_triangles), ("repeat earlier ones", &self.duplicate_triangles)]
        {
            if let Some(first) = list.first() {
                warnings.push(format!("{} triangles {what}, the first being triangle {first}", list.len()));
            }
        }
        warnings
    }

    /// Refuses a mesh through which more than one ray in 1,000 escapes from surface to surface.
    ///
    /// # Errors
    /// [`Error::Leaking`].
    pub fn check(&self) -> Result<(), Error> {
        if self.escape_rate() <= MAX_ESCAPE_RATE {
            return Ok(());
        }
        Err(Error::Leaking {
            escape_rate: self.escape_rate(),
            open_edges: self.open_edges.len(),
            example_m: self.open_edges.first().map(|edge| edge.ends_m),
        })
    }
}

impl fmt::Display for MeshReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (triangles, planes, rays) = (self.triangles, self.planes, self.rays);
        writeln!(f, "{triangles} triangles in {planes} planes around {:.1} m3.", self.volume_m3)?;
        match self.escaped_rays {
            0 => writeln!(f, "Holds sound: none of {rays} rays from surface to surface escapes.")?,
            n => {
                let verdict = if self.check().is_ok() { "Nearly holds sound" } else { "Leaks" };
                let percent = 100.0 * self.escape_rate();
                writeln!(
                    f,
                    "{verdict}: {n} of {rays} rays from surface to surface escape ({percent:.3} %)."
                )?;
            }
        }
        for (edges, what, listed) in [
            (
                &self.open_edges,
                "of one triangle, closed by nothing: the rim of a hole or of a free screen",
                LISTED,
            ),
            (
                &self.crowded_edges,
                "of three or more triangles: where a partition meets a wall, or faces lie in each other",
                LISTED,
            ),
            (
                &self.resting_edges,
                "of one triangle, closed by other faces: T-junctions, bodies that stand on a face",
                1,
            ),
        ] {
            let Some(longest) = edges.first() else { continue };
            let total_m: f64 = edges.iter().map(MeshEdge::length_m).sum();
            writeln!(f, "Edges {what}: {}, {total_m:.2} m in all.", edges.len())?;
            writeln!(f, "  the longest: {longest}")?;
            for edge in edges.iter().take(listed).skip(1) {
                writeln!(f, "               {edge}")?;
            }
        }
        if self.flipped_edges > 0 {
            let edges = self.flipped_edges;
            writeln!(
                f,
                "Edges between triangles that are turned against each other: {edges}; the volume may be wrong."
            )?;
        }
        for (list, what) in [
            (&self.degenerate_triangles, "without area"),
            (&self.duplicate_triangles, "on the corners of an earlier one"),
        ] {
            if let Some(first) = list.first() {
                writeln!(f, "Triangles {what}: {}, the first being triangle {first}.", list.len())?;
            }
        }
        Ok(())
    }
}

/// Rays sent, and those that met nothing.
fn escaped(mesh: &MeshScene, point_m: Vec3) -> (u64, u64) {
    let (mut legs, mut escapes) = (0u64, 0u64);
    for ray in 0..RAYS {
        let mut random = generator(0x1EAC, ray);
        let (mut origin, mut heading) = (point_m, direction(&mut random));
        for _ in 0..LEGS {
            legs += 1;
            let Some(hit) = next_hit(mesh, origin, &mut heading, &mut random) else {
                escapes += 1;
                break;
            };
            let surface = &mesh.surfaces.triangles[hit.triangle as usize];
            origin = before_hit(origin, heading, hit.distance);
            heading = reflected(surface, heading, Reflection::Scattered, &mut random);
        }
    }
    (legs, escapes)
}
