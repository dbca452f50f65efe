#![allow(clippy::unwrap_used)] // a panic is how a test fails

use super::*;
use crate::likelihood::expansion::Expansion;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Logarithm of the density of a normal distribution, from its covariance as it stands.
fn ln_normal(residual: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let inverse = covariance.clone().try_inverse().unwrap();
    let n = residual.len() as f64;
    -0.5 * ((residual.transpose() * inverse * residual)[(0, 0)]
        + covariance.determinant().ln()
        + n * std::f64::consts::TAU.ln())
}

/// Two hypotheses about five data: slopes, means of the predictions, and what is known of the parameters.
struct Problem {
    expansion: Expansion,
    slopes: [DMatrix<f64>; 2],
    means: [DVector<f64>; 2],
    covariances: [DMatrix<f64>; 2],
}

impl Problem {
    fn new() -> Self {
        let of = |seed: f64, columns: usize| {
            DMatrix::from_fn(5, columns, |i, j| (seed + 1.7 * i as f64 + 0.9 * j as f64).sin())
        };
        let spread = |seed: f64, n: usize| {
            let half = DMatrix::from_fn(n, n, |i, j| 0.4 * (seed + 2.3 * i as f64 - 1.1 * j as f64).cos());
            &half * half.transpose() + DMatrix::identity(n, n) * 0.2
        };
        Self {
            expansion: Expansion {
                predicted: DVector::zeros(5),
                slopes: DMatrix::zeros(5, 0),
                weights: DVector::from_vec(vec![3.0, 2.0, 8.0, 1.0, 4.0]),
                shared: of(0.4, 1) * 0.5,
            },
            slopes: [of(1.0, 2), of(5.0, 3)],
            means: [of(2.0, 1).column(0) * 1.5, of(3.0, 1).column(0).into_owned()],
            covariances: [spread(0.3, 2), spread(1.9, 3)],
        }
    }

    /// Covariance of the data under a hypothesis.
    fn predictive(&self, k: usize) -> DMatrix<f64> {
        DMatrix::from_diagonal(&self.expansion.weights.map(|w| 1.0 / w))
            + &self.expansion.shared * self.expansion.shared.transpose()
            + &self.slopes[k] * &self.covariances[k] * self.slopes[k].transpose()
    }

    fn expected(&self, truth: usize) -> f64 {
        let mut columns = DMatrix::zeros(5, 7);
        columns.columns_mut(0, 2).copy_from(&self.slopes[0]);
        columns.columns_mut(2, 3).copy_from(&self.slopes[1]);
        columns.set_column(5, &self.means[0]);
        columns.set_column(6, &self.means[1]);
        let products = self.expansion.products(&columns);
        let known = self.covariances.clone().map(|c| Known::of_covariance(c).unwrap());
        let one = |k: usize| Predictive {
            known: &known[k],
            slopes: if k == 0 { 0..2 } else { 2..5 },
            predicted: 5 + k,
        };
        expected_nats(&products, &one(truth), &one(1 - truth)).unwrap()
    }
}

#[test]
fn expected_evidence_is_the_mean_of_what_is_realised() {
    let problem = Problem::new();
    let covariances = [0, 1].map(|k| problem.predictive(k));
    for truth in [0, 1] {
        let half = covariances[truth].clone().cholesky().unwrap().unpack();
        let mut random = Pcg64Mcg::seed_from_u64(7);
        const DRAWS: usize = 40_000;
        let realised: Vec<f64> = (0..DRAWS)
            .map(|_| {
                let noise = DVector::from_fn(5, |_, _| random.sample::<f64, _>(StandardNormal));
                let data = &problem.means[truth] + &half * noise;
                let ln = |k: usize| ln_normal(&(&data - &problem.means[k]), &covariances[k]);
                ln(truth) - ln(1 - truth)
            })
            .collect();
        let mean = realised.iter().sum::<f64>() / DRAWS as f64;
        let variance = realised.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (DRAWS - 1) as f64;
        let standard_error = (variance / DRAWS as f64).sqrt();
        let expected = problem.expected(truth);
        assert!(expected > 0.3, "a test of nothing: {expected}");
        assert!((mean - expected).abs() < 4.0 * standard_error, "{mean} {expected} {standard_error}");
    }
}

#[test]
fn expected_evidence_is_the_divergence_of_two_normal_distributions() {
    let problem = Problem::new();
    let [first, second] = [0, 1].map(|k| problem.predictive(k));
    let inverse = second.clone().try_inverse().unwrap();
    let apart = &problem.means[0] - &problem.means[1];
    let expected = 0.5
        * ((apart.transpose() * &inverse * &apart)[(0, 0)] + (inverse * &first).trace() - 5.0
            + (second.determinant() / first.determinant()).ln());
    assert!((problem.expected(0) - expected).abs() < 1e-10, "{} {expected}", problem.expected(0));
}

#[test]
fn a_known_line_against_none_is_half_its_squared_distance() {
    // Two data of variance 1, a level known to 2 shared by both hypotheses, which differ by a known slope: the level takes its part.
    let one = Expansion {
        predicted: DVector::zeros(2),
        slopes: DMatrix::zeros(2, 0),
        weights: DVector::from_element(2, 1.0),
        shared: DMatrix::zeros(2, 0),
    };
    let columns = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.0, 1.0, 3.0, 0.0]);
    let products = one.products(&columns);
    let known = Known::independent(&[2.0]);
    let of = |predicted| Predictive { known: &known, slopes: 0..1, predicted };
    // (V + S) = [[5, 4], [4, 5]], whose inverse is [[5, -4], [-4, 5]] / 9: 1/2 * 9 * 5 / 9.
    assert!((expected_nats(&products, &of(1), &of(2)).unwrap() - 2.5).abs() < 1e-12);
    let projected = known.projected(&products, 0..1, 1..2).unwrap();
    assert!((projected[(0, 0)] - 5.0).abs() < 1e-12);
    // What is learned of the level: 1/2 ln det(1 + 4 * 2).
    let information = DMatrix::from_element(1, 1, 2.0);
    assert!((known.information_nats(&information).unwrap() - 0.5 * 9f64.ln()).abs() < 1e-12);
}

#[test]
fn the_size_that_is_named_is_that_of_which_so_many_nats_are_expected() {
    // Against the evidence of one datum y = size + e, by numerical integration over e.
    let (information, prior_variance, size) = (4.0f64, 0.6f64, 1.7f64);
    let variance = 1.0 / information;
    let evidence = |y: f64| {
        let wide = variance + prior_variance;
        0.5 * (y * y / variance - y * y / wide - (wide / variance).ln())
    };
    let step = 1e-3;
    let mean: f64 = (-8000..=8000)
        .map(|k| {
            let z = f64::from(k) * step;
            let density = (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
            density * step * evidence(size + z * variance.sqrt())
        })
        .sum();
    assert!(mean > 1.0, "a test of nothing: {mean}");
    let found = size_that_reaches(mean, information, prior_variance);
    assert!((found - size).abs() < 1e-6, "{found}");
    assert_eq!(size_that_reaches(3.0, 0.0, 1.0), f64::INFINITY);
}
