//! Walls that react locally, hidden in a laboratory room, are told from walls that absorb alike at all angles.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::rivals::diagnoser_among;
use sabine_acoustics::Bands;
use sabine_diagnose::{DiagnoseConfig, Diagnosis, Verdict};
use sabine_testkit::{Hidden, LabConfig, Laboratory};

fn diagnose(seed: u64, hidden: &[Hidden]) -> Diagnosis {
    let bands = Bands::octaves(500.0, 4000.0).unwrap();
    let config = LabConfig { seed, receivers: 8, bands, sample_rate_hz: 16_000, ..LabConfig::default() };
    let lab = Laboratory::new(config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(hidden, &folder.path().join("room"), None).unwrap();
    let config = DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() };
    let rivals = ["angle_dependent_absorption", "scattering", "surface_absorption"];
    diagnoser_among(config, &rivals).diagnose(&room, &[], &()).unwrap()
}

#[test]
fn walls_that_react_locally_are_found() {
    let found = diagnose(781, &[Hidden::AngleDependentAbsorption { share: 1.0 }]);
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(found.verdict, Verdict::Explained, "{named:?} {:?} {:?}", found.candidates, found.lack_of_fit);
    assert_eq!(named, ["angle_dependent_absorption"]);
    let gain = found.causes[0].held_out_gain.clone().unwrap();
    assert!(gain.low > 0.0, "{gain:?}");
    // The share comes out a fifth low (docs/validation/diagnose.md).
    let share = &found.causes[0].parameters[0];
    assert!(share.low > 0.5 && share.high > 0.85, "{share:?}");
}
