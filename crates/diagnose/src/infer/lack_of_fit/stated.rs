//! Whether what was fitted contradicts what was stated: absorption against the tables, gains and places against how well they are known.
//!
//! Under a right model and right statements a fitted value is a draw from the prior, shrunk towards its mean: where a fit with the
//! covariance S has learned from a prior with the covariance P, its distance from the prior's mean has the covariance P - S (Evans and
//! Moshonov 2006, on conflicts of prior and data). Directions about which the data say little are left out.

use crate::likelihood::laplace::{LaplaceFit, Model, covariance_beforehand};
use crate::statistics::chi_squared_tail;
use nalgebra::{DMatrix, DVector};

/// A direction counts if the data have taken this share of the prior's variance away.
const LEAST_LEARNED: f64 = 0.1;

/// Probability that parameters of a fit lie as far from what was stated of them by chance. `model` is the one that was fitted: what its priors
/// say together counts, as of absorption that goes together over the octaves.
pub(super) fn contradiction(fit: &LaplaceFit, model: &dyn Model, parameters: &[usize]) -> f64 {
    let n = parameters.len();
    // With the prior's covariance P = L L', L^-1 (x - mean) has the covariance 1 beforehand.
    let whiten = covariance_beforehand(model, parameters).and_then(|p| Some(p.cholesky()?.l()));
    let Some(l) = whiten else { return 1.0 };
    let off = DVector::from_fn(n, |i, _| fit.values[parameters[i]] - model.priors()[parameters[i]].mean);
    let left = DMatrix::from_fn(n, n, |i, j| fit.covariance[(parameters[i], parameters[j])]);
    let solved = |m: &DMatrix<f64>| l.solve_lower_triangular(m);
    let left = solved(&left).and_then(|half| solved(&half.transpose()));
    let (Some(off), Some(left)) = (l.solve_lower_triangular(&off), left) else { return 1.0 };
    let directions = (DMatrix::identity(n, n) - left).symmetric_eigen();
    let (mut sum, mut degrees) = (0.0, 0.0);
    for (share, direction) in directions.eigenvalues.iter().zip(directions.eigenvectors.column_iter()) {
        if *share > LEAST_LEARNED {
            sum += direction.dot(&off).powi(2) / share;
            degrees += 1.0;
        }
    }
    chi_squared_tail(sum, degrees)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::likelihood::laplace::{Prior, Slopes, Together};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    /// Two parameters about zero, which correlate beforehand.
    struct Pair {
        priors: [Prior; 2],
        together: Vec<Together>,
        covariance: DMatrix<f64>,
    }

    impl Pair {
        fn of(sd: f64, correlation: f64) -> Self {
            let block = DMatrix::from_row_slice(2, 2, &[1.0, correlation, correlation, 1.0]);
            let priors = [Prior::normal(0.0, sd); 2];
            let together = if correlation == 0.0 {
                Vec::new()
            } else {
                vec![Together::new(0..2, block.clone()).unwrap()]
            };
            Self { priors, together, covariance: block * sd.powi(2) }
        }

        fn drawn(&self, normal: [f64; 2]) -> [f64; 2] {
            let l = self.covariance.clone().cholesky().unwrap().l();
            let x = l * DVector::from_column_slice(&normal);
            [x[0], x[1]]
        }

        /// The data determine the sum better than the difference: `y = 3 (a + b) + noise` and `y = a - b + noise`.
        fn fitted(&self, truth: [f64; 2], noise: [f64; 2]) -> LaplaceFit {
            let design = DMatrix::from_row_slice(2, 2, &[3.0, 3.0, 1.0, -1.0]);
            let data = &design * DVector::from_column_slice(&truth) + DVector::from_column_slice(&noise);
            let precision = design.transpose() * &design + self.covariance.clone().try_inverse().unwrap();
            let covariance = precision.try_inverse().unwrap();
            let values = &covariance * design.transpose() * data;
            LaplaceFit {
                values: values.iter().copied().collect(),
                log_likelihood: 0.0,
                log_posterior: 0.0,
                covariance,
                log_evidence: 0.0,
                converged: true,
            }
        }
    }

    impl Model for Pair {
        fn priors(&self) -> &[Prior] {
            &self.priors
        }

        fn together(&self) -> &[Together] {
            &self.together
        }

        fn log_likelihood(&self, _: &[f64], _: Option<&mut Slopes>) -> f64 {
            0.0
        }
    }

    #[test]
    fn right_statements_are_contradicted_as_often_as_the_probability_says() {
        for (sd, correlation) in [(1.0, 0.0), (2.0, 0.0), (1.0, 0.9), (2.0, -0.8)] {
            let pair = Pair::of(sd, correlation);
            let mut random = Pcg64Mcg::seed_from_u64(3);
            let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
            let tenths = (0..2000).filter(|_| {
                let fit = pair.fitted(pair.drawn([draw(), draw()]), [draw(), draw()]);
                contradiction(&fit, &pair, &[0, 1]) < 0.1
            });
            // 200 are expected, give or take 13.
            let found = tenths.count();
            assert!((150..250).contains(&found), "{sd} {correlation}: {found}");
        }
    }

    #[test]
    fn what_lies_far_from_its_statement_is_found_where_the_data_can_tell() {
        let pair = Pair::of(1.0, 0.0);
        assert!(contradiction(&pair.fitted([6.0, 6.0], [0.0; 2]), &pair, &[0, 1]) < 1e-5);
        // Nothing is learned of a single parameter that is not part of the data.
        let fit = LaplaceFit { covariance: DMatrix::identity(2, 2), ..pair.fitted([4.0, 4.0], [0.0; 2]) };
        assert!(contradiction(&fit, &pair, &[0, 1]) > 0.99);
    }

    #[test]
    fn parameters_that_go_together_and_are_all_off_contradict_once() {
        let off = |correlation: f64| {
            let pair = Pair::of(1.0, correlation);
            contradiction(&pair.fitted([2.5, 2.5], [0.0; 2]), &pair, &[0, 1])
        };
        assert!(off(0.95) > 3.0 * off(0.0), "{} {}", off(0.95), off(0.0));
    }
}
