//! Sound that stands for speech.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::Signal;

/// Bursts of noise, every half second or so, through an exponential decay: speech enough for a test of the machinery.
pub fn bursts(seconds: f64, t60_s: f64, rate_hz: u32, seed: u64) -> Signal {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let rate = f64::from(rate_hz);
    let fall = (-6.9078 / (t60_s * rate)).exp();
    let (mut level, mut left) = (0.0f64, 0usize);
    let samples = (0..(seconds * rate) as usize)
        .map(|_| {
            if left == 0 {
                left = (rng.random_range(0.2..0.7) * rate) as usize;
                level = rng.random_range(0.1..0.5);
            }
            left -= 1;
            level *= fall;
            (level * rng.random_range(-1.0..1.0)) as f32 + rng.random_range(-1e-4f32..1e-4)
        })
        .collect();
    Signal::new(samples, rate_hz).expect("finite samples")
}
