//! Sound around edges, against exact and approximate theories, and in rooms.

use crate::wedge_oracles::*;
use proptest::prelude::*;
use sabine_acoustics::Error;
use sabine_acoustics::*;
use sabine_paths::Conditions;
use sabine_paths::*;
use sabine_propagate::{DiffractingEdges, MeshScene};
use sabine_scene::*;
use std::f64::consts::{PI, TAU};
use std::path::Path;

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

/// Source and receiver about a half plane, from just within the shadow to far behind the screen, near and far, askew.
const BEHIND_A_SCREEN: [(Cylindrical, Cylindrical); 8] = [
    ([3.0, 0.9, 0.0], [3.0, 0.9 + PI + 0.02, 0.0]),
    ([3.0, 0.9, 0.0], [3.0, 0.9 + PI + 0.2, 0.0]),
    ([3.0, 0.9, 0.0], [3.0, 0.9 + PI + 0.8, 0.0]),
    ([3.0, 0.9, 0.0], [3.0, 6.0, 0.0]),
    ([1.0, 0.8, 0.0], [5.0, 4.5, 2.0]),
    ([0.7, 1.5, 0.0], [0.7, 5.5, 0.0]),
    ([10.0, 1.2, -3.0], [2.0, 5.0, 4.0]),
    ([20.0, 0.3, 0.0], [20.0, 4.0, 0.0]),
];

#[test]
fn a_long_edge_is_the_half_plane_of_macdonald() {
    let mut worst_db: f64 = 0.0;
    for (source, receiver) in BEHIND_A_SCREEN {
        let edge = wedge(TAU, source, receiver, [-30.0, 30.0]);
        for hz in OCTAVES_HZ {
            let expected = db(half_plane(TAU * hz / SPEED_M_S, source, receiver));
            let found = db(edge.energy_gain(hz, SPEED_M_S));
            assert!(
                (found - expected).abs() < 0.2,
                "{source:?} {receiver:?} {hz} Hz: {found} != {expected} dB"
            );
            worst_db = worst_db.max((found - expected).abs());
        }
    }
    eprintln!("worst difference from Macdonald's solution: {worst_db:.3} dB");
}

#[test]
fn a_body_with_a_right_angle_follows_the_uniform_theory() {
    let open = 1.5 * PI;
    let mut worst_db: f64 = 0.0;
    for (source, receiver) in [
        ([3.0, 0.5, 0.0], [3.0, 0.5 + PI + 0.1, 0.0]),
        ([3.0, 0.5, 0.0], [3.0, 4.5, 0.0]),
        ([2.0, 0.9, 0.0], [5.0, 4.3, 3.0]),
        ([4.0, 0.2, 1.0], [2.0, 3.6, 0.0]),
    ] {
        let edge = wedge(open, source, receiver, [-30.0, 30.0]);
        for hz in [500.0, 1000.0, 2000.0, 4000.0, 8000.0] {
            let expected = db(uniform_theory(TAU * hz / SPEED_M_S, 1.5, source, receiver));
            let found = db(edge.energy_gain(hz, SPEED_M_S));
            assert!(
                (found - expected).abs() < 0.5,
                "{source:?} {receiver:?} {hz} Hz: {found} != {expected} dB"
            );
            worst_db = worst_db.max((found - expected).abs());
        }
    }
    eprintln!("worst difference from the uniform theory from 500 Hz on: {worst_db:.3} dB");
}

/// Source and receiver well in front of and behind the screen: Maekawa measured there, and his chart ends at 24 dB.
#[test]
fn screens_follow_the_chart_of_maekawa() {
    let mut worst_db: f64 = 0.0;
    // Largest at a Fresnel number of 0.12 close to the border, where exact theory attenuates by 9.8 dB, the fitted curve by 6.8.
    for bend in [0.05, 0.15, 0.3, 0.5] {
        let (source, receiver) = ([4.0, 0.5 * PI - 0.5 * bend, 0.0], [4.0, 1.5 * PI + 0.5 * bend, 0.0]);
        let direct_m = 8.0 * (0.5 * bend).cos();
        let edge = wedge(TAU, source, receiver, [-30.0, 30.0]);
        for hz in OCTAVES_HZ {
            let fresnel_number = 2.0 * (8.0 - direct_m) * hz / SPEED_M_S;
            let expected = -kurze_anderson_db(fresnel_number);
            let found = db(edge.energy_gain(hz, SPEED_M_S) * (direct_m / 8.0).powi(2));
            worst_db = worst_db.max((found - expected).abs());
            assert!((found - expected).abs() < 3.0, "bend {bend} {hz} Hz: {found} != {expected} dB");
        }
    }
    eprintln!("worst difference from Kurze and Anderson: {worst_db:.2} dB");
}

/// The integral over a short edge as printed: over z, with m, l and acosh, by small steps.
#[test]
fn a_short_edge_is_the_integral_over_its_length() {
    for (open, source, receiver, visible) in [
        (TAU, [1.0, 1.4, 0.7], [1.5, 4.9, 0.9], [0.0, 1.5]),
        (TAU, [1.0, 1.4, 2.5], [1.5, 4.9, 3.0], [0.0, 1.5]), // the straight way passes beside the edge
        (1.5 * PI, [2.0, 0.3, -1.0], [0.8, 4.0, 2.0], [-0.2, 0.4]),
        (1.2 * PI, [2.0, 0.2, 0.0], [3.0, 3.6, 0.0], [-1.0, 5.0]),
    ] {
        let edge = wedge(open, source, receiver, visible);
        let nu = PI / open;
        for hz in [100.0, 1000.0, 8000.0] {
            let (k, steps) = (TAU * hz / SPEED_M_S, 400_000);
            let step = (visible[1] - visible[0]) / f64::from(steps);
            let (mut re, mut im) = (0.0, 0.0);
            for i in 0..steps {
                let z = visible[0] + (f64::from(i) + 0.5) * step;
                let (from, to) = (z - source[2], z - receiver[2]);
                let (m, l) = (source[0].hypot(from), receiver[0].hypot(to));
                let eta = ((m * l + from * to) / (source[0] * receiver[0])).max(1.0).acosh();
                let mut beta = 0.0;
                for phi in [
                    PI + source[1] + receiver[1],
                    PI + source[1] - receiver[1],
                    PI - source[1] + receiver[1],
                    PI - source[1] - receiver[1],
                ] {
                    beta += (nu * phi).sin() / ((nu * eta).cosh() - (nu * phi).cos());
                }
                let share = -nu / (4.0 * PI) * beta / (m * l) * step;
                re += share * (k * (m + l)).cos();
                im -= share * (k * (m + l)).sin();
            }
            let expected = db((re * re + im * im) * edge.length_m().powi(2));
            let found = db(edge.energy_gain(hz, SPEED_M_S));
            assert!((found - expected).abs() < 0.02, "{visible:?} {hz} Hz: {found} != {expected} dB");
        }
    }
}

#[test]
fn longer_edges_tend_to_the_edge_without_ends() {
    let (source, receiver) = ([1.0, 1.2, 0.0], [1.5, 4.8, 0.0]);
    let endless = |hz: f64| db(half_plane(TAU * hz / SPEED_M_S, source, receiver));
    // Largest deviation over the octaves, each edge four times as long as the one before.
    let deviation_db = [0.5, 2.0, 8.0, 32.0].map(|half_m| {
        let edge = wedge(TAU, source, receiver, [-half_m, half_m]);
        OCTAVES_HZ
            .iter()
            .map(|&hz| (db(edge.energy_gain(hz, SPEED_M_S)) - endless(hz)).abs())
            .fold(0.0, f64::max)
    });
    eprintln!("edges of 1, 4, 16, 64 m differ by up to {deviation_db:.2?} dB from an endless one");
    assert!(
        deviation_db[1] < 0.3 * deviation_db[0]
            && deviation_db[2] < 0.3 * deviation_db[1]
            && deviation_db[3] < 0.1
    );
}

#[test]
fn the_level_falls_from_6_db_at_the_border_into_the_shadow() {
    let source = [3.0, 0.5 * PI, 0.0];
    let behind = |bend: f64| [3.0, 1.5 * PI + bend, 0.0];
    let bends = (0..=40).map(|i| 1e-7 + 0.03 * f64::from(i));
    let edges: Vec<_> = bends.map(|bend| wedge(TAU, source, behind(bend), [-30.0, 30.0])).collect();
    for hz in OCTAVES_HZ {
        let levels: Vec<f64> = edges.iter().map(|edge| db(edge.energy_gain(hz, SPEED_M_S))).collect();
        let expected = db(half_plane(TAU * hz / SPEED_M_S, source, behind(1e-7)));
        assert!((levels[0] - expected).abs() < 0.05, "{hz} Hz: {} != {expected} dB", levels[0]);
        // The mirror image in the screen, deep in its own shadow there, adds its part: little where waves are short.
        assert!((levels[0] + 6.02).abs() < 2.0 / (hz / 62.5).sqrt(), "{hz} Hz: {}", levels[0]);
        // Steepest at first, by 0.17 dB per degree at 1 kHz and 0.5 at 8 kHz (steps of 1.7 degrees).
        assert!(
            levels.windows(2).all(|pair| (0.0..2.5).contains(&(pair[0] - pair[1]))),
            "{hz} Hz: {levels:?}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Any wedge, any points in each other's shadow: exchange changes nothing, and no edge adds energy.
    #[test]
    fn source_and_receiver_may_be_exchanged(
        open in 1.02f64..2.0, from in 0.0f64..1.0, into in 0.0f64..1.0,
        radii in prop::array::uniform2(0.05f64..20.0), heights in prop::array::uniform2(-10.0f64..10.0),
        ends in prop::array::uniform2(-5.0f64..5.0), hz in 20.0f64..20e3,
    ) {
        let open = open * PI;
        // Two angles in [0, open] that are more than pi apart.
        let apart = PI + 1e-6 + (open - PI - 1e-6) * into;
        let first = (open - apart) * from;
        let (a, b) = ([radii[0], first, heights[0]], [radii[1], first + apart, heights[1]]);
        let visible = [ends[0].min(ends[1]), ends[0].max(ends[1]) + 0.01];
        let (there, back) = (wedge(open, a, b, visible), wedge(open, b, a, visible));
        prop_assert_eq!(there.length_m(), back.length_m());
        let (gain, other) = (there.energy_gain(hz, SPEED_M_S), back.energy_gain(hz, SPEED_M_S));
        prop_assert!(gain.is_finite() && (gain - other).abs() <= 1e-12 * gain);
        for band in 0..8 {
            let mean = there.band_energy_gain(Bands::SIMULATION, band, SPEED_M_S);
            prop_assert!(mean.is_finite() && mean >= 0.0);
        }
    }
}

#[test]
fn the_octave_mean_is_the_mean_over_the_octave() {
    for (source, receiver, visible) in
        [([3.0, 0.9, 0.0], [3.0, 4.5, 0.0], [-30.0, 30.0]), ([1.0, 1.4, 0.7], [1.5, 4.9, 0.9], [0.0, 1.5])]
    {
        let edge = wedge(TAU, source, receiver, visible);
        for band in 0..8 {
            let (low, high) = Bands::SIMULATION.edges_hz(band);
            let values =
                (0..400).map(|i| edge.energy_gain(low + (high - low) * (f64::from(i) + 0.5) / 400.0, 330.0));
            let expected = db(values.sum::<f64>() / 400.0);
            let found = db(edge.band_energy_gain(Bands::SIMULATION, band, 330.0));
            assert!((found - expected).abs() < 0.2, "{visible:?} band {band}: {found} != {expected} dB");
        }
    }
}

#[test]
fn what_is_no_wedge_or_no_shadow_is_refused() {
    let at = |radius_m: f64, angle_rad: f64| EdgePoint { radius_m, angle_rad, along_m: 0.0 };
    let edge = [[0.0, 1.0]];
    for (open, source, receiver) in [
        (0.9 * PI, at(1.0, 0.1), at(1.0, 2.0)), // a corner that faces inward
        (f64::NAN, at(1.0, 0.1), at(1.0, 4.0)),
        (TAU, at(0.0, 0.1), at(1.0, 4.0)),             // on the edge
        (1.5 * PI, at(1.0, 0.1), at(1.0, 5.0)),        // within the solid
        (TAU, at(1.0, 1.0), at(1.0, 1.0 + 0.99 * PI)), // in sight
        (TAU, at(1.0, f64::NAN), at(1.0, 4.0)),
    ] {
        let found = EdgeDiffraction::new(open, source, receiver, &edge);
        assert!(matches!(found, Err(Error::OutOfRange(_))), "{open} {source:?} {receiver:?}: {found:?}");
    }
    let (source, receiver) = (at(1.0, 1.0), at(1.0, 5.0));
    assert!(matches!(EdgeDiffraction::new(TAU, source, receiver, &[]), Err(Error::Empty { .. })));
    let reversed = EdgeDiffraction::new(TAU, source, receiver, &[[1.0, 0.0]]);
    assert!(matches!(reversed, Err(Error::OutOfRange(_))));
}

// ---- Edges of meshes

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

fn box_faces([x0, y0, z0]: [f64; 3], [x1, y1, z1]: [f64; 3]) -> Vec<Vec<[f64; 3]>> {
    vec![
        vec![[x0, y0, z0], [x0, y1, z0], [x0, y1, z1], [x0, y0, z1]],
        vec![[x1, y0, z0], [x1, y0, z1], [x1, y1, z1], [x1, y1, z0]],
        vec![[x0, y0, z0], [x0, y0, z1], [x1, y0, z1], [x1, y0, z0]],
        vec![[x0, y1, z0], [x1, y1, z0], [x1, y1, z1], [x0, y1, z1]],
        vec![[x0, y0, z0], [x1, y0, z0], [x1, y1, z0], [x0, y1, z0]],
        vec![[x0, y0, z1], [x0, y1, z1], [x1, y1, z1], [x1, y0, z1]],
    ]
}

/// A screen in the plane x = 3, on the floor, 1.5 m wide and 1.8 m high.
fn screen() -> Vec<[f64; 3]> {
    vec![[3.0, 2.0, 0.0], [3.0, 3.5, 0.0], [3.0, 3.5, 1.8], [3.0, 2.0, 1.8]]
}

fn room_with(faces: impl IntoIterator<Item = Vec<[f64; 3]>>) -> Scene {
    let mut all = box_faces([0.0; 3], [6.0, 5.0, 3.0]);
    all.extend(faces);
    scene(&all)
}

fn around(scene: &Scene, source: [f64; 3], receiver: [f64; 3]) -> PathSet {
    let mut paths = PathSet::new(1, 100.0);
    let mesh = MeshScene::new(scene).unwrap();
    DiffractingEdges::find(scene, &mesh).add_paths(&mut paths, &mesh, source, receiver);
    paths
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

const SOURCE: [f64; 3] = [1.5, 2.6, 1.2];
const RECEIVER: [f64; 3] = [4.6, 3.0, 1.3];

#[test]
fn nothing_bends_in_a_box_or_where_the_source_is_in_sight() {
    let empty = room_with([]);
    let edges = DiffractingEdges::find(&empty, &MeshScene::new(&empty).unwrap());
    for (source, receiver) in [(SOURCE, RECEIVER), ([0.01, 0.01, 0.01], [5.9, 4.9, 2.9])] {
        assert!(around(&empty, source, receiver).is_empty());
    }
    // Twelve edges, all of them only seen from outside.
    assert_eq!(edges.len(), 12);
    let with_screen = room_with([screen()]);
    assert!(around(&with_screen, SOURCE, [4.6, 3.0, 2.8]).is_empty());
    assert!(around(&with_screen, SOURCE, [2.9, 3.0, 1.0]).is_empty());
}

#[test]
fn behind_a_screen_sound_comes_over_its_three_edges() {
    let room = room_with([screen()]);
    let paths = around(&room, SOURCE, RECEIVER);
    // Not below: the screen stands on the floor.
    assert_eq!((paths.len(), paths.diffractions().len()), (3, 3));
    // Over the top the way is straight when unfolded; so it is around the sides, which are crossed at the height in between.
    let over = |r: [f64; 2], z: f64| (r[0] + r[1]).hypot(z);
    let radius = |p: [f64; 3], y_or_z: f64, axis: usize| (p[0] - 3.0).hypot(p[axis] - y_or_z);
    let mut expected_m = [
        over([radius(SOURCE, 1.8, 2), radius(RECEIVER, 1.8, 2)], 0.4),
        over([radius(SOURCE, 2.0, 1), radius(RECEIVER, 2.0, 1)], 0.1),
        over([radius(SOURCE, 3.5, 1), radius(RECEIVER, 3.5, 1)], 0.1),
    ];
    expected_m.sort_by(f64::total_cmp);
    let mut found_m: Vec<f64> = paths.lengths_m().iter().map(|&l| f64::from(l)).collect();
    found_m.sort_by(f64::total_cmp);
    for (found, expected) in found_m.iter().zip(expected_m) {
        assert!((found - expected).abs() < 1e-5, "{found_m:?} != {expected_m:?}");
    }
    // The first comes over the top: forward and up from the source, and from above to the receiver.
    let first = (0..3).min_by(|&i, &j| paths.lengths_m()[i].total_cmp(&paths.lengths_m()[j])).unwrap();
    assert!(paths.is_exact(first) && paths.departure(first)[0] > 0.9 && paths.departure(first)[2] > 0.3);
    assert!(paths.arrival(first)[0] < -0.9 && paths.arrival(first)[2] > 0.2);
    // Relative to the direct sound that the screen takes away: -3 to -8 dB in the lowest octave, then falling without end.
    let energy = paths.energies(&Conditions::new(&[hard()], &Air::default())).unwrap();
    let free = distance(SOURCE, RECEIVER).powi(-2);
    let levels: Vec<f64> =
        energy.iter().map(|e| db(e.iter().map(|&e| f64::from(e)).sum::<f64>() / free)).collect();
    eprintln!("behind the screen, relative to no screen: {levels:.1?} dB in the octaves from 62.5 Hz");
    assert!(
        (-8.0..-3.0).contains(&levels[0]) && levels.windows(2).all(|pair| pair[1] < pair[0]),
        "{levels:?}"
    );
    assert!(levels[7] < -18.0);
}

#[test]
fn exchanging_source_and_receiver_changes_no_bit() {
    let room = room_with([screen()]);
    let (there, back) = (around(&room, SOURCE, RECEIVER), around(&room, RECEIVER, SOURCE));
    assert_eq!(there.diffractions(), back.diffractions());
    for i in 0..there.len() {
        assert_eq!((there.departure(i), there.arrival(i)), (back.arrival(i), back.departure(i)));
    }
}

#[test]
fn the_triangles_of_a_screen_do_not_matter() {
    let whole = around(&room_with([screen()]), SOURCE, RECEIVER);
    // In tiles of unequal size without common corners, and both sides of a sheet.
    let tile = |y: [f64; 2], z: [f64; 2]| {
        vec![[3.0, y[0], z[0]], [3.0, y[1], z[0]], [3.0, y[1], z[1]], [3.0, y[0], z[1]]]
    };
    let tiles = vec![
        tile([2.0, 2.5], [0.0, 1.8]),
        tile([2.5, 3.5], [0.0, 0.7]),
        tile([2.5, 2.9], [0.7, 1.8]),
        tile([2.9, 3.5], [0.7, 1.8]),
        tile([2.0, 3.5], [0.0, 1.8]),
    ];
    let tiled = around(&room_with(tiles), SOURCE, RECEIVER);
    assert_eq!(tiled.len(), 3);
    let energies = |paths: &PathSet| paths.energies(&Conditions::new(&[hard()], &Air::default())).unwrap();
    for (a, b) in energies(&whole).iter().zip(&energies(&tiled)) {
        let (mut a, mut b) = (a.clone(), b.clone());
        a.sort_by(f32::total_cmp);
        b.sort_by(f32::total_cmp);
        for (a, b) in a.iter().zip(b) {
            assert!((a / b - 1.0).abs() < 1e-4, "{a} != {b}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Any triangles, crossing each other or not: finite energies, below that of the free path, the same both ways.
    #[test]
    fn no_mesh_upsets_it(
        corners in prop::collection::vec(prop::array::uniform9(-2.0f64..2.0), 1..40),
        ends in prop::array::uniform6(-3.0f64..3.0),
    ) {
        let faces: Vec<_> = corners.iter().map(|c| c.chunks(3).map(|p| [p[0], p[1], p[2]]).collect()).collect();
        let soup = scene(&faces);
        let (source, receiver) = ([ends[0], ends[1], ends[2]], [ends[3], ends[4], ends[5]]);
        let (there, back) = (around(&soup, source, receiver), around(&soup, receiver, source));
        prop_assert_eq!(there.diffractions(), back.diffractions());
        let energies = there.energies(&Conditions::new(&[hard()], &Air::default())).unwrap();
        for (band, i) in (0..8).flat_map(|band| (0..there.len()).map(move |i| (band, i))) {
            // Where its faces nearly form a plane, the wedge doubles the pressure, and nowhere does it more.
            let free = 4.0 * f64::from(there.lengths_m()[i]).powi(-2);
            let energy = f64::from(energies[band][i]);
            prop_assert!(energy.is_finite() && energy >= 0.0 && energy < free, "band {band}: {energy} of {free}");
        }
    }
}

#[test]
fn a_long_screen_in_the_open_is_a_half_plane_at_every_octave() {
    // 40 m wide, the ground far below; the mesh must find the geometry that Macdonald's solution is then asked for.
    let wall = scene(&[vec![[0.0, -20.0, -30.0], [0.0, 20.0, -30.0], [0.0, 20.0, 2.0], [0.0, -20.0, 2.0]]]);
    let (source, receiver) = ([-2.0, 0.5, 1.0], [3.0, -0.7, 0.5]);
    let paths = around(&wall, source, receiver);
    let top =
        (0..paths.len()).min_by(|&i, &j| paths.lengths_m()[i].total_cmp(&paths.lengths_m()[j])).unwrap();
    let edge = &paths.diffractions()[top].1;
    let cylindrical = |p: [f64; 3]| {
        // From the face towards the source, which looks to negative x; the screen hangs down from its edge.
        [p[0].hypot(p[2] - 2.0), (-p[0]).atan2(2.0 - p[2]).rem_euclid(TAU), p[1]]
    };
    for hz in OCTAVES_HZ {
        let expected = db(half_plane(TAU * hz / SPEED_M_S, cylindrical(source), cylindrical(receiver)));
        let found = db(edge.energy_gain(hz, SPEED_M_S));
        assert!((found - expected).abs() < 0.2, "{hz} Hz: {found} != {expected} dB");
    }
    // Weighted as a free path of that length: 1/25 of the energy at 1 m in 5 m.
    let over_m = f64::from(paths.lengths_m()[top]);
    assert!((f64::from(paths.log_weights()[top]) + 2.0 * over_m.ln()).abs() < 1e-5);
}

#[test]
fn an_inner_corner_of_an_l_shaped_room_bends_sound() {
    // The square (0..4) x (0..4) less the square (2..4) x (2..4): one edge stands out, at (2, 2).
    let (floor, ceiling) = (0.0, 3.0);
    let outline = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]];
    let mut faces: Vec<Vec<[f64; 3]>> = (0..6)
        .map(|i| {
            let ([x, y], [u, v]) = (outline[i], outline[(i + 1) % 6]);
            vec![[x, y, floor], [u, v, floor], [u, v, ceiling], [x, y, ceiling]]
        })
        .collect();
    for z in [floor, ceiling] {
        faces.push(vec![[0.0, 0.0, z], [4.0, 0.0, z], [4.0, 2.0, z], [0.0, 2.0, z]]);
        faces.push(vec![[0.0, 2.0, z], [2.0, 2.0, z], [2.0, 4.0, z], [0.0, 4.0, z]]);
    }
    let (source, receiver) = ([3.5, 1.2, 1.5], [1.2, 3.5, 1.5]);
    let paths = around(&scene(&faces), source, receiver);
    assert_eq!(paths.len(), 1);
    let expected_m = 2.0 * 1.5f64.hypot(0.8);
    assert!((f64::from(paths.lengths_m()[0]) - expected_m).abs() < 1e-5);
    // A wedge of 270 degrees, visible from floor to ceiling.
    let angle = |out: f64, off: f64| off.atan2(out);
    let own = wedge(
        1.5 * PI,
        [0.5 * expected_m, angle(1.5, 0.8), 1.5],
        [0.5 * expected_m, 1.5 * PI - angle(1.5, 0.8), 1.5],
        [0.0, 3.0],
    );
    for hz in OCTAVES_HZ {
        let (found, expected) =
            (paths.diffractions()[0].1.energy_gain(hz, SPEED_M_S), own.energy_gain(hz, SPEED_M_S));
        assert!((db(found) - db(expected)).abs() < 0.01, "{hz} Hz: {} != {} dB", db(found), db(expected));
    }
}

#[test]
fn only_the_visible_part_of_an_edge_counts() {
    // A post before the screen hides part of its top from the source.
    let post = vec![[2.5, 2.5, 0.0], [2.5, 2.7, 0.0], [2.5, 2.7, 3.0], [2.5, 2.5, 3.0]];
    let (source, receiver) = ([1.5, 2.6, 1.2], [4.6, 2.6, 1.3]);
    let free = around(&room_with([screen()]), source, receiver);
    let hidden = around(&room_with([screen(), post]), source, receiver);
    let shortest = |paths: &PathSet| paths.lengths_m().iter().copied().fold(f32::INFINITY, f32::min);
    // Seen from the source the post spans 2.45 to 2.75 m at the screen; the bend at 2.6 m has to give way by 0.15 m.
    let aside_m = |end: [f64; 3]| ((end[0] - 3.0).powi(2) + (end[2] - 1.8).powi(2) + 0.15f64.powi(2)).sqrt();
    let expected_m = aside_m(source) + aside_m(receiver);
    let found: Vec<f64> = hidden.lengths_m().iter().map(|&l| f64::from(l)).collect();
    assert!(found.iter().any(|&l| (l - expected_m).abs() < 1e-3), "{found:?} without {expected_m}");
    assert!(f64::from(shortest(&free)) < expected_m - 1e-3);
}

#[test]
fn appended_sets_keep_their_diffraction() {
    let part = around(&room_with([screen()]), SOURCE, RECEIVER);
    let mut whole = PathSet::new(1, 100.0);
    let floor = whole.reflect(PathSet::DIRECT, 0, Reflection::Specular);
    let reflected = Contribution {
        length_m: 4.0,
        log_weight: -2.0 * 4f64.ln(),
        chain: floor,
        tail: PathSet::DIRECT,
        departure: [0.0, 0.0, -1.0],
        arrival: [0.0, 0.0, -1.0],
        batch: None,
    };
    whole.push(reflected);
    whole.append(&part);
    let (alone, joined) = (
        part.energies(&Conditions::new(&[hard()], &Air::default())).unwrap(),
        whole.energies(&Conditions::new(&[hard()], &Air::default())).unwrap(),
    );
    for (alone, joined) in alone.iter().zip(&joined) {
        assert_eq!(alone[..], joined[1..]);
        assert!((joined[0] / (0.9 * 0.9 / 16.0) - 1.0).abs() < 0.1);
    }
}

/// As much of OBJ as the models of BRAS use.
fn read_obj(path: &Path) -> Scene {
    let text = std::fs::read_to_string(path).unwrap();
    let (mut vertices, mut faces) = (Vec::<[f64; 3]>::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let at: Vec<f64> = words.map(|w| w.parse().unwrap()).collect();
                vertices.push([at[0], at[1], at[2]]);
            }
            Some("f") => {
                let corner = |w: &str| vertices[w.split('/').next().unwrap().parse::<usize>().unwrap() - 1];
                faces.push(words.map(corner).collect());
            }
            _ => {}
        }
    }
    scene(&faces)
}

/// All `position_m` under a heading of `room.toml`.
fn positions(toml: &str, heading: &str) -> Vec<[f64; 3]> {
    let list = |part: &str| -> Option<[f64; 3]> {
        let list = part.split("position_m").nth(1)?.split('[').nth(1)?.split(']').next()?;
        let at: Vec<f64> = list.split(',').map(|c| c.trim().parse().unwrap()).collect();
        Some([at[0], at[1], at[2]])
    };
    toml.split(heading).skip(1).filter_map(list).collect()
}

#[test]
fn real_rooms_have_edges_and_paths_over_them_only_in_the_shadow() {
    let rooms = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms"));
    if !rooms.is_dir() {
        eprintln!("skipped: {} is absent", rooms.display());
        return;
    }
    let mut in_shadow = 0;
    let mut state = 1u64;
    // A random number from 0 to 1 (Knuth's multiplier).
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    for name in ["bras_cr1_doorangle1", "bras_cr1_doorangle3", "bras_cr2", "bras_cr3", "bras_cr4"] {
        let scene = read_obj(&rooms.join(name).join("room.obj"));
        let toml = std::fs::read_to_string(rooms.join(name).join("room.toml")).unwrap();
        let mesh = MeshScene::new(&scene).unwrap();
        let start = std::time::Instant::now();
        let edges = DiffractingEdges::find(&scene, &mesh);
        eprintln!(
            "{name}: {} triangles, {} edges in {:?}",
            scene.triangles().len(),
            edges.len(),
            start.elapsed()
        );
        // What it costs at worst: between any two points of the box about the room.
        let bounds: Vec<[f64; 2]> = (0..3)
            .map(|axis| {
                let all = scene.vertices().iter().map(|v| v[axis]);
                [all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max)]
            })
            .collect();
        let (mut longest, mut most) = (std::time::Duration::ZERO, 0);
        for _ in 0..100 {
            let mut place = || {
                [0, 1, 2].map(|axis: usize| bounds[axis][0] + random() * (bounds[axis][1] - bounds[axis][0]))
            };
            let (mut paths, from, to) = (PathSet::new(1, 200.0), place(), place());
            let start = std::time::Instant::now();
            edges.add_paths(&mut paths, &mesh, from, to);
            longest = longest.max(start.elapsed());
            most = most.max(paths.len());
        }
        eprintln!("  100 random pairs: at most {longest:?} and {most} paths");
        for source in positions(&toml, "[[sources]]") {
            for receiver in positions(&toml, "[[receivers]]") {
                let start = std::time::Instant::now();
                let mut paths = PathSet::new(1, 200.0);
                edges.add_paths(&mut paths, &mesh, source, receiver);
                let took = start.elapsed();
                let line: Vec<f64> = (0..3).map(|i| receiver[i] - source[i]).collect();
                let d = distance(source, receiver);
                let heading = [line[0] / d, line[1] / d, line[2] / d];
                let blocked = mesh.closest_hit(source, heading, d - 1e-5).is_some();
                assert!(blocked || paths.is_empty(), "{name} {source:?} {receiver:?}");
                in_shadow += usize::from(blocked);
                let energies = paths.energies(&Conditions::new(&[hard()], &Air::default())).unwrap();
                for energy in energies.iter().flatten() {
                    assert!(energy.is_finite() && f64::from(*energy) < d.powi(-2));
                }
                if blocked {
                    let level = |e: &Vec<f32>| db(e.iter().map(|&e| f64::from(e)).sum::<f64>() * d * d);
                    let levels: Vec<f64> = energies.iter().map(level).collect();
                    eprintln!("  {source:?} {receiver:?}: {} paths, {took:?}, {levels:.1?} dB", paths.len());
                }
            }
        }
    }
    assert!(in_shadow > 0);
}
