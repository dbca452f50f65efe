//! What must hold of a mesh that was read.

use sabine_acoustics::{Bands, Material};
use sabine_scene::Mesh;
use std::path::Path;

/// Reads the file and asks for a scene of it.
pub fn check(path: &Path) {
    let Ok(mesh) = Mesh::read(path) else { return };
    for vertex in mesh.vertices_m() {
        assert!(vertex.iter().all(|c| c.abs() <= 1e5), "{vertex:?}");
    }
    for triangle in mesh.triangles() {
        assert!(triangle.vertices.iter().all(|&v| (v as usize) < mesh.vertices_m().len()));
        assert!((triangle.material as usize) < mesh.material_names().len());
    }
    let material = Material::uniform(Bands::T60, 0.1, 0.1).expect("a plain material");
    let tables = mesh.material_names().iter().map(|name| (name.clone(), material.clone())).collect();
    if let Ok(scene) = mesh.into_scene(&tables) {
        assert!(scene.volume_m3().is_finite());
    }
}
