//! A model is found at some positions, saved, read, and held against the true one at positions that it has not seen.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::rivals::diagnoser_among;
use sabine_acoustics::Bands;
use sabine_diagnose::{DiagnoseConfig, DisplacedSurface, ExtendedModel, ModelCause, ModelChange};
use sabine_scene::MeasuredRoom;
use sabine_testkit::{End, Hidden, LabConfig, Laboratory};

/// Positions that the model is found at; twelve more are never fitted.
const FITTED: usize = 8;

fn config() -> DiagnoseConfig {
    DiagnoseConfig { rays: 2000, ..DiagnoseConfig::default() }
}

/// Root mean square error of the decay curves at positions that are left out, in dB, absorption fitted at the others.
fn left_out_db(room: &MeasuredRoom) -> f64 {
    let fresh: Vec<String> = room.receivers()[FITTED..].iter().map(|r| r.id.clone()).collect();
    let diagnoser = diagnoser_among(config(), &[]).with_effects(Vec::new());
    diagnoser.diagnose(room, &fresh, &()).unwrap().held_out.unwrap().db_rmse[0]
}

/// Errors at fresh positions of the room as stated, as found and as it is.
fn errors_db(seed: u64, hidden: &[Hidden], effects: &[&str], truth: Vec<ModelChange>) -> [f64; 3] {
    let lab = Laboratory::new(LabConfig { seed, receivers: FITTED + 12, ..LabConfig::default() }).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(hidden, &folder.path().join("room"), None).unwrap();
    let fitted = room.with_responses(|response| response.receiver < FITTED);
    let found = diagnoser_among(config(), effects).diagnose(&fitted, &[], &()).unwrap();
    assert_eq!(found.causes.len(), hidden.len(), "{:?}", found.causes);
    let path = folder.path().join("extended_model.toml");
    found.model.write(&path).unwrap();
    let mut model = ExtendedModel::read(&path).unwrap();
    // Absorption is fitted anew in all three: what counts is the cause.
    model.absorption.clear();
    model.uncertainty = None;
    let mut true_model = ExtendedModel::default();
    true_model.centres_hz.clone_from(&model.centres_hz);
    true_model.causes.push(ModelCause::new("truth", truth));
    let as_modelled = |model: &ExtendedModel| {
        let extended = model.room(&room).unwrap();
        left_out_db(&extended.measured_room(&room).unwrap())
    };
    let errors = [left_out_db(&room), as_modelled(&model), as_modelled(&true_model)];
    println!("{effects:?}: stated, found, true: {errors:.3?} dB");
    errors
}

fn predicts_as_well_as_the_true_model([_, found, truth]: [f64; 3]) {
    assert!(found < 1.02 * truth, "{found} dB for {truth}");
}

/// Where decays tell of the change at all, the model is nearer to the true one than to what is stated.
fn predicts_better_than_stated(errors: [f64; 3]) {
    predicts_as_well_as_the_true_model(errors);
    let [stated, found, truth] = errors;
    assert!(found - truth < 0.5 * (stated - truth), "{errors:?}");
}

#[test]
#[ignore = "nightly: minutes"]
fn a_wall_that_stands_elsewhere_predicts_fresh_positions_as_well_as_the_true_one() {
    let lab = Laboratory::new(LabConfig { seed: 25_201, receivers: 20, ..LabConfig::default() }).unwrap();
    let offset_m = 0.35;
    let [_, [x, _, z]] = lab.scene().bounds_m();
    // The wall y = 0.
    let wall = DisplacedSurface::new([0.5 * x, 0.0, 0.5 * z], [0.0, -1.0, 0.0], offset_m, [0.0; 2]);
    let hidden = [Hidden::SurfaceDisplacement { face: 2, offset_m }];
    let effects = ["surface_displacement", "position_error", "time_zero"];
    let truth = vec![ModelChange::SurfaceDisplacement(wall)];
    predicts_better_than_stated(errors_db(25_201, &hidden, &effects, truth));
}

#[test]
#[ignore = "nightly: minutes"]
fn scattering_predicts_fresh_positions_as_well_as_the_true_one() {
    let lab = Laboratory::new(LabConfig { seed: 25_202, receivers: 20, ..LabConfig::default() }).unwrap();
    let scattering = vec![0.7; Bands::T60.len()];
    let materials = lab.scene().materials().iter().map(|m| (m.name.clone(), scattering.clone()));
    let truth = vec![ModelChange::Scattering(materials.collect())];
    let effects = ["scattering", "surface_absorption"];
    predicts_better_than_stated(errors_db(25_202, &[Hidden::Scattering { scattering }], &effects, truth));
}

#[test]
#[ignore = "nightly: minutes"]
fn two_changes_at_once_predict_fresh_positions_as_well_as_the_true_ones() {
    let lab = Laboratory::new(LabConfig { seed: 25_203, receivers: 20, ..LabConfig::default() }).unwrap();
    let offset_m = [0.25, -0.2, 0.1];
    let source = &lab.sources()[0];
    let truth = vec![
        ModelChange::Temperature(lab.air().temperature_c() + 8.0),
        ModelChange::Position {
            id: source.id.clone(),
            position_m: [0, 1, 2].map(|k| source.position_m[k] + offset_m[k]),
        },
    ];
    let hidden = [
        Hidden::SoundSpeed { temperature_offset_k: 8.0 },
        Hidden::PositionError { end: End::Source, index: 0, offset_m },
    ];
    let effects = ["sound_speed", "position_error", "time_zero", "sampling_clock"];
    predicts_as_well_as_the_true_model(errors_db(25_203, &hidden, &effects, truth));
}
