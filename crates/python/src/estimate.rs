//! Reverberation time and equalisation heard in speech.

use crate::bands::centres_hz;
use crate::failure::Failure;
use crate::readings::Columns;
use crate::samples::{Samples, signal};
use pyo3::prelude::*;
use sabine::estimator::Estimator;

/// What speech tells; in Python a dictionary.
#[derive(IntoPyObject)]
pub struct Heard<'py> {
    t60_bands_hz: Vec<f64>,
    t60_s: Columns<'py>,
    eq_bands_hz: Vec<f64>,
    eq_db: Columns<'py>,
    warnings: Vec<String>,
}

/// Estimates with the weights that the library brings along.
///
/// # Errors
/// Samples or sample rate are refused, or the recording is too short, silent or too loud.
#[pyfunction]
pub fn estimate<'py>(
    py: Python<'py>,
    samples: Samples<'py>,
    sample_rate: f64,
) -> Result<Heard<'py>, Failure> {
    let speech = signal(&samples, sample_rate)?;
    let heard =
        py.detach(|| -> Result<_, Failure> { Ok(Estimator::pretrained()?.estimate_detailed(&speech)?) })?;
    let (t60_s, eq_db) = (heard.targets.t60_s(), heard.targets.eq_db());
    Ok(Heard {
        t60_bands_hz: centres_hz(t60_s.bands()),
        t60_s: Columns::of_estimates(py, t60_s),
        eq_bands_hz: centres_hz(eq_db.bands()),
        eq_db: Columns::of_estimates(py, eq_db),
        warnings: heard.warnings.iter().map(ToString::to_string).collect(),
    })
}
