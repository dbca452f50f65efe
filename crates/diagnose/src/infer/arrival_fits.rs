//! Fits of arrival times that were made before.

use crate::likelihood::laplace::LaplaceFit;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// A fit, and where the parameters of each case stand.
pub(crate) type ArrivalFit = (LaplaceFit, Vec<usize>);

/// What a fit was asked for: cases (candidates, in order) and which responses are used.
type Asked = (Vec<usize>, Vec<bool>);

/// Fits of arrival times by their cases (candidates, in order) and the responses that were used. While a diagnosis runs nothing changes that
/// they rest on: what was measured, the cases, and what the room as stated predicts. Causes that are named re-trace decays alone.
#[derive(Default)]
pub(crate) struct ArrivalFits {
    known: Mutex<HashMap<Asked, ArrivalFit>>,
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
        if let Some(found) = known().get(&key) {
            return Ok(found.clone());
        }
        let found = fit()?;
        known().insert(key, found.clone());
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn a_fit_is_made_once_for_each_set_of_cases_and_responses() {
        let fits = ArrivalFits::default();
        let mut made = 0;
        let mut fit = |cases: &[usize], used: &[bool]| {
            let found = fits.of(cases.to_vec(), used, || {
                made += 1;
                let covariance = DMatrix::zeros(0, 0);
                let (values, converged) = (vec![f64::from(made)], true);
                let [log_likelihood, log_posterior, log_evidence] = [0.0; 3];
                let fit =
                    LaplaceFit { values, log_likelihood, log_posterior, covariance, log_evidence, converged };
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
        // One that fails is tried again.
        assert_eq!(fits.of(vec![4], &[true], || Err("no")).err(), Some("no"));
        assert_eq!(fits.of(vec![4], &[true], || Err("still no")).err(), Some("still no"));
    }
}
