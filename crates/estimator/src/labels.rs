//! Between the outputs of the network and seconds and decibels.

use sabine_acoustics::{Bands, Estimate, PerBand};
use serde::{Deserialize, Serialize};

/// Number of reverberation times: 125 Hz to 8 kHz.
pub const T60_COUNT: usize = 7;
/// Number of levels relative to 1 kHz: 62.5, 125, 250, 500, 2000, 4000 Hz.
pub const EQ_COUNT: usize = 6;
/// Number of labels, reverberation times first.
pub const LABEL_COUNT: usize = T60_COUNT + EQ_COUNT;
/// Index of the 1 kHz band among [`Bands::EQ`]: the reference, which has no label.
const EQ_REFERENCE: usize = 4;

/// Nominal centre of a label's octave in Hz.
///
/// # Panics
/// If `label` is not below [`LABEL_COUNT`].
pub fn label_hz(label: usize) -> f64 {
    if label < T60_COUNT {
        Bands::T60.nominal_hz(label)
    } else {
        let eq = label - T60_COUNT;
        Bands::EQ.nominal_hz(if eq < EQ_REFERENCE { eq } else { eq + 1 })
    }
}

/// `T60 500 Hz` or `EQ 500 Hz`.
///
/// # Panics
/// As [`label_hz`].
pub fn label_name(label: usize) -> String {
    format!("{} {} Hz", if label < T60_COUNT { "T60" } else { "EQ" }, label_hz(label))
}

/// What the network is taught for a reverberation time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum T60Scale {
    /// Seconds.
    Linear,
    /// Natural logarithm of seconds: errors count in proportion, and estimates are positive.
    Log,
}

/// The scale on which the network is taught: mean 0 and deviation 1 over the training set.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelScale {
    /// How reverberation times are taken.
    pub t60: T60Scale,
    /// Mean of each label over the training set, on that scale.
    pub mean: Vec<f64>,
    /// Standard deviation of each label, on that scale.
    pub deviation: Vec<f64>,
}

impl LabelScale {
    /// A label in seconds or dB, as the network is taught it; NaN (missing) stays NaN.
    pub fn encode(&self, label: usize, value: f64) -> f64 {
        let value = if self.is_log(label) { value.ln() } else { value };
        (value - self.mean[label]) / self.deviation[label]
    }

    /// A label and its standard deviation in seconds or dB from those on the network's scale.
    pub fn decode(&self, label: usize, value: f64, deviation: f64) -> Estimate {
        let value = value * self.deviation[label] + self.mean[label];
        let deviation = deviation * self.deviation[label];
        if self.is_log(label) {
            // 1 ms to 100 s: what the vocabulary takes for a reverberation time.
            let value = value.exp().clamp(1e-3, 100.0);
            Estimate::new(value, value * deviation)
        } else if label < T60_COUNT {
            Estimate::new(value.clamp(0.01, 100.0), deviation)
        } else {
            Estimate::new(value.clamp(-200.0, 200.0), deviation)
        }
    }

    fn is_log(&self, label: usize) -> bool {
        label < T60_COUNT && self.t60 == T60Scale::Log
    }
}

/// Labels spread over the bands of the vocabulary; the level at 1 kHz is 0 dB exactly.
pub(crate) fn per_band(labels: &[Estimate]) -> (PerBand<Estimate>, PerBand<Estimate>) {
    let t60_s = PerBand::from_fn(Bands::T60, |band| labels[band]);
    let eq_db = PerBand::from_fn(Bands::EQ, |band| match band {
        EQ_REFERENCE => Estimate::exact(0.0),
        below if below < EQ_REFERENCE => labels[T60_COUNT + below],
        above => labels[T60_COUNT + above - 1],
    });
    (t60_s, eq_db)
}
