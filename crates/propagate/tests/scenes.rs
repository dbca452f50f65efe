//! The hierarchy against plain search.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use proptest::prelude::*;
use sabine_acoustics::{Material, NamedMaterial, OctaveBands, RayScene, Scene, Triangle};
use sabine_propagate::{BruteForceScene, MeshScene};

fn soup(corners: &[[f64; 9]], shift_m: f64) -> Scene {
    let material = Material::uniform(OctaveBands::T60, 0.1, 0.1).unwrap();
    let vertices = corners
        .iter()
        .flat_map(|c| (0..3).map(|i| [c[3 * i] + shift_m, c[3 * i + 1], c[3 * i + 2]]))
        .collect();
    let triangles = (0..corners.len() as u32)
        .map(|i| Triangle { vertices: [3 * i, 3 * i + 1, 3 * i + 2], material: 0 })
        .collect();
    Scene::new(vertices, triangles, vec![NamedMaterial { name: "any".into(), material }]).unwrap()
}

proptest! {
    /// Any triangles, any ray, anywhere: both scenes see the same surface at the same distance.
    #[test]
    fn the_hierarchy_finds_what_plain_search_finds(
        corners in prop::collection::vec(prop::array::uniform9(-5.0f64..5.0), 1..60),
        origin in prop::array::uniform3(-8.0f64..8.0),
        z in -1.0f64..1.0,
        azimuth in 0.0f64..std::f64::consts::TAU,
        shift_m in prop::sample::select(vec![0.0, 1e4]),
    ) {
        let scene = soup(&corners, shift_m);
        let r = (1.0 - z * z).sqrt();
        let direction = [r * azimuth.cos(), r * azimuth.sin(), z];
        let from = [origin[0] + shift_m, origin[1], origin[2]];
        let fast = MeshScene::new(&scene).unwrap().closest_hit(from, direction, f64::INFINITY);
        let plain = BruteForceScene::new(&scene).unwrap().closest_hit(from, direction, f64::INFINITY);
        match (fast, plain) {
            (Some(a), Some(b)) => prop_assert!((a.distance - b.distance).abs() < 1e-5, "{a:?} {b:?}"),
            (a, b) => prop_assert_eq!(a, b),
        }
    }
}

#[test]
fn axis_parallel_rays_and_limits_agree() {
    let m = Material::uniform(OctaveBands::T60, 0.1, 0.1).unwrap();
    let scene = Scene::shoebox([4.0, 3.0, 2.0], std::array::from_fn(|_| m.clone())).unwrap();
    let (fast, plain) = (MeshScene::new(&scene).unwrap(), BruteForceScene::new(&scene).unwrap());
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let mut direction = [0.0; 3];
            direction[axis] = sign;
            for (limit, expected) in [(f64::INFINITY, true), (0.4, false)] {
                let a = fast.closest_hit([1.0, 1.0, 0.5], direction, limit);
                assert_eq!(
                    a.map(|h| h.distance),
                    plain.closest_hit([1.0, 1.0, 0.5], direction, limit).map(|h| h.distance)
                );
                assert_eq!(a.is_some(), expected);
            }
        }
    }
}
