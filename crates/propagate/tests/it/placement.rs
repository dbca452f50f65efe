//! Scenes, sources and receivers that cannot be traced, and what is said of them.

use crate::shoebox::*;
use sabine_acoustics::*;
use sabine_paths::Conditions;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::{Scene, Triangle};

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
    let plain = uniform_box(SIZE_M, Bands::T60, 0.2, 0.3);
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
        std::array::from_fn(|_| Material::uniform(Bands::T60, 0.1, 0.1).unwrap()),
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
    assert!(closed.is_closed() && closed.escaped_rays == 0 && closed.planes == 6);
    assert!((closed.volume_m3 - 72.0).abs() < 1e-9);
    assert!(closed.warnings().is_empty());
    // A flap at a wall's seam: an edge with three triangles and two open ones. A needle. A wall triangle twice.
    let (a, b) = ([0.0, 0.0, 0.0], [0.0, 0.0, 3.0]);
    let flap = [a, b, [1.0, 1.0, 1.5]];
    let needle = [a, b, [0.0, 0.0, 1.0]];
    let twice = [[0.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 4.0, 3.0]];
    let odd = MeshReport::inspect(&box_with(&[flap, needle, twice], &[]), [3.0, 1.0, 1.5]).unwrap();
    assert_eq!(odd.crowded_edges.iter().map(|e| e.ends_m).collect::<Vec<_>>(), vec![[a, b]]);
    assert_eq!(odd.open_edges.len(), 2); // of the flap
    assert_eq!(odd.degenerate_triangles, vec![13]);
    assert_eq!(odd.duplicate_triangles, vec![14]);
    assert_eq!(odd.warnings().len(), 4);
}

/// A wall of two triangles beside a wall of four, a table without underside on the floor, a cupboard with its own back wall.
#[test]
fn edges_that_touch_other_faces_are_no_leaks() {
    let [x, y, z] = SIZE_M;
    // The wall at x = 0, cut at half its width: its neighbours have one edge where it has two.
    let cut = |a: f64, b: f64| {
        [[[0.0, a, 0.0], [0.0, b, 0.0], [0.0, b, z]], [[0.0, a, 0.0], [0.0, b, z], [0.0, a, z]]]
    };
    let split = box_with(&[cut(0.0, 0.5 * y), cut(0.5 * y, y)].concat(), &[0, 1]);
    let report = MeshReport::inspect(&split, HERE).unwrap();
    assert!(report.is_closed() && report.escaped_rays == 0);
    // Above and below: one long edge, two short ones each.
    assert_eq!(report.resting_edges.len(), 6);
    assert!((report.resting_edges[0].length_m() - y).abs() < 1e-12);
    assert!((report.resting_edges[2].length_m() - 0.5 * y).abs() < 1e-12);
    assert!(report.warnings().is_empty());

    let table = body([2.0, 1.0, 0.0], [3.0, 2.0, 0.8]);
    let open_below: Vec<_> = table.iter().filter(|t| t.iter().any(|p| p[2] > 0.0)).copied().collect();
    assert_eq!(open_below.len(), 10);
    let report = MeshReport::inspect(&box_with(&open_below, &[]), HERE).unwrap();
    assert!(report.is_closed() && report.resting_edges.len() == 4, "{report}");

    let cupboard = body([x - 0.5, 1.0, 0.0], [x, 2.0, 2.0]);
    let report = MeshReport::inspect(&box_with(&cupboard, &[]), HERE).unwrap();
    assert!(report.is_closed() && report.resting_edges.is_empty(), "{report}");

    // Raised by a hand's breadth, the same table has a rim.
    let raised: Vec<_> = open_below.iter().map(|t| t.map(|[x, y, z]| [x, y, z + 0.1])).collect();
    let report = MeshReport::inspect(&box_with(&raised, &[]), HERE).unwrap();
    assert_eq!((report.open_edges.len(), report.resting_edges.len()), (4, 0), "{report}");
    assert!(!report.is_closed() && report.check().is_ok());
}

#[test]
fn a_report_reads_well() {
    let hole = MeshReport::inspect(&box_with(&[], &[10]), HERE).unwrap();
    let text = hole.to_string();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "11 triangles in 6 planes around 60.0 m3.");
    assert!(lines[1].starts_with("Leaks: ") && lines[1].ends_with(" %)."), "{text}");
    assert_eq!(
        lines[2],
        "Edges of one triangle, closed by nothing: the rim of a hole or of a free screen: 3, 17.21 m in all."
    );
    assert_eq!(
        lines[3],
        "  the longest: 7.211 m from (0.000, 0.000, 3.000) to (6.000, 4.000, 3.000), ceiling"
    );
    assert_eq!(lines.len(), 6);
    let error = hole.check().unwrap_err().to_string();
    assert!(
        error.contains("through 3 open edges (the longest from [0.0, 0.0, 3.0] to [6.0, 4.0, 3.0] m)"),
        "{error}"
    );
}

/// A body whose underside lies on the floor: rays downwards cross both at once, and the count is undecided.
#[test]
fn points_in_a_flat_body_on_the_floor_are_named() {
    // Its faces look into it, and then, as those of the room do, at the air.
    let inward = body([4.0, 2.0, 0.0], [5.5, 3.5, 0.1]);
    let outward = inward.iter().map(|&[a, b, c]| [a, c, b]).collect();
    for faces in [inward, outward] {
        let mesh = MeshScene::new(&box_with(&faces, &[])).unwrap();
        let within = [4.7, 2.7, 0.05];
        for (from, to) in [(HERE, within), (within, HERE)] {
            let refused = check_placement(&mesh, &source(from), &receiver(to));
            assert!(matches!(refused, Err(sabine_propagate::Error::InsideBody { .. })), "{refused:?}");
        }
        let above = check_placement(&mesh, &source(HERE), &receiver([4.7, 2.7, 0.15])).unwrap();
        assert!((above - 0.05).abs() < 1e-9);
    }
}

/// A cabin with walls of its own is a room, but not the one where the source is.
#[test]
fn a_receiver_in_a_sealed_cabin_hears_nothing() {
    let (outer, inner) = (body([3.5, 1.5, 0.2], [5.8, 3.8, 2.8]), body([3.6, 1.6, 0.3], [5.7, 3.7, 2.7]));
    let cabin = box_with(&[outer, inner].concat(), &[]);
    assert!(matches!(
        refusal(&cabin, HERE, THERE),
        sabine_propagate::Error::NoPath { max_length_m, .. } if max_length_m > 1.0
    ));
    // Both in the cabin hear each other.
    let paths = quick(false).trace(&cabin, &source([4.0, 2.0, 1.0]), &receiver(THERE), &Air::default(), &());
    assert!(!paths.unwrap().is_empty());
}

#[test]
fn places_that_are_no_numbers_are_refused() {
    let scene = box_with(&[], &[]);
    let mesh = MeshScene::new(&scene).unwrap();
    for wild in [f64::NAN, f64::INFINITY, -1e300] {
        let mut nowhere = receiver(THERE);
        nowhere.position_m[1] = wild;
        assert!(check_placement(&mesh, &source(HERE), &nowhere).is_err(), "{wild}");
    }
}

/// A heap of bodies, 12 triangles each, turned about the vertical.
fn heap(bodies: usize) -> Scene {
    let wall = uniform_box(SIZE_M, Bands::T60, 0.1, 0.1);
    let (mut vertices, mut triangles) = (wall.vertices().to_vec(), wall.triangles().to_vec());
    let n = (bodies as f64).cbrt().ceil() as usize;
    let cell = SIZE_M.map(|side| side / n as f64);
    for k in 0..bodies {
        let place = [k % n, k / n % n, k / n / n];
        let (sin, cos) = (0.7 * k as f64).sin_cos();
        let base = vertices.len() as u32;
        let half = 0.2 * cell[2] * (1.0 + 0.3 * (k as f64).sin());
        vertices.extend((0..8u32).map(|corner| {
            let [u, v, w] = [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { -half } else { half });
            let turned = [u * cos - v * sin, u * sin + v * cos, w];
            std::array::from_fn(|axis| (place[axis] as f64 + 0.5) * cell[axis] + turned[axis])
        }));
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        triangles.extend(faces.iter().flat_map(|&[a, b, c, d]| {
            [[a, b, c], [a, c, d]].map(|t| Triangle { vertices: t.map(|i| base + i), material: 4 })
        }));
    }
    Scene::new(vertices, triangles, wall.materials().to_vec()).unwrap()
}

/// It takes seconds, not minutes: nothing in it grows with the square of the number of triangles.
#[test]
fn a_million_triangles_are_repaired_inspected_and_traced() {
    let scene = heap(83_334);
    assert!(scene.triangles().len() > 1_000_000);
    let (same, repaired) = scene.welded(Scene::WELD_TOLERANCE_M).unwrap();
    assert!(repaired.is_unchanged() && same == scene);
    // Along an edge of the floor the view is free.
    let (from, to) = ([0.002, 0.002, 0.002], [5.998, 0.002, 0.002]);
    let config = TracerConfig { rays: 100, duration_s: 0.05, image_order: 1, ..Default::default() };
    let tracer = PathTracer::new(config).unwrap();
    let paths = tracer.trace(&scene, &source(from), &receiver(to), &Air::default(), &()).unwrap();
    assert!(paths.is_exact(0) && (f64::from(paths.lengths_m()[0]) - 5.996).abs() < 1e-5);
    let report = MeshReport::inspect(&scene, from).unwrap();
    assert!(report.is_closed() && report.escaped_rays == 0, "{report}");
}

#[test]
fn a_room_without_area_and_wild_settings_are_refused() {
    let flat = Scene::new(
        vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        vec![Triangle { vertices: [0, 1, 2], material: 0 }],
        uniform_box(SIZE_M, Bands::T60, 0.1, 0.1).materials()[..1].to_vec(),
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
        assert!(matches!(PathTracer::new(config.clone()), Err(sabine_propagate::Error::OutOfRange(_))));
        assert!(ReferenceTracer::new(config).is_err());
    }
}

/// Absorption and scattering at their limits, in one octave or in all.
#[test]
fn extreme_materials_give_finite_energies() {
    let bands = Bands::octaves(500.0, 1000.0).unwrap();
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
            let energies = paths.energies(&Conditions::new(&vec![wall; 6], &Air::default())).unwrap();
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
