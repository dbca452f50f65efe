//! Sound around edges, against exact and approximate theories, and in rooms.

mod meshes;
mod real_rooms;
mod wedges;

use crate::wedge_oracles::Cylindrical;
use sabine_acoustics::{Bands, Material};
use sabine_paths::{EdgeDiffraction, EdgePoint};
use sabine_scene::{NamedMaterial, Scene, Triangle};

const SPEED_M_S: f64 = 343.2;
const OCTAVES_HZ: [f64; 8] = [62.5, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0];

fn db(energy: f64) -> f64 {
    10.0 * energy.log10()
}

fn point([radius_m, angle_rad, along_m]: Cylindrical) -> EdgePoint {
    EdgePoint { radius_m, angle_rad, along_m }
}

fn wedge(open_rad: f64, source: Cylindrical, receiver: Cylindrical, visible_m: [f64; 2]) -> EdgeDiffraction {
    EdgeDiffraction::new(open_rad, point(source), point(receiver), &[visible_m]).unwrap()
}

fn hard() -> Material {
    Material::uniform(Bands::SIMULATION, 0.1, 0.1).unwrap()
}

/// Each face by its own corners, none shared, as many real files have it.
fn scene(faces: &[Vec<[f64; 3]>]) -> Scene {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for face in faces {
        let first = vertices.len() as u32;
        vertices.extend_from_slice(face);
        for i in 1..face.len() as u32 - 1 {
            triangles.push(Triangle { vertices: [first, first + i, first + i + 1], material: 0 });
        }
    }
    Scene::new(vertices, triangles, vec![NamedMaterial { name: "hard".into(), material: hard() }]).unwrap()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}
