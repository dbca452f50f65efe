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

/// Estimates with the weights that the library brings along, from one recording or several of one room.
///
/// # Errors
/// Samples or sample rate are refused, or the recording is too short, silent or too loud.
#[pyfunction]
pub fn estimate<'py>(
    py: Python<'py>,
    recordings: Vec<Samples<'py>>,
    sample_rate: f64,
) -> Result<Heard<'py>, Failure> {
    let speech =
        recordings.iter().map(|samples| signal(samples, sample_rate)).collect::<Result<Vec<_>, _>>()?;
    let (targets, warnings) = py.detach(|| -> Result<_, Failure> {
        let estimator = Estimator::pretrained()?;
        let heard = estimator.estimate_batch(&speech).into_iter().collect::<Result<Vec<_>, _>>()?;
        let targets = match heard.as_slice() {
            [one] => one.targets.clone(),
            several => estimator.combine(several)?,
        };
        let mut warnings: Vec<String> = Vec::new();
        for (number, one) in heard.iter().enumerate() {
            let which = if heard.len() > 1 { format!("recording {number}: ") } else { String::new() };
            warnings.extend(one.warnings.iter().map(|warning| format!("{which}{warning}")));
        }
        Ok((targets, warnings))
    })?;
    let (t60_s, eq_db) = (targets.t60_s(), targets.eq_db());
    Ok(Heard {
        t60_bands_hz: centres_hz(t60_s.bands()),
        t60_s: Columns::of_estimates(py, t60_s),
        eq_bands_hz: centres_hz(eq_db.bands()),
        eq_db: Columns::of_estimates(py, eq_db),
        warnings,
    })
}
