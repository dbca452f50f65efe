//! Sweeps, and responses from their recordings.

use crate::failure::Failure;
use crate::samples::{Samples, rate_hz, signal};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use sabine::acoustics::{DeconvolutionConfig, ExponentialSweep, SweepConfig, deconvolve};

/// An exponential sweep.
#[pyclass(frozen)]
pub struct Sweep(ExponentialSweep);

/// What a sweep is made of, as `sabine.Sweep` says it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Settings {
    sample_rate: f64,
    from_hz: f64,
    to_hz: f64,
    duration_s: f64,
    fade_in_s: f64,
    fade_out_s: f64,
    silence_s: f64,
    repetitions: usize,
    peak: f64,
}

/// The responses of a recording; in Python a dictionary, which `sabine.SweepMeasurement` takes.
#[derive(IntoPyObject)]
struct Found<'py> {
    responses: Bound<'py, PyArray2<f32>>,
    sample_rate: u32,
    start_s: f64,
    differences_db: Bound<'py, PyArray1<f64>>,
    left_out: Vec<usize>,
    clock_drift_ppm: Option<f64>,
}

#[pymethods]
impl Sweep {
    #[new]
    fn new(py: Python<'_>, settings: Settings) -> Result<Self, Failure> {
        let config = SweepConfig {
            sample_rate_hz: rate_hz(settings.sample_rate)?,
            from_hz: settings.from_hz,
            to_hz: settings.to_hz,
            duration_s: settings.duration_s,
            fade_in_s: settings.fade_in_s,
            fade_out_s: settings.fade_out_s,
            silence_s: settings.silence_s,
            repetitions: settings.repetitions,
            peak: settings.peak,
        };
        Ok(Self(py.detach(|| ExponentialSweep::new(config))?))
    }

    /// One sweep without silence.
    fn samples<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        PyArray1::from_slice(py, self.0.samples())
    }

    /// Every repetition with the silence after it.
    fn playback<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray1<f32>>, Failure> {
        Ok(PyArray1::from_vec(py, py.detach(|| self.0.playback())?.into_samples()))
    }

    /// Responses of a recording, one for each channel.
    fn deconvolve<'py>(
        &self,
        py: Python<'py>,
        channels: Vec<Samples<'py>>,
        sample_rate: f64,
        leave_out_differing: bool,
        allow_clock_drift: bool,
    ) -> Result<Found<'py>, Failure> {
        let channels =
            channels.iter().map(|samples| signal(samples, sample_rate)).collect::<Result<Vec<_>, _>>()?;
        let config = DeconvolutionConfig { leave_out_differing, allow_clock_drift };
        let found = py.detach(|| deconvolve(&channels, &self.0, &config))?;
        let rows: Vec<Vec<f32>> =
            found.responses.into_iter().map(|response| response.into_samples()).collect();
        Ok(Found {
            responses: PyArray2::from_vec2(py, &rows)?,
            sample_rate: self.0.config().sample_rate_hz,
            start_s: found.start_s,
            differences_db: PyArray1::from_vec(py, found.differences_db),
            left_out: found.left_out,
            clock_drift_ppm: found.clock_drift_ppm,
        })
    }
}
