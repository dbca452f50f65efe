//! The edges that a mesh has, and the paths around them.

use super::*;
use crate::wedge_oracles::*;
use proptest::prelude::*;
use sabine_acoustics::*;
use sabine_paths::*;
use sabine_propagate::{DiffractingEdges, MeshScene};
use std::f64::consts::{PI, TAU};

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
