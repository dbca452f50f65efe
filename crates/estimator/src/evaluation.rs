//! How far off a model is in rooms that it has not heard, beside guesses that do not listen.

use crate::calibrate::{Heard, QUANTILE_90, hear_all};
use crate::dataset::{Clip, Dataset, Partition};
use crate::labels::{LABEL_COUNT, T60_COUNT};
use crate::model::Model;
use crate::{DatasetFault, Error};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::collections::BTreeMap;

/// Bootstrap samples of an interval.
const RESAMPLES: usize = 2000;

/// A mean over rooms, and its 95 % bootstrap interval over rooms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoomMean {
    /// The mean.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// Mean absolute errors, in seconds or dB, each first over the clips of a room and then over rooms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Of the model.
    pub model: RoomMean,
    /// Of the mean of the training labels.
    pub constant: RoomMean,
    /// Of the median of the very labels that are to be estimated: no constant does better, and nobody knows it beforehand.
    pub best_constant: RoomMean,
    /// Of the model minus the constant's: below zero throughout the interval if the model is better.
    pub gain: RoomMean,
    /// Mean of estimate minus truth.
    pub bias: RoomMean,
    /// Share of the clips whose truth lies in the 90 % interval of the estimate.
    pub coverage_90: f64,
    /// Clips that have the label.
    pub clips: usize,
}

/// Which clips are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// The partition.
    pub partition: Partition,
    /// Whether measured rooms only.
    pub measured: bool,
    /// Range of the signal-to-noise ratio in dB, upper end excluded.
    pub snr_db: [f64; 2],
    /// Range of the true T60 at 1 kHz in seconds, upper end excluded.
    pub t60_s: [f64; 2],
}

impl Selection {
    /// All clips of a partition.
    pub fn all(partition: Partition) -> Self {
        let anything = [f64::NEG_INFINITY, f64::INFINITY];
        Self { partition, measured: false, snr_db: anything, t60_s: anything }
    }

    fn holds(&self, dataset: &Dataset, clip: &Clip) -> bool {
        let within = |value: f32, range: [f64; 2]| {
            let open = range[0] == f64::NEG_INFINITY && range[1] == f64::INFINITY;
            open || (f64::from(value) >= range[0] && f64::from(value) < range[1])
        };
        clip.partition == self.partition
            && (!self.measured || dataset.is_measured(clip.room))
            && within(clip.snr_db, self.snr_db)
            && within(clip.labels[3], self.t60_s)
    }
}

/// The answers of a model to all clips of a partition, ready to be judged in any selection.
pub struct Evaluation<'a> {
    model: &'a Model,
    dataset: &'a Dataset,
    heard: Vec<Heard>,
}

/// Errors of one clip in one label.
#[derive(Clone, Copy, Default)]
pub(crate) struct ClipError {
    pub model: f64,
    pub constant: f64,
    pub best: f64,
    pub bias: f64,
    pub covered: bool,
}

/// Errors by room of so many labels.
pub(crate) fn summarise<K>(rooms: &BTreeMap<K, Vec<ClipError>>, labels: usize) -> Option<Errors> {
    let count: usize = rooms.values().map(Vec::len).sum();
    if count == 0 {
        return None;
    }
    let mean = |f: &dyn Fn(&ClipError) -> f64| {
        let means: Vec<f64> = rooms.values().map(|r| r.iter().map(f).sum::<f64>() / r.len() as f64).collect();
        bootstrap(&means)
    };
    let covered = rooms.values().flatten().filter(|e| e.covered).count();
    Some(Errors {
        model: mean(&|e| e.model),
        constant: mean(&|e| e.constant),
        best_constant: mean(&|e| e.best),
        gain: mean(&|e| e.model - e.constant),
        bias: mean(&|e| e.bias),
        coverage_90: covered as f64 / count as f64,
        clips: count / labels.max(1),
    })
}

impl<'a> Evaluation<'a> {
    /// Hears every clip of a partition.
    ///
    /// # Errors
    /// [`Error::Dataset`] if there is none, [`Error::Io`].
    pub fn new(model: &'a Model, dataset: &'a Dataset, partition: Partition) -> Result<Self, Error> {
        let clips = dataset.partition(partition);
        if clips.is_empty() {
            let fault = DatasetFault::Rooms { partition: partition.name(), found: 0, needed: 1 };
            return Err(Error::dataset("data set", fault));
        }
        Ok(Self { model, dataset, heard: hear_all(model, dataset, clips)? })
    }

    /// Errors of one label, or none where no selected clip has it.
    pub fn label(&self, label: usize, selection: &Selection) -> Option<Errors> {
        self.judge(&[label], selection)
    }

    /// Errors over the seven reverberation times, octaves with the same weight.
    pub fn t60(&self, selection: &Selection) -> Option<Errors> {
        self.judge(&(0..T60_COUNT).collect::<Vec<_>>(), selection)
    }

    /// Errors over the six levels.
    pub fn eq(&self, selection: &Selection) -> Option<Errors> {
        self.judge(&(T60_COUNT..LABEL_COUNT).collect::<Vec<_>>(), selection)
    }

    /// Rooms of a selection with their number of clips.
    pub fn rooms(&self, selection: &Selection) -> BTreeMap<String, usize> {
        let mut rooms = BTreeMap::new();
        for heard in &self.heard {
            let clip = &self.dataset.clips()[heard.clip];
            if selection.holds(self.dataset, clip) {
                let name =
                    self.dataset.room_name(clip.room).map_or_else(|| clip.room.to_string(), str::to_owned);
                *rooms.entry(name).or_insert(0) += 1;
            }
        }
        rooms
    }

    fn judge(&self, labels: &[usize], selection: &Selection) -> Option<Errors> {
        let mut rooms: BTreeMap<i64, Vec<ClipError>> = BTreeMap::new();
        for &label in labels {
            for (room, error) in self.errors(label, selection) {
                rooms.entry(room).or_default().push(error);
            }
        }
        summarise(&rooms, labels.len())
    }

    fn errors(&self, label: usize, selection: &Selection) -> Vec<(i64, ClipError)> {
        let model = self.model;
        let guess = model.labels.decode(label, 0.0, 1.0).value;
        let chosen: Vec<(&Heard, &Clip, f64)> = self
            .heard
            .iter()
            .map(|heard| (heard, &self.dataset.clips()[heard.clip]))
            .filter(|(_, clip)| selection.holds(self.dataset, clip))
            .map(|(heard, clip)| (heard, clip, f64::from(clip.labels[label])))
            .filter(|(_, _, truth)| !truth.is_nan())
            .collect();
        let mut truths: Vec<f64> = chosen.iter().map(|c| c.2).collect();
        truths.sort_by(f64::total_cmp);
        let Some(&median) = truths.get(truths.len() / 2) else { return Vec::new() };
        let one = |(heard, clip, truth): (&Heard, &Clip, f64)| {
            let output = f64::from(heard.outputs[label]);
            let learned = if model.learned_variance() {
                (0.5 * f64::from(heard.outputs[LABEL_COUNT + label])).exp()
            } else {
                1.0
            };
            let deviation = learned * model.calibration.deviation[label];
            let value = model.labels.decode(label, output, deviation).value;
            let error = ClipError {
                model: (value - truth).abs(),
                constant: (guess - truth).abs(),
                best: (median - truth).abs(),
                bias: value - truth,
                covered: (output - model.labels.encode(label, truth)).abs() <= QUANTILE_90 * deviation,
            };
            (clip.room, error)
        };
        chosen.into_iter().map(one).collect()
    }
}

/// Mean of the values and its percentile bootstrap interval, always with the same resamples.
fn bootstrap(values: &[f64]) -> RoomMean {
    let n = values.len();
    let value = values.iter().sum::<f64>() / n as f64;
    let mut rng = Pcg64Mcg::seed_from_u64(95);
    let mut means: Vec<f64> = (0..RESAMPLES)
        .map(|_| (0..n).map(|_| values[rng.random_range(0..n)]).sum::<f64>() / n as f64)
        .collect();
    means.sort_by(f64::total_cmp);
    let at = |share: f64| means[((RESAMPLES - 1) as f64 * share).round() as usize];
    RoomMean { value, low: at(0.025), high: at(0.975) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bootstrap_interval_is_that_of_the_standard_error() {
        // 400 values evenly over 0..1: deviation 1/sqrt(12), standard error 1/sqrt(12 * 400).
        let values: Vec<f64> = (0..400).map(|i| (f64::from(i) + 0.5) / 400.0).collect();
        let found = bootstrap(&values);
        let half = 1.96 / (12.0f64 * 400.0).sqrt();
        assert!((found.value - 0.5).abs() < 1e-12);
        // 2000 resamples place each end within about 5 % of the half width (one standard error), 4 of them allowed.
        assert!((found.high - 0.5 - half).abs() < 0.2 * half, "{found:?}");
        assert!((0.5 - found.low - half).abs() < 0.2 * half, "{found:?}");
    }
}
