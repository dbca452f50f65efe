//! The filter as a value.

use crate::octave::{support_hz, weight};
use crate::{EqDesigner, EqFilterConfig, Error, convolve};
use sabine_acoustics::{OctaveBands, PerBand, Signal};

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
/// use sabine_acoustics::{OctaveBands, PerBand};
/// use sabine_eqfilter::{EqFilter, EqFilterConfig};
/// let gains = PerBand::new(OctaveBands::EQ, vec![-6.0, 3.0, 0.0, 1.0, 0.0, -2.0, -8.0])?;
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
    /// For many designs with the same bands and sample rate, plan an [`EqDesigner`] once.
    ///
    /// # Errors
    /// As [`EqDesigner::new`] and [`EqDesigner::design`].
    pub fn design(
        gains_db: &PerBand<f64>,
        sample_rate_hz: u32,
        config: EqFilterConfig,
    ) -> Result<Self, Error> {
        EqDesigner::new(gains_db.bands(), sample_rate_hz, config)?.design(gains_db)
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

    /// The gain of the filter in each band, in dB: its power response averaged over the octave; `None` for a band that lies
    /// wholly above half the sample rate.
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

/// Mean power gain of some taps over each octave in dB, on a grid fine enough that it does not matter.
pub(crate) fn band_gains_db(taps: &[f32], sample_rate_hz: u32, bands: OctaveBands) -> PerBand<Option<f64>> {
    let rate = f64::from(sample_rate_hz);
    PerBand::from_fn(bands, |b| {
        if bands.edges_hz(b).0 >= rate / 2.0 {
            return None;
        }
        let (low_hz, high_hz) = support_hz(bands, b);
        let high_hz = high_hz.min(rate / 2.0);
        // Eight points for each independent value of the response.
        let points = ((high_hz - low_hz) / rate * taps.len() as f64 * 8.0).ceil().max(64.0) as usize;
        let (mut sum, mut total) = (0.0, 0.0);
        for i in 0..points {
            let hz = low_hz + (high_hz - low_hz) * (i as f64 + 0.5) / points as f64;
            let w = weight(bands, b, hz);
            sum += w * power_at(taps, hz / rate);
            total += w;
        }
        Some(10.0 * (sum / total).log10())
    })
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
