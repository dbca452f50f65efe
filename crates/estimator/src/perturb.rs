//! Augmentation of features: what changes in the sound changes in the labels.

use crate::labels::{EQ_COUNT, LABEL_COUNT, T60_COUNT};
use crate::layout::FeatureLayout;
use rand::Rng;
use sabine_features::{hz_to_mel, mel_to_hz};
use serde::{Deserialize, Serialize};

/// How strongly features are changed in training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PerturbConfig {
    /// Standard deviation of the gain of each octave in dB, independent of its neighbours; the labels move along.
    pub eq_db: f64,
    /// Standard deviation of the level in dB.
    pub level_db: f64,
    /// Whether the clip begins anywhere in itself.
    pub rotate: bool,
}

impl Default for PerturbConfig {
    fn default() -> Self {
        Self { eq_db: 3.0, level_db: 6.0, rotate: true }
    }
}

/// Octaves whose gains are drawn: 62.5 Hz to 8 kHz.
const OCTAVES: usize = 8;
/// The one that the others are relative to: 1 kHz.
const REFERENCE: usize = 4;

/// Draws changes and applies them.
#[derive(Clone, Debug)]
pub(crate) struct Perturb {
    config: PerturbConfig,
    /// For each mel band: the octave below its centre, and how far it is towards the next.
    position: Vec<(usize, f32)>,
    frames: usize,
}

impl Perturb {
    pub fn new(config: PerturbConfig, layout: &FeatureLayout) -> Self {
        let (low, high) = (hz_to_mel(layout.low_hz), hz_to_mel(layout.high_hz));
        let position = (0..layout.mels)
            .map(|band| {
                let centre_hz = mel_to_hz(low + (high - low) * (band + 1) as f64 / (layout.mels + 1) as f64);
                let octave = (centre_hz / 62.5).log2().clamp(0.0, (OCTAVES - 1) as f64);
                let below = (octave.floor() as usize).min(OCTAVES - 2);
                (below, (octave - below as f64) as f32)
            })
            .collect();
        Self { config, position, frames: layout.frames }
    }

    /// Changes levels in dB `[mel][frame]` and their labels in place.
    pub fn apply(&self, window_db: &mut [f32], labels: &mut [f32; LABEL_COUNT], rng: &mut impl Rng) {
        let gain: [f32; OCTAVES] = std::array::from_fn(|_| (normal(rng) * self.config.eq_db) as f32);
        let level = (normal(rng) * self.config.level_db) as f32;
        let shift = if self.config.rotate { rng.random_range(0..self.frames) } else { 0 };
        for (row, &(below, part)) in window_db.chunks_exact_mut(self.frames).zip(&self.position) {
            let change = level + gain[below] + part * (gain[below + 1] - gain[below]);
            row.rotate_left(shift);
            row.iter_mut().for_each(|v| *v += change);
        }
        let reference = octave_mean(&gain, REFERENCE);
        for (eq, label) in labels[T60_COUNT..T60_COUNT + EQ_COUNT].iter_mut().enumerate() {
            let octave = if eq < REFERENCE { eq } else { eq + 1 };
            *label += octave_mean(&gain, octave) - reference;
        }
    }
}

/// Mean over an octave of a curve in dB that is linear in log frequency between octave centres: a quarter of the octave's
/// width lies on either side of its centre's quarters, so each neighbour has an eighth of the weight.
fn octave_mean(gain: &[f32; OCTAVES], octave: usize) -> f32 {
    let left = gain[octave.saturating_sub(1)];
    let right = gain[(octave + 1).min(OCTAVES - 1)];
    0.75 * gain[octave] + 0.125 * (left + right)
}

/// Standard normal, Box and Muller.
fn normal(rng: &mut impl Rng) -> f64 {
    let u: f64 = 1.0 - rng.random::<f64>();
    let v: f64 = rng.random();
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn the_label_moves_as_far_as_the_spectrum() {
        // White features: after the change, the level of an octave is the mean over the mel bands within it.
        let layout = FeatureLayout::default();
        let config = PerturbConfig { eq_db: 4.0, level_db: 3.0, rotate: true };
        let perturb = Perturb::new(config, &layout);
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let (low, high) = (hz_to_mel(0.0), hz_to_mel(8000.0));
        let mut worst: f64 = 0.0;
        for _ in 0..200 {
            let mut window = vec![-40.0; layout.mels * layout.frames];
            let mut labels = [0.0; LABEL_COUNT];
            perturb.apply(&mut window, &mut labels, &mut rng);
            let octave = |hz: f64| {
                let inside: Vec<f64> = (0..layout.mels)
                    .filter(|b| {
                        let centre = mel_to_hz(low + (high - low) * (*b + 1) as f64 / 33.0);
                        (centre / hz).log2().abs() < 0.5
                    })
                    .map(|b| f64::from(window[b * layout.frames]))
                    .collect();
                inside.iter().sum::<f64>() / inside.len() as f64
            };
            // 2 kHz and 4 kHz hold seven mel bands each: enough to read a mean.
            for (label, hz) in [(4, 2000.0), (5, 4000.0)] {
                let expected = octave(hz) - octave(1000.0);
                worst = worst.max((f64::from(labels[T60_COUNT + label]) - expected).abs());
            }
            assert!(labels[..T60_COUNT].iter().all(|t| *t == 0.0));
        }
        // The mel bands sample the piecewise linear curve at six to eight points of an octave: within a tenth of the
        // steepest change from octave to octave (about four standard deviations, 16 dB).
        assert!(worst < 1.6, "{worst} dB");
    }
}
