//! Fits of arrival times that were made before.

use crate::likelihood::laplace::LaplaceFit;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// A fit, and where the parameters of each case stand.
pub(crate) type ArrivalFit = (LaplaceFit, Vec<usize>);

/// What a fit was asked for: cases (candidates, in order) and which responses are used.
type Asked = (Vec<usize>, Vec<bool>);

/// Elements of covariances that are kept: 64 MB. They grow with the square of the number of places, and a fit that is not kept is made
/// again.
const MOST_ELEMENTS: usize = 8_000_000;

/// Fits of arrival times by their cases (candidates, in order) and the responses that were used. While a diagnosis runs nothing changes that
/// they rest on: what was measured, the cases, and what the room as stated predicts. Causes that are named re-trace decays alone.
#[derive(Default)]
pub(crate) struct ArrivalFits {
    known: Mutex<Known>,
}

#[derive(Default)]
struct Known {
    fits: HashMap<Asked, ArrivalFit>,
    /// Elements of their covariances.
    elements: usize,
}

impl ArrivalFits {
    /// The fit of these cases to these responses, made now if it is not known.
    pub fn of<E>(
        &self,
        cases: Vec<usize>,
        used: &[bool],
        fit: impl FnOnce() -> Result<ArrivalFit, E>,
    ) -> Result<ArrivalFit, E> {
        let key = (cases, used.to_vec());
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known().fits.get(&key) {
            return Ok(found.clone());
        }
        let found = fit()?;
        let mut known = known();
        let elements = known.elements + found.0.covariance.len();
        if elements <= MOST_ELEMENTS && known.fits.insert(key, found.clone()).is_none() {
            known.elements = elements;
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use nalgebra::DMatrix;

    fn of_size(size: usize) -> LaplaceFit {
        let covariance = DMatrix::zeros(size, size);
        let [log_likelihood, log_posterior, log_evidence] = [0.0; 3];
        LaplaceFit {
            values: Vec::new(),
            log_likelihood,
            log_posterior,
            covariance,
            log_evidence,
            converged: true,
        }
    }

    #[test]
    fn a_fit_is_made_once_for_each_set_of_cases_and_responses() {
        let fits = ArrivalFits::default();
        let mut made = 0;
        let mut fit = |cases: &[usize], used: &[bool]| {
            let found = fits.of(cases.to_vec(), used, || {
                made += 1;
                let fit = LaplaceFit { values: vec![f64::from(made)], ..of_size(0) };
                Ok::<_, ()>((fit, Vec::new()))
            });
            found.unwrap().0.values[0]
        };
        let asked: [(&[usize], &[bool]); 5] = [
            (&[], &[true; 2]),
            (&[3], &[true; 2]),
            (&[3], &[true, false]),
            (&[3], &[true; 2]),
            (&[], &[true; 2]),
        ];
        assert_eq!(asked.map(|(cases, used)| fit(cases, used)), [1.0, 2.0, 3.0, 2.0, 1.0]);
        // What would take too much memory is not kept.
        let mut made = 0;
        for (size, expected) in [(2_000, 1), (2_000, 1), (2_100, 2), (2_100, 3)] {
            let large = || {
                made += 1;
                Ok::<_, ()>((of_size(size), Vec::new()))
            };
            fits.of(vec![size], &[true], large).unwrap();
            assert_eq!(made, expected, "{size}");
        }
        // One that fails is tried again.
        assert_eq!(fits.of(vec![4], &[true], || Err("no")).err(), Some("no"));
        assert_eq!(fits.of(vec![4], &[true], || Err("still no")).err(), Some("still no"));
    }
}
