//! Changing the sample rate.

use crate::error::Error;
use crate::out_of_range::OutOfRange;
use crate::signal::{ImpulseResponse, Signal};
use rubato::audioadapter_buffers::direct::InterleavedSlice;
use rubato::{Fft, FixedSync, Resampler, WindowFunction};

/// Shortest length of the anti-aliasing filter, in samples of the lower rate: the pass band reaches 98 % of the lower Nyquist
/// frequency.
const FILTER_SAMPLES: u64 = 1024;

/// The same sound at another sample rate: amplitudes and times stay, and what lies above the new Nyquist frequency goes.
///
/// Linear phase, and the filter's delay is taken out. The length is that of the input, rounded up to a whole sample.
///
/// ```
/// use sabine_acoustics::{Signal, resample};
/// let tone = (0..48_000).map(|i| (std::f32::consts::TAU * 1000.0 * i as f32 / 48e3).cos()).collect();
/// let low = resample(&Signal::new(tone, 48_000)?, 16_000)?;
/// assert_eq!(low.samples().len(), 16_000);
/// // A cosine of 1 kHz is at its crest every 16 samples.
/// assert!((low.samples()[8000] - 1.0).abs() < 1e-4);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
///
/// # Errors
/// [`Error::OutOfRange`] for a rate outside 1 kHz to 768 kHz.
pub fn resample(signal: &Signal, sample_rate_hz: u32) -> Result<Signal, Error> {
    if sample_rate_hz == signal.sample_rate_hz() {
        return Ok(signal.clone());
    }
    let samples = convert(signal.samples(), signal.sample_rate_hz(), sample_rate_hz, 1.0)?;
    Signal::new(samples, sample_rate_hz)
}

/// The same room at another sample rate: the **transfer function** stays, and with it the level of sound convolved with the
/// response.
///
/// A response is a density in time: at twice the rate there are twice as many samples under the same curve, so amplitudes are
/// those of [`resample`] times old rate / new rate. A direct sound of one unit sample at 1 m keeps its area of one, not its peak.
///
/// # Errors
/// As [`resample`].
pub fn resample_response(response: &ImpulseResponse, sample_rate_hz: u32) -> Result<ImpulseResponse, Error> {
    let old_hz = response.sample_rate_hz();
    if sample_rate_hz == old_hz {
        return Ok(response.clone());
    }
    let gain = f64::from(old_hz) / f64::from(sample_rate_hz);
    let samples = convert(response.samples(), old_hz, sample_rate_hz, gain)?;
    ImpulseResponse::new(samples, sample_rate_hz)
}

fn convert(samples: &[f32], old_hz: u32, new_hz: u32, gain: f64) -> Result<Vec<f32>, Error> {
    let mut resampler = BlockResampler::with_gain(old_hz, new_hz, gain)?;
    let mut converted = Vec::with_capacity(resampler.length(samples.len() as u64) as usize);
    resampler.push(samples, &mut converted)?;
    resampler.finish(&mut converted)?;
    Ok(converted)
}

/// Changes the sample rate of a stream, block by block: what comes out is, sample by sample, what [`resample`] makes of the
/// whole.
///
/// ```
/// use sabine_acoustics::{BlockResampler, Signal, resample};
/// let sound: Vec<f32> = (0..48_000).map(|i| (0.01 * i as f32).sin()).collect();
/// let mut resampler = BlockResampler::new(48_000, 16_000)?;
/// let mut low = Vec::new();
/// for block in sound.chunks(1000) {
///     resampler.push(block, &mut low)?;
/// }
/// resampler.finish(&mut low)?;
/// assert_eq!(low, resample(&Signal::new(sound, 48_000)?, 16_000)?.samples());
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
pub struct BlockResampler {
    /// None where the rates are equal.
    filter: Option<Fft<f64>>,
    old_hz: u32,
    new_hz: u32,
    gain: f64,
    /// Samples that wait for a whole block of the filter.
    waiting: Vec<f64>,
    block: usize,
    output: Vec<f64>,
    /// Samples of the filter's delay that are still to come out.
    delay: usize,
    taken: u64,
    given: u64,
}

impl std::fmt::Debug for BlockResampler {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BlockResampler")
            .field("old_hz", &self.old_hz)
            .field("new_hz", &self.new_hz)
            .field("taken", &self.taken)
            .finish_non_exhaustive()
    }
}

impl BlockResampler {
    /// Plans the filter.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a rate outside 1 kHz to 768 kHz.
    pub fn new(old_hz: u32, new_hz: u32) -> Result<Self, Error> {
        Self::with_gain(old_hz, new_hz, 1.0)
    }

    fn with_gain(old_hz: u32, new_hz: u32, gain: f64) -> Result<Self, Error> {
        for rate_hz in [old_hz, new_hz] {
            OutOfRange::check(
                "sample rate (Hz)",
                f64::from(rate_hz),
                1e3,
                768e3,
                "between 1 kHz and 768 kHz",
            )?;
        }
        let filter = if old_hz == new_hz { None } else { Some(filter(old_hz, new_hz)?) };
        let of = |length: fn(&Fft<f64>) -> usize| filter.as_ref().map_or(0, length);
        Ok(Self {
            block: of(Fft::input_frames_next),
            output: vec![0.0; of(Fft::output_frames_next)],
            delay: of(Fft::output_delay),
            filter,
            old_hz,
            new_hz,
            gain,
            waiting: Vec::new(),
            taken: 0,
            given: 0,
        })
    }

    /// Samples that come out of so many: rounded up.
    pub fn length(&self, samples: u64) -> u64 {
        (samples * u64::from(self.new_hz)).div_ceil(u64::from(self.old_hz))
    }

    /// Takes samples and appends those that they complete to `resampled`.
    ///
    /// # Errors
    /// [`Error::Implementation`] if the filter fails, which lengths that agree do not cause.
    pub fn push(&mut self, samples: &[f32], resampled: &mut Vec<f32>) -> Result<(), Error> {
        self.taken += samples.len() as u64;
        if self.filter.is_none() {
            resampled.extend_from_slice(samples);
            return Ok(());
        }
        let mut rest = samples;
        while !rest.is_empty() {
            let (now, later) = rest.split_at((self.block - self.waiting.len()).min(rest.len()));
            self.waiting.extend(now.iter().map(|&s| f64::from(s)));
            rest = later;
            if self.waiting.len() == self.block {
                self.process(resampled)?;
            }
        }
        Ok(())
    }

    /// Appends what is still in the filter.
    ///
    /// # Errors
    /// As [`BlockResampler::push`].
    pub fn finish(mut self, resampled: &mut Vec<f32>) -> Result<(), Error> {
        while self.filter.is_some() && self.given < self.length(self.taken) {
            self.waiting.resize(self.block, 0.0);
            self.process(resampled)?;
        }
        Ok(())
    }

    /// Filters one block; never gives more samples than belong to those taken.
    fn process(&mut self, resampled: &mut Vec<f32>) -> Result<(), Error> {
        let Some(filter) = &mut self.filter else { return Ok(()) };
        let failed =
            |error: Box<dyn std::error::Error + Send + Sync>| Error::implementation("resampling", error);
        let frames = self.output.len();
        let input = InterleavedSlice::new(&self.waiting, 1, self.block).map_err(|e| failed(e.into()))?;
        let mut output =
            InterleavedSlice::new_mut(&mut self.output, 1, frames).map_err(|e| failed(e.into()))?;
        filter.process_into_buffer(&input, &mut output, None).map_err(|e| failed(e.into()))?;
        self.waiting.clear();
        let late = self.delay.min(frames);
        self.delay -= late;
        let left = (self.length(self.taken) - self.given) as usize;
        let ready = &self.output[late..late + (frames - late).min(left)];
        resampled.extend(ready.iter().map(|s| (s * self.gain) as f32));
        self.given += ready.len() as u64;
        Ok(())
    }
}

/// Blocks of `unit` old samples become blocks of whole new samples. An even number of units makes the delay of half a block a
/// whole number of samples on both sides.
fn filter(old_hz: u32, new_hz: u32) -> Result<Fft<f64>, Error> {
    let divisor = u64::from(greatest_common_divisor(old_hz, new_hz));
    let unit = u64::from(old_hz) / divisor;
    let lower = u64::from(old_hz.min(new_hz)) / divisor;
    let block = (2 * FILTER_SAMPLES.div_ceil(2 * lower) * unit) as usize;
    let (old, new) = (old_hz as usize, new_hz as usize);
    Fft::new_custom(old, new, block, 1, 1, WindowFunction::BlackmanHarris2, FixedSync::Both)
        .map_err(|error| Error::implementation("resampling", error))
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    const PAIRS: [(u32, u32); 8] = [
        (48_000, 16_000),
        (44_100, 16_000),
        (22_050, 16_000),
        (16_000, 48_000),
        (44_100, 48_000),
        (96_000, 44_100),
        (16_000, 22_050),
        (8_000, 11_025),
    ];

    fn tone(frequency_hz: f64, rate_hz: u32, seconds: f64) -> Signal {
        let n = (f64::from(rate_hz) * seconds) as usize;
        let samples = (0..n).map(|i| (TAU * frequency_hz * i as f64 / f64::from(rate_hz)).sin() as f32);
        Signal::new(samples.collect(), rate_hz).unwrap()
    }

    /// A tone up to 90 % of the lower Nyquist frequency keeps amplitude and phase to -90 dB, away from the ends.
    #[test]
    fn tones_stay_what_they_are() {
        for (old, new) in PAIRS {
            for share in [0.01, 0.3, 0.9] {
                let frequency = share * 0.5 * f64::from(old.min(new));
                let found = resample(&tone(frequency, old, 1.0), new).unwrap();
                let wanted = tone(frequency, new, 1.0);
                assert_eq!(found.samples().len(), new as usize);
                let ends = new as usize / 5;
                let worst = (ends..new as usize - ends)
                    .map(|i| (found.samples()[i] - wanted.samples()[i]).abs())
                    .fold(0.0, f32::max);
                assert!(worst < 3.2e-5, "{old} -> {new} Hz, {frequency} Hz: {worst}");
            }
        }
    }

    /// What the new rate cannot hold is gone, to -90 dB.
    #[test]
    fn nothing_folds_back() {
        for (old, new) in PAIRS.into_iter().filter(|(old, new)| old > new) {
            for share in [1.03, 1.3] {
                let frequency = share * 0.5 * f64::from(new);
                if frequency >= 0.5 * f64::from(old) {
                    continue;
                }
                let found = resample(&tone(frequency, old, 1.0), new).unwrap();
                let ends = new as usize / 5;
                let worst =
                    found.samples()[ends..new as usize - ends].iter().fold(0.0, |a: f32, b| a.max(b.abs()));
                assert!(worst < 3.2e-5, "{old} -> {new} Hz, {frequency} Hz: {worst}");
            }
        }
    }

    /// The transfer function at a frequency, summed in f64.
    fn transfer(samples: &[f32], rate_hz: u32, frequency_hz: f64) -> (f64, f64) {
        samples.iter().enumerate().fold((0.0, 0.0), |(re, im), (i, &s)| {
            let phase = TAU * frequency_hz * i as f64 / f64::from(rate_hz);
            (re + f64::from(s) * phase.cos(), im - f64::from(s) * phase.sin())
        })
    }

    /// A pulse keeps its area and its instant: magnitude 1 and the phase of its delay at every frequency.
    #[test]
    fn a_response_keeps_its_transfer_function() {
        for (old, new) in PAIRS {
            let at = old as usize / 4 + 1;
            let mut pulse = vec![0.0; old as usize / 2];
            pulse[at] = 1.0;
            let response = ImpulseResponse::new(pulse, old).unwrap();
            let found = resample_response(&response, new).unwrap();
            for share in [0.05, 0.5, 0.9] {
                let frequency = share * 0.5 * f64::from(old.min(new));
                let (re, im) = transfer(found.samples(), new, frequency);
                let phase = TAU * frequency * at as f64 / f64::from(old);
                let error = (re - phase.cos()).hypot(im + phase.sin());
                assert!(error < 1e-4, "{old} -> {new} Hz at {frequency} Hz: {error}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn any_length_and_rate_gives_the_right_length(n in 1usize..3000, old in 1000u32..100_000, new in 1000u32..100_000) {
            let signal = Signal::new(vec![0.25; n], old).unwrap();
            let found = resample(&signal, new).unwrap();
            let exact = n as f64 * f64::from(new) / f64::from(old);
            prop_assert!(found.samples().len() as f64 - exact < 1.0 && found.samples().len() as f64 >= exact - 1e-9, "{n} at {old} gave {}", found.samples().len());
        }
    }

    #[test]
    fn absurd_rates_are_refused() {
        let signal = Signal::new(vec![0.0; 10], 48_000).unwrap();
        for rate in [0, 999, 768_001, u32::MAX] {
            assert!(matches!(resample(&signal, rate), Err(Error::OutOfRange(_))));
        }
    }
}
