//! The filter as a value.

use crate::grid::Grid;
use crate::octave::active_bands;
use crate::plans::planned;
use crate::{EqFilterConfig, Error, convolve};
use sabine_acoustics::{Bands, PerBand, Signal};

/// How the phase of a filter runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Symmetric about the middle tap: every frequency is delayed alike.
    Linear,
    /// The least delay that the magnitude permits.
    Minimum,
}

/// An FIR filter with given gains in octave bands.
///
/// ```
/// use sabine_acoustics::{Bands, PerBand};
/// use sabine_eqfilter::{EqFilter, EqFilterConfig};
/// let gains = PerBand::new(Bands::EQ, vec![-6.0, 3.0, 0.0, 1.0, 0.0, -2.0, -8.0])?;
/// let filter = EqFilter::design(&gains, 16_000, EqFilterConfig::PAPER)?;
/// assert_eq!((filter.taps().len(), filter.delay_samples()), (1025, 512));
/// for (realised, wanted) in filter.realised_db().values().iter().zip(gains.values()) {
///     assert!((realised.unwrap() - wanted).abs() < 0.01);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct EqFilter {
    taps: Vec<f32>,
    sample_rate_hz: u32,
    phase: Phase,
    wanted_db: PerBand<f64>,
    realised_db: PerBand<Option<f64>>,
}

impl EqFilter {
    /// A linear-phase filter of odd length (Type I) whose gain in each octave band, smoothing included, is the one wanted.
    ///
    /// The plans of the last few bands, rates and settings are kept, so that a repeated design takes a fraction of the time of
    /// the first. To hold a plan of your own, use [`EqDesigner`](crate::EqDesigner).
    ///
    /// # Errors
    /// As [`EqDesigner::new`](crate::EqDesigner::new) and [`EqDesigner::design`](crate::EqDesigner::design).
    pub fn design(
        gains_db: &PerBand<f64>,
        sample_rate_hz: u32,
        config: EqFilterConfig,
    ) -> Result<Self, Error> {
        planned(gains_db.bands(), sample_rate_hz, config)?.design(gains_db)
    }

    pub(crate) fn linear(
        taps: Vec<f32>,
        sample_rate_hz: u32,
        wanted_db: PerBand<f64>,
        realised_db: PerBand<Option<f64>>,
    ) -> Self {
        Self { taps, sample_rate_hz, phase: Phase::Linear, wanted_db, realised_db }
    }

    /// The same filter with other taps.
    pub(crate) fn with_taps(self, taps: Vec<f32>, phase: Phase) -> Self {
        let realised_db = band_gains_db(&taps, self.sample_rate_hz, self.wanted_db.bands());
        Self { taps, phase, realised_db, ..self }
    }

    /// The taps, the first in time first.
    pub fn taps(&self) -> &[f32] {
        &self.taps
    }

    /// Samples per second.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// How its phase runs.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Delay in samples, the same at all frequencies; 0 for minimum phase.
    pub fn delay_samples(&self) -> usize {
        match self.phase {
            Phase::Linear => self.taps.len() / 2,
            Phase::Minimum => 0,
        }
    }

    /// Delay in seconds.
    pub fn delay_s(&self) -> f64 {
        self.delay_samples() as f64 / f64::from(self.sample_rate_hz)
    }

    /// The gains asked for, in dB.
    pub fn wanted_db(&self) -> &PerBand<f64> {
        &self.wanted_db
    }

    /// The gain of the filter in each band, in dB: its power response averaged over the octave; `None` for a band whose
    /// centre lies above half the sample rate.
    pub fn realised_db(&self) -> &PerBand<Option<f64>> {
        &self.realised_db
    }

    /// Gain at one frequency in dB.
    pub fn gain_db(&self, frequency_hz: f64) -> f64 {
        10.0 * power_at(&self.taps, frequency_hz / f64::from(self.sample_rate_hz)).log10()
    }

    /// The signal filtered, as long as it was, with the delay of the filter taken out.
    ///
    /// # Errors
    /// [`Error::SampleRate`] for a signal at another sample rate, [`Error::Acoustics`] if the result overflows.
    pub fn apply(&self, signal: &Signal) -> Result<Signal, Error> {
        let full = self.apply_with_delay(signal)?;
        let samples = full.samples()[self.delay_samples()..][..signal.samples().len()].to_vec();
        Ok(Signal::new(samples, self.sample_rate_hz)?)
    }

    /// The whole convolution, `signal + taps - 1` samples: what comes out is [`EqFilter::delay_samples`] late.
    ///
    /// # Errors
    /// As [`EqFilter::apply`].
    pub fn apply_with_delay(&self, signal: &Signal) -> Result<Signal, Error> {
        if signal.sample_rate_hz() != self.sample_rate_hz {
            return Err(Error::SampleRate {
                filter_hz: self.sample_rate_hz,
                signal_hz: signal.sample_rate_hz(),
            });
        }
        Ok(Signal::new(convolve(signal.samples(), &self.taps), self.sample_rate_hz)?)
    }
}

/// Mean power gain of some taps over each octave in dB.
pub(crate) fn band_gains_db(taps: &[f32], sample_rate_hz: u32, bands: Bands) -> PerBand<Option<f64>> {
    let active = active_bands(bands, sample_rate_hz);
    let gains = Grid::new(taps.len() / 2, sample_rate_hz).band_gains_db(taps, bands, active);
    PerBand::from_fn(bands, |b| gains.get(b).copied())
}

/// Power response at a frequency in cycles per sample.
fn power_at(taps: &[f32], cycles: f64) -> f64 {
    let (sin, cos) = (std::f64::consts::TAU * cycles).sin_cos();
    // Goertzel's recurrence.
    let (mut s1, mut s2) = (0.0, 0.0);
    for &tap in taps {
        (s1, s2) = (f64::from(tap) + 2.0 * cos * s1 - s2, s1);
    }
    let (re, im) = (s1 - s2 * cos, s2 * sin);
    re * re + im * im
}
