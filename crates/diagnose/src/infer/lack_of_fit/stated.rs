//! Whether what was fitted contradicts what was stated: absorption against the tables, gains and places against how well they are known.
//!
//! Under a right model and right statements a fitted value is a draw from the prior, shrunk towards its mean: where a fit with the
//! covariance S has learned from a prior with the covariance P, its distance from the prior's mean has the covariance P - S (Evans and
//! Moshonov 2006, on conflicts of prior and data). Directions about which the data say little are left out.

use crate::likelihood::laplace::{LaplaceFit, Prior};
use crate::statistics::chi_squared_tail;
use nalgebra::DMatrix;

/// A direction counts if the data have taken this share of the prior's variance away.
const LEAST_LEARNED: f64 = 0.1;

/// Probability that parameters of a fit lie as far from what was stated of them by chance.
pub(super) fn contradiction(fit: &LaplaceFit, priors: &[Prior], parameters: &[usize]) -> f64 {
    let n = parameters.len();
    let scaled =
        |i: usize| (fit.values[parameters[i]] - priors[parameters[i]].mean) / priors[parameters[i]].sd;
    let learned = DMatrix::from_fn(n, n, |i, j| {
        let (a, b) = (parameters[i], parameters[j]);
        f64::from(u8::from(i == j)) - fit.covariance[(a, b)] / (priors[a].sd * priors[b].sd)
    });
    let directions = learned.symmetric_eigen();
    let (mut sum, mut degrees) = (0.0, 0.0);
    for (share, direction) in directions.eigenvalues.iter().zip(directions.eigenvectors.column_iter()) {
        if *share > LEAST_LEARNED {
            let along: f64 = direction.iter().enumerate().map(|(i, v)| v * scaled(i)).sum();
            sum += along * along / share;
            degrees += 1.0;
        }
    }
    chi_squared_tail(sum, degrees)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    /// Two parameters of which the data determine the sum, and little else: `y = a + b + noise` and `y = 0.3 (a - b) + noise`.
    fn fitted(truth: [f64; 2], noise: [f64; 2]) -> LaplaceFit {
        let design = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.3, -0.3]);
        let data = &design * nalgebra::DVector::from_column_slice(&truth)
            + nalgebra::DVector::from_column_slice(&noise);
        let precision = design.transpose() * &design + DMatrix::identity(2, 2);
        let covariance = precision.try_inverse().expect("positive definite");
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

    #[test]
    fn right_statements_are_contradicted_as_often_as_the_probability_says() {
        let priors = [Prior::normal(0.0, 1.0); 2];
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
        let tenths = (0..2000).filter(|_| {
            let fit = fitted([draw(), draw()], [draw(), draw()]);
            contradiction(&fit, &priors, &[0, 1]) < 0.1
        });
        // 200 are expected, give or take 13.
        let found = tenths.count();
        assert!((150..250).contains(&found), "{found}");
    }

    #[test]
    fn what_lies_far_from_its_statement_is_found_where_the_data_can_tell() {
        let priors = [Prior::normal(0.0, 1.0); 2];
        assert!(contradiction(&fitted([6.0, 6.0], [0.0; 2]), &priors, &[0, 1]) < 1e-5);
        // Nothing is learned of a single parameter that is not part of the data.
        let fit = LaplaceFit { covariance: DMatrix::identity(2, 2), ..fitted([4.0, 4.0], [0.0; 2]) };
        assert!(contradiction(&fit, &priors, &[0, 1]) > 0.99);
    }
}
