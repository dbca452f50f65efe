//! The most probable parameters of a model, how sure they are, and how probable the model makes the data.

use crate::effect::Parameter;
use crate::error::Error;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// What is known of a parameter beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prior {
    pub mean: f64,
    pub sd: f64,
    pub low: f64,
    pub high: f64,
}

impl Prior {
    pub fn normal(mean: f64, sd: f64) -> Self {
        Self { mean, sd, low: f64::NEG_INFINITY, high: f64::INFINITY }
    }

    /// That of a parameter of an effect.
    pub fn of(parameter: &Parameter) -> Self {
        let (low, high) = parameter.bounds;
        Self { mean: parameter.neutral, sd: parameter.prior_sd, low, high }
    }
}

/// Parameters, one behind the other, whose priors go together: the inverse of their correlation.
#[derive(Clone, Debug)]
pub(crate) struct Together {
    pub range: Range<usize>,
    inverse: DMatrix<f64>,
    half_log_determinant: f64,
}

impl Together {
    /// `None` where the matrix is no correlation of that many parameters.
    pub fn new(range: Range<usize>, correlation: DMatrix<f64>) -> Option<Self> {
        if correlation.shape() != (range.len(), range.len()) {
            return None;
        }
        let factor = correlation.cholesky()?;
        let half_log_determinant = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        Some(Self { range, inverse: factor.inverse(), half_log_determinant })
    }
}

/// The normal densities of all parameters beforehand: each independent, but for those that go together.
#[derive(Clone, Copy)]
pub(crate) struct Priors<'a> {
    each: &'a [Prior],
    together: &'a [Together],
}

impl<'a> Priors<'a> {
    fn of(model: &'a dyn Model) -> Self {
        Self { each: model.priors(), together: model.together() }
    }

    /// Visits the inverse of the covariance: row, column, value.
    fn for_each(&self, mut visit: impl FnMut(usize, usize, f64)) {
        let mut alone = vec![true; self.each.len()];
        for block in self.together {
            for (i, a) in block.range.clone().enumerate() {
                alone[a] = false;
                for (j, b) in block.range.clone().enumerate() {
                    visit(a, b, block.inverse[(i, j)] / (self.each[a].sd * self.each[b].sd));
                }
            }
        }
        let alone = alone.iter().enumerate().filter(|(_, alone)| **alone);
        alone.for_each(|(i, _)| visit(i, i, self.each[i].sd.powi(-2)));
    }

    /// Logarithm of the density, constants left out.
    fn penalty(&self, x: &[f64]) -> f64 {
        let off = |i: usize| x[i] - self.each[i].mean;
        let mut sum = 0.0;
        self.for_each(|i, j, inverse| sum -= 0.5 * off(i) * inverse * off(j));
        sum
    }

    /// Adds its gradient.
    fn pull(&self, x: &[f64], gradient: &mut DVector<f64>) {
        self.for_each(|i, j, inverse| gradient[i] -= inverse * (x[j] - self.each[j].mean));
    }

    /// Adds the inverse of the covariance.
    fn add_to(&self, information: &mut DMatrix<f64>) {
        self.for_each(|i, j, inverse| information[(i, j)] += inverse);
    }

    /// Half the logarithm of the determinant of the covariance.
    fn log_volume(&self) -> f64 {
        let alone: f64 = self.each.iter().map(|p| p.sd.ln()).sum();
        alone + self.together.iter().map(|block| block.half_log_determinant).sum::<f64>()
    }
}

/// The inverse of the covariance of a model's parameters beforehand.
pub(crate) fn known_beforehand(model: &dyn Model) -> DMatrix<f64> {
    let known = Priors::of(model);
    let mut inverse = DMatrix::zeros(known.each.len(), known.each.len());
    known.add_to(&mut inverse);
    inverse
}

/// The covariance of some of a model's parameters beforehand. Those that go together with others need not all be among them.
pub(crate) fn covariance_beforehand(model: &dyn Model, parameters: &[usize]) -> Option<DMatrix<f64>> {
    let whole = known_beforehand(model).cholesky()?.inverse();
    Some(whole.select_rows(parameters).select_columns(parameters))
}

/// Derivatives of a log-likelihood: its gradient, and the expected curvature (Fisher information).
pub(crate) struct Slopes {
    pub gradient: DVector<f64>,
    pub information: DMatrix<f64>,
}

impl Slopes {
    /// Of `n` parameters, none so far.
    pub fn zero(n: usize) -> Self {
        Self { gradient: DVector::zeros(n), information: DMatrix::zeros(n, n) }
    }

    pub fn add(&mut self, other: &Self) {
        self.gradient += &other.gradient;
        self.information += &other.information;
    }

    /// Adds what one reading says that changes with some parameters (indices) by so much: the pull of its residual, and its weight.
    pub fn add_one(&mut self, changes: &[(usize, f64)], pull: f64, weight: f64) {
        for &(a, x) in changes {
            self.gradient[a] += pull * x;
            for &(b, y) in changes {
                self.information[(a, b)] += weight * x * y;
            }
        }
    }
}

/// A log-likelihood of parameters with priors.
pub(crate) trait Model {
    fn priors(&self) -> &[Prior];
    /// Parameters whose priors go together.
    fn together(&self) -> &[Together] {
        &[]
    }
    /// Log-likelihood, its slopes added where wanted.
    fn log_likelihood(&self, values: &[f64], slopes: Option<&mut Slopes>) -> f64;
}

/// Where a model is most probable.
#[derive(Clone, Debug)]
pub(crate) struct LaplaceFit {
    pub values: Vec<f64>,
    pub log_likelihood: f64,
    /// The same with the priors' penalties, constants left out.
    pub log_posterior: f64,
    pub covariance: DMatrix<f64>,
    /// Logarithm of the probability of the data, the parameters integrated out (Laplace: MacKay 2003, chapter 27).
    pub log_evidence: f64,
    /// Whether the search came to rest; else it took what it had.
    pub converged: bool,
}

impl LaplaceFit {
    pub fn sd(&self, i: usize) -> f64 {
        self.covariance[(i, i)].max(0.0).sqrt()
    }
}

const MAX_STEPS: usize = 40;
const FIRST_DAMPING: f64 = 1e-3;
/// A step shorter than this many prior standard deviations ends the search ...
const TOLERANCE: f64 = 0.02;
/// ... if it gains less than this, in nats ...
const GAIN_NATS: f64 = 0.02;
/// ... and so does one that promises less than this, in nats: it is taken at its word. It leads by less than a twentieth of a posterior
/// standard deviation.
const PROMISED_NATS: f64 = 1e-3;

/// Levenberg-Marquardt on the log-posterior within bounds.
pub(crate) fn maximise(model: &dyn Model, start: &[f64], what: &'static str) -> Result<LaplaceFit, Error> {
    let priors = model.priors();
    let n = priors.len();
    let known = Priors::of(model);
    let mut x: Vec<f64> = start.iter().zip(priors).map(|(x, p)| x.clamp(p.low, p.high)).collect();
    let [mut slopes, mut tried_slopes] = [(); 2].map(|()| Slopes::zero(n));
    let mut damping = FIRST_DAMPING;
    let mut converged = false;
    let mut likelihood = fill(model, &x, &mut slopes);
    'steps: for _ in 0..MAX_STEPS {
        let value = likelihood + known.penalty(&x);
        let mut gradient = slopes.gradient.clone();
        known.pull(&x, &mut gradient);
        let held: Vec<bool> = (0..n)
            .map(|i| {
                (x[i] <= priors[i].low && gradient[i] < 0.0) || (x[i] >= priors[i].high && gradient[i] > 0.0)
            })
            .collect();
        let mut accepted = None;
        while damping < 1e8 {
            let step = damped_step(&slopes.information, &gradient, &held, damping, known)
                .ok_or(Error::Singular { what })?;
            let tried = moved(&x, &step, priors);
            let length = (0..n).map(|i| ((tried[i] - x[i]) / priors[i].sd).abs()).fold(0.0, f64::max);
            let promised = 0.5 * step.dot(&gradient);
            if damping <= FIRST_DAMPING && length < TOLERANCE && promised < PROMISED_NATS {
                // The top of the parabola, without another look at the data.
                let full = damped_step(&slopes.information, &gradient, &held, 0.0, known);
                let last = moved(&x, &full.ok_or(Error::Singular { what })?, priors);
                let by = DVector::from_iterator(n, last.iter().zip(&x).map(|(l, x)| l - x));
                let mut bent = slopes.information.clone();
                known.add_to(&mut bent);
                let gain = gradient.dot(&by) - 0.5 * by.dot(&(bent * &by));
                converged = value.is_finite();
                likelihood = value + gain - known.penalty(&last);
                x = last;
                break 'steps;
            }
            // Most steps are taken: their slopes are wanted next.
            let found = fill(model, &tried, &mut tried_slopes);
            let gain = found + known.penalty(&tried) - value;
            if gain.is_finite() && gain >= -1e-9 {
                accepted = Some((tried, found, length, gain));
                damping = (damping * 0.2).max(1e-9);
                break;
            }
            if length < 1e-9 {
                break;
            }
            damping = damping.max(1e-4) * 10.0;
        }
        let Some((next, found, length, gain)) = accepted else {
            // No step gains anything: this is the top as far as numbers can tell, if there are numbers.
            converged = value.is_finite();
            break;
        };
        (x, likelihood) = (next, found);
        std::mem::swap(&mut slopes, &mut tried_slopes);
        if length < TOLERANCE && gain < GAIN_NATS {
            converged = true;
            break;
        }
    }
    let mut h = slopes.information;
    known.add_to(&mut h);
    let factor = h.cholesky().ok_or(Error::Singular { what })?;
    let half_log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    let log_posterior = likelihood + known.penalty(&x);
    Ok(LaplaceFit {
        values: x,
        log_likelihood: likelihood,
        log_posterior,
        covariance: factor.inverse(),
        log_evidence: log_posterior - half_log_determinant - known.log_volume(),
        converged,
    })
}

/// Step up a parabola of this gradient and curvature, and shorter where damped; parameters that bounds hold stay.
fn damped_step(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
    held: &[bool],
    damping: f64,
    priors: Priors<'_>,
) -> Option<DVector<f64>> {
    let mut h = information.clone();
    let mut g = gradient.clone();
    priors.add_to(&mut h);
    for (i, &held) in held.iter().enumerate() {
        h[(i, i)] *= 1.0 + damping;
        if held {
            h.row_mut(i).fill(0.0);
            h.column_mut(i).fill(0.0);
            h[(i, i)] = 1.0;
            g[i] = 0.0;
        }
    }
    Some(h.cholesky()?.solve(&g))
}

/// A step farther, no farther than bounds allow.
fn moved(x: &[f64], step: &DVector<f64>, priors: &[Prior]) -> Vec<f64> {
    x.iter().zip(step.iter()).zip(priors).map(|((x, step), p)| (x + step).clamp(p.low, p.high)).collect()
}

fn fill(model: &dyn Model, x: &[f64], slopes: &mut Slopes) -> f64 {
    slopes.gradient.fill(0.0);
    slopes.information.fill(0.0);
    model.log_likelihood(x, Some(slopes))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    /// Measurements of a line, with known error: everything has a closed form.
    struct Line {
        priors: Vec<Prior>,
        together: Vec<Together>,
        data: Vec<(f64, f64)>,
        sd: f64,
    }

    impl Model for Line {
        fn priors(&self) -> &[Prior] {
            &self.priors
        }

        fn together(&self) -> &[Together] {
            &self.together
        }

        fn log_likelihood(&self, x: &[f64], slopes: Option<&mut Slopes>) -> f64 {
            let mut value = 0.0;
            let mut own = Slopes::zero(2);
            for (t, y) in &self.data {
                let row = DVector::from_vec(vec![1.0, *t]);
                let residual = (y - x[0] - x[1] * t) / self.sd;
                value -= 0.5 * residual * residual + self.sd.ln() + 0.5 * std::f64::consts::TAU.ln();
                own.gradient += &row * (residual / self.sd);
                own.information += &row * row.transpose() / (self.sd * self.sd);
            }
            if let Some(slopes) = slopes {
                slopes.gradient += own.gradient;
                slopes.information += own.information;
            }
            value
        }
    }

    #[test]
    fn evidence_of_a_linear_model_is_that_of_the_joint_normal() {
        let data = vec![(0.0, 0.4), (1.0, 1.9), (2.0, 2.2), (3.0, 4.1)];
        for correlation in [0.0, 0.8] {
            let priors = vec![Prior::normal(0.5, 2.0), Prior::normal(0.0, 3.0)];
            let block = DMatrix::from_row_slice(2, 2, &[1.0, correlation, correlation, 1.0]);
            let together = vec![Together::new(0..2, block).unwrap()];
            let line = Line { priors, together, data: data.clone(), sd: 0.7 };
            let found = maximise(&line, &[0.0, 0.0], "a line").unwrap();
            // y ~ N(A mean, A P A' + s2 I).
            let a = DMatrix::from_fn(4, 2, |i, j| if j == 0 { 1.0 } else { data[i].0 });
            let p = DMatrix::from_row_slice(2, 2, &[4.0, 6.0 * correlation, 6.0 * correlation, 9.0]);
            let c = &a * &p * a.transpose() + DMatrix::identity(4, 4) * 0.49;
            let r = DVector::from_fn(4, |i, _| data[i].1 - 0.5);
            let quadratic = (r.transpose() * c.clone().try_inverse().unwrap() * &r)[(0, 0)];
            let expected = -0.5 * (quadratic + c.determinant().ln() + 4.0 * std::f64::consts::TAU.ln());
            assert!((found.log_evidence - expected).abs() < 1e-9, "{} {expected}", found.log_evidence);
            assert!(found.converged);
        }
    }

    #[test]
    fn what_is_no_correlation_is_refused() {
        assert!(Together::new(0..2, DMatrix::from_element(2, 2, 1.5)).is_none());
        assert!(Together::new(0..3, DMatrix::identity(2, 2)).is_none());
    }

    #[test]
    fn bounds_hold() {
        let mut priors = vec![Prior::normal(0.0, 10.0), Prior::normal(0.0, 10.0)];
        priors[1].high = 0.5;
        let line =
            Line { priors, together: Vec::new(), data: vec![(0.0, 0.0), (1.0, 2.0), (2.0, 4.0)], sd: 0.1 };
        let found = maximise(&line, &[0.0, 0.0], "a line").unwrap();
        assert_eq!(found.values[1], 0.5);
        // The best level under that slope: the mean of y - t / 2.
        assert!((found.values[0] - 1.5).abs() < 1e-3);
    }

    #[test]
    fn a_likelihood_that_is_not_finite_has_no_top() {
        struct Impossible([Prior; 1]);
        impl Model for Impossible {
            fn priors(&self) -> &[Prior] {
                &self.0
            }

            fn log_likelihood(&self, _: &[f64], _: Option<&mut Slopes>) -> f64 {
                f64::NEG_INFINITY
            }
        }
        let found = maximise(&Impossible([Prior::normal(0.0, 1.0)]), &[0.5], "nothing").unwrap();
        assert!(!found.converged);
    }
}
