//! Samples of numpy as those of the library.

use crate::failure::{Failure, refused};
use numpy::PyReadonlyArray1;
use sabine::acoustics::{ImpulseResponse, Signal};

/// One contiguous channel.
pub type Samples<'py> = PyReadonlyArray1<'py, f32>;

/// An impulse response.
///
/// # Errors
/// As [`ImpulseResponse::new`]; for a sample rate that is no whole number.
pub fn response(samples: &Samples, sample_rate_hz: f64) -> Result<ImpulseResponse, Failure> {
    Ok(ImpulseResponse::new(samples.as_slice()?.to_vec(), rate_hz(sample_rate_hz)?)?)
}

/// A recording.
///
/// # Errors
/// As [`Signal::new`]; for a sample rate that is no whole number.
pub fn signal(samples: &Samples, sample_rate_hz: f64) -> Result<Signal, Failure> {
    Ok(Signal::new(samples.as_slice()?.to_vec(), rate_hz(sample_rate_hz)?)?)
}

/// A sample rate as whole Hz: Python's users have it as 44100 and as 44100.0.
///
/// # Errors
/// It is negative, too large, not finite, or has a fraction.
pub fn rate_hz(sample_rate_hz: f64) -> Result<u32, Failure> {
    let rate_hz = sample_rate_hz as u32;
    if f64::from(rate_hz) == sample_rate_hz {
        return Ok(rate_hz);
    }
    Err(refused(format!("sample_rate: {sample_rate_hz} Hz is not a whole number between 1 kHz and 768 kHz")))
}
