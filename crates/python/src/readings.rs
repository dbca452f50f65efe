//! Readings as columns of numbers, one for each band, and single ones.

use numpy::PyArray1;
use pyo3::prelude::*;
use sabine::acoustics::{Estimate, PerBand, Reading};

/// The values of a quantity and their standard errors, NaN where there is none, and for each band the reason or `None`.
/// In Python: a dictionary, which `sabine.Readings` takes.
#[derive(IntoPyObject)]
pub struct Columns<'py> {
    value: Bound<'py, PyArray1<f64>>,
    standard_error: Bound<'py, PyArray1<f64>>,
    reason: Vec<Option<String>>,
}

impl<'py> Columns<'py> {
    /// Columns of readings.
    pub fn of(py: Python<'py>, readings: &PerBand<Reading>) -> Self {
        let column = |pick: fn(&Estimate) -> f64| {
            let values = readings.values().iter().map(|reading| reading.as_ref().map_or(f64::NAN, pick));
            PyArray1::from_iter(py, values)
        };
        let reason = |reading: &Reading| reading.as_ref().err().map(ToString::to_string);
        Self {
            value: column(|estimate| estimate.value),
            standard_error: column(|estimate| estimate.standard_error),
            reason: readings.values().iter().map(reason).collect(),
        }
    }

    /// Columns of estimates, which are all there.
    pub fn of_estimates(py: Python<'py>, estimates: &PerBand<Estimate>) -> Self {
        Self::of(py, &estimates.map(|estimate| Ok(*estimate)))
    }
}

/// A single reading: NaN where there is none, and then the reason. In Python: a dictionary, which `sabine.Reading` takes.
#[derive(IntoPyObject)]
pub struct Single {
    value: f64,
    standard_error: f64,
    reason: Option<String>,
}

impl From<&Reading> for Single {
    fn from(reading: &Reading) -> Self {
        match reading {
            Ok(Estimate { value, standard_error }) => {
                Self { value: *value, standard_error: *standard_error, reason: None }
            }
            Err(reason) => {
                Self { value: f64::NAN, standard_error: f64::NAN, reason: Some(reason.to_string()) }
            }
        }
    }
}
