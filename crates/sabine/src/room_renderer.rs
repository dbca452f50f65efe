//! Placing sound of any length in a matched room.

use crate::{Error, RoomMatch};
use sabine_acoustics::{
    AudioReader, BlockResampler, Channel, ImpulseResponse, SampleFormat, Signal, WavWriter,
};
use sabine_eqfilter::{BlockConvolver, EqFilter, convolve};
use std::path::Path;

/// Highest magnitude of a rendered sound.
const FULL_SCALE: f32 = 0.95;
/// Samples that are read at a time.
const BLOCK: usize = 1 << 16;

/// Response and filter of a match, ready to place sound in the room.
#[derive(Clone, Debug)]
pub struct RoomRenderer {
    taps: Vec<f32>,
    /// Delay of the filter, which is taken out, in samples.
    delay: usize,
    /// Length of the response, in samples.
    response_length: usize,
    sample_rate_hz: u32,
}

/// A file that was rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RenderedFile {
    /// By how much the sound was scaled to fit full scale, in dB, 0 or below: 0 for a source of the level of the dry sound at
    /// 1 m.
    pub gain_db: f64,
    /// Length of the dry sound, in seconds.
    pub dry_duration_s: f64,
    /// Sample rate of the rendered sound, in Hz.
    pub sample_rate_hz: u32,
}

impl RoomMatch {
    /// What renders other sounds in the matched room, at the sample rate of the response.
    pub fn renderer(&self) -> RoomRenderer {
        RoomRenderer::new(&self.response, &self.eq_filter)
    }
}

impl RoomRenderer {
    pub(crate) fn new(response: &ImpulseResponse, filter: &EqFilter) -> Self {
        Self {
            taps: convolve(response.samples(), filter.taps()),
            delay: filter.delay_samples(),
            response_length: response.samples().len(),
            sample_rate_hz: response.sample_rate_hz(),
        }
    }

    /// Sample rate of what it renders, in Hz.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// Renders a file of any length as a mono WAV file, whole or not at all: read twice, block by block, once for the peak and
    /// once to write. Sound at another sample rate is resampled; where the peak is beyond 0.95 of full scale, the whole is scaled
    /// down to it.
    ///
    /// # Errors
    /// Of reading `dry` and writing `rendered`.
    pub fn render_file(
        &self,
        dry: impl AsRef<Path>,
        channel: Channel,
        rendered: impl AsRef<Path>,
        format: SampleFormat,
    ) -> Result<RenderedFile, Error> {
        let mut peak = 0.0_f32;
        let dry_duration_s = self.run(dry.as_ref(), channel, &mut |block| {
            peak = block.iter().fold(peak, |peak, s| peak.max(s.abs()));
            Ok(())
        })?;
        let gain = full_scale_gain(peak);
        let mut writer = WavWriter::create(rendered, 1, self.sample_rate_hz, format)?;
        self.run(dry.as_ref(), channel, &mut |block| {
            block.iter_mut().for_each(|s| *s *= gain);
            Ok(writer.write(block)?)
        })?;
        writer.finish()?;
        let gain_db = 20.0 * f64::from(gain).log10();
        Ok(RenderedFile { gain_db, dry_duration_s, sample_rate_hz: self.sample_rate_hz })
    }

    /// Renders a sound in memory; the sample rates must agree.
    pub(crate) fn render(&self, dry: &Signal) -> Result<(Signal, f64), Error> {
        let mut wet = Vec::new();
        let mut convolver = BlockConvolver::new(&self.taps)?;
        convolver.push(dry.samples(), &mut wet);
        convolver.finish(&mut wet);
        wet.truncate(self.delay + dry.samples().len() + self.response_length - 1);
        wet.drain(..self.delay);
        let gain = full_scale_gain(wet.iter().fold(0.0, |peak, s| peak.max(s.abs())));
        wet.iter_mut().for_each(|s| *s *= gain);
        Ok((Signal::new(wet, self.sample_rate_hz)?, 20.0 * f64::from(gain).log10()))
    }

    /// Hands the rendered sound over in blocks and says how long the dry sound is, in seconds.
    fn run(
        &self,
        dry: &Path,
        channel: Channel,
        take: &mut dyn FnMut(&mut [f32]) -> Result<(), Error>,
    ) -> Result<f64, Error> {
        let mut reader = AudioReader::open(dry, channel)?;
        let mut resampler = BlockResampler::new(reader.sample_rate_hz(), self.sample_rate_hz)?;
        let mut convolver = BlockConvolver::new(&self.taps)?;
        let (mut block, mut resampled, mut wet) = (Vec::new(), Vec::new(), Vec::new());
        let mut late = self.delay;
        let mut hand_over = |wet: &mut Vec<f32>| {
            let skipped = late.min(wet.len());
            late -= skipped;
            let taken = take(&mut wet[skipped..]);
            wet.clear();
            taken
        };
        while reader.read_block(&mut block, BLOCK)? > 0 {
            resampled.clear();
            resampler.push(&block, &mut resampled)?;
            convolver.push(&resampled, &mut wet);
            hand_over(&mut wet)?;
        }
        resampled.clear();
        resampler.finish(&mut resampled)?;
        convolver.push(&resampled, &mut wet);
        convolver.finish(&mut wet);
        // The filter is as long after its middle as before it: what it adds at the end belongs to no sound.
        wet.truncate(wet.len().saturating_sub(self.taps.len() - self.response_length - self.delay));
        hand_over(&mut wet)?;
        Ok(reader.position() as f64 / f64::from(reader.sample_rate_hz()))
    }
}

/// The gain that brings a peak within full scale.
fn full_scale_gain(peak: f32) -> f32 {
    if peak <= FULL_SCALE { 1.0 } else { FULL_SCALE / peak }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::{Bands, PerBand, read_audio, resample, write_wav};
    use sabine_eqfilter::EqFilterConfig;

    fn noise(count: usize, gain: f32) -> Vec<f32> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        };
        (0..count).map(|_| gain * next()).collect()
    }

    /// From a file, resampled on the way, as from memory by the plain chain of convolution and filter.
    #[test]
    fn blocks_are_the_chain_of_convolution_and_filter() {
        let response: Vec<f32> =
            noise(9000, 1.0).iter().enumerate().map(|(i, n)| n * (-(i as f32) / 1500.0).exp()).collect();
        let response = ImpulseResponse::new(response, 48_000).unwrap();
        let gains = PerBand::new(Bands::EQ, vec![-6.0, 3.0, 0.0, 1.0, 0.0, -2.0, -8.0]).unwrap();
        let filter = EqFilter::design(&gains, 48_000, EqFilterConfig::default()).unwrap();
        let renderer = RoomRenderer::new(&response, &filter);
        let folder = tempfile::tempdir().unwrap();
        let (dry, wet) = (folder.path().join("dry.wav"), folder.path().join("wet.wav"));
        for (samples, gain) in [(70_001, 0.5), (2, 1e-3)] {
            write_wav(&dry, &noise(samples, gain), 16_000, SampleFormat::Float32).unwrap();
            let done = renderer.render_file(&dry, Channel::Mono, &wet, SampleFormat::Float32).unwrap();
            let read = read_audio(&wet, Channel::Mono).unwrap();
            let sound = resample(&read_audio(&dry, Channel::Mono).unwrap(), 48_000).unwrap();
            let plain = Signal::new(convolve(sound.samples(), response.samples()), 48_000).unwrap();
            let plain = filter.apply(&plain).unwrap();
            let gain = 10_f64.powf(done.gain_db / 20.0) as f32;
            assert!((gain < 1.0) == (plain.peak() > FULL_SCALE), "{gain}");
            let (in_memory, _) = renderer.render(&sound).unwrap();
            for found in [&read, &in_memory] {
                assert_eq!(found.samples().len(), plain.samples().len());
                for (found, plain) in found.samples().iter().zip(plain.samples()) {
                    assert!((found - gain * plain).abs() < 1e-5, "{found} for {}", gain * plain);
                }
            }
        }
    }
}
