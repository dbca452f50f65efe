//! Places that were measured in coordinates that are not those of the mesh.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::hidden_effects::{ON_TIMES, THREE_OCTAVES_HZ, diagnose_among, lab, only_cause, small_lab};
use sabine_diagnose::{ExtendedModel, ModelCause, ModelChange, RigidMotion};
use sabine_scene::MeasuredRoom;
use sabine_testkit::Hidden;

fn apart_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// The one name, the shift to 3 cm, the turn to half a degree; the extended model has all places where they are.
fn places_in_other_coordinates_are_found(seed: u64, shift_m: [f64; 3], turn_deg: f64) {
    let lab = small_lab(seed, 6, THREE_OCTAVES_HZ);
    let hidden = [Hidden::CoordinateShift { shift_m, turn_deg }];
    let rivals = ["coordinate_shift", "position_error", "room_dimensions", "time_zero"];
    let found = diagnose_among(&lab, &hidden, &rivals);
    let cause = only_cause(&found, "coordinate_shift");
    let of = |name: &str| cause.parameters.iter().find(|p| p.name == name).unwrap();
    for (name, shift) in ["shift_x", "shift_y", "shift_z"].into_iter().zip(shift_m) {
        assert!((of(name).value - shift).abs() < 0.03, "{:?} {shift}", of(name));
    }
    assert!((of("turn").value - turn_deg).abs() < 0.5, "{:?} {turn_deg}", of("turn"));

    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(&hidden, &folder.path().join("room"), None).unwrap();
    let (truth, extended) = (lab.truth(&hidden).unwrap(), found.model.room(&room).unwrap());
    let sources =
        extended.sources.iter().map(|s| s.position_m).zip(truth.sources.iter().map(|s| s.position_m));
    let receivers = extended.receivers.iter().map(|r| r.position_m).zip(truth.receivers_m.iter().copied());
    for (rendered, is) in sources.chain(receivers) {
        assert!(apart_m(rendered, is) < 0.05, "{rendered:?} {is:?}");
    }
    assert_eq!(extended.scene.vertices(), room.scene().vertices());
    let path = folder.path().join("extended_model.toml");
    found.model.write(&path).unwrap();
    assert_eq!(ExtendedModel::read(&path).unwrap(), found.model);
}

#[test]
fn places_that_are_shifted_and_turned_are_found() {
    places_in_other_coordinates_are_found(556, [0.3, -0.2, 0.1], 3.0);
}

#[test]
#[ignore = "nightly: minutes, and a lighter one is not ignored"]
fn places_that_are_shifted_or_turned_in_several_rooms_are_found() {
    for (seed, shift_m, turn_deg) in [
        (557, [0.1, 0.0, 0.0], 0.0),
        (558, [0.0, -0.1, 0.15], 0.0),
        (559, [0.0, 0.0, 0.0], 3.0),
        (560, [-0.35, 0.15, 0.1], -3.0),
    ] {
        places_in_other_coordinates_are_found(seed, shift_m, turn_deg);
    }
}

/// How many of several rooms for each size of the shift and the turn are given the one right name, and how far off the fit is.
#[test]
#[ignore = "nightly: many minutes"]
fn shifts_from_10_to_60_cm_are_found_with_and_without_a_turn() {
    const ROOMS: u64 = 6;
    let (mut right, mut rooms) = (0, 0);
    for (number, (kind, strength)) in ["coordinate_shift.shift", "coordinate_shift"]
        .into_iter()
        .flat_map(|kind| [1.0 / 3.0, 2.0 / 3.0, 4.0 / 3.0, 2.0].map(|strength| (kind, strength)))
        .enumerate()
    {
        for room in 0..ROOMS {
            let seed = 60_000 + 100 * number as u64 + room;
            let lab = lab(seed);
            let hidden = Hidden::random(kind, strength, &lab, seed).unwrap();
            let Hidden::CoordinateShift { shift_m, turn_deg } = hidden else { panic!("{hidden:?}") };
            let found = diagnose_among(&lab, &[hidden], &ON_TIMES);
            let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
            let is_right = named == ["coordinate_shift"];
            rooms += 1;
            right += usize::from(is_right);
            if is_right {
                let values: Vec<f64> = found.causes[0].parameters.iter().map(|p| p.value).collect();
                let off_m = apart_m([values[0], values[1], values[2]], shift_m);
                println!(
                    "{kind} {strength:.2} seed {seed}: {off_m:.3} m, {:.2} deg off",
                    values[3] - turn_deg
                );
                assert!(off_m < 0.05 && (values[3] - turn_deg).abs() < 0.5, "{values:?}");
            } else {
                println!("{kind} {strength:.2} seed {seed}: {named:?} for {shift_m:.3?} {turn_deg:.1}");
            }
        }
    }
    println!("{right} of {rooms}");
    assert!(10 * right >= 9 * rooms, "{right} of {rooms}");
}

#[test]
fn a_model_moves_all_places_and_the_axes_that_are_stated_whatever_the_order_of_changes() {
    let folder = tempfile::tempdir().unwrap();
    let lab = lab(561);
    let room: MeasuredRoom = lab.write(&[], &folder.path().join("room"), None).unwrap();
    let motion = RigidMotion::new([0.2, -0.1, 0.05], 4.0, [2.0, 1.5, 1.2]);
    let id = room.receivers()[1].id.clone();
    let position_m = room.receivers()[1].position_m.map(|c| c + 0.1);
    let changes =
        [ModelChange::CoordinateShift(motion), ModelChange::Position { id: id.clone(), position_m }];
    let built = |changes: Vec<ModelChange>| {
        let mut model = ExtendedModel::default();
        model.centres_hz = room.bands().iter_hz().collect();
        model.causes.push(ModelCause::new("by_hand", changes));
        let path = folder.path().join("model.toml");
        model.write(&path).unwrap();
        let read = ExtendedModel::read(&path).unwrap();
        assert_eq!(read, model);
        read.room(&room).unwrap()
    };
    let [forth, back] = [changes.to_vec(), changes.iter().rev().cloned().collect()].map(built);
    assert_eq!((&forth.sources, &forth.receivers), (&back.sources, &back.receivers));
    for (stated, found) in room.sources().iter().zip(&forth.sources) {
        assert_eq!(found.position_m, motion.moved(stated.position_m));
        assert_eq!(found.axis.unwrap(), motion.turned(stated.axis.unwrap()));
    }
    for (stated, found) in room.receivers().iter().zip(&forth.receivers) {
        let in_file = if stated.id == id { position_m } else { stated.position_m };
        assert_eq!(found.position_m, motion.moved(in_file));
    }
    // What is no motion of a room is refused, by its name.
    let mut wild = ExtendedModel::default();
    wild.centres_hz = room.bands().iter_hz().collect();
    let motion = RigidMotion::new([0.0; 3], 200.0, [0.0; 3]);
    wild.causes.push(ModelCause::new("by_hand", vec![ModelChange::CoordinateShift(motion)]));
    let error = wild.room(&room).unwrap_err().to_string();
    assert!(error.contains("coordinate_shift.turn_deg"), "{error}");
}
