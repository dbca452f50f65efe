//! Rooms of the laboratory, and what is asked of them.
#![allow(dead_code)] // each test uses some of it

use sabine_acoustics::{Bands, ImpulseResponse};
use sabine_scene::{Levels, Receiver, Source};
use sabine_testkit::{Hidden, LabConfig, Laboratory, Truth};

/// One octave, which then reaches from 0 Hz to Nyquist: samples are pulses as they are.
pub fn one_octave(seed: u64, receivers: usize, sample_rate_hz: u32) -> Laboratory {
    let bands = Bands::octaves(1000.0, 1000.0).unwrap();
    let config = LabConfig {
        seed,
        receivers,
        sample_rate_hz,
        bands,
        levels: Levels::Absolute,
        ..LabConfig::default()
    };
    Laboratory::new(config).unwrap()
}

/// Of some rooms the one with the fewest images.
pub fn quick_room(receivers: usize) -> Laboratory {
    let images = |lab: &Laboratory| lab.truth(&[]).unwrap().duration_s.powi(3) / lab.scene().volume_m3();
    let labs = (30..50).map(|seed| one_octave(seed, receivers, 8_000));
    labs.min_by(|a, b| images(a).total_cmp(&images(b))).unwrap()
}

pub fn seven_octaves(seed: u64, receivers: usize) -> Laboratory {
    let config = LabConfig { seed, receivers, levels: Levels::Absolute, ..LabConfig::default() };
    Laboratory::new(config).unwrap()
}

/// Samples with the response's gain taken off.
pub fn samples(lab: &Laboratory, effects: &[Hidden]) -> Vec<Vec<f64>> {
    let truth = lab.truth(effects).unwrap();
    let plain = |(r, gain_db): (ImpulseResponse, f64)| {
        let gain = 10f64.powf(-gain_db / 20.0);
        r.samples().iter().map(|&s| f64::from(s) * gain).collect()
    };
    lab.responses(effects).unwrap().into_iter().zip(truth.gains_db).map(plain).collect()
}

pub fn energy(samples: &[f64]) -> f64 {
    samples.iter().map(|s| s * s).sum()
}

pub fn true_places(truth: &Truth, receiver: usize) -> (Source, Receiver) {
    let source = Source::omni("s", truth.sources[0].position_m).unwrap();
    (source, Receiver::omni("r", truth.receivers_m[receiver]).unwrap())
}

pub fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}
