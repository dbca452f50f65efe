//! A file of clips.

use crate::error::Error;
use crate::labels::Labels;
use half::f16;
use sabine_acoustics::{Estimate, NoReading, Reading};
use safetensors::tensor::{Dtype, TensorView};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Octaves of the reverberation time, 125 Hz to 8 kHz.
pub(crate) const T60_BANDS: usize = 7;
/// Octaves of the equalisation, 62.5 Hz to 4 kHz without 1 kHz, where it is 0 by definition.
pub(crate) const EQ_BANDS: usize = 6;

/// Clips on their way into a file.
#[derive(Debug, Default)]
pub(crate) struct ShardContent {
    pub(crate) clips: usize,
    pub(crate) features: Vec<f16>,
    pub(crate) t60_s: Vec<f32>,
    pub(crate) eq_db: Vec<f32>,
    pub(crate) snr_db: Vec<f32>,
    pub(crate) drr_db: Vec<f32>,
    pub(crate) room: Vec<i64>,
    pub(crate) speaker: Vec<i64>,
    pub(crate) statistics: LabelStatistics,
}

impl ShardContent {
    /// Adds what follows.
    pub(crate) fn append(&mut self, mut other: Self) {
        self.clips += other.clips;
        self.features.append(&mut other.features);
        self.t60_s.append(&mut other.t60_s);
        self.eq_db.append(&mut other.eq_db);
        self.snr_db.append(&mut other.snr_db);
        self.drr_db.append(&mut other.drr_db);
        self.room.append(&mut other.room);
        self.speaker.append(&mut other.speaker);
        self.statistics.merge(&other.statistics);
    }

    /// Adds the labels of a clip; NaN stands for a missing one.
    pub(crate) fn push_labels(&mut self, labels: &Labels, snr_db: f64) {
        for (i, reading) in labels.t60_s().values().iter().enumerate() {
            self.t60_s.push(number(reading));
            self.statistics.t60_s[i].add(reading, &T60_EDGES_S);
        }
        let eq = labels.eq_db();
        for (i, (_, reading)) in eq.iter().filter(|(hz, _)| *hz != 1000.0).enumerate() {
            self.eq_db.push(number(reading));
            self.statistics.eq_db[i].add(reading, &EQ_EDGES_DB);
        }
        self.drr_db.push(number(labels.drr_db()));
        self.statistics.drr_db.add(labels.drr_db(), &EQ_EDGES_DB);
        self.snr_db.push(snr_db as f32);
        self.statistics.snr_db.add(&Ok(Estimate::exact(snr_db)), &SNR_EDGES_DB);
    }

    /// The bytes of the file, the same for the same content.
    pub(crate) fn encode(&self, mels: usize, frames: usize, path: &Path) -> Result<Vec<u8>, Error> {
        let n = self.clips;
        let features: Vec<u8> = self.features.iter().flat_map(|v| v.to_le_bytes()).collect();
        let floats = |v: &[f32]| v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        let integers = |v: &[i64]| v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        let (t60, eq) = (floats(&self.t60_s), floats(&self.eq_db));
        let (snr, drr) = (floats(&self.snr_db), floats(&self.drr_db));
        let (room, speaker) = (integers(&self.room), integers(&self.speaker));
        let failed = |source| Error::Shard { path: path.to_owned(), source };
        let view = |dtype, shape: Vec<usize>, bytes| TensorView::new(dtype, shape, bytes).map_err(failed);
        let tensors = BTreeMap::from([
            ("features", view(Dtype::F16, vec![n, mels, frames], &features)?),
            ("t60_s", view(Dtype::F32, vec![n, T60_BANDS], &t60)?),
            ("eq_db", view(Dtype::F32, vec![n, EQ_BANDS], &eq)?),
            ("snr_db", view(Dtype::F32, vec![n], &snr)?),
            ("drr_db", view(Dtype::F32, vec![n], &drr)?),
            ("room", view(Dtype::I64, vec![n], &room)?),
            ("speaker", view(Dtype::I64, vec![n], &speaker)?),
        ]);
        safetensors::serialize(tensors, None).map_err(failed)
    }
}

fn number(reading: &Reading) -> f32 {
    reading.as_ref().map_or(f32::NAN, |estimate| estimate.value as f32)
}

/// Edges of the histogram of reverberation times, s.
pub(crate) const T60_EDGES_S: [f64; 26] = edges(0.0, 0.1);
/// Edges of the histograms of levels and ratios, dB.
pub(crate) const EQ_EDGES_DB: [f64; 26] = edges(-37.5, 3.0);
/// Edges of the histogram of signal-to-noise ratios, dB.
pub(crate) const SNR_EDGES_DB: [f64; 26] = edges(-10.0, 4.0);

const fn edges(first: f64, step: f64) -> [f64; 26] {
    let mut edges = [0.0; 26];
    let mut i = 0;
    while i < 26 {
        edges[i] = first + step * i as f64;
        i += 1;
    }
    edges
}

/// How the labels of a shard or a partition are distributed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LabelStatistics {
    /// Reverberation time at 125 Hz to 8 kHz.
    pub t60_s: [Distribution; T60_BANDS],
    /// Equalisation at 62.5, 125, 250, 500, 2000 and 4000 Hz re 1 kHz.
    pub eq_db: [Distribution; EQ_BANDS],
    /// Signal-to-noise ratio.
    pub snr_db: Distribution,
    /// Ratio of direct to reverberant energy.
    pub drr_db: Distribution,
}

impl LabelStatistics {
    /// Adds those of other clips.
    pub(crate) fn merge(&mut self, other: &Self) {
        for (a, b) in self.t60_s.iter_mut().zip(&other.t60_s) {
            a.merge(b);
        }
        for (a, b) in self.eq_db.iter_mut().zip(&other.eq_db) {
            a.merge(b);
        }
        self.snr_db.merge(&other.snr_db);
        self.drr_db.merge(&other.drr_db);
    }
}

/// Moments and histogram of a label.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// Clips that have it.
    pub count: u64,
    /// Sum of the values.
    pub sum: f64,
    /// Sum of their squares.
    pub sum_of_squares: f64,
    /// Lower edge of the first bin of the histogram.
    pub first_edge: f64,
    /// Width of its bins.
    pub bin_width: f64,
    /// Values in each bin; those outside are in the outermost ones.
    pub histogram: Vec<u64>,
    /// Clips that lack it, by reason.
    pub missing: BTreeMap<String, u64>,
}

impl Distribution {
    /// Mean of the values; NaN if there are none.
    pub fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }

    /// Standard deviation of the values.
    pub fn standard_deviation(&self) -> f64 {
        (self.sum_of_squares / self.count as f64 - self.mean().powi(2)).max(0.0).sqrt()
    }

    fn add(&mut self, reading: &Reading, edges: &[f64; 26]) {
        match reading {
            Ok(estimate) => {
                let value = estimate.value;
                self.count += 1;
                self.sum += value;
                self.sum_of_squares += value * value;
                self.first_edge = edges[0];
                self.bin_width = ((edges[1] - edges[0]) * 1e9).round() / 1e9;
                self.histogram.resize(edges.len() - 1, 0);
                let bin =
                    ((value - self.first_edge) / self.bin_width).floor().clamp(0.0, (edges.len() - 2) as f64);
                self.histogram[bin as usize] += 1;
            }
            Err(reason) => *self.missing.entry(kind(reason).to_owned()).or_insert(0) += 1,
        }
    }

    fn merge(&mut self, other: &Self) {
        if other.count > 0 {
            self.first_edge = other.first_edge;
            self.bin_width = other.bin_width;
            self.histogram.resize(other.histogram.len().max(self.histogram.len()), 0);
        }
        self.count += other.count;
        self.sum += other.sum;
        self.sum_of_squares += other.sum_of_squares;
        for (a, b) in self.histogram.iter_mut().zip(&other.histogram) {
            *a += b;
        }
        for (reason, count) in &other.missing {
            *self.missing.entry(reason.clone()).or_insert(0) += count;
        }
    }
}

/// A short name for each reason.
fn kind(reason: &NoReading) -> &'static str {
    match reason {
        NoReading::DynamicRange { .. } => "dynamic range",
        NoReading::NoOnset => "no onset",
        NoReading::AboveNyquist { .. } => "above half the sample rate",
        NoReading::TooShort { .. } => "too short",
        NoReading::FilterRinging { .. } => "filter ringing",
        NoReading::NoDecay => "no decay",
        NoReading::Uncertain { .. } => "too uncertain",
        NoReading::NotConverged => "not converged",
        _ => "other",
    }
}
