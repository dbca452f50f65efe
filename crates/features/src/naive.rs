//! The log-mel spectrogram by definition, to hold the fast one against.

use crate::feature_extractor::FeatureExtractor;
use crate::{Error, LogMelConfig};
use ndarray::Array2;
use sabine_acoustics::OutOfRange;
use std::f64::consts::{PI, TAU};

/// Log-mel spectrogram by the definition: a discrete Fourier sum for each bin, dense triangles, double precision.
///
/// It shares no code with [`crate::LogMel`] but the settings and is some hundred times slower: an oracle and a second
/// implementation of the trait, not a tool.
#[derive(Clone, Debug)]
pub struct NaiveLogMel {
    config: LogMelConfig,
}

impl NaiveLogMel {
    /// Checks the settings. Bands that hold no bin are kept, at the floor.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting out of its range.
    pub fn new(config: LogMelConfig) -> Result<Self, Error> {
        config.check()?;
        if config.n_fft < 2 {
            let (field, range) = ("n_fft", "at least 2");
            return Err(OutOfRange { field, value: config.n_fft as f64, range }.into());
        }
        if config.hop == 0 || config.hop > config.n_fft {
            let (field, range) = ("hop", "between 1 and n_fft");
            return Err(OutOfRange { field, value: config.hop as f64, range }.into());
        }
        Ok(Self { config })
    }

    /// Corner `index` of the triangles in Hz: the mel scale is walked in closed form, linear to 1 kHz and by the factor
    /// 6.4^(1/27) for each mel beyond (Slaney 1998).
    fn corner_hz(&self, index: usize) -> f64 {
        let to_mel = |hz: f64| match hz {
            hz if hz <= 1000.0 => hz * 0.015,
            hz => 15.0 + 27.0 * (hz / 1000.0).log(6.4),
        };
        let share = index as f64 / (self.config.mels as f64 + 1.0);
        let mel = to_mel(self.config.low_hz) * (1.0 - share) + to_mel(self.config.high_hz) * share;
        if mel <= 15.0 { mel / 0.015 } else { 1000.0 * 6.4_f64.powf((mel - 15.0) / 27.0) }
    }
}

impl FeatureExtractor for NaiveLogMel {
    fn sample_rate_hz(&self) -> u32 {
        self.config.sample_rate_hz
    }

    fn features(&self) -> usize {
        self.config.mels
    }

    fn frames(&self, samples: usize) -> usize {
        let LogMelConfig { n_fft, hop, .. } = self.config;
        (samples + hop).saturating_sub(n_fft) / hop
    }

    fn extract(&self, samples: &[f32]) -> Array2<f32> {
        let LogMelConfig { sample_rate_hz, n_fft, hop, mels, floor_power, .. } = self.config;
        let power = |frame: usize, bin: usize| {
            let (mut re, mut im) = (0.0, 0.0);
            for n in 0..n_fft {
                let windowed =
                    f64::from(samples[frame * hop + n]) * (PI * n as f64 / n_fft as f64).sin().powi(2);
                let angle = TAU * ((bin * n) % n_fft) as f64 / n_fft as f64;
                re += windowed * angle.cos();
                im -= windowed * angle.sin();
            }
            re * re + im * im
        };
        let frames = self.frames(samples.len());
        let spectra = Array2::from_shape_fn((n_fft / 2 + 1, frames), |(bin, frame)| power(frame, bin));
        let triangles = Array2::from_shape_fn((mels, n_fft / 2 + 1), |(band, bin)| {
            let hz = bin as f64 * f64::from(sample_rate_hz) / n_fft as f64;
            let (left, centre, right) =
                (self.corner_hz(band), self.corner_hz(band + 1), self.corner_hz(band + 2));
            let height = 2.0 / (right - left);
            if hz <= left || hz >= right {
                0.0
            } else if hz <= centre {
                height * (hz - left) / (centre - left)
            } else {
                height * (right - hz) / (right - centre)
            }
        });
        triangles.dot(&spectra).mapv(|p| {
            let level_db = 10.0 * p.max(floor_power).log10();
            if p.is_finite() { level_db as f32 } else { f32::NAN }
        })
    }
}
