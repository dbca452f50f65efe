//! Estimates from files of any length.

use crate::Error;
use crate::estimator::Estimator;
use crate::live::LiveEstimator;
use crate::warning::Warning;
use crate::window_estimate::DetailedEstimate;
use crate::windows::FlatTops;
use sabine_acoustics::{AudioReader, BlockResampler};

/// Samples that are read at a time.
const BLOCK: usize = 1 << 16;

impl Estimator {
    /// Hears what is left of a file block by block: the answer is that of [`Estimator::estimate_detailed`] for the whole, and an
    /// hour takes a few megabytes.
    ///
    /// ```
    /// use sabine_acoustics::{AudioReader, Channel, read_audio};
    /// use sabine_estimator::Estimator;
    /// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/speech/recording.wav");
    /// let estimator = Estimator::pretrained()?;
    /// let in_blocks = estimator.estimate_reader(&mut AudioReader::open(path, Channel::Mono)?)?;
    /// assert_eq!(in_blocks, estimator.estimate_detailed(&read_audio(path, Channel::Mono)?)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Estimator::estimate_detailed`], and what [`AudioReader::read_block`] gives.
    pub fn estimate_reader(&self, reader: &mut AudioReader) -> Result<DetailedEstimate, Error> {
        let (found_hz, needed_hz) = (reader.sample_rate_hz(), self.sample_rate_hz());
        if found_hz < needed_hz {
            return Err(Error::SampleRate { found_hz, needed_hz });
        }
        // Flat tops are flat at the rate at which they were recorded only.
        let mut tops = FlatTops::default();
        let mut listener = LiveEstimator::with_windows(self, 1);
        let mut resampler = BlockResampler::new(found_hz, needed_hz)?;
        let (mut block, mut resampled) = (Vec::new(), Vec::new());
        while reader.read_block(&mut block, BLOCK)? > 0 {
            tops.push(&block);
            resampled.clear();
            resampler.push(&block, &mut resampled)?;
            listener.listen(&resampled);
        }
        resampled.clear();
        resampler.finish(&mut resampled)?;
        listener.listen(&resampled);
        let mut warnings = self.hearable(&tops, tops.samples() as f64 / f64::from(found_hz))?;
        if found_hz != needed_hz {
            warnings.push(Warning::Resampled { from_hz: found_hz, to_hz: needed_hz });
        }
        listener.conclude(warnings)
    }
}
