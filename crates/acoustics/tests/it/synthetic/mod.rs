//! Responses whose decay is known: Gaussian noise under exponential envelopes, on a floor of Gaussian noise.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use sabine_acoustics::ImpulseResponse;

/// White noise whose power is the sum of decays `(t60_s, level_db)`, plus white noise at `noise_db`, both relative to a full
/// scale of 0.1.
pub fn decay(
    sample_rate_hz: u32,
    duration_s: f64,
    slopes: &[(f64, f64)],
    noise_db: f64,
    seed: u64,
) -> ImpulseResponse {
    let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
    let mut gaussian = || -> f64 { StandardNormal.sample(&mut rng) };
    let rate = f64::from(sample_rate_hz);
    let noise = 10f64.powf(0.05 * noise_db);
    let samples = (0..(duration_s * rate) as usize)
        .map(|i| {
            let t = i as f64 / rate;
            let power: f64 =
                slopes.iter().map(|(t60_s, level_db)| 10f64.powf(0.1 * level_db - 6.0 * t / t60_s)).sum();
            (0.1 * (power.sqrt() * gaussian() + noise * gaussian())) as f32
        })
        .collect();
    ImpulseResponse::new(samples, sample_rate_hz).unwrap()
}

/// White noise alone.
pub fn noise(sample_rate_hz: u32, duration_s: f64, seed: u64) -> ImpulseResponse {
    decay(sample_rate_hz, duration_s, &[], 0.0, seed)
}
