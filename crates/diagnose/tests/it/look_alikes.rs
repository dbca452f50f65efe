//! What a diagnosis must not be sure of: effects that no catalogue holds, and causes that the measurement cannot tell apart. And two
//! causes at once, which it can.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::hidden_effects::diagnose_by;
use crate::rivals::diagnoser_among;
use sabine_acoustics::Bands;
use sabine_diagnose::{DiagnoseConfig, Diagnoser, Diagnosis, Verdict};
use sabine_testkit::{Hidden, LabConfig, Laboratory};

fn lab(seed: u64, receivers: usize) -> Laboratory {
    Laboratory::new(LabConfig { seed, receivers, ..LabConfig::default() }).unwrap()
}

fn diagnose(lab: &Laboratory, hidden: &[Hidden], config: DiagnoseConfig) -> Diagnosis {
    diagnose_by(&Diagnoser::new(config).unwrap(), lab, hidden)
}

/// Weighs these effects, and all at night.
fn diagnose_among(
    lab: &Laboratory,
    hidden: &[Hidden],
    config: DiagnoseConfig,
    effects: &[&str],
) -> Diagnosis {
    diagnose_by(&diagnoser_among(config, effects), lab, hidden)
}

fn few_rays() -> DiagnoseConfig {
    DiagnoseConfig { rays: 2000, ..DiagnoseConfig::default() }
}

fn named(found: &Diagnosis) -> Vec<&str> {
    let mut named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    named.sort_unstable();
    named
}

fn gets_no_name(id: &str, seed: u64) {
    let lab = lab(seed, 8);
    let found = diagnose(&lab, &[Hidden::random(id, 1.0, &lab, seed).unwrap()], few_rays());
    assert_eq!(found.verdict, Verdict::Unexplained, "{:?}", named(&found));
    assert!(found.causes.is_empty() && found.lack_of_fit.p_value < 0.01, "{:?}", found.lack_of_fit);
    // Where it shows is said all the same.
    assert!(!found.residuals.is_empty());
}

#[test]
fn gains_that_drift_while_it_is_measured_get_no_name() {
    gets_no_name("gain_drift", 901);
}

#[test]
#[ignore = "nightly: minutes"]
fn dropouts_get_no_name() {
    gets_no_name("dropouts", 902);
}

#[test]
#[ignore = "nightly: minutes"]
fn a_foreign_sound_gets_no_name() {
    gets_no_name("foreign_chirp", 901);
}

#[test]
fn two_causes_are_both_found() {
    let lab = lab(921, 8);
    let hidden = ["time_zero", "background_noise"].map(|id| Hidden::random(id, 1.0, &lab, 921).unwrap());
    let rivals =
        ["time_zero", "background_noise", "sound_speed", "position_error", "truncation", "coupled_volume"];
    let found = diagnose_among(&lab, &hidden, few_rays(), &rivals);
    assert_eq!(found.verdict, Verdict::Explained, "{:?}", found.lack_of_fit);
    assert_eq!(named(&found), ["background_noise", "time_zero"]);
    for cause in &found.causes {
        assert!(cause.held_out_gain.as_ref().unwrap().low > 0.0, "{cause:?}");
    }
}

/// A clock that runs fast and air that is colder stretch all arrival times by the same factor.
#[test]
#[ignore = "nightly: minutes, and that the two cannot be told apart is asked in the gate"]
fn a_clock_and_a_temperature_come_as_a_set() {
    let lab = lab(931, 24);
    // Places are as good as the laboratory's are: 5 mm.
    let config = DiagnoseConfig { position_sd_m: 0.005, ..few_rays() };
    let found = diagnose(&lab, &[Hidden::SamplingClock { ppm: 900.0 }], config);
    assert_eq!(found.verdict, Verdict::Ambiguous, "{:?} {:?}", named(&found), found.candidates);
    let mut set: Vec<&str> = found.alternatives.iter().map(String::as_str).collect();
    set.sort_unstable();
    assert_eq!(set, ["sampling_clock", "sound_speed"]);
    assert!(found.would_decide.iter().any(|w| w.contains("loopback")), "{:?}", found.would_decide);
}

/// Which of the two stretches arrival times is open, and decays tell the loudspeaker's response whichever it is.
#[test]
#[ignore = "nightly: a minute and more; that the two cannot be told apart is asked in the gate"]
fn a_loudspeaker_is_named_beside_a_set_of_a_clock_and_a_temperature() {
    // Arrival times are the same in few octaves.
    let bands = Bands::octaves(500.0, 4000.0).unwrap();
    let config =
        LabConfig { seed: 931, receivers: 24, bands, sample_rate_hz: 16_000, ..LabConfig::default() };
    let lab = Laboratory::new(config).unwrap();
    let loudspeaker = Hidden::random("transducer_response", 1.0, &lab, 931).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let hidden = [Hidden::SamplingClock { ppm: 900.0 }, loudspeaker];
    let room = lab.write(&hidden, &folder.path().join("room"), None).unwrap();
    let config = DiagnoseConfig { position_sd_m: 0.005, ..few_rays() };
    let ids =
        ["sampling_clock", "sound_speed", "transducer_response", "surface_absorption", "air_absorption"];
    let diagnoser = Diagnoser::new(config).unwrap().with_only(&ids.map(str::to_owned)).unwrap();
    let found = diagnoser.diagnose(&room, &[], &()).unwrap();
    assert_eq!(found.verdict, Verdict::Ambiguous, "{:?} {:?}", named(&found), found.candidates);
    assert_eq!(found.causes.len(), 2, "{:?}", named(&found));
    assert_eq!(found.causes[0].effect, "transducer_response");
    assert!(found.alternatives.contains(&found.causes[1].effect));
    let mut set = found.alternatives.clone();
    set.sort_unstable();
    assert_eq!(set, ["sampling_clock", "sound_speed"]);
}

/// Both straighten decays. What scatters is found by chance, more or less: with 3,000 rays this room was named the other way, and with 10,000
/// of one seed of seven (5000): there the gain at positions left out has an interval that reaches below zero.
#[test]
#[ignore = "nightly: minutes, and rough walls and walls that react locally are each found in the gate"]
fn some_scattering_is_told_from_walls_that_react_locally() {
    let lab = lab(5000, 12);
    let hidden = Hidden::random("scattering", 0.5, &lab, 5000).unwrap();
    let rivals = ["scattering", "angle_dependent_absorption", "surface_absorption", "air_absorption"];
    let found = diagnose_among(&lab, &[hidden], DiagnoseConfig::default(), &rivals);
    assert_eq!(found.verdict, Verdict::Explained, "{:?}", found.lack_of_fit);
    assert_eq!(named(&found), ["scattering"]);
}
