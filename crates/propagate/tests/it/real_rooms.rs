//! Real models, where their files are present: BRAS CR1 to CR4 (Aspoeck et al. 2020), dEchorate.

use crate::shoebox::*;
use rand::{Rng, SeedableRng};
use sabine_acoustics::*;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::{MeasuredRoom, Scene};
use std::path::Path;

fn rooms() -> Vec<(&'static str, MeasuredRoom)> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms"));
    if !path.is_dir() {
        eprintln!("skipped: {} is absent", path.display());
        return Vec::new();
    }
    ["bras_cr1_doorangle1", "bras_cr1_doorangle3", "bras_cr2", "bras_cr3", "bras_cr4", "dechorate_011111"]
        .map(|name| (name, MeasuredRoom::read(path.join(name)).unwrap()))
        .into()
}

/// How often the triangles surround a point, by solid angles (van Oosterom and Strackee 1983, Jacobson et al. 2013): shares
/// no code with the rays.
fn winding(scene: &Scene, p: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let angle = |i: usize| {
        let [a, b, c] = scene.corners_m(i).map(|q| std::array::from_fn(|k| q[k] - p[k]));
        let cross: [f64; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            b[i] * c[j] - b[j] * c[i]
        });
        let [la, lb, lc] = [a, b, c].map(|v: [f64; 3]| dot(v, v).sqrt());
        let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        2.0 * dot(a, cross).atan2(below)
    };
    (0..scene.triangles().len()).map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Points about the room and 2 cm off its faces, on either side.
fn points(scene: &Scene, seed: u64) -> Vec<[f64; 3]> {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let bound =
        |k: usize, pick: fn(f64, f64) -> f64| scene.vertices().iter().map(|v| v[k]).reduce(pick).unwrap();
    let low: [f64; 3] = std::array::from_fn(|k| bound(k, f64::min));
    let size: [f64; 3] = std::array::from_fn(|k| bound(k, f64::max) - low[k]);
    let mut points: Vec<[f64; 3]> = (0..300)
        .map(|_| std::array::from_fn(|k| low[k] + size[k] * (1.2 * random.random::<f64>() - 0.1)))
        .collect();
    while points.len() < 600 {
        let [a, b, c] = scene.corners_m(random.random_range(0..scene.triangles().len()));
        let (u, v): (f64, f64) = (random.random(), random.random());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let [e, f]: [[f64; 3]; 2] = [b, c].map(|p| std::array::from_fn(|k| p[k] - a[k]));
        let normal: [f64; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            e[i] * f[j] - e[j] * f[i]
        });
        let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        if length > 1e-9 {
            for side in [-0.02, 0.02] {
                points.push(std::array::from_fn(|k| a[k] + u * e[k] + v * f[k] + side * normal[k] / length));
            }
        }
    }
    points
}

#[test]
fn points_are_in_the_room_where_solid_angles_say_so() {
    for (name, room) in rooms() {
        let mut judged = 0;
        let (scene, from) = (room.scene(), &room.sources()[0]);
        let mesh = MeshScene::new(scene).unwrap();
        for point in points(scene, 1) {
            let turns = winding(scene, point);
            // The faces look into the room; other numbers come near the few that do not, and near sheets.
            let inside = (turns + 1.0).abs() < 0.1;
            if !inside && turns.abs() >= 0.1 {
                continue;
            }
            match check_placement(&mesh, from, &receiver(point)) {
                Err(sabine_propagate::Error::OnSurface { .. }) => continue,
                Ok(_) => assert!(inside, "{name} {point:?}: {turns} turns"),
                Err(error) => {
                    use sabine_propagate::Error::{InsideBody, Outside};
                    assert!(matches!(error, Outside { .. } | InsideBody { .. }), "{name}: {error}");
                    assert!(!inside, "{name} {point:?}: {turns} turns, but {error}");
                }
            }
            judged += 1;
        }
        assert!(judged > 500, "{name}: {judged} points judged");
    }
}

#[test]
fn every_published_source_and_receiver_is_inside_and_traced() {
    for (name, room) in rooms() {
        let mesh = MeshScene::new(room.scene()).unwrap();
        let config = TracerConfig { rays: 500, duration_s: 0.3, ..Default::default() };
        let tracer = PathTracer::new(config).unwrap();
        assert!(!room.sources().is_empty() && !room.receivers().is_empty(), "{name}");
        for from in room.sources() {
            for to in room.receivers() {
                check_placement(&mesh, from, to).unwrap_or_else(|e| panic!("{name}: {e}"));
            }
            for to in &room.receivers()[..3.min(room.receivers().len())] {
                let paths = tracer.trace(room.scene(), from, to, &Air::default(), &());
                let paths = paths.unwrap_or_else(|e| panic!("{name} {from:?} {to:?}: {e}"));
                let exact = (0..paths.len()).filter(|&i| paths.is_exact(i)).count();
                assert!(paths.len() > exact);
            }
        }
        // Outside is outside.
        let error = tracer
            .trace(room.scene(), &source([1e3, 0.0, 0.0]), &room.receivers()[0], &Air::default(), &())
            .unwrap_err();
        assert!(error.to_string().contains("outside"), "{name}: {error}");
    }
}

/// None of the models leaks, whatever their edges look like.
#[test]
fn the_edges_of_real_rooms_are_explained() {
    // Open, crowded and resting edges; planes; volume in m3.
    let expected: [(&str, [usize; 3], usize, f64); 6] = [
        ("bras_cr1_doorangle1", [3, 4, 1], 72, 225.8),
        ("bras_cr1_doorangle3", [3, 21, 1], 72, 225.6),
        ("bras_cr2", [0, 0, 6], 102, 146.1),
        ("bras_cr3", [2, 3, 270], 313, 3330.6),
        ("bras_cr4", [4, 3, 125], 1380, 8656.6),
        ("dechorate_011111", [0, 0, 0], 6, 80.1),
    ];
    for ((name, room), (_, edges, planes, volume_m3)) in rooms().into_iter().zip(expected) {
        for source in room.sources() {
            let report = MeshReport::inspect(room.scene(), source.position_m).unwrap();
            eprintln!("{name}: {report}");
            let found = [&report.open_edges, &report.crowded_edges, &report.resting_edges].map(Vec::len);
            assert_eq!((found, report.planes), (edges, planes), "{name}");
            assert!((report.volume_m3 - volume_m3).abs() < 0.1, "{name}");
            assert_eq!(report.escaped_rays, 0, "{name}");
            assert!(report.rays == 2_048 * 8 && report.check().is_ok());
        }
    }
    // The door of CR1 is a sheet that stands open: its rim is free, and the report says where it is and what it is made of.
    if let Some((_, room)) = rooms().first() {
        let text = MeshReport::inspect(room.scene(), room.sources()[0].position_m).unwrap().to_string();
        assert!(text.contains("the longest: 2.140 m from (0.687, -0.038, 2.190) to (0.687, -0.038, 0.050)"));
        assert!(text.contains("tablesEquipment") && text.contains("Holds sound"), "{text}");
    }
}
