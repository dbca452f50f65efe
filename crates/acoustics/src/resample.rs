//! Changing the sample rate.

use crate::error::check_range;
use crate::{Error, ImpulseResponse, Signal};
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
    check_range("sample rate (Hz)", f64::from(new_hz), 1e3, 768e3, "between 1 kHz and 768 kHz")?;
    let failed = |error: Box<dyn std::error::Error + Send + Sync>| Error::implementation("resampling", error);
    let divisor = u64::from(greatest_common_divisor(old_hz, new_hz));
    // Blocks of `unit` old samples become blocks of whole new samples. An even number of units makes the delay of half a block
    // a whole number of samples on both sides.
    let unit = u64::from(old_hz) / divisor;
    let lower = u64::from(old_hz.min(new_hz)) / divisor;
    let block = 2 * FILTER_SAMPLES.div_ceil(2 * lower) * unit;
    let mut resampler = Fft::<f64>::new_custom(
        old_hz as usize,
        new_hz as usize,
        block as usize,
        1,
        1,
        WindowFunction::BlackmanHarris2,
        FixedSync::Both,
    )
    .map_err(|error| failed(error.into()))?;
    let input: Vec<f64> = samples.iter().map(|&s| f64::from(s)).collect();
    let buffer = InterleavedSlice::new(&input, 1, input.len()).map_err(|error| failed(error.into()))?;
    let mut output =
        resampler.process_all(&buffer, input.len(), None).map_err(|error| failed(error.into()))?.take_data();
    // rubato rounds the length up in floating point, which may give one sample too many.
    let exact = (samples.len() as u64 * u64::from(new_hz)).div_ceil(u64::from(old_hz));
    output.resize(exact as usize, 0.0);
    Ok(output.into_iter().map(|s| (s * gain) as f32).collect())
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
            assert!(matches!(resample(&signal, rate), Err(Error::OutOfRange { .. })));
        }
    }
}
