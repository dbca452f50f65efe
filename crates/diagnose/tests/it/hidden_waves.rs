//! Standing waves hidden in the responses of laboratory rooms must be found, and none where there is none.
//!
//! The laboratory sums the modes of its box in closed form; the diagnosis solves the wave equation on voxels.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::rivals::diagnoser_among;
use sabine_acoustics::Bands;
use sabine_diagnose::{DiagnoseConfig, Diagnosis, Verdict};
use sabine_testkit::{Hidden, LabConfig, Laboratory, at_night};

/// What scatters levels in the low octaves, or bends their decays.
const RIVALS: [&str; 6] = [
    "room_modes",
    "coherent_reflections",
    "background_noise",
    "surface_absorption",
    "scattering",
    "transducer_response",
];

fn diagnose(lab: &Laboratory, hidden: &[Hidden]) -> Diagnosis {
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(hidden, &folder.path().join("room"), None).unwrap();
    let config = DiagnoseConfig { rays: 2000, ..DiagnoseConfig::default() };
    let found = diagnoser_among(config, &RIVALS).diagnose(&room, &[], &()).unwrap();
    println!("{:?}, {:?}", found.verdict, found.lack_of_fit);
    for cause in &found.causes {
        println!("{} {:.1} nats {:?} {:?}", cause.effect, cause.nats, cause.held_out_gain, cause.parameters);
    }
    println!("{:?}", found.candidates.iter().map(|c| (&c.effect, c.nats, c.d_prime)).collect::<Vec<_>>());
    println!("{:?}", found.seconds);
    found
}

/// Octaves from one to the other, recorded at 16 kHz.
fn few_octaves(seed: u64, low_hz: f64, high_hz: f64) -> LabConfig {
    let bands = Bands::octaves(low_hz, high_hz).unwrap();
    LabConfig { seed, bands, sample_rate_hz: 16_000, ..LabConfig::default() }
}

/// The same, and all octaves at night.
fn few_by_day(seed: u64, low_hz: f64, high_hz: f64) -> LabConfig {
    if at_night() { LabConfig { seed, ..LabConfig::default() } } else { few_octaves(seed, low_hz, high_hz) }
}

fn are_found(config: LabConfig) {
    let seed = config.seed;
    let lab = Laboratory::new(config).unwrap();
    let hidden = Hidden::random("room_modes", 1.0, &lab, seed).unwrap();
    let found = diagnose(&lab, &[hidden]);
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(named, ["room_modes"], "{:?}", found.lack_of_fit);
    assert_eq!(found.verdict, Verdict::Explained);
    let cause = &found.causes[0];
    let gain = cause.held_out_gain.as_ref().unwrap();
    assert!(gain.low > 0.0 && gain.db_rmse_after < gain.db_rmse_before, "{gain:?}");
    let share = cause.parameters.iter().find(|p| p.name == "share_of_waves").unwrap();
    assert!((share.value - 1.0).abs() < 0.1, "{share:?}");
    let left = cause.parameters.iter().find(|p| p.name == "left_to_chance").unwrap();
    assert!(left.value < 0.2, "{left:?}");
}

#[test]
fn standing_waves_are_found() {
    are_found(few_by_day(810, 125.0, 4000.0));
}

#[test]
fn a_room_of_rays_has_no_standing_waves() {
    // Waves are solved in the low octaves: those above say nothing of them.
    let found = diagnose(&Laboratory::new(few_octaves(810, 125.0, 1000.0)).unwrap(), &[]);
    assert_eq!(found.verdict, Verdict::Adequate, "{:?} {:?}", found.causes, found.lack_of_fit);
    // They were looked for.
    let score = found.candidates.iter().find(|c| c.effect == "room_modes").unwrap();
    assert!(score.nats < 0.0, "{score:?}");
}

#[test]
#[ignore = "minutes"]
fn standing_waves_are_found_in_another_room() {
    are_found(LabConfig { seed: 811, ..LabConfig::default() });
}

/// Not met: `source_directivity` (6.9 nats) is named beside them.
#[test]
#[ignore = "minutes; a second cause is named"]
fn standing_waves_are_all_that_is_found_in_a_third_room() {
    are_found(LabConfig { seed: 812, ..LabConfig::default() });
}

/// Rooms as most programs make them: image sources that all have the sign of the source. Their sum is not that of their energies, below the
/// Schroeder frequency nor above it.
fn reflections_in_phase_are_all_that_is_named(config: LabConfig) {
    let config = LabConfig { receivers: 8, positive_reflections: true, ..config };
    let found = diagnose(&Laboratory::new(config).unwrap(), &[]);
    let names: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(names, ["coherent_reflections"], "{:?} {:?}", found.lack_of_fit, found.notes);
    let share = &found.causes[0].parameters[0];
    assert!((share.value - 1.0).abs() < 0.1, "{share:?}");
    // Decay curves at positions that were left out.
    let held_out = found.held_out.as_ref().unwrap();
    assert!(held_out.db_rmse[1] < 0.5 * held_out.db_rmse[0], "{held_out:?}");
}

#[test]
fn reflections_that_add_in_phase_are_named() {
    reflections_in_phase_are_all_that_is_named(few_by_day(9101, 250.0, 2000.0));
}

#[test]
#[ignore = "nightly: minutes"]
fn in_another_room_reflections_that_add_in_phase_are_named() {
    reflections_in_phase_are_all_that_is_named(LabConfig { seed: 9102, ..LabConfig::default() });
}

/// What sums of pressures predict hangs on the materials: the right one is told if each is weighed with those that it asks for.
#[test]
#[ignore = "nightly: minutes"]
fn beside_reflections_in_phase_the_material_that_is_another_is_told() {
    let config = LabConfig { seed: 9103, receivers: 8, positive_reflections: true, ..LabConfig::default() };
    let lab = Laboratory::new(config).unwrap();
    let hidden = Hidden::random("surface_absorption", 1.0, &lab, 9103).unwrap();
    let Hidden::SurfaceAbsorption { material, .. } = hidden else { panic!("{hidden:?}") };
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(&[hidden], &folder.path().join("room"), None).unwrap();
    let config = DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() };
    let effects = ["coherent_reflections", "surface_absorption", "coupled_volume"];
    let found = diagnoser_among(config, &effects).diagnose(&room, &[], &()).unwrap();
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(named, ["coherent_reflections", "surface_absorption"], "{:?}", found.lack_of_fit);
    let cause = &found.causes[1];
    assert_eq!(cause.subject.as_deref(), Some(lab.scene().materials()[material].name.as_str()));
    assert!(cause.other_subjects.is_empty(), "{:?}", cause.other_subjects);
}
