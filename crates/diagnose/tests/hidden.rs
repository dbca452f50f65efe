//! Effects hidden in synthetic energies, and what is found of them.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{EnergyResponse, OctaveBands};
use sabine_diagnose::{BackgroundNoise, Effect, Misfit, Pair, TransducerResponse, explain};

const BIN_S: f64 = 0.02;
const BINS: usize = 40;

fn bands() -> OctaveBands {
    OctaveBands::new(500.0, 2000.0).unwrap()
}

/// A decay of 60 dB in 0.8 s in every band.
fn prediction() -> EnergyResponse {
    let energy: Vec<f64> =
        (0..3 * BINS).map(|i| 10f64.powf(-6.0 * (i % BINS) as f64 * BIN_S / 0.8)).collect();
    EnergyResponse::new(bands(), BIN_S, energy, vec![0.0; 3 * BINS]).unwrap()
}

/// Energy as narrow-band noise has it: the mean of n = B dt squared magnitudes of complex Gaussian samples, each of which
/// is exponentially distributed.
fn measured(mean: &EnergyResponse, seed: u64) -> EnergyResponse {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut energy = Vec::new();
    for band in 0..bands().len() {
        let (low, high) = bands().edges_hz(band);
        let n = ((high - low) * BIN_S).round() as usize;
        for &e in mean.band(band) {
            let sum: f64 = (0..n).map(|_| -(1.0 - rng.random::<f64>()).ln()).sum();
            energy.push(e * sum / n as f64);
        }
    }
    EnergyResponse::new(bands(), BIN_S, energy, vec![0.0; 3 * BINS]).unwrap()
}

fn pairs(mean: &EnergyResponse, seeds: std::ops::Range<u64>) -> Vec<Pair> {
    seeds.map(|seed| Pair { measured: measured(mean, seed), predicted: prediction() }).collect()
}

#[test]
fn chance_alone_gives_a_chi_squared_of_one() {
    let mut sum = 0.0;
    for pair in pairs(&prediction(), 0..20) {
        sum += Misfit::between(&pair.measured, &pair.predicted, 40.0).unwrap().reduced_chi_squared();
    }
    // 20 pairs of about 81 bins: the mean scatters by about sqrt(2 / 1620) = 0.035, and the logarithm of a Gamma variate
    // with n = 7 degrees (500 Hz) spreads by up to 15 % more than 1 / sqrt(n).
    let mean = sum / 20.0;
    assert!((0.88..1.25).contains(&mean), "{mean}");
}

#[test]
fn a_hidden_gain_is_found_and_helps_at_new_positions() {
    let truth = [4.0, 0.0, -5.0];
    let mean = TransducerResponse.apply(&truth, &prediction()).unwrap();
    let found = explain(&TransducerResponse, &pairs(&mean, 0..6), &pairs(&mean, 100..103)).unwrap();
    for (band, &expected) in truth.iter().enumerate() {
        // The mean of decibels lies below the decibels of the mean, by 10 / ln 10 / (2 n): 0.3 dB at 500 Hz, less above.
        let n = [7.0, 14.0, 28.0][band];
        let bias_db = 10.0 / std::f64::consts::LN_10 / (2.0 * n);
        let off = found.values[band] - (expected - bias_db);
        assert!(off.abs() < 4.0 * found.standard_errors[band] + 0.02, "band {band}: {off} dB");
    }
    assert!(found.held_out_after_db < 0.6 * found.held_out_before_db, "{found:?}");
}

#[test]
fn hidden_noise_is_found_and_a_gain_does_not_explain_it() {
    let truth = [-25.0, -30.0, -20.0];
    let mean = BackgroundNoise.apply(&truth, &prediction()).unwrap();
    let (fit, test) = (pairs(&mean, 0..6), pairs(&mean, 100..103));
    let found = explain(&BackgroundNoise, &fit, &test).unwrap();
    for (band, &expected) in truth.iter().enumerate() {
        assert!((found.values[band] - expected).abs() < 4.0 * found.standard_errors[band] + 0.4, "{found:?}");
    }
    let rival = explain(&TransducerResponse, &fit, &test).unwrap();
    assert!(found.held_out_after_db < 0.5 * rival.held_out_after_db, "{found:?} {rival:?}");
}

#[test]
fn an_absent_effect_gains_nothing() {
    let found =
        explain(&TransducerResponse, &pairs(&prediction(), 0..6), &pairs(&prediction(), 100..103)).unwrap();
    assert!((found.held_out_after_db - found.held_out_before_db).abs() < 0.1, "{found:?}");
}

#[test]
fn what_cannot_be_compared_is_an_error() {
    let silent = EnergyResponse::new(bands(), BIN_S, vec![0.0; 3 * BINS], vec![0.0; 3 * BINS]).unwrap();
    assert!(Misfit::between(&silent, &prediction(), 40.0).is_err());
    assert!(Misfit::between(&prediction(), &silent, 40.0).is_err());
    let coarse = EnergyResponse::new(bands(), 0.05, vec![1.0; 3], vec![0.0; 3]).unwrap();
    assert!(Misfit::between(&coarse, &prediction(), 40.0).is_err());
    assert!(explain(&TransducerResponse, &[], &pairs(&prediction(), 0..1)).is_err());
    assert!(explain(&TransducerResponse, &pairs(&prediction(), 0..1), &[]).is_err());
}
