//! Rooms written as GLB.

use sabine_acoustics::{Bands, Material, PerBand};
use sabine_scene::{Mesh, Scene};
use std::collections::BTreeMap;

/// Ours, read by our own reader, which other writers' files have been read by.
#[test]
fn a_room_comes_back_from_glb_with_its_materials() {
    let bands = Bands::T60;
    let carpet = Material::new(
        PerBand::new(bands, vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]).unwrap(),
        PerBand::uniform(bands, 0.25),
    )
    .unwrap();
    let wall = Material::uniform(bands, 0.1, 0.1).unwrap();
    let own: [Material; 6] = std::array::from_fn(|i| if i == 4 { carpet.clone() } else { wall.clone() });
    let room = Scene::shoebox([4.1, 3.2, 2.3], own).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.glb");
    std::fs::write(&path, room.to_glb().unwrap()).unwrap();
    let mesh = Mesh::read(&path).unwrap();
    let named: BTreeMap<String, Material> =
        room.materials().iter().map(|m| (m.name.clone(), m.material.clone())).collect();
    assert_eq!(*mesh.surfaces(), named);
    let back = mesh.into_scene(&named).unwrap();
    assert!((back.volume_m3() - room.volume_m3()).abs() < 1e-4 && back.triangles().len() == 12);
    let areas = |scene: &Scene| -> BTreeMap<String, i64> {
        let names = scene.materials().iter().map(|m| m.name.clone());
        names.zip(scene.material_areas_m2().iter().map(|a| (a * 1e4).round() as i64)).collect()
    };
    assert_eq!(areas(&back), areas(&room));
    // The axes are where they were: single precision is all that is lost.
    let off = back.bounds_m().into_iter().flatten().zip(room.bounds_m().into_iter().flatten());
    assert!(off.map(|(a, b)| (a - b).abs()).all(|off| off < 1e-6), "{:?}", back.bounds_m());
}
