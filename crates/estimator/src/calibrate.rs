//! Errors by room, and how wide an interval has to be.

use crate::Error;
use crate::config::NetworkConfig;
use crate::dataset::{Dataset, Partition};
use crate::labels::{LABEL_COUNT, T60_COUNT};
use crate::model::{Calibration, Model};
use crate::network::{Network, Scratch, spectrum};
use crate::parameters::Parameters;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// 90 % quantile of the magnitude of a standard normal variable.
pub(crate) const QUANTILE_90: f64 = 1.644_853_626_951_472_7;

impl Calibration {
    /// Claims nothing: unit deviations, full correlation, no limits.
    pub(crate) fn uncalibrated(mels: usize) -> Self {
        Self {
            deviation: vec![1.0; LABEL_COUNT],
            window_correlation: vec![1.0; LABEL_COUNT],
            t60_range_s: vec![[0.01, 100.0]; T60_COUNT],
            statistic_mean: vec![0.0; 2 * mels],
            statistic_deviation: vec![1.0; 2 * mels],
            novelty_limit: 1e6,
        }
    }
}

/// What the network says of a clip, on its own scale.
#[derive(Clone, Debug)]
pub(crate) struct Heard {
    pub clip: usize,
    pub outputs: Vec<f32>,
    /// Mean and deviation over time of each mel band.
    pub statistics: Vec<f32>,
}

/// Hears clips on all threads.
pub(crate) fn hear_all(model: &Model, dataset: &Dataset, clips: &[usize]) -> Result<Vec<Heard>, Error> {
    let network = Network::new(&model.parameters);
    let NetworkConfig { frames, .. } = *network.config();
    clips
        .par_iter()
        .map_init(
            || (Vec::new(), Scratch::default()),
            |(window, scratch), &clip| {
                dataset.read(clip, window)?;
                model.normalisation.apply(window);
                let mut statistics = Vec::new();
                spectrum(window, frames, &mut statistics);
                Ok(Heard { clip, outputs: network.infer_with_scratch(window, scratch), statistics })
            },
        )
        .collect()
}

/// Errors of a model, each the mean over rooms of the mean over the room's clips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Score {
    /// Mean over labels of the absolute error relative to that of the constant guess.
    pub relative: f64,
    /// Mean absolute error of T60 over octaves, in seconds.
    pub t60_s: f64,
    /// The same of EQ, in dB.
    pub eq_db: f64,
}

pub(crate) fn score(model: &Model, dataset: &Dataset, clips: &[usize]) -> Result<Score, Error> {
    let heard = hear_all(model, dataset, clips)?;
    // (error, error of the guess, count) by room and label.
    let mut rooms: BTreeMap<i64, Vec<[f64; 3]>> = BTreeMap::new();
    for heard in &heard {
        let clip = &dataset.clips()[heard.clip];
        let sums = rooms.entry(clip.room).or_insert_with(|| vec![[0.0; 3]; LABEL_COUNT]);
        for (k, sum) in sums.iter_mut().enumerate() {
            let truth = f64::from(clip.labels[k]);
            if !truth.is_nan() {
                let guess = model.labels.decode(k, 0.0, 1.0).value;
                let value = model.labels.decode(k, f64::from(heard.outputs[k]), 1.0).value;
                sum[0] += (value - truth).abs();
                sum[1] += (guess - truth).abs();
                sum[2] += 1.0;
            }
        }
    }
    let mut errors = Vec::new();
    for k in 0..LABEL_COUNT {
        let means: Vec<(f64, f64)> = rooms
            .values()
            .filter(|r| r[k][2] > 0.0)
            .map(|r| (r[k][0] / r[k][2], r[k][1] / r[k][2]))
            .collect();
        let n = means.len() as f64;
        if !means.is_empty() {
            let (ours, guess) = means.iter().fold((0.0, 0.0), |sum, m| (sum.0 + m.0 / n, sum.1 + m.1 / n));
            errors.push((k, ours, guess));
        }
    }
    let average = |of: &dyn Fn(&(usize, f64, f64)) -> bool, f: &dyn Fn(&(usize, f64, f64)) -> f64| {
        let chosen: Vec<f64> = errors.iter().filter(|e| of(e)).map(f).collect();
        chosen.iter().sum::<f64>() / chosen.len() as f64
    };
    Ok(Score {
        relative: average(&|_| true, &|e| e.1 / e.2),
        t60_s: average(&|e| e.0 < T60_COUNT, &|e| e.1),
        eq_db: average(&|e| e.0 >= T60_COUNT, &|e| e.1),
    })
}

/// Draws each label towards the mean of the training labels, and removes its bias, as far as the validation rooms ask for
/// (a line by least squares, each room with the same weight; its slope is 0 to 1). A network that knows its training voices
/// by heart makes too much of what it hears in others, of the equalisation above all. The lines go into the output layer.
pub(crate) fn shrink(model: &Model, dataset: &Dataset) -> Result<Parameters, Error> {
    let validation = hear_all(model, dataset, dataset.partition(Partition::Validation))?;
    let counts = clips_by_room(&validation, dataset);
    let mut tensors = model.parameters.tensors().clone();
    for k in 0..LABEL_COUNT {
        let points = validation.iter().filter_map(|heard| {
            let clip = &dataset.clips()[heard.clip];
            let truth = model.labels.encode(k, f64::from(clip.labels[k]));
            (!truth.is_nan()).then(|| (f64::from(heard.outputs[k]), truth, 1.0 / counts[&clip.room]))
        });
        let (slope, offset) = line(points);
        if let Some(weights) = tensors.get_mut("output.weight") {
            let inputs = weights.len() / model.parameters.config().outputs;
            weights[k * inputs..(k + 1) * inputs].iter_mut().for_each(|w| *w *= slope as f32);
        }
        if let Some(bias) = tensors.get_mut("output.bias") {
            bias[k] = (f64::from(bias[k]) * slope + offset) as f32;
        }
    }
    Parameters::new(model.parameters.config().clone(), tensors)
}

/// Slope, 0 to 1, and offset of the line through (value, truth, weight) with the least squares; 1 and 0 without points.
fn line(points: impl Iterator<Item = (f64, f64, f64)>) -> (f64, f64) {
    let (mut n, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (value, truth, weight) in points {
        n += weight;
        x += weight * value;
        y += weight * truth;
        xx += weight * value * value;
        xy += weight * value * truth;
    }
    if n == 0.0 {
        return (1.0, 0.0);
    }
    let variance = xx - x * x / n;
    let slope = if variance > 0.0 { ((xy - x * y / n) / variance).clamp(0.0, 1.0) } else { 1.0 };
    (slope, (y - slope * x) / n)
}

fn clips_by_room(heard: &[Heard], dataset: &Dataset) -> BTreeMap<i64, f64> {
    let mut counts = BTreeMap::new();
    for heard in heard {
        *counts.entry(dataset.clips()[heard.clip].room).or_insert(0.0) += 1.0;
    }
    counts
}

/// Widens or narrows the deviations until 90 % of the validation clips lie within their 90 % intervals (each room with the
/// same weight), and notes what the training set was like.
pub(crate) fn calibrate(model: &Model, dataset: &Dataset) -> Result<Calibration, Error> {
    let mut calibration = Calibration::uncalibrated(model.layout.mels);
    let validation = hear_all(model, dataset, dataset.partition(Partition::Validation))?;
    let counts = clips_by_room(&validation, dataset);
    for k in 0..LABEL_COUNT {
        let ratios: Vec<(f64, f64)> = validation
            .iter()
            .filter_map(|heard| {
                let clip = &dataset.clips()[heard.clip];
                let truth = model.labels.encode(k, f64::from(clip.labels[k]));
                let learned = if model.learned_variance() {
                    (0.5 * f64::from(heard.outputs[LABEL_COUNT + k])).exp()
                } else {
                    1.0
                };
                let ratio = (f64::from(heard.outputs[k]) - truth).abs() / learned;
                (!truth.is_nan()).then(|| (ratio, 1.0 / counts[&clip.room]))
            })
            .collect();
        if let Some(quantile) = weighted_quantile(ratios, 0.9) {
            calibration.deviation[k] = (quantile / QUANTILE_90).max(1e-6);
        }
    }
    let train = dataset.partition(Partition::Train);
    for k in 0..T60_COUNT {
        let values = train.iter().map(|&c| f64::from(dataset.clips()[c].labels[k])).filter(|v| !v.is_nan());
        let values: Vec<(f64, f64)> = values.map(|v| (v, 1.0)).collect();
        if let (Some(low), Some(high)) =
            (weighted_quantile(values.clone(), 0.01), weighted_quantile(values, 0.99))
        {
            calibration.t60_range_s[k] = [low, high];
        }
    }
    let sample: Vec<usize> = train.iter().copied().step_by(train.len().div_ceil(4096)).collect();
    let heard = hear_all(model, dataset, &sample)?;
    let n = heard.len() as f64;
    for i in 0..2 * model.layout.mels {
        let mean = heard.iter().map(|h| f64::from(h.statistics[i])).sum::<f64>() / n;
        let variance = heard.iter().map(|h| (f64::from(h.statistics[i]) - mean).powi(2)).sum::<f64>() / n;
        calibration.statistic_mean[i] = mean;
        calibration.statistic_deviation[i] = variance.sqrt().max(1e-3);
    }
    let novelty: Vec<(f64, f64)> =
        validation.iter().map(|h| (calibration.novelty(&h.statistics), 1.0)).collect();
    if let Some(limit) = weighted_quantile(novelty, 0.995) {
        calibration.novelty_limit = limit;
    }
    Ok(calibration)
}

impl Calibration {
    /// Root-mean-square of the standardised long-term statistics of a window.
    pub(crate) fn novelty(&self, statistics: &[f32]) -> f64 {
        let squares = statistics
            .iter()
            .zip(self.statistic_mean.iter().zip(&self.statistic_deviation))
            .map(|(v, (mean, deviation))| ((f64::from(*v) - mean) / deviation).powi(2));
        (squares.sum::<f64>() / statistics.len() as f64).sqrt()
    }
}

/// The value below which a share of the weight lies.
pub(crate) fn weighted_quantile(mut values: Vec<(f64, f64)>, share: f64) -> Option<f64> {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = values.iter().map(|v| v.1).sum();
    let mut below = 0.0;
    for (value, weight) in &values {
        below += weight;
        if below >= share * total {
            return Some(*value);
        }
    }
    values.last().map(|v| v.0)
}

#[cfg(test)]
mod tests {
    use super::line;

    #[test]
    fn a_line_is_found_and_never_steeper_than_one() {
        let points = |slope: f64| {
            (0..10).map(move |i| (f64::from(i), slope * f64::from(i) - 0.5, f64::from(1 + i % 2)))
        };
        let (slope, offset) = line(points(0.6));
        assert!((slope - 0.6).abs() < 1e-12 && (offset + 0.5).abs() < 1e-12);
        // Twice as steep as allowed: the offset meets the mean of the points (their values weighted).
        let mean = (0..10).map(|i| f64::from(i * (1 + i % 2))).sum::<f64>() / 15.0;
        let (slope, offset) = line(points(2.0));
        assert!(slope == 1.0 && (offset - (mean - 0.5)).abs() < 1e-12);
        assert_eq!(line(std::iter::empty()), (1.0, 0.0));
    }
}
