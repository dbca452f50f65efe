//! Scenes, sources and receivers that cannot be traced, and what is said of them.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod shoebox;

use sabine_acoustics::*;
use sabine_propagate::*;
use shoebox::*;

const SIZE_M: [f64; 3] = [6.0, 4.0, 3.0];

fn quick(allow_leaks: bool) -> PathTracer {
    PathTracer::new(TracerConfig { rays: 500, duration_s: 0.05, allow_leaks, ..Default::default() }).unwrap()
}

/// What the tracer says, unwrapped from the vocabulary's error.
fn refusal(scene: &Scene, from: [f64; 3], to: [f64; 3]) -> sabine_propagate::Error {
    let error = quick(false).trace(scene, &source(from), &receiver(to), &Air::default(), &()).unwrap_err();
    let sabine_acoustics::Error::Implementation { source, .. } = error else { panic!("{error}") };
    *source.downcast().unwrap()
}

/// The box, and whatever other triangles.
fn box_with(extra: &[[[f64; 3]; 3]], without: &[usize]) -> Scene {
    let plain = uniform_box(SIZE_M, OctaveBands::T60, 0.2, 0.3);
    let mut vertices = plain.vertices().to_vec();
    let mut triangles: Vec<Triangle> =
        plain.triangles().iter().enumerate().filter(|(i, _)| !without.contains(i)).map(|(_, t)| *t).collect();
    for corners in extra {
        let first = vertices.len() as u32;
        vertices.extend(corners);
        triangles.push(Triangle { vertices: [first, first + 1, first + 2], material: 0 });
    }
    Scene::new(vertices, triangles, plain.materials().to_vec()).unwrap()
}

/// A rectangle at x, from y0 to y1, over the whole height.
fn screen(x: f64, y0: f64, y1: f64) -> [[[f64; 3]; 3]; 2] {
    let z = SIZE_M[2];
    [[[x, y0, 0.0], [x, y1, 0.0], [x, y1, z]], [[x, y0, 0.0], [x, y1, z], [x, y0, z]]]
}

/// A closed box within the room, from `low` to `high`.
fn body(low: [f64; 3], high: [f64; 3]) -> Vec<[[f64; 3]; 3]> {
    let inner = Scene::shoebox(
        std::array::from_fn(|i| high[i] - low[i]),
        std::array::from_fn(|_| Material::uniform(OctaveBands::T60, 0.1, 0.1).unwrap()),
    )
    .unwrap();
    (0..12).map(|i| inner.corners_m(i).map(|c| std::array::from_fn(|k| c[k] + low[k]))).collect()
}

const HERE: [f64; 3] = [1.0, 1.0, 1.5];
const THERE: [f64; 3] = [5.0, 3.0, 1.5];

#[test]
fn points_outside_the_room_are_named() {
    let scene = box_with(&[], &[]);
    for outside in [[-1.0, 1.0, 1.5], [6.001 + 1e-3, 1.0, 1.5], [3.0, 2.0, 50.0]] {
        assert!(matches!(
            refusal(&scene, outside, THERE),
            sabine_propagate::Error::Outside { what: "source", .. }
        ));
        assert!(matches!(
            refusal(&scene, HERE, outside),
            sabine_propagate::Error::Outside { what: "receiver", .. }
        ));
    }
}

#[test]
fn points_in_a_body_on_a_surface_or_at_the_same_place_are_named() {
    let scene = box_with(&body([4.0, 2.0, 0.5], [5.5, 3.5, 2.5]), &[]);
    assert!(matches!(
        refusal(&scene, HERE, THERE),
        sabine_propagate::Error::InsideBody { what: "receiver", .. }
    ));
    assert!(matches!(
        refusal(&scene, THERE, HERE),
        sabine_propagate::Error::InsideBody { what: "source", .. }
    ));
    let scene = box_with(&[], &[]);
    let at_floor = [3.0, 2.0, 2e-4];
    assert!(matches!(
        refusal(&scene, HERE, at_floor),
        sabine_propagate::Error::OnSurface { what: "receiver", distance_m, .. } if (distance_m - 2e-4).abs() < 1e-9
    ));
    assert!(matches!(
        refusal(&scene, at_floor, HERE),
        sabine_propagate::Error::OnSurface { what: "source", .. }
    ));
    assert!(matches!(refusal(&scene, HERE, HERE), sabine_propagate::Error::Coincident { .. }));
}

#[test]
fn a_hole_is_named_with_its_edges_unless_it_is_wanted() {
    // One of the two triangles of the ceiling is missing.
    let scene = box_with(&[], &[10]);
    let sabine_propagate::Error::Leaking { escape_rate, open_edges, example_m } =
        refusal(&scene, HERE, THERE)
    else {
        panic!("a hole went unnoticed")
    };
    assert_eq!(open_edges, 3);
    assert!(escape_rate > 0.05 && example_m.is_some());
    let paths = quick(true).trace(&scene, &source(HERE), &receiver(THERE), &Air::default(), &()).unwrap();
    assert!(!paths.is_empty());
}

#[test]
fn a_closed_partition_lets_nothing_through() {
    let scene = box_with(&screen(3.0, 0.0, SIZE_M[1]), &[]);
    assert!(matches!(refusal(&scene, HERE, THERE), sabine_propagate::Error::NoPath { .. }));
}

/// A screen without thickness is legitimate, and casts a shadow.
#[test]
fn a_screen_blocks_the_direct_sound_and_nothing_else() {
    let open = box_with(&[], &[]);
    let screened = box_with(&screen(3.0, 1.0, 3.0), &[]);
    let trace = |scene: &Scene| {
        quick(false).trace(scene, &source(HERE), &receiver(THERE), &Air::default(), &()).unwrap()
    };
    let is_direct = |paths: &PathSet| (0..paths.len()).any(|i| paths.is_direct(i));
    let (open, screened) = (trace(&open), trace(&screened));
    assert!(is_direct(&open));
    assert!(!is_direct(&screened));
    assert!((0..screened.len()).any(|i| screened.is_exact(i)));
    // The direct sound, exactly.
    let direct = (0..open.len()).find(|&i| open.is_direct(i)).unwrap();
    let distance_m = 20f64.sqrt();
    assert!((f64::from(open.lengths_m()[direct]) - distance_m).abs() < 1e-6);
    assert!((f64::from(open.log_weights()[direct]) + 2.0 * distance_m.ln()).abs() < 1e-6);
    let expected = [4.0 / distance_m, 2.0 / distance_m, 0.0];
    for (axis, along) in expected.into_iter().enumerate() {
        assert!((open.departure(direct)[axis] - along).abs() < 1e-3);
        assert!((open.arrival(direct)[axis] + along).abs() < 1e-3);
    }
}

#[test]
fn the_report_lists_what_is_odd() {
    let closed = MeshReport::inspect(&box_with(&[], &[]), HERE).unwrap();
    assert!(closed.is_closed() && closed.escape_rate == 0.0 && closed.planes == 6);
    assert!((closed.volume_m3 - 72.0).abs() < 1e-9);
    assert!(closed.warnings().is_empty());
    // A flap at a wall's seam: an edge with three triangles and two open ones. A needle. A wall triangle twice.
    let (a, b) = ([0.0, 0.0, 0.0], [0.0, 0.0, 3.0]);
    let flap = [a, b, [1.0, 1.0, 1.5]];
    let needle = [a, b, [0.0, 0.0, 1.0]];
    let twice = [[0.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 4.0, 3.0]];
    let odd = MeshReport::inspect(&box_with(&[flap, needle, twice], &[]), [3.0, 1.0, 1.5]).unwrap();
    assert_eq!(odd.crowded_edges_m, vec![[a, b]]);
    assert_eq!(odd.open_edges_m.len(), 4); // two of the flap, two of the needle
    assert_eq!(odd.degenerate_triangles, vec![13]);
    assert_eq!(odd.duplicate_triangles, vec![14]);
    assert_eq!(odd.warnings().len(), 4);
}

#[test]
fn a_room_without_area_and_wild_settings_are_refused() {
    let flat = Scene::new(
        vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        vec![Triangle { vertices: [0, 1, 2], material: 0 }],
        uniform_box(SIZE_M, OctaveBands::T60, 0.1, 0.1).materials()[..1].to_vec(),
    )
    .unwrap();
    assert!(matches!(MeshScene::new(&flat), Err(sabine_propagate::Error::NoSurface { triangles: 1 })));
    for config in [
        TracerConfig { rays: 0, ..Default::default() },
        TracerConfig { duration_s: f64::INFINITY, ..Default::default() },
        TracerConfig { duration_s: -1.0, ..Default::default() },
        TracerConfig { image_order: 99, ..Default::default() },
        TracerConfig { receiver_radius_m: f64::NAN, ..Default::default() },
    ] {
        assert!(matches!(PathTracer::new(config.clone()), Err(sabine_propagate::Error::OutOfRange { .. })));
        assert!(ReferenceTracer::new(config).is_err());
    }
}

/// Absorption and scattering at their limits, in one octave or in all.
#[test]
fn extreme_materials_give_finite_energies() {
    let bands = OctaveBands::new(500.0, 1000.0).unwrap();
    for (s0, s1) in [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        for a in [0.0, 1.0] {
            let wall = Material::new(
                PerBand::new(bands, vec![a, 0.5]).unwrap(),
                PerBand::new(bands, vec![s0, s1]).unwrap(),
            )
            .unwrap();
            let scene = Scene::shoebox(SIZE_M, std::array::from_fn(|_| wall.clone())).unwrap();
            let config = TracerConfig { rays: 2_000, duration_s: 0.3, ..Default::default() };
            let paths = PathTracer::new(config)
                .unwrap()
                .trace(&scene, &source(HERE), &receiver(THERE), &Air::default(), &())
                .unwrap();
            let energies = paths.energies(&vec![wall; 6], &Air::default()).unwrap();
            assert!(energies.iter().flatten().all(|e| e.is_finite()));
            assert!(paths.log_weights().iter().all(|w| w.is_finite()));
            // Both octaves get their energy after the exact paths.
            let late = |b: usize| -> f64 {
                (0..paths.len())
                    .filter(|&i| paths.lengths_m()[i] > 30.0)
                    .map(|i| f64::from(energies[b][i]))
                    .sum()
            };
            assert!(late(1) > 0.0 && (a == 1.0 || late(0) > 0.0));
        }
    }
}
