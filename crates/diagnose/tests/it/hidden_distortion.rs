//! Harmonics of a sweep, hidden before the direct sound of laboratory rooms: found there, and not where a long lead-in holds noise alone.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::rivals::diagnoser_among;
use sabine_diagnose::{DiagnoseConfig, Diagnosis, Verdict};
use sabine_scene::TimeZero;
use sabine_testkit::{Hidden, LabConfig, Laboratory};

fn lab(seed: u64) -> Laboratory {
    Laboratory::new(LabConfig { seed, receivers: 8, time_zero: TimeZero::Common, ..LabConfig::default() })
        .unwrap()
}

fn diagnose(lab: &Laboratory, hidden: &[Hidden]) -> Diagnosis {
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(hidden, &folder.path().join("room"), None).unwrap();
    let config = DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() };
    let rivals =
        ["nonlinear_distortion", "time_zero", "background_noise", "truncation", "transducer_response"];
    diagnoser_among(config, &rivals).diagnose(&room, &[], &()).unwrap()
}

#[test]
fn an_overdriven_loudspeaker_is_found() {
    let lab = lab(771);
    let hidden = Hidden::random("nonlinear_distortion", 1.0, &lab, 771).unwrap();
    let Hidden::NonlinearDistortion { sweep_s, from_hz, to_hz, quadratic, cubic, .. } = hidden else {
        panic!("{hidden:?}")
    };
    let found = diagnose(&lab, &[hidden]);
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(found.verdict, Verdict::Explained, "{named:?} {:?} {:?}", found.candidates, found.lack_of_fit);
    assert_eq!(named, ["nonlinear_distortion"]);
    let gain = found.causes[0].held_out_gain.clone().unwrap();
    assert!(gain.low > 0.0, "{gain:?}");
    // A. Farina 2000: the k-th harmonic leads by L ln(k), the frequency growing as exp(t / L).
    let growth_s = sweep_s / (to_hz / from_hz).ln();
    let truths = [
        ("second_harmonic_lead", growth_s * 2f64.ln()),
        ("second_harmonic_1_khz", 20.0 * (0.5 * quadratic.abs()).log10()),
        ("third_harmonic_1_khz", 20.0 * (0.25 * cubic.abs()).log10()),
    ];
    for (name, truth) in truths {
        let p = found.causes[0].parameters.iter().find(|p| p.name == name).unwrap();
        assert!(p.low <= truth && truth <= p.high, "{name}: {truth} is not within {} to {}", p.low, p.high);
        assert!(p.high - p.low < if p.unit == "s" { 0.01 } else { 5.0 }, "{name}: {} to {}", p.low, p.high);
    }
}

#[test]
fn a_long_lead_in_alone_is_no_distortion() {
    let found = diagnose(&lab(772), &[Hidden::TimeZero { latency_s: 0.8 }]);
    assert_eq!(found.verdict, Verdict::Adequate, "{:?} {:?}", found.candidates.first(), found.lack_of_fit);
    let own = found.candidates.iter().find(|c| c.effect == "nonlinear_distortion").unwrap();
    assert!(own.nats < 0.0, "{own:?}");
}
