//! Surfaces that the mesh lacks, hidden in laboratory rooms: found from single early reflections, and not where there are none.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::rivals::diagnoser_among;
use sabine_acoustics::Bands;
use sabine_diagnose::{Cause, DiagnoseConfig, Diagnoser, Diagnosis, Verdict};
use sabine_testkit::{Hidden, LabConfig, Laboratory, at_night};

fn lab(seed: u64, receivers: usize) -> Laboratory {
    Laboratory::new(LabConfig { seed, receivers, ..LabConfig::default() }).unwrap()
}

/// All octaves at night.
fn in_three_octaves(seed: u64, receivers: usize) -> Laboratory {
    if at_night() {
        return lab(seed, receivers);
    }
    let bands = Bands::octaves(500.0, 2000.0).unwrap();
    let config = LabConfig { seed, receivers, bands, sample_rate_hz: 16_000, ..LabConfig::default() };
    Laboratory::new(config).unwrap()
}

/// What absorbs, or reflects, as a surface does that the mesh lacks.
const RIVALS: [&str; 7] = [
    "extra_reflector",
    "open_patch",
    "surface_absorption",
    "surface_displacement",
    "position_error",
    "time_zero",
    "scattering",
];

fn diagnose(lab: &Laboratory, hidden: &[Hidden]) -> Diagnosis {
    let config = DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() };
    diagnose_by(&diagnoser_among(config, &RIVALS), lab, hidden)
}

fn diagnose_by(diagnoser: &Diagnoser, lab: &Laboratory, hidden: &[Hidden]) -> Diagnosis {
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(hidden, &folder.path().join("room"), None).unwrap();
    diagnoser.diagnose(&room, &[], &()).unwrap()
}

/// The one cause that is named, with a gain at positions not seen.
fn only_cause(found: &Diagnosis, effect: &str) -> Cause {
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(found.verdict, Verdict::Explained, "{named:?} {:?}", found.lack_of_fit);
    assert_eq!(named, [effect]);
    let gain = found.causes[0].held_out_gain.clone().unwrap();
    assert!(gain.low > 0.0, "{gain:?}");
    found.causes[0].clone()
}

fn interval(cause: &Cause, name: &str) -> (f64, f64) {
    let p = cause.parameters.iter().find(|p| p.name == name).unwrap();
    (p.low, p.high)
}

#[test]
fn a_panel_that_the_mesh_lacks_is_found_and_located() {
    let lab = lab(711, 12);
    let hidden = Hidden::random("extra_reflector", 1.0, &lab, 711).unwrap();
    let Hidden::ExtraReflector { centre_m, normal, ref reflectance, .. } = hidden else {
        panic!("{hidden:?}")
    };
    let source = lab.sources()[0].position_m;
    let far: f64 = (0..3).map(|k| normal[k] * (source[k] - centre_m[k])).sum();
    let found = diagnose(&lab, std::slice::from_ref(&hidden));
    let cause = only_cause(&found, "extra_reflector");
    for (k, name) in ["image_x", "image_y", "image_z"].into_iter().enumerate() {
        let truth = source[k] - 2.0 * far * normal[k];
        let (low, high) = interval(&cause, name);
        assert!(low <= truth && truth <= high, "{name}: {truth} is not within {low} to {high}");
        assert!(high - low < 0.2, "{name}: {low} to {high}");
    }
    assert_eq!(found.model.applied().sheets.len(), 1);
    // What the panel adds to decays is not predicted, which is no second cause.
    let left = found.lack_of_fit.p_value_explained < 0.01;
    let told = found.notes.iter().any(|note| note.contains("without the sound that the surface"));
    assert_eq!(told, left, "{:?}", found.notes);
    // The pulse's height is that of the high octaves.
    let (low, high) = interval(&cause, "reflectance");
    let truth_db = 10.0 * reflectance[reflectance.len() - 1].log10();
    assert!(low <= truth_db && truth_db <= high, "reflectance: {truth_db} is not within {low} to {high}");
}

#[test]
fn a_hole_in_a_wall_is_found_and_located() {
    let lab = lab(750, 12);
    let hidden = Hidden::random("open_patch", 1.0, &lab, 750).unwrap();
    let Hidden::OpenPatch { face, centre_m, size_m } = hidden else { panic!("{hidden:?}") };
    let config = DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() };
    let rivals = ["open_patch", "surface_absorption", "scattering"];
    let found = diagnose_by(&diagnoser_among(config, &rivals), &lab, std::slice::from_ref(&hidden));
    let cause = only_cause(&found, "open_patch");
    let names = ["centre_x", "centre_y", "centre_z"];
    for (k, name) in names.into_iter().enumerate() {
        let (low, high) = interval(&cause, name);
        let truth = centre_m[k];
        assert!(low - 1e-6 <= truth && truth <= high + 1e-6, "{name}: {truth} is not within {low} to {high}");
        // In its plane, and to half a metre within it.
        assert!(high - low < if k == face / 2 { 1e-6 } else { 1.0 }, "{name}: {low} to {high}");
    }
    let (low, high) = interval(&cause, "area");
    let truth = size_m[0] * size_m[1];
    assert!(low <= truth && truth <= high, "area: {truth} is not within {low} to {high}");
    // It renders as a sheet that absorbs everything.
    assert_eq!(found.model.applied().sheets.len(), 1);
    assert!((found.model.applied().sheets[0].absorption - 1.0).abs() < 1e-12);
}

#[test]
fn a_room_whose_mesh_is_right_lacks_no_surface() {
    let found = diagnose(&in_three_octaves(701, 12), &[]);
    assert_eq!(found.verdict, Verdict::Adequate, "{:?} {:?}", found.candidates.first(), found.lack_of_fit);
    for c in
        found.candidates.iter().filter(|c| ["extra_reflector", "open_patch"].contains(&c.effect.as_str()))
    {
        assert!(c.nats < 3.0, "{c:?}");
    }
}

/// Forty responses confirm every image, those of the walls too: they must not count a second time.
#[test]
fn a_wall_of_the_mesh_is_not_found_again_by_many_receivers() {
    let lab = in_three_octaves(8000, 40);
    let config = DiagnoseConfig { rays: 200, ..DiagnoseConfig::default() };
    let diagnoser = Diagnoser::new(config).unwrap().with_only(&["extra_reflector".to_owned()]).unwrap();
    let found = diagnose_by(&diagnoser, &lab, &[]);
    assert_eq!(found.candidates.len(), 1);
    assert!(found.candidates[0].nats < 3.0, "{:?}", found.candidates);
    assert!(found.causes.is_empty());
}
