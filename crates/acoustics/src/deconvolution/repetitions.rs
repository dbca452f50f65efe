//! Repetitions of a sweep: compared, and averaged.

use super::DeconvolutionConfig;
use crate::correlation::Correlation;
use crate::sweep::ExponentialSweep;
use crate::sweep_error::SweepError;

/// What of the responses is compared in time, around the largest sample, in seconds.
const BEFORE_S: f64 = 0.005;
const AFTER_S: f64 = 0.03;
/// Largest shift from one repetition to the next that is searched, in seconds.
const REACH_S: f64 = 0.005;
/// Largest shift from the first to the last repetition, in samples: their mean loses 0.1 dB at two thirds of half the sample
/// rate.
const LARGEST_SHIFT: f64 = 0.25;
/// How far the difference of a repetition from the others may lie above that of the others from each other, in dB.
const LARGEST_EXCESS_DB: f64 = 6.0;
/// Differences this far below the response's energy are none: rounding.
const ROUNDING: f64 = 1e-8;
/// Of two repetitions neither is known to be right. They may differ by this share of the energy, -20 dB, less the excess: in a
/// quiet room it is less than -30 dB, and with more noise than that there is little to read.
const PAIR_SHARE: f64 = 2.5e-3;

/// What the repetitions of a sweep say of each other.
pub(super) struct Repetitions {
    pub(super) differences_db: Vec<f64>,
    pub(super) left_out: Vec<usize>,
    pub(super) clock_drift_ppm: Option<f64>,
}

impl Repetitions {
    /// Compares the responses of all repetitions.
    ///
    /// # Errors
    /// [`SweepError::ClockDrift`], [`SweepError::RepetitionDiffers`].
    pub(super) fn judge(
        responses: &[Vec<f64>],
        sweep: &ExponentialSweep,
        config: &DeconvolutionConfig,
    ) -> Result<Self, SweepError> {
        let count = responses.len();
        if count == 1 {
            return Ok(Self { differences_db: Vec::new(), left_out: Vec::new(), clock_drift_ppm: None });
        }
        let rate = f64::from(sweep.config().sample_rate_hz);
        let shift = median_shift(responses, rate);
        let ppm = 1e6 * shift / sweep.period() as f64;
        if (shift * (count - 1) as f64).abs() > LARGEST_SHIFT && !config.allow_clock_drift {
            return Err(SweepError::ClockDrift { ppm });
        }
        let energy = |samples: &[f64]| samples.iter().map(|x| x * x).sum::<f64>();
        let energies: Vec<f64> = responses.iter().map(|r| energy(r)).collect();
        let whole = median(&energies).max(f64::MIN_POSITIVE);
        let differences = differences(responses);
        let usual = if count == 2 { PAIR_SHARE * whole } else { median(&differences) };
        let excess_db = |k: usize| 10.0 * (differences[k] / usual.max(ROUNDING * whole)).log10();
        let left_out: Vec<usize> = (0..count).filter(|&k| excess_db(k) > LARGEST_EXCESS_DB).collect();
        if let Some(&repetition) = left_out.first() {
            let few = count - left_out.len() < 2;
            if few || !config.leave_out_differing {
                let worst = left_out.iter().copied().max_by(|&a, &b| excess_db(a).total_cmp(&excess_db(b)));
                let repetition = worst.unwrap_or(repetition);
                return Err(SweepError::RepetitionDiffers { repetition, excess_db: excess_db(repetition) });
            }
        }
        let differences_db =
            differences.iter().map(|d| 10.0 * (d.max(f64::MIN_POSITIVE) / whole).log10()).collect();
        Ok(Self { differences_db, left_out, clock_drift_ppm: Some(ppm) })
    }

    /// The mean of the repetitions that were not left out.
    pub(super) fn mean(&self, responses: &[Vec<f64>]) -> Vec<f32> {
        let kept: Vec<&Vec<f64>> = responses
            .iter()
            .enumerate()
            .filter(|(k, _)| !self.left_out.contains(k))
            .map(|(_, response)| response)
            .collect();
        (0..responses[0].len())
            .map(|i| (kept.iter().map(|r| r[i]).sum::<f64>() / kept.len() as f64) as f32)
            .collect()
    }
}

/// Energy of the difference of each response from the one most like it.
fn differences(responses: &[Vec<f64>]) -> Vec<f64> {
    let between = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    (0..responses.len())
        .map(|k| {
            let others = (0..responses.len()).filter(|&j| j != k);
            others.map(|j| between(&responses[k], &responses[j])).fold(f64::INFINITY, f64::min)
        })
        .collect()
}

/// Samples by which each repetition comes later than the one before it, the median: one that differs does not count.
fn median_shift(responses: &[Vec<f64>], rate: f64) -> f64 {
    let first = &responses[0];
    let magnitude = |i: &usize| first[*i].abs();
    let peak = (0..first.len()).max_by(|a, b| magnitude(a).total_cmp(&magnitude(b))).unwrap_or(0);
    let samples_in = |seconds: f64| (seconds * rate) as usize;
    let range = peak.saturating_sub(samples_in(BEFORE_S))..(peak + samples_in(AFTER_S)).min(first.len());
    let shifts: Vec<f64> = responses
        .windows(2)
        .map(|pair| {
            Correlation::new(&pair[0], &pair[1], range.clone(), REACH_S * rate)
                .points()
                .fold((0.0, f64::NEG_INFINITY), |best, point| if point.1 > best.1 { point } else { best })
                .0
        })
        .collect();
    median(&shifts)
}

/// The middle value, the lower one of two.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[(sorted.len() - 1) / 2]
}
