//! Sampled sound.

use crate::error::Error;

/// Mono samples at a sample rate. Full scale is 1; the samples are finite and there is at least one.
/// ```
/// use sabine_acoustics::Signal;
/// let second = Signal::new(vec![0.5, -0.25], 2_000)?;
/// assert_eq!((second.peak(), second.duration_s()), (0.5, 1e-3));
/// assert!(Signal::new(vec![f32::NAN], 48_000).is_err());
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    samples: Vec<f32>,
    sample_rate_hz: u32,
}

impl Signal {
    /// Checks and takes the samples.
    ///
    /// # Errors
    /// [`Error::Empty`], [`Error::NotFinite`], or [`Error::OutOfRange`] for a sample rate outside 1 kHz to 768 kHz.
    pub fn new(samples: Vec<f32>, sample_rate_hz: u32) -> Result<Self, Error> {
        check_samples("signal", &samples, sample_rate_hz)?;
        Ok(Self { samples, sample_rate_hz })
    }

    /// The samples.
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// Samples per second.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// Length in seconds.
    pub fn duration_s(&self) -> f64 {
        self.samples.len() as f64 / f64::from(self.sample_rate_hz)
    }

    /// Largest magnitude.
    pub fn peak(&self) -> f32 {
        peak(&self.samples)
    }

    /// Gives the samples back.
    pub fn into_samples(self) -> Vec<f32> {
        self.samples
    }
}

/// The **pressure** at a receiver after an impulse at a source: what sound is convolved with.
///
/// Scaled so that the direct sound of an omnidirectional source at 1 m has amplitude 1. Sample 0 is the instant of
/// emission unless a measurement says otherwise.
/// ```
/// use sabine_acoustics::{ImpulseResponse, Onset};
/// // The direct sound over 3.43 m at 343 m/s.
/// let mut samples = vec![0.0; 4800];
/// samples[480] = 1.0 / 3.43;
/// let response = ImpulseResponse::new(samples, 48_000)?;
/// let arrival_s = Onset::find(response.samples(), 48_000)?.index as f64 / 48_000.0;
/// assert!((arrival_s * 343.0 - 3.43).abs() < 0.08, "{arrival_s}");
/// assert!((response.peak() * 3.43 - 1.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ImpulseResponse {
    samples: Vec<f32>,
    sample_rate_hz: u32,
}

impl ImpulseResponse {
    /// Checks and takes the samples.
    ///
    /// # Errors
    /// As [`Signal::new`].
    pub fn new(samples: Vec<f32>, sample_rate_hz: u32) -> Result<Self, Error> {
        check_samples("impulse response", &samples, sample_rate_hz)?;
        Ok(Self { samples, sample_rate_hz })
    }

    /// The samples.
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// Samples per second.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// Length in seconds.
    pub fn duration_s(&self) -> f64 {
        self.samples.len() as f64 / f64::from(self.sample_rate_hz)
    }

    /// Largest magnitude.
    pub fn peak(&self) -> f32 {
        peak(&self.samples)
    }

    /// Gives the samples back.
    pub fn into_samples(self) -> Vec<f32> {
        self.samples
    }
}

impl From<Signal> for ImpulseResponse {
    fn from(signal: Signal) -> Self {
        Self { samples: signal.samples, sample_rate_hz: signal.sample_rate_hz }
    }
}

impl From<ImpulseResponse> for Signal {
    fn from(response: ImpulseResponse) -> Self {
        Self { samples: response.samples, sample_rate_hz: response.sample_rate_hz }
    }
}

fn peak(samples: &[f32]) -> f32 {
    samples.iter().fold(0.0, |peak, s| peak.max(s.abs()))
}

pub(crate) fn check_samples(what: &'static str, samples: &[f32], sample_rate_hz: u32) -> Result<(), Error> {
    if samples.is_empty() {
        return Err(Error::Empty { what });
    }
    if let Some(index) = samples.iter().position(|s| !s.is_finite()) {
        return Err(Error::NotFinite { what, index });
    }
    Ok(crate::out_of_range::OutOfRange::check(
        "sample rate (Hz)",
        f64::from(sample_rate_hz),
        1e3,
        768e3,
        "between 1 kHz and 768 kHz",
    )?)
}
