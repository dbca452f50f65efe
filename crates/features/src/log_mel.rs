//! The log-mel spectrogram.

use crate::feature_extractor::FeatureExtractor;
use crate::mel::LANES;
use crate::stft::{Stft, StftScratch, check_length};
use crate::{Error, LogMelStream, MelBands};
use ndarray::Array2;
use sabine_acoustics::OutOfRange;

/// Settings of a log-mel spectrogram. The default is that of Tang et al. 2020, section 3.4: four seconds give 32 x 499.
#[derive(Clone, Debug, PartialEq)]
pub struct LogMelConfig {
    /// Sample rate of the input in Hz, 1 kHz to 768 kHz.
    pub sample_rate_hz: u32,
    /// Samples in a frame, 2 to 2^20.
    pub n_fft: usize,
    /// Samples from frame to frame, 1 to `n_fft`.
    pub hop: usize,
    /// Number of mel bands, at least 1, few enough that each holds a bin.
    pub mels: usize,
    /// Lower end of the lowest band in Hz, from 0.
    pub low_hz: f64,
    /// Upper end of the highest band in Hz, above `low_hz`, at most half the sample rate.
    pub high_hz: f64,
    /// Power below which a level is not told apart: 1e-30 to 1. 1e-10 makes -100 dB the lowest level.
    pub floor_power: f64,
}

impl Default for LogMelConfig {
    fn default() -> Self {
        Self {
            sample_rate_hz: 16_000,
            n_fft: 256,
            hop: 128,
            mels: 32,
            low_hz: 0.0,
            high_hz: 8_000.0,
            floor_power: 1e-10,
        }
    }
}

impl LogMelConfig {
    /// Checks each setting.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let rate = f64::from(self.sample_rate_hz);
        OutOfRange::check("sample_rate_hz", rate, 1e3, 768e3, "between 1 kHz and 768 kHz")?;
        OutOfRange::check("mels", self.mels as f64, 1.0, 4096.0, "between 1 and 4096")?;
        OutOfRange::check(
            "high_hz",
            self.high_hz,
            f64::MIN_POSITIVE,
            rate / 2.0,
            "above 0, at most half the sample rate",
        )?;
        OutOfRange::check("low_hz", self.low_hz, 0.0, self.high_hz.next_down(), "from 0 to below high_hz")?;
        Ok(OutOfRange::check("floor_power", self.floor_power, 1e-30, 1.0, "between 1e-30 and 1")?)
    }
}

/// Log-mel spectrogram: power of a Hann-windowed STFT, in mel bands of unit area, in dB re 1.
///
/// Planned once by [`LogMel::new`], then run on as many signals and threads as wanted. Frames are independent of each other
/// and of the length of the signal. A frame that holds a sample which is not finite gives NaN, never a number.
///
/// ```
/// use sabine_features::{LogMel, LogMelConfig};
/// use sabine_features::FeatureExtractor;
/// let log_mel = LogMel::new(LogMelConfig::default())?;
/// let silence = log_mel.extract(&vec![0.0; 64_000]);
/// assert_eq!(silence.dim(), (32, 499));
/// assert!(silence.iter().all(|&db| db == -100.0));
/// # Ok::<(), sabine_features::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct LogMel {
    config: LogMelConfig,
    stft: Stft,
    bands: MelBands,
}

/// Working memory of [`LogMel::extract_into`] and [`LogMelStream`].
#[derive(Clone, Debug)]
pub struct LogMelScratch {
    stft: StftScratch,
    /// Power of each bin in the frames side by side.
    power: Vec<[f32; LANES]>,
}

impl LogMel {
    /// Checks the settings and plans the transform.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting out of its range, [`Error::EmptyMelBand`] for more bands than the transform
    /// resolves.
    pub fn new(config: LogMelConfig) -> Result<Self, Error> {
        config.check()?;
        let stft = Stft::new(config.n_fft, config.hop)?;
        let bands =
            MelBands::new(config.sample_rate_hz, config.n_fft, config.mels, config.low_hz, config.high_hz)?;
        Ok(Self { config, stft, bands })
    }

    /// The settings.
    pub fn config(&self) -> &LogMelConfig {
        &self.config
    }

    /// The transform behind it.
    pub fn stft(&self) -> &Stft {
        &self.stft
    }

    /// The mel bands.
    pub fn bands(&self) -> &MelBands {
        &self.bands
    }

    /// Working memory for [`LogMel::extract_into`].
    pub fn scratch(&self) -> LogMelScratch {
        LogMelScratch { stft: self.stft.scratch(), power: vec![[0.0; LANES]; self.stft.bins()] }
    }

    /// Levels in dB, `[mel, frame]` row by row, written to `mels * frames` values without allocating.
    ///
    /// # Errors
    /// [`Error::BufferLength`] if `out` has another length or the scratch is of another `n_fft`.
    pub fn extract_into(
        &self,
        samples: &[f32],
        scratch: &mut LogMelScratch,
        out: &mut [f32],
    ) -> Result<(), Error> {
        let frames = self.stft.frames(samples.len());
        check_length("output", self.bands.len() * frames, out.len())?;
        scratch.stft.check(&self.stft)?;
        self.extract_checked(samples, scratch, out);
        Ok(())
    }

    /// Starts a spectrogram of live input.
    pub fn stream(&self) -> LogMelStream {
        LogMelStream::new(self)
    }

    /// [`LogMel::extract_into`] after the check of the length.
    fn extract_checked(&self, samples: &[f32], scratch: &mut LogMelScratch, out: &mut [f32]) {
        let frames = self.stft.frames(samples.len());
        let floor = self.config.floor_power as f32;
        for first in (0..frames).step_by(LANES) {
            let lanes = LANES.min(frames - first);
            for lane in 0..lanes {
                let frame = &samples[(first + lane) * self.config.hop..][..self.config.n_fft];
                self.bin_power(frame, lane, scratch);
            }
            self.bands.apply(&scratch.power, |band, powers| {
                out[band * frames + first..][..lanes].copy_from_slice(&powers[..lanes]);
            });
        }
        for value in out {
            *value = power_to_db(*value, floor);
        }
    }

    /// Levels of one frame.
    pub(crate) fn frame_levels(&self, frame: &[f32], scratch: &mut LogMelScratch, levels_db: &mut [f32]) {
        self.bin_power(frame, 0, scratch);
        let floor = self.config.floor_power as f32;
        self.bands.apply(&scratch.power, |band, powers| levels_db[band] = power_to_db(powers[0], floor));
    }

    /// Power of one frame in each bin, written to a lane.
    fn bin_power(&self, frame: &[f32], lane: usize, scratch: &mut LogMelScratch) {
        self.stft.transform(frame, &mut scratch.stft);
        for (p, x) in scratch.power.iter_mut().zip(&scratch.stft.spectrum) {
            p[lane] = x.norm_sqr() as f32;
        }
    }
}

impl FeatureExtractor for LogMel {
    fn sample_rate_hz(&self) -> u32 {
        self.config.sample_rate_hz
    }

    fn features(&self) -> usize {
        self.bands.len()
    }

    fn frames(&self, samples: usize) -> usize {
        self.stft.frames(samples)
    }

    fn extract(&self, samples: &[f32]) -> Array2<f32> {
        let mut out = Array2::zeros((self.features(), self.frames(samples.len())));
        let mut scratch = self.scratch();
        if let Some(values) = out.as_slice_mut() {
            self.extract_checked(samples, &mut scratch, values);
        }
        out
    }
}

/// `10 log10(max(power, floor))` within 4e-6 dB, branch-free so that the compiler makes vectors of it; NaN stays NaN.
///
/// The logarithm is split into exponent and mantissa m in [1/sqrt 2, sqrt 2), and ln m = 2 artanh((m - 1) / (m + 1)) summed
/// to the ninth power, whose remainder is below 1e-9.
#[inline]
fn power_to_db(power: f32, floor: f32) -> f32 {
    /// 10 log10(2) and 20 / ln(10).
    const DB_PER_OCTAVE: f32 = 3.010_3;
    const DB_PER_TWO_NEPER: f32 = 8.685_89;
    /// Bits of 1/sqrt 2, the least mantissa.
    const LEAST: u32 = 0x3f35_04f3;
    let clamped = if power < floor { floor } else { power };
    let shifted = clamped.to_bits().wrapping_sub(LEAST);
    let exponent = (shifted as i32 >> 23) as f32;
    let mantissa = f32::from_bits((shifted & 0x007f_ffff) + LEAST);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let s2 = s * s;
    let series = s * (1.0 + s2 * (1.0 / 3.0 + s2 * (0.2 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0)))));
    let db = DB_PER_OCTAVE * exponent + DB_PER_TWO_NEPER * series;
    if clamped <= f32::MAX { db } else { f32::NAN }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fast_logarithm_is_a_logarithm() {
        let mut power = 1e-10_f32;
        while power < 1e12 {
            let found = f64::from(power_to_db(power, 1e-10));
            let expected = 10.0 * f64::from(power).log10();
            // Two units in the last place of a level near 100 dB, and less for small ones.
            assert!(
                (found - expected).abs() <= 1e-6 + 1.5e-7 * expected.abs(),
                "{power}: {found} != {expected}"
            );
            power *= 1.000_37;
        }
        assert_eq!(power_to_db(0.0, 1.0), 0.0);
        assert!(power_to_db(f32::NAN, 1e-10).is_nan());
        assert!(power_to_db(f32::INFINITY, 1e-10).is_nan());
    }
}
