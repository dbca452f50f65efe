//! The decay in a box of mirrors, averaged over directions.

use super::truth::{Medium, Truth};
use std::f64::consts::TAU;

/// Time step in seconds.
const STEP_S: f64 = 1e-3;
/// Directions in an octant.
const DIRECTIONS: usize = 512;
/// A band that has fallen by this much has no say, in dB.
const SILENT_DB: f64 = 85.0;

/// Mean share of energy that the walls have left to images of an age, by band.
///
/// A path with direction cosines n meets the walls of axis a once every L_a / (c |n_a|), the two in turn. What is left after a time
/// is the mean over the sphere of exp(-c t sum_a |n_a| k_a / L_a), k_a = -ln sqrt(R R'). It is smooth where the images
/// themselves are not.
pub(crate) struct BoxDecay {
    bands: usize,
    /// `[step][band]`.
    left: Vec<f64>,
}

impl BoxDecay {
    pub(crate) fn new(truth: &Truth, medium: &Medium, duration_s: f64) -> Self {
        let mirrored = truth.log_mirrored();
        let bands = mirrored.len();
        let steps = (duration_s / STEP_S).ceil() as usize + 2;
        let mut left = vec![0.0; steps * bands];
        for d in 0..DIRECTIONS {
            // A spiral of equal areas; the octant is a quarter of the upper half.
            let z = (d as f64 + 0.5) / DIRECTIONS as f64;
            let azimuth = 0.25 * TAU * ((d as f64 * 0.618_033_988_749_894_9) % 1.0);
            let flat = (1.0 - z * z).sqrt();
            let n = [flat * azimuth.cos(), flat * azimuth.sin(), z];
            for (band, logs) in mirrored.iter().enumerate() {
                let rate: f64 =
                    (0..3).map(|a| 0.5 * n[a] / truth.size_m[a] * (logs[2 * a] + logs[2 * a + 1])).sum();
                let factor = (rate * medium.speed_m_s * STEP_S).exp();
                let mut value = 1.0 / DIRECTIONS as f64;
                for step in 0..steps {
                    left[step * bands + band] += value;
                    value *= factor;
                }
            }
        }
        Self { bands, left }
    }

    /// One over what the walls have left in each band, step by step; 0 where nothing is heard any more, or there is no band.
    pub(crate) fn weights<const LANES: usize>(&self, medium: &Medium) -> Weights<LANES> {
        let silent = 10f64.powf(-0.1 * SILENT_DB);
        let step = |(step, left): (usize, &[f64])| {
            let mut weights = [0.0; LANES];
            let length_m = step as f64 * STEP_S * medium.speed_m_s;
            for (band, weight) in weights.iter_mut().enumerate().take(self.bands) {
                let heard = left[band] * (-medium.exponents_per_m[band] * length_m).exp() > silent;
                *weight = if heard { 1.0 / left[band] } else { 0.0 };
            }
            weights
        };
        Weights { steps: self.left.chunks(self.bands).enumerate().map(step).collect() }
    }

    /// When what is still to come has fallen by a level, in each band, the air included; at most the duration covered.
    pub(crate) fn fallen_s(&self, medium: &Medium, by_db: f64) -> Vec<f64> {
        let steps = self.left.len() / self.bands;
        let fallen = |band: usize| {
            let energy = |step: usize| {
                let length_m = step as f64 * STEP_S * medium.speed_m_s;
                self.left[step * self.bands + band] * (-medium.exponents_per_m[band] * length_m).exp()
            };
            let limit = (0..steps).map(energy).sum::<f64>() * 10f64.powf(-0.1 * by_db);
            let mut rest = 0.0;
            let latest = (0..steps).rev().find(|&step| {
                rest += energy(step);
                rest > limit
            });
            latest.unwrap_or(0) as f64 * STEP_S
        };
        (0..self.bands).map(fallen).collect()
    }

    /// When all bands have.
    pub(crate) fn all_fallen_s(&self, medium: &Medium, by_db: f64) -> f64 {
        self.fallen_s(medium, by_db).into_iter().fold(0.0, f64::max)
    }
}

/// What a share of energy is worth, against the mean of its age.
pub(crate) struct Weights<const LANES: usize> {
    steps: Vec<[f64; LANES]>,
}

impl<const LANES: usize> Weights<LANES> {
    pub(crate) fn at(&self, time_s: f64) -> &[f64; LANES] {
        &self.steps[((time_s / STEP_S) as usize).min(self.steps.len() - 1)]
    }
}

#[cfg(test)]
mod tests {
    use crate::{LabConfig, Laboratory, ShoeboxImages};
    use sabine_acoustics::Bands;
    use sabine_scene::{Receiver, Source};

    /// Images between two ages, counted one by one.
    #[test]
    fn walls_leave_to_images_what_the_mean_over_directions_says() {
        let bands = Bands::octaves(1000.0, 1000.0).unwrap();
        let config = LabConfig { seed: 3, receivers: 1, sample_rate_hz: 8000, bands, ..LabConfig::default() };
        let lab = Laboratory::new(config).unwrap();
        let (truth, scene) = (lab.truth(&[]).unwrap(), lab.true_scene(&[]).unwrap());
        let medium = truth.medium().unwrap();
        let decay = super::BoxDecay::new(&truth, &medium, 0.5);
        let source = Source::omni("s", truth.sources[0].position_m).unwrap();
        let receiver = Receiver::omni("r", truth.receivers_m[0]).unwrap();
        let air = truth.air().unwrap();
        let images = ShoeboxImages::new(0.31).unwrap().images(&scene, &source, &receiver, &air).unwrap();
        for from_s in [0.1, 0.2, 0.3] {
            let to_s = from_s + 0.01;
            let shell: Vec<f64> = images
                .iter()
                .filter(|i| (from_s..to_s).contains(&(i.length_m / medium.speed_m_s)))
                .map(|i| {
                    let left =
                        |(&n, m): (&u32, usize)| (1.0 - truth.materials[m].absorption[0]).powi(n as i32);
                    i.hits.iter().zip(truth.faces).map(left).product()
                })
                .collect();
            let mean = shell.iter().sum::<f64>() / shell.len() as f64;
            let expected = decay.left[((from_s + 0.005) / super::STEP_S) as usize];
            assert!(shell.len() > 1000, "{} images", shell.len());
            assert!((mean / expected - 1.0).abs() < 0.08, "{from_s} s: {mean} for {expected}");
        }
    }
}
