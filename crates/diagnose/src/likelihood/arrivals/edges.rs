//! What lies about the top of a likelihood with edges: whether a small face reflects to a receiver, or a box hides a path, changes all at once, and no
//! slope shows where.

use crate::likelihood::laplace::{LaplaceFit, Model};
use nalgebra::{Cholesky, DVector, Dyn};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use std::ops::Range;

/// Rounds of draws, each from where the one before had found something, draws in each, and their seed.
const ROUNDS: usize = 3;
const DRAWS: usize = 250;
const SEED: u64 = 1;
/// A round reaches so much farther than the one before has found anything, and no less than this share of the parabola's reach.
const WIDER: f64 = 1.4;
const NARROWEST: f64 = 0.03;

/// Takes the edges into the evidence of a top, and into how well some of its parameters are known, the others being where they are: by drawing
/// from the parabola of the fit, and weighing each draw by what it finds (importance sampling with proposals that adapt: MacKay 2003, 29.2; Cappé et
/// al. 2004). Evidence and standard deviations become no more than those of the parabola.
pub(super) fn take_in(model: &dyn Model, top: &mut LaplaceFit, own: Range<usize>) {
    let Some(about) = About::of(model, top, own.clone()) else { return };
    let mut shares = vec![1.0; own.len()];
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    let mut nats = 0.0;
    let mut moments = shares.clone();
    for round in 0..ROUNDS {
        if round > 0 {
            shares.iter_mut().zip(&moments).for_each(|(s, m)| *s = (WIDER * m).clamp(NARROWEST, 1.0));
        }
        let Some(found) = about.round(&shares, &mut random) else { return };
        (nats, moments) = found;
    }
    top.log_evidence += nats.min(0.0);
    for (share, i) in moments.iter().zip(own) {
        let share = share.min(1.0);
        top.covariance.row_mut(i).scale_mut(share);
        top.covariance.column_mut(i).scale_mut(share);
    }
}

/// A top, and the parabola about it.
struct About<'a> {
    model: &'a dyn Model,
    values: Vec<f64>,
    own: Range<usize>,
    /// Upper factor of the precision of the own parameters, the others held.
    factor: Cholesky<f64, Dyn>,
    /// Standard deviations of the same.
    sd: Vec<f64>,
    at_top: f64,
}

impl<'a> About<'a> {
    fn of(model: &'a dyn Model, top: &LaplaceFit, own: Range<usize>) -> Option<Self> {
        let precision = top.covariance.clone().cholesky()?.inverse();
        let n = own.len();
        let factor = precision.view((own.start, own.start), (n, n)).into_owned().cholesky()?;
        let covariance = factor.inverse();
        let sd = (0..n).map(|i| covariance[(i, i)].sqrt()).collect();
        let mut about = Self { model, values: top.values.clone(), own, factor, sd, at_top: 0.0 };
        about.at_top = about.posterior(&top.values);
        Some(about)
    }

    /// Logarithm of likelihood and prior of the own parameters, as far as these matter.
    fn posterior(&self, x: &[f64]) -> f64 {
        let priors = self.model.priors();
        let penalty = |i: usize| 0.5 * ((x[i] - priors[i].mean) / priors[i].sd).powi(2);
        self.model.log_likelihood(x, None) - self.own.clone().map(penalty).sum::<f64>()
    }

    /// Draws with these shares of the parabola's reach: the logarithm of what is found over what the parabola promises, and how far from the top it
    /// is found, as shares of the parabola's standard deviations. None if the factor is singular.
    fn round(&self, shares: &[f64], random: &mut Pcg64Mcg) -> Option<(f64, Vec<f64>)> {
        let priors = self.model.priors();
        let mut x = self.values.clone();
        let (mut sum, mut squares) = (0.0, vec![0.0; shares.len()]);
        let upper = self.factor.l().transpose();
        for _ in 0..DRAWS {
            let deviates = DVector::from_fn(shares.len(), |_, _| StandardNormal.sample(random));
            let off = upper.solve_upper_triangular(&deviates)?;
            let off: Vec<f64> = off.iter().zip(shares).map(|(off, share)| off * share).collect();
            for (i, off) in self.own.clone().zip(&off) {
                x[i] = self.values[i] + off;
            }
            if !self.own.clone().all(|i| (priors[i].low..=priors[i].high).contains(&x[i])) {
                continue;
            }
            let weight = (self.posterior(&x) - self.at_top + 0.5 * deviates.norm_squared()).exp();
            sum += weight;
            squares
                .iter_mut()
                .zip(off)
                .zip(&self.sd)
                .for_each(|((s, off), sd)| *s += weight * (off / sd).powi(2));
        }
        let volume: f64 = shares.iter().map(|share| share.ln()).sum();
        let nats = (sum / DRAWS as f64).max(f64::MIN_POSITIVE).ln() + volume;
        Some((nats, squares.into_iter().map(|s| (s / sum.max(f64::MIN_POSITIVE)).sqrt()).collect()))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::likelihood::laplace::{Prior, Slopes, maximise};

    /// A likelihood that is even within edges of the first parameter, and normal in the second.
    struct Slot {
        priors: Vec<Prior>,
        half: f64,
    }

    impl Model for Slot {
        fn priors(&self) -> &[Prior] {
            &self.priors
        }

        fn log_likelihood(&self, x: &[f64], slopes: Option<&mut Slopes>) -> f64 {
            if let Some(slopes) = slopes {
                slopes.gradient[1] += 25.0 * (1.0 - x[1]);
                slopes.information[(1, 1)] += 25.0;
            }
            -12.5 * (x[1] - 1.0).powi(2) - if x[0].abs() < self.half { 0.0 } else { 30.0 }
        }
    }

    #[test]
    fn evidence_and_deviations_are_those_within_the_edges() {
        for half in [0.1, 0.5, 5.0] {
            let model = Slot { priors: vec![Prior::normal(0.0, 1.0), Prior::normal(0.0, 2.0)], half };
            let mut top = maximise(&model, &[0.0, 0.0], "a slot").unwrap();
            let before = top.clone();
            take_in(&model, &mut top, 0..2);
            // The share of a normal distribution, and its deviation, within the edges: by sums.
            let steps = (0..20_000).map(|i| (f64::from(i) - 9_999.5) * 1e-3);
            let within: Vec<(f64, f64)> =
                steps.filter(|x| x.abs() < half).map(|x| (x, (-0.5 * x * x).exp())).collect();
            let all: f64 = within.iter().map(|(_, w)| w).sum();
            let share = all * 1e-3 / std::f64::consts::TAU.sqrt();
            let sd = (within.iter().map(|(x, w)| w * x * x).sum::<f64>() / all).sqrt();
            let found = top.log_evidence - before.log_evidence;
            assert!((found - share.ln()).abs() < 0.2, "{half}: {found} {}", share.ln());
            assert!((top.sd(0) / sd - 1.0).abs() < 0.2, "{half}: {} {sd}", top.sd(0));
            assert!((top.sd(1) / before.sd(1) - 1.0).abs() < 0.2, "{half}: {}", top.sd(1));
        }
    }
}
