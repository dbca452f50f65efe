//! Responses and speech with known properties, for tests.
#![allow(dead_code)] // each test file takes what it needs

use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use sabine_acoustics::{ImpulseResponse, Signal};
use std::path::PathBuf;

/// A direct sound of amplitude one at sample 100, then Gaussian noise that decays by 60 dB in `t60_s`, 20 dB below it at
/// first, over a floor `floor_db` below the direct sound.
pub fn response(t60_s: f64, length_s: f64, floor_db: f64, rate_hz: u32, seed: u64) -> ImpulseResponse {
    let mut rng = Pcg64::seed_from_u64(seed);
    let rate = f64::from(rate_hz);
    let floor = 10f64.powf(-floor_db / 20.0);
    let samples = (0..(length_s * rate) as usize)
        .map(|i| {
            let t = (i as f64 - 100.0) / rate;
            let late: f64 = StandardNormal.sample(&mut rng);
            let noise: f64 = StandardNormal.sample(&mut rng);
            let decay = if t > 0.0 { 0.1 * 10f64.powf(-3.0 * t / t60_s) } else { 0.0 };
            let direct = if i == 100 { 1.0 } else { 0.0 };
            (direct + decay * late + floor * noise) as f32
        })
        .collect();
    ImpulseResponse::new(samples, rate_hz).unwrap()
}

/// Something like speech: syllables of a buzz, four a second, with pauses.
pub fn speech(seconds: f64, pitch_hz: f64, seed: u64) -> Signal {
    let mut rng = Pcg64::seed_from_u64(seed);
    let samples = (0..(seconds * 16e3) as usize)
        .map(|i| {
            let t = i as f64 / 16e3;
            let syllable = (std::f64::consts::TAU * 4.0 * t).sin().max(0.0);
            let buzz: f64 = (1..20)
                .map(|k| (std::f64::consts::TAU * pitch_hz * f64::from(k) * t).sin() / f64::from(k))
                .sum();
            (0.1 * syllable * (buzz + 0.1 * rng.random_range(-1.0..1.0))) as f32
        })
        .collect();
    Signal::new(samples, 16_000).unwrap()
}

/// The shared data, if it is there.
pub fn shared_data() -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    if path.is_dir() {
        Some(path)
    } else {
        eprintln!("skipped: {} is not there", path.display());
        None
    }
}

/// The value below which a share of the values lies.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}
