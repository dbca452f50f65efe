//! One answer from many windows.

use crate::estimator::Estimator;
use crate::evidence::Evidence;
use crate::labels::{LABEL_COUNT, T60_COUNT, label_hz, per_band};
use crate::warning::{Warning, of_sounds};
use crate::window_estimate::{DetailedEstimate, HeardWindow, WindowEstimate};
use crate::windows::Loudness;
use crate::{Error, WeightsFault};
use sabine_acoustics::RoomTargets;

/// One label joined over windows, before the correlation of their errors is taken into account.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct JointLabel {
    pub mean: f64,
    /// Variance of one window.
    pub variance: f64,
    /// Number of windows, less where some count more than others.
    pub windows: f64,
}

impl JointLabel {
    /// The mean weighted by precision and `weights`.
    pub fn new(heard: &[HeardWindow], weights: &[f64], label: usize) -> Self {
        Self::of_readings(heard.iter().zip(weights).map(|(window, weight)| {
            (window.output.mean[label], window.output.deviation[label].powi(2), *weight)
        }))
    }

    /// The same of readings, each with its variance and its weight.
    pub fn of_readings(readings: impl Iterator<Item = (f64, f64, f64)>) -> Self {
        let (mut total, mut squares, mut mean, mut variance) = (0.0, 0.0, 0.0, 0.0);
        for (value, own, weight) in readings {
            let precision = weight / own;
            total += precision;
            squares += precision * precision;
            mean += precision * value;
            variance += precision * own;
        }
        Self { mean: mean / total, variance: variance / total, windows: total * total / squares }
    }

    /// Standard deviation where the errors of windows have this correlation: the variance of one window is
    /// `correlation + (1 - correlation) / windows` of what it was.
    pub fn deviation(&self, correlation: f64) -> f64 {
        (self.variance * (correlation + (1.0 - correlation) / self.windows)).sqrt()
    }
}

/// What each window is worth beside the others: nothing without speech.
pub(crate) fn weigh(heard: &[HeardWindow]) -> Vec<f64> {
    let loudest_db = heard.iter().map(|h| h.loudness.high_db).fold(f64::NEG_INFINITY, f64::max);
    let weight = |loudness: &Loudness| if loudness.is_active(loudest_db) { loudness.weight() } else { 0.0 };
    heard.iter().map(|h| weight(&h.loudness)).collect()
}

/// Means of the cues of the windows that count.
fn mean_cues(heard: &[HeardWindow], weights: &[f64]) -> Vec<f64> {
    let count = weights.iter().filter(|w| **w > 0.0).count().max(1) as f64;
    let mut mean = vec![0.0; heard.first().map_or(0, |h| h.cues.len())];
    for (window, _) in heard.iter().zip(weights).filter(|(_, w)| **w > 0.0) {
        mean.iter_mut().zip(&window.cues).for_each(|(mean, cue)| *mean += cue / count);
    }
    mean
}

impl Estimator {
    /// Joins windows and says what may be wrong with them.
    pub(crate) fn judge(
        &self,
        heard: &[HeardWindow],
        mut warnings: Vec<Warning>,
    ) -> Result<DetailedEstimate, Error> {
        let calibration = &self.model.calibration;
        let weights = weigh(heard);
        let inactive = weights.iter().filter(|w| **w == 0.0).count();
        if inactive > 0 {
            warnings.push(Warning::Inactive { windows: inactive, of: heard.len() });
        }
        let active = || heard.iter().zip(&weights).filter(|(_, w)| **w > 0.0).map(|(heard, _)| heard);
        let range_db = active().map(|h| h.loudness.range_db).fold(f64::NEG_INFINITY, f64::max);
        if active().all(|h| h.loudness.is_noisy()) {
            warnings.push(Warning::Noisy { range_db });
        }
        let novelty = active().map(|h| h.output.novelty).sum::<f64>() / active().count().max(1) as f64;
        if novelty > calibration.novelty_limit {
            warnings.push(Warning::Unfamiliar { novelty, limit: calibration.novelty_limit });
        }
        let joint: [JointLabel; LABEL_COUNT] =
            std::array::from_fn(|label| JointLabel::new(heard, &weights, label));
        let evidence = Evidence::new(joint, mean_cues(heard, &weights));
        if let Some(detectors) = &self.model.detectors {
            // 1 kHz is the fourth octave from 125 Hz.
            let high_s = calibration.t60_range_s[3][1];
            let clipped = warnings.iter().any(|warning| matches!(warning, Warning::Clipped { .. }));
            warnings.extend(of_sounds(&detectors.heard(&evidence), clipped, high_s));
        }
        let targets = self.targets(|label| {
            (joint[label].mean, joint[label].deviation(calibration.window_correlation[label]))
        })?;
        for (band, range) in calibration.t60_range_s.iter().enumerate().take(T60_COUNT) {
            let t60_s = targets.t60_s().values()[band].value;
            if t60_s < range[0] || t60_s > range[1] {
                let band_hz = label_hz(band);
                warnings.push(Warning::EdgeOfRange { band_hz, t60_s, low_s: range[0], high_s: range[1] });
            }
        }
        let total: f64 = weights.iter().sum();
        let frame_s = self.model.layout.frame_s();
        let windows = heard
            .iter()
            .zip(&weights)
            .map(|(HeardWindow { first, output, .. }, weight)| {
                Ok(WindowEstimate {
                    start_s: *first as f64 * frame_s,
                    targets: self.targets(|label| (output.mean[label], output.deviation[label]))?,
                    weight: weight / total,
                })
            })
            .collect::<Result<_, Error>>()?;
        Ok(DetailedEstimate { targets, windows, warnings, evidence })
    }

    /// Targets from a mean and a deviation of each label on the network's scale.
    pub(crate) fn targets(&self, label: impl Fn(usize) -> (f64, f64)) -> Result<RoomTargets, Error> {
        let labels: Vec<_> = (0..LABEL_COUNT)
            .map(|k| {
                let (mean, deviation) = label(k);
                let estimate = self.model.labels.decode(k, mean, deviation);
                // Finite weights can have products that are not: such a network has no answer.
                if [mean, deviation, estimate.value, estimate.standard_error].iter().all(|v| v.is_finite()) {
                    return Ok(estimate);
                }
                let fault = WeightsFault::NotFinite { tensor: "output".into(), index: k };
                Err(Error::Weights { name: "estimate of this recording".into(), fault: Box::new(fault) })
            })
            .collect::<Result<_, Error>>()?;
        let (t60_s, eq_db) = per_band(&labels);
        Ok(RoomTargets::new(t60_s, eq_db)?)
    }
}
