//! Exponential sine sweeps (ISO 18233:2006, annex B).

use crate::error::Error;
use crate::out_of_range::OutOfRange;
use crate::signal::Signal;

/// What an [`ExponentialSweep`] is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepConfig {
    /// Samples per second, 1 kHz to 768 kHz.
    pub sample_rate_hz: u32,
    /// Frequency at which it begins, in Hz; from 1 Hz on.
    pub from_hz: f64,
    /// Frequency at which it ends, in Hz; at least twice the first, at most half the sample rate.
    pub to_hz: f64,
    /// Length of a sweep, in seconds, 0.1 to 600. Twice the length, 3 dB more range; harmonic distortion of order k comes
    /// `duration_s` ln(k) / ln(`to_hz` / `from_hz`) before the response, and must have decayed by then.
    pub duration_s: f64,
    /// Half-cosine fade at the beginning, in seconds.
    pub fade_in_s: f64,
    /// Half-cosine fade at the end, in seconds. Both fades together last at most half the sweep.
    pub fade_out_s: f64,
    /// Silence after each sweep, in seconds, 0 to 600: longer than the room's reverberation time, or the response is cut
    /// (ISO 18233, B.5).
    pub silence_s: f64,
    /// How often it is played, 1 to 100. Twice as often, 3 dB more range, if nothing changes meanwhile.
    pub repetitions: usize,
    /// Largest amplitude, above 0 up to 1 (full scale).
    pub peak: f64,
}

impl Default for SweepConfig {
    /// 20 Hz to 20 kHz in 10 s at 48 kHz, once, half of full scale.
    fn default() -> Self {
        Self {
            sample_rate_hz: 48_000,
            from_hz: 20.0,
            to_hz: 20_000.0,
            duration_s: 10.0,
            fade_in_s: 0.1,
            fade_out_s: 0.02,
            silence_s: 3.0,
            repetitions: 1,
            peak: 0.5,
        }
    }
}

/// A sine whose frequency rises by the same factor in each second: x(t) = a sin(2 pi f1 L (exp(t / L) - 1)) with
/// L = T / ln(f2 / f1) (ISO 18233:2006, annex B; A. Farina: Simultaneous measurement of impulse response and distortion with a
/// swept-sine technique, AES 108, 2000). Its energy is the same in each octave.
///
/// ```
/// use sabine_acoustics::{ExponentialSweep, SweepConfig};
/// let sweep = ExponentialSweep::new(SweepConfig { duration_s: 2.0, repetitions: 2, ..SweepConfig::default() })?;
/// assert_eq!(sweep.samples().len(), 96_000);
/// // Two sweeps, each followed by 3 s of silence.
/// assert_eq!(sweep.playback()?.duration_s(), 10.0);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ExponentialSweep {
    config: SweepConfig,
    samples: Vec<f32>,
}

impl ExponentialSweep {
    /// Makes the sweep.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting outside the range that [`SweepConfig`] states.
    pub fn new(config: SweepConfig) -> Result<Self, Error> {
        check(&config)?;
        let rate = f64::from(config.sample_rate_hz);
        let count = (config.duration_s * rate).round() as usize;
        let scale_s = config.duration_s / (config.to_hz / config.from_hz).ln();
        let samples = (0..count)
            .map(|i| {
                let t = i as f64 / rate;
                let turns = config.from_hz * scale_s * (t / scale_s).exp_m1();
                let left_s = (count - 1 - i) as f64 / rate;
                let gain = fade(t, config.fade_in_s) * fade(left_s, config.fade_out_s);
                (config.peak * gain * (std::f64::consts::TAU * turns.fract()).sin()) as f32
            })
            .collect();
        Ok(Self { config, samples })
    }

    /// What it was made of.
    pub fn config(&self) -> &SweepConfig {
        &self.config
    }

    /// One sweep, without silence.
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// What is played: every repetition with the silence after it.
    ///
    /// # Errors
    /// None for a sweep that was made: the samples are finite.
    pub fn playback(&self) -> Result<Signal, Error> {
        let mut all = Vec::with_capacity(self.period() * self.config.repetitions);
        for repetition in 1..=self.config.repetitions {
            all.extend_from_slice(&self.samples);
            all.resize(repetition * self.period(), 0.0);
        }
        Signal::new(all, self.config.sample_rate_hz)
    }

    /// Samples from the start of one repetition to that of the next.
    pub(crate) fn period(&self) -> usize {
        self.samples.len() + (self.config.silence_s * f64::from(self.config.sample_rate_hz)).round() as usize
    }

    /// Time in which the frequency rises by a factor of e, in seconds.
    pub(crate) fn scale_s(&self) -> f64 {
        self.config.duration_s / (self.config.to_hz / self.config.from_hz).ln()
    }

    /// Squared magnitude of the spectrum without fades, by the method of stationary phase.
    pub(crate) fn spectrum_power(&self, frequency_hz: f64) -> f64 {
        let rate = f64::from(self.config.sample_rate_hz);
        (0.5 * self.config.peak * rate).powi(2) * self.scale_s() / frequency_hz.max(1.0)
    }
}

/// Rises from 0 to 1 within a time.
fn fade(time_s: f64, length_s: f64) -> f64 {
    if time_s >= length_s { 1.0 } else { 0.5 - 0.5 * (std::f64::consts::PI * time_s / length_s).cos() }
}

fn check(config: &SweepConfig) -> Result<(), Error> {
    let rate = f64::from(config.sample_rate_hz);
    let within = OutOfRange::check;
    within("sample_rate_hz", rate, 1e3, 768e3, "between 1 kHz and 768 kHz")?;
    within("from_hz", config.from_hz, 1.0, 0.25 * rate, "between 1 Hz and a quarter of the sample rate")?;
    let highest = "between twice from_hz and half the sample rate";
    within("to_hz", config.to_hz, 2.0 * config.from_hz, 0.5 * rate, highest)?;
    within("duration_s", config.duration_s, 0.1, 600.0, "between 0.1 and 600 s")?;
    let fades = "such that both fades last at most half the sweep";
    within("fade_in_s", config.fade_in_s, 0.0, 0.5 * config.duration_s, fades)?;
    within("fade_out_s", config.fade_out_s, 0.0, 0.5 * config.duration_s - config.fade_in_s, fades)?;
    within("silence_s", config.silence_s, 0.0, 600.0, "between 0 and 600 s")?;
    within("repetitions", config.repetitions as f64, 1.0, 100.0, "between 1 and 100")?;
    within("peak", config.peak, 1e-3, 1.0, "between 0.001 and 1 (full scale)")?;
    let samples = (config.duration_s + config.silence_s) * rate * config.repetitions as f64;
    Ok(within("number of samples", samples, 1.0, 1e9, "at most 1e9")?)
}
