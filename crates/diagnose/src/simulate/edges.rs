//! The ways around the edges of the mesh.

use crate::error::Error;
use sabine_paths::PathSet;
use sabine_propagate::{DiffractingEdges, MeshScene};
use sabine_scene::Scene;

/// Edges of a mesh around which sound bends.
pub(crate) struct Edges {
    mesh: MeshScene,
    edges: DiffractingEdges,
    materials: usize,
}

impl Edges {
    /// None where nothing bends sound.
    pub fn find(scene: &Scene) -> Result<Option<Self>, Error> {
        let mesh = MeshScene::new(scene)?;
        let edges = DiffractingEdges::find(scene, &mesh);
        let materials = scene.materials().len();
        Ok((!edges.is_empty()).then_some(Self { mesh, edges, materials }))
    }

    /// The paths over one edge between two places, of at most this length: none where they see each other.
    pub fn paths(edges: Option<&Self>, places_m: [[f64; 3]; 2], longest_m: f64) -> Option<PathSet> {
        let found = edges?;
        let mut paths = PathSet::new(found.materials, longest_m);
        found.edges.add_paths(&mut paths, &found.mesh, places_m[0], places_m[1]);
        (!paths.is_empty()).then_some(paths)
    }
}
