//! Is the mesh fit to hold sound?

use crate::Error;
use crate::mesh_scene::MeshScene;
use crate::random::{direction, generator};
use crate::vector::{Vec3, norm, sub};
use crate::walk::{before_hit, next_hit, reflected};
use sabine_acoustics::{Reflection, Scene};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Vertices within this distance are one (m): models repeat them for each face, rounded.
const WELD_M: f64 = 1e-5;
/// Rays that look for leaks ...
const RAYS: u64 = 2_048;
/// ... and the surfaces that each visits.
const LEGS: usize = 8;
/// Share of escaping rays above which a mesh is refused: at 1 in 1,000 a wall of absorption 0.05 seems 2 % softer.
const MAX_ESCAPE_RATE: f64 = 1e-3;

/// What is odd about a mesh.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct MeshReport {
    /// Edges that belong to one triangle only, as pairs of points in metres, longest first. A hole has them, and so has a
    /// screen without thickness, or a vertex that lies on another triangle's edge.
    pub open_edges_m: Vec<[[f64; 3]; 2]>,
    /// Edges that three or more triangles share, as pairs of points in metres.
    pub crowded_edges_m: Vec<[[f64; 3]; 2]>,
    /// Triangles without area, by index.
    pub degenerate_triangles: Vec<usize>,
    /// Triangles on the same three corners as an earlier one, by index.
    pub duplicate_triangles: Vec<usize>,
    /// Number of planes in which the triangles lie.
    pub planes: usize,
    /// Volume that the mesh encloses, in m3, if it is closed and its triangles are turned alike.
    pub volume_m3: f64,
    /// Share of rays, scattered from surface to surface from the source on, that meet nothing.
    pub escape_rate: f64,
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
        let welded = weld(scene.vertices());
        let mut edges: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        let mut seen = BTreeSet::new();
        let (mut degenerate_triangles, mut duplicate_triangles) = (Vec::new(), Vec::new());
        for (i, triangle) in scene.triangles().iter().enumerate() {
            let [a, b, c] = triangle.vertices.map(|v| welded[v as usize]);
            if mesh.surfaces.triangles[i].is_degenerate() {
                degenerate_triangles.push(i);
            }
            // A needle along an edge may close it, where it joins three points of a line.
            if a == b || b == c || c == a {
                continue;
            }
            let mut corners = [a, b, c];
            corners.sort_unstable();
            if !seen.insert(corners) {
                duplicate_triangles.push(i);
                continue;
            }
            for [p, q] in [[a, b], [b, c], [c, a]] {
                *edges.entry([p.min(q), p.max(q)]).or_default() += 1;
            }
        }
        let longest_first = |wanted: &dyn Fn(usize) -> bool| {
            let mut found: Vec<[Vec3; 2]> = edges
                .iter()
                .filter(|&(_, &uses)| wanted(uses))
                .map(|(edge, _)| edge.map(|v| scene.vertices()[v]))
                .collect();
            let length = |e: &[Vec3; 2]| norm(sub(e[0], e[1]));
            found.sort_by(|a, b| length(b).total_cmp(&length(a)));
            found
        };
        Ok(Self {
            open_edges_m: longest_first(&|uses| uses == 1),
            crowded_edges_m: longest_first(&|uses| uses > 2),
            degenerate_triangles,
            duplicate_triangles,
            planes: mesh.surfaces.planes.len(),
            volume_m3: scene.volume_m3(),
            escape_rate: escape_rate(mesh, point_m),
        })
    }

    /// Whether every edge joins two triangles.
    pub fn is_closed(&self) -> bool {
        self.open_edges_m.is_empty() && self.crowded_edges_m.is_empty()
    }

    /// What is worth telling, in words; empty for a sound mesh.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let at = |edges: &[[[f64; 3]; 2]]| {
            edges.first().map(|[a, b]| format!(", the longest from {a:?} to {b:?} m")).unwrap_or_default()
        };
        if self.escape_rate > 0.0 {
            warnings.push(format!("{:.3} % of rays between surfaces escape", 100.0 * self.escape_rate));
        }
        if !self.open_edges_m.is_empty() {
            let (count, example) = (self.open_edges_m.len(), at(&self.open_edges_m));
            warnings.push(format!("{count} edges belong to one triangle only{example}"));
        }
        if !self.crowded_edges_m.is_empty() {
            let (count, example) = (self.crowded_edges_m.len(), at(&self.crowded_edges_m));
            warnings.push(format!("{count} edges are shared by three or more triangles{example}"));
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
        if self.escape_rate <= MAX_ESCAPE_RATE {
            return Ok(());
        }
        Err(Error::Leaking {
            escape_rate: self.escape_rate,
            open_edges: self.open_edges_m.len(),
            example_m: self.open_edges_m.first().copied(),
        })
    }
}

/// For each vertex the first one at the same place.
pub(crate) fn weld(vertices: &[Vec3]) -> Vec<usize> {
    let mut first_in: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    let mut welded = Vec::with_capacity(vertices.len());
    for (i, &vertex) in vertices.iter().enumerate() {
        let [x, y, z] = vertex.map(|c| (c / WELD_M).round() as i64);
        let twin = (0..27i64).find_map(|n| {
            let near = first_in.get(&[x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1])?;
            near.iter().copied().find(|&j| norm(sub(vertices[j], vertex)) < WELD_M)
        });
        welded.push(twin.unwrap_or_else(|| {
            first_in.entry([x, y, z]).or_default().push(i);
            i
        }));
    }
    welded
}

fn escape_rate(mesh: &MeshScene, point_m: Vec3) -> f64 {
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
    escapes as f64 / legs as f64
}
