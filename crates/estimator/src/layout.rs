//! What the network hears: the layout of the features, and how they are normalised.

use crate::{Error, WeightsFault};
use ndarray::ArrayView2;
use sabine_features::{LogMel, LogMelConfig};
use serde::{Deserialize, Serialize};

/// The features that a network was trained on; weights travel with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FeatureLayout {
    /// Sample rate in Hz.
    pub sample_rate_hz: u32,
    /// Samples in a frame.
    pub n_fft: usize,
    /// Samples from frame to frame.
    pub hop: usize,
    /// Number of mel bands.
    pub mels: usize,
    /// Frames of a window.
    pub frames: usize,
    /// Lower end of the lowest band in Hz.
    pub low_hz: f64,
    /// Upper end of the highest band in Hz.
    pub high_hz: f64,
    /// Power below which a level was not told apart in the clips that were trained on.
    pub floor_power: f64,
}

impl Default for FeatureLayout {
    /// Four seconds at 16 kHz in 32 mel bands (Tang et al. 2020, section 3.4).
    fn default() -> Self {
        let config = LogMelConfig::default();
        Self {
            sample_rate_hz: config.sample_rate_hz,
            n_fft: config.n_fft,
            hop: config.hop,
            mels: config.mels,
            frames: 499,
            low_hz: config.low_hz,
            high_hz: config.high_hz,
            floor_power: config.floor_power,
        }
    }
}

impl FeatureLayout {
    /// The extractor of these features, with a floor so low that it is no limit: the level of a recording is free, and each
    /// window is given its own floor when it is heard.
    ///
    /// # Errors
    /// [`Error::Weights`] if no extractor can be so.
    pub fn extractor(&self) -> Result<LogMel, Error> {
        let config = LogMelConfig {
            sample_rate_hz: self.sample_rate_hz,
            n_fft: self.n_fft,
            hop: self.hop,
            mels: self.mels,
            low_hz: self.low_hz,
            high_hz: self.high_hz,
            floor_power: LEAST_POWER,
        };
        LogMel::new(config).map_err(|source| Error::Weights {
            name: "feature layout".into(),
            fault: Box::new(WeightsFault::Features { source }),
        })
    }

    /// Length of a window in samples.
    pub fn window_samples(&self) -> usize {
        (self.frames - 1) * self.hop + self.n_fft
    }

    /// Length of a window in seconds.
    pub fn window_s(&self) -> f64 {
        self.window_samples() as f64 / f64::from(self.sample_rate_hz)
    }

    /// Seconds from frame to frame.
    pub fn frame_s(&self) -> f64 {
        self.hop as f64 / f64::from(self.sample_rate_hz)
    }
}

/// Floor of the features as they are extracted to be heard, relative to full scale.
const LEAST_POWER: f64 = 1e-30;

/// How features in dB become the input of the network.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalisation {
    /// Mean of each mel band over the training set, in dB (after the level is removed).
    pub mean_db: Vec<f32>,
    /// Standard deviation of each mel band, in dB.
    pub deviation_db: Vec<f32>,
    /// Whether the mean level of the window is removed first: the gain of a microphone says nothing about the room.
    pub remove_level: bool,
}

impl Normalisation {
    /// Normalises a window `[mel][frame]` of levels in dB in place.
    pub fn apply(&self, window_db: &mut [f32]) {
        let frames = window_db.len() / self.mean_db.len();
        let level_db = if self.remove_level { mean(window_db) } else { 0.0 };
        let rows = window_db.chunks_exact_mut(frames).zip(self.mean_db.iter().zip(&self.deviation_db));
        for (row, (mean, deviation)) in rows {
            let (shift, gain) = (level_db + mean, 1.0 / deviation);
            row.iter_mut().for_each(|v| *v = (*v - shift) * gain);
        }
    }

    /// Copies `frames` frames from `first` on out of a longer spectrogram; where it ends, it begins again.
    pub(crate) fn cut(
        spectrogram_db: ArrayView2<'_, f32>,
        first: usize,
        frames: usize,
        window_db: &mut Vec<f32>,
    ) {
        let available = spectrogram_db.ncols();
        window_db.clear();
        for row in spectrogram_db.rows() {
            window_db.extend((first..first + frames).map(|frame| row[frame % available]));
        }
    }
}

/// Mean with a fixed order of additions.
pub(crate) fn mean(values: &[f32]) -> f32 {
    (values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64) as f32
}
