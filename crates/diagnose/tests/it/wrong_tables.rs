//! A simulation that fits only with other materials than its room file states.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::invariances::copy;
use sabine_diagnose::{DiagnoseConfig, Diagnoser, Diagnosis, Verdict};
use sabine_scene::MeasuredRoom;
use sabine_testkit::{LabConfig, Laboratory};

/// Without any cause to name: what is asked is whether the fit is adequate.
fn fitted(room: &MeasuredRoom) -> Diagnosis {
    let config = DiagnoseConfig { rays: 1000, wave_solutions: false, ..DiagnoseConfig::default() };
    Diagnoser::new(config).unwrap().with_only(&[]).unwrap().diagnose(room, &[], &()).unwrap()
}

#[test]
fn tables_that_are_wrong_by_half_are_contradicted_and_right_ones_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let lab = Laboratory::new(LabConfig { seed: 583, receivers: 6, ..LabConfig::default() }).unwrap();
    let room = lab.write(&[], &folder.path().join("right"), None).unwrap();
    let found = fitted(&room);
    assert_eq!(found.verdict, Verdict::Adequate, "{:?}", found.lack_of_fit);

    let path = folder.path().join("wrong");
    let mut wrong = copy(&room);
    for prior in &mut wrong.priors {
        prior.absorption = prior.absorption.as_ref().map(|a| a.map(|a| (1.5 * a).min(0.95)));
    }
    let found = fitted(&wrong.write(&path).unwrap());
    assert_eq!(found.verdict, Verdict::Unexplained, "{:?}", found.lack_of_fit);
    let failed: Vec<&str> =
        found.lack_of_fit.tests.iter().filter(|t| t.p_value < 0.01).map(|t| t.name.as_str()).collect();
    assert!(failed.contains(&"absorption against the tables"), "{failed:?}");
}
