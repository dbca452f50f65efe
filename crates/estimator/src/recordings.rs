//! Long recordings: how the error falls with their length, and how wide the interval of a joint estimate has to be.

use crate::calibrate::QUANTILE_90;
use crate::estimator::Estimator;
use crate::evaluation::{ClipError, Errors, summarise};
use crate::joint::{JointLabel, weigh};
use crate::labels::{LABEL_COUNT, T60_COUNT};
use crate::model::Model;
use crate::{DatasetFault, Error};
use sabine_acoustics::Signal;
use std::collections::{BTreeMap, BTreeSet};

/// A recording, and what is known of its room.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Name of the room.
    pub room: String,
    /// What was recorded.
    pub speech: Signal,
    /// Reverberation times in seconds, then levels in dB ([`label_name`](crate::label_name)); NaN where missing.
    pub labels: [f64; LABEL_COUNT],
}

/// Excerpts of one length of recordings, as a model hears them.
pub struct RecordingEvaluation<'a> {
    model: &'a Model,
    excerpts: Vec<Excerpt<'a>>,
}

struct Excerpt<'a> {
    recording: &'a Recording,
    joint: [JointLabel; LABEL_COUNT],
}

impl Excerpt<'_> {
    /// Whether the truth lies in the 90 % interval, on the network's scale.
    fn covers(&self, model: &Model, label: usize, correlation: f64) -> bool {
        let joint = &self.joint[label];
        let truth = model.labels.encode(label, self.recording.labels[label]);
        (joint.mean - truth).abs() <= QUANTILE_90 * joint.deviation(correlation)
    }
}

impl<'a> RecordingEvaluation<'a> {
    /// Cuts every recording into excerpts of `duration_s`, one after the other, and hears each by itself. Silent excerpts are
    /// left out, and so is what remains at the end.
    ///
    /// # Errors
    /// What [`Estimator::estimate_detailed`] refuses, silence excepted; [`Error::Dataset`] if nothing remains.
    pub fn new(
        estimator: &'a Estimator,
        recordings: &'a [Recording],
        duration_s: f64,
    ) -> Result<Self, Error> {
        let mut excerpts = Vec::new();
        for recording in recordings {
            let rate_hz = recording.speech.sample_rate_hz();
            let length = (duration_s * f64::from(rate_hz)).round().max(1.0) as usize;
            for samples in recording.speech.samples().chunks_exact(length) {
                let heard = match estimator.windows(&Signal::new(samples.to_vec(), rate_hz)?) {
                    Err(Error::Silent { .. }) => continue,
                    heard => heard?,
                };
                let weights = weigh(&heard);
                let joint = std::array::from_fn(|label| JointLabel::new(&heard, &weights, label));
                excerpts.push(Excerpt { recording, joint });
            }
        }
        if excerpts.is_empty() {
            let fault = DatasetFault::Rooms { partition: "recordings", found: 0, needed: 1 };
            return Err(Error::dataset("recordings", fault));
        }
        Ok(Self { model: estimator.model(), excerpts })
    }

    /// Mean number of windows in an excerpt, windows that count less counted so.
    pub fn windows(&self) -> f64 {
        self.excerpts.iter().map(|e| e.joint[0].windows).sum::<f64>() / self.excerpts.len() as f64
    }

    /// Errors of one label, or none where no recording has it.
    pub fn label(&self, label: usize) -> Option<Errors> {
        self.judge(label..label + 1)
    }

    /// Errors over the seven reverberation times, octaves with the same weight.
    pub fn t60(&self) -> Option<Errors> {
        self.judge(0..T60_COUNT)
    }

    /// Errors over the six levels.
    pub fn eq(&self) -> Option<Errors> {
        self.judge(T60_COUNT..LABEL_COUNT)
    }

    fn judge(&self, labels: std::ops::Range<usize>) -> Option<Errors> {
        let (scale, calibration) = (&self.model.labels, &self.model.calibration);
        let mut rooms: BTreeMap<&str, Vec<ClipError>> = BTreeMap::new();
        for label in labels.clone() {
            let known = self.known(label);
            let mut truths: Vec<f64> = known.iter().map(|e| e.recording.labels[label]).collect();
            truths.sort_by(f64::total_cmp);
            let Some(&median) = truths.get(truths.len() / 2) else { continue };
            let guess = scale.decode(label, 0.0, 1.0).value;
            for excerpt in known {
                let truth = excerpt.recording.labels[label];
                let value = scale.decode(label, excerpt.joint[label].mean, 1.0).value;
                rooms.entry(&excerpt.recording.room).or_default().push(ClipError {
                    model: (value - truth).abs(),
                    constant: (guess - truth).abs(),
                    best: (median - truth).abs(),
                    bias: value - truth,
                    covered: excerpt.covers(self.model, label, calibration.window_correlation[label]),
                });
            }
        }
        summarise(&rooms, labels.len())
    }

    fn known(&self, label: usize) -> Vec<&Excerpt<'a>> {
        self.excerpts.iter().filter(|e| !e.recording.labels[label].is_nan()).collect()
    }
}

impl Estimator {
    /// The model with the correlation of the errors of windows measured: for each label the least (in steps of 0.01) with
    /// which 90 % of the truths lie in the 90 % intervals of joint estimates over `durations_s`, every room with the same
    /// weight. The rooms should be neither those that the network was trained on nor those that it is tested in.
    ///
    /// # Errors
    /// As [`RecordingEvaluation::new`]; [`Error::Dataset`] where a label is known in none of the recordings.
    pub fn calibrated(&self, recordings: &[Recording], durations_s: &[f64]) -> Result<Model, Error> {
        let evaluations = durations_s
            .iter()
            .map(|duration_s| RecordingEvaluation::new(self, recordings, *duration_s))
            .collect::<Result<Vec<_>, Error>>()?;
        let mut model = self.model().clone();
        for label in 0..LABEL_COUNT {
            let known: Vec<&Excerpt<'_>> = evaluations.iter().flat_map(|e| e.known(label)).collect();
            let rooms: BTreeSet<&str> = known.iter().map(|e| e.recording.room.as_str()).collect();
            if rooms.is_empty() {
                let fault =
                    DatasetFault::NoLabels { partition: "recordings", label: crate::label_name(label) };
                return Err(Error::dataset("recordings", fault));
            }
            let coverage = |correlation: f64| {
                let mut by_room: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
                for excerpt in &known {
                    let room = by_room.entry(&excerpt.recording.room).or_default();
                    room.0 += f64::from(u8::from(excerpt.covers(&model, label, correlation)));
                    room.1 += 1.0;
                }
                by_room.values().map(|(covered, all)| covered / all).sum::<f64>() / rooms.len() as f64
            };
            let least = (0..100).map(|step| f64::from(step) / 100.0).find(|c| coverage(*c) >= 0.9);
            model.calibration.window_correlation[label] = least.unwrap_or(1.0);
        }
        Ok(model)
    }
}
