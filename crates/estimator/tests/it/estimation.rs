//! The pretrained estimator on synthetic recordings, and weights that do not fit.

use crate::bursts::bursts;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{RoomEstimator, Signal};
use sabine_estimator::{ConstantEstimator, Error, Estimator, Model, Warning, WeightsFault, add_checksum};

const WEIGHTS: &[u8] = include_bytes!("../../weights/room.safetensors");

#[test]
fn a_longer_decay_is_heard_as_longer() {
    let estimator = Estimator::pretrained().unwrap();
    let at_1_khz = |t60_s| {
        let targets = estimator.estimate(&bursts(8.0, t60_s, 16_000, 1)).unwrap();
        *targets.t60_s().at_hz(1000.0).unwrap()
    };
    let (short, long) = (at_1_khz(0.25), at_1_khz(1.2));
    // Bursts are no speech, so no value is promised; but four times the decay is heard as at least one and a half times.
    assert!(long.value > 1.5 * short.value, "{short:?} {long:?}");
    assert!(short.standard_error > 0.0 && long.standard_error > 0.0);
}

#[test]
fn level_and_repetition_change_little() {
    let estimator = Estimator::pretrained().unwrap();
    let loud = bursts(8.0, 0.6, 16_000, 2);
    let quiet = Signal::new(loud.samples().iter().map(|s| s * 0.01).collect(), 16_000).unwrap();
    let (a, b) = (estimator.estimate(&loud).unwrap(), estimator.estimate(&quiet).unwrap());
    for (a, b) in a.t60_s().values().iter().zip(b.t60_s().values()) {
        assert!((a.value / b.value - 1.0).abs() < 1e-3, "{a:?} {b:?}");
    }
    let detailed = estimator.estimate_detailed(&loud).unwrap();
    assert_eq!(detailed.windows.len(), 4);
    assert!((detailed.windows.iter().map(|w| w.weight).sum::<f64>() - 1.0).abs() < 1e-12);
    assert_eq!(detailed.targets, a);
    assert_eq!(a.eq_db().at_hz(1000.0).map(|e| e.value), Some(0.0));
}

#[test]
fn what_cannot_be_judged_is_refused_and_what_is_doubtful_is_said() {
    let estimator = Estimator::pretrained().unwrap();
    let short = estimator.estimate_detailed(&bursts(0.9, 0.5, 16_000, 3));
    assert!(matches!(short, Err(Error::TooShort { needed_s: 1.0, .. })));
    let silent = Signal::new(vec![0.0; 32_000], 16_000).unwrap();
    assert!(matches!(estimator.estimate_detailed(&silent), Err(Error::Silent { .. })));
    let telephone = estimator.estimate_detailed(&bursts(5.0, 0.5, 8_000, 3));
    assert!(matches!(telephone, Err(Error::SampleRate { found_hz: 8_000, needed_hz: 16_000 })));
    let says = |signal: &Signal, wanted: fn(&Warning) -> bool| {
        let found = estimator.estimate_detailed(signal).unwrap().warnings;
        assert!(found.iter().any(wanted), "{found:?}");
        assert!(found.iter().all(|w| !w.to_string().is_empty()));
    };
    says(&bursts(1.5, 0.5, 16_000, 3), |w| matches!(w, Warning::Short { .. }));
    says(&bursts(5.0, 0.5, 48_000, 3), |w| matches!(w, Warning::Resampled { from_hz: 48_000, .. }));
    let speech = bursts(6.0, 0.5, 16_000, 3);
    let cut = speech.samples().iter().map(|s| s.clamp(-0.1, 0.1)).collect();
    says(&Signal::new(cut, 16_000).unwrap(), |w| matches!(w, Warning::Clipped { .. }));
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let noise = (0..64_000).map(|_| rng.random_range(-0.1f32..0.1)).collect();
    says(&Signal::new(noise, 16_000).unwrap(), |w| matches!(w, Warning::Noisy { .. }));
    let tone = (0..64_000).map(|n| (n as f32 * 0.4).sin()).collect();
    says(&Signal::new(tone, 16_000).unwrap(), |w| matches!(w, Warning::Unfamiliar { .. }));
    // A chord of steady tones with a beat: music rather than speech.
    let chord = |n: usize| {
        let s = n as f32 / 16_000.0;
        let beat = (1.0 - (s * 2.0).fract()).powi(2) + 0.05;
        beat * [220.0f32, 277.2, 329.6, 440.0]
            .iter()
            .map(|hz| (std::f32::consts::TAU * hz * s).sin())
            .sum::<f32>()
            * 0.2
    };
    let music = Signal::new((0..128_000).map(chord).collect(), 16_000).unwrap();
    says(&music, |w| matches!(w, Warning::Unfamiliar { .. }));
    let mut pause = speech.into_samples();
    pause.extend(vec![1e-5; 160_000]);
    says(&Signal::new(pause, 16_000).unwrap(), |w| matches!(w, Warning::Inactive { .. }));
}

#[test]
fn a_reverberation_time_outside_the_range_that_was_trained_on_is_said() {
    let mut model = Estimator::pretrained().unwrap().model().clone();
    model.calibration.t60_range_s = vec![[0.05, 0.2]; 7];
    let estimator = Estimator::new(model).unwrap();
    let found = estimator.estimate_detailed(&bursts(6.0, 0.8, 16_000, 1)).unwrap().warnings;
    let edges = found.iter().filter(|w| matches!(w, Warning::EdgeOfRange { high_s, .. } if *high_s == 0.2));
    assert_eq!(edges.count(), 7, "{found:?}");
}

#[test]
fn errors_cross_the_seam_with_their_cause() {
    let estimator = Estimator::pretrained().unwrap();
    let error = estimator.estimate(&bursts(0.5, 0.5, 16_000, 3)).unwrap_err();
    assert!(error.to_string().contains("0.50 s; at least 1.00 s"), "{error}");
    let guess = ConstantEstimator::of_training(estimator.model()).unwrap();
    let targets = guess.estimate(&bursts(0.5, 0.5, 16_000, 3)).unwrap();
    let t60_s = targets.t60_s().at_hz(500.0).unwrap();
    assert!((0.2..2.0).contains(&t60_s.value) && t60_s.standard_error > 0.0);
}

#[test]
fn weights_survive_a_round_trip() {
    let model = Model::from_safetensors("test", WEIGHTS).unwrap();
    let full = model.to_safetensors(false).unwrap();
    assert_eq!(Model::from_safetensors("test", &full).unwrap(), model);
    // The committed file has half-precision weights: halving them again loses nothing.
    assert_eq!(Model::from_safetensors("test", &model.to_safetensors(true).unwrap()).unwrap(), model);
    assert!(WEIGHTS.len() < 200_000);
}

/// With the checksum that fits what the bytes have become: blanks take the place of the old one, at the end of the header.
fn sealed(bytes: &[u8]) -> Vec<u8> {
    let before = br#",\"sha256\":\""#;
    let at = bytes.windows(before.len()).position(|w| w == before).unwrap();
    let mut bytes = bytes.to_vec();
    bytes[at..at + before.len() + 64 + 2].fill(b' ');
    // Without a header of its own there is nothing to seal.
    add_checksum(&bytes).unwrap_or(bytes)
}

#[test]
fn weights_that_do_not_fit_are_refused_with_the_reason() {
    let fault = |bytes: &[u8]| match Estimator::from_safetensors(bytes) {
        Err(Error::Weights { fault, .. }) => *fault,
        other => panic!("{other:?}"),
    };
    for length in [0, 7, 100, WEIGHTS.len() / 2, WEIGHTS.len() - 1] {
        assert!(matches!(fault(&WEIGHTS[..length]), WeightsFault::Container { .. }), "{length} bytes");
    }
    let replaced = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let at = WEIGHTS.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let mut bytes = WEIGHTS.to_vec();
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        // Whoever changes a file on purpose gives it the checksum that fits.
        fault(&sealed(&bytes))
    };
    assert!(matches!(
        replaced("sabine-estimator-2", "sabine-estimator-9"),
        WeightsFault::Layout { field: "format", .. }
    ));
    assert!(matches!(replaced("\"sabine\"", "\"nobody\""), WeightsFault::Metadata { .. }));
    let missing = replaced("network.output.bias", "network.output.bios");
    assert!(
        matches!(missing, WeightsFault::Missing { ref tensor } if tensor == "network.output.bias"),
        "{missing}"
    );
    let other_features = replaced("\\\"mels\\\":32", "\\\"mels\\\":64");
    assert!(matches!(other_features, WeightsFault::Layout { field: "network.mels", .. }), "{other_features}");
    // The last bytes are weights in half precision: all ones is NaN.
    let mut bytes = WEIGHTS.to_vec();
    let end = bytes.len();
    bytes[end - 2..].fill(0xff);
    assert!(matches!(fault(&bytes), WeightsFault::Checksum { .. }));
    assert!(matches!(fault(&sealed(&bytes)), WeightsFault::NotFinite { .. }));
    let nowhere = Estimator::from_file("/nowhere/weights.safetensors");
    assert!(matches!(nowhere, Err(Error::Io { .. })), "{nowhere:?}");
}
