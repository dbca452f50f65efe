//! The score test of many laws at once: the likelihood is expanded to second order about a fit, and what the fit leaves open (materials,
//! gains, named causes, levels, drift and the tracer's chance) is projected out of every column by one solution of the normal equations.
//!
//! Source: score tests, C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948; the evidence of a parabola, MacKay 2003, chapter 27.

use crate::likelihood::expansion::Expansion;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// The bins of one response.
pub(crate) struct ScreenPair {
    pub expansion: Expansion,
    /// What the bins pull at the prediction.
    pub pulls: DVector<f64>,
    /// Change of the bins' logarithms of energy with each column in each band, `(bin, column * bands + band)`.
    pub x: DMatrix<f64>,
}

/// Columns with all nuisances projected out.
pub(crate) struct Screen {
    bands: usize,
    /// `(bin, column * bands + band)`, and the same over the covariance of the data.
    pairs: Vec<(DMatrix<f64>, DMatrix<f64>)>,
    /// Slopes of the nuisances and columns together over that covariance, and the same times the covariance of the nuisances.
    along: DMatrix<f64>,
    solved: DMatrix<f64>,
    /// Slope of the log-likelihood with each column in each band.
    pub slopes: DVector<f64>,
    /// Information on the bands of each column, `[column]`, `(band, band)`.
    blocks: Vec<DMatrix<f64>>,
}

/// A law as the screen knows it: a column, and up to two parameters.
#[derive(Clone, Debug)]
pub(crate) struct ScreenTerm {
    pub column: usize,
    /// Share of each parameter in each band, `[parameter][band]`.
    pub shares: Vec<DVector<f64>>,
    /// Standard deviations of the parameters beforehand.
    pub sd: Vec<f64>,
    /// Whether the only parameter is sought above zero alone.
    pub takes_only: bool,
    pub ln_prior: f64,
}

/// What the evidence of a term is made of, whatever the data.
#[derive(Clone, Debug)]
pub(crate) struct ReadyTerm {
    pub term: ScreenTerm,
    /// (information + 1 / sd^2)^-1.
    spread: DMatrix<f64>,
    /// Logarithm of its probability beforehand, less what its parameters cost.
    constant: f64,
}

impl Screen {
    /// The screen of a fit: its responses and the covariance of its parameters (what is known beforehand included).
    pub fn new(bands: usize, pairs: Vec<ScreenPair>, covariance: &DMatrix<f64>) -> Self {
        let width = pairs.first().map_or(0, |p| p.x.ncols());
        let mut along = DMatrix::zeros(covariance.nrows(), width);
        let mut slopes = DVector::zeros(width);
        let mut held = Vec::with_capacity(pairs.len());
        for ScreenPair { expansion, pulls, x } in pairs {
            let over = expansion.over_covariance(&x);
            along += expansion.slopes.tr_mul(&over);
            slopes += x.tr_mul(&pulls);
            held.push((x, over));
        }
        let solved = covariance * &along;
        let mut screen = Self { bands, pairs: held, along, solved, slopes, blocks: Vec::new() };
        screen.blocks = (0..width / bands.max(1)).map(|c| screen.product(c, c)).collect();
        screen
    }

    fn places(&self, column: usize) -> Range<usize> {
        column * self.bands..(column + 1) * self.bands
    }

    /// Product of two columns over the covariance of data and nuisances together, `(band of a, band of b)`.
    fn product(&self, a: usize, b: usize) -> DMatrix<f64> {
        let (of_a, of_b) = (self.places(a).start, self.places(b).start);
        let n = self.bands;
        let mut sum = -self.along.columns(of_a, n).tr_mul(&self.solved.columns(of_b, n));
        for (x, over) in &self.pairs {
            sum += x.columns(of_a, n).tr_mul(&over.columns(of_b, n));
        }
        sum
    }

    /// Prepares a term.
    pub fn ready(&self, term: ScreenTerm) -> ReadyTerm {
        let block = &self.blocks[term.column];
        let count = term.shares.len();
        let information = |i: usize, j: usize| term.shares[i].dot(&(block * &term.shares[j]));
        let known = |i: usize| term.sd[i].powi(-2);
        let precision =
            DMatrix::from_fn(count, count, |i, j| information(i, j) + if i == j { known(i) } else { 0.0 });
        let ln_known: f64 = (0..count).map(|i| known(i).ln()).sum();
        let ln_determinant = precision.determinant().max(1e-300).ln();
        let spread = precision.try_inverse().unwrap_or_else(|| DMatrix::zeros(count, count));
        let constant = term.ln_prior - 0.5 * (ln_determinant - ln_known);
        ReadyTerm { term, spread, constant }
    }

    /// Standard deviation of the only parameter of a term by the data alone, nothing known of it beforehand.
    pub fn sd(&self, ready: &ReadyTerm) -> f64 {
        let shares = &ready.term.shares[0];
        shares.dot(&(&self.blocks[ready.term.column] * shares)).max(0.0).sqrt().recip()
    }

    /// Logarithm of how much more probable the data are under a term than without, times its probability beforehand, in nats. `slopes` are
    /// those of the data, or of others that were drawn.
    pub fn nats(&self, ready: &ReadyTerm, slopes: &DVector<f64>) -> f64 {
        let first = self.places(ready.term.column).start;
        let own = slopes.rows(first, self.bands);
        let count = ready.term.shares.len();
        let pull: Vec<f64> = ready.term.shares.iter().map(|shares| shares.dot(&own)).collect();
        if count == 1 && ready.term.takes_only && pull[0] < 0.0 {
            return ready.constant;
        }
        let pairs = (0..count).flat_map(|i| (0..count).map(move |j| (i, j)));
        let square: f64 = pairs.map(|(i, j)| pull[i] * ready.spread[(i, j)] * pull[j]).sum();
        ready.constant + 0.5 * square
    }

    /// Cosine of the angle between what two terms change at their most probable parameters, nuisances projected out.
    pub fn cosine(&self, a: &ReadyTerm, b: &ReadyTerm) -> f64 {
        let direction = |ready: &ReadyTerm| -> DVector<f64> {
            let own = self.slopes.rows(self.places(ready.term.column).start, self.bands);
            let pull = DVector::from_iterator(
                ready.term.shares.len(),
                ready.term.shares.iter().map(|s| s.dot(&own)),
            );
            let found = &ready.spread * pull;
            ready.term.shares.iter().zip(found.iter()).map(|(shares, x)| shares * *x).sum()
        };
        self.cosine_of((a.term.column, &direction(a)), (b.term.column, &direction(b)))
    }

    /// The same of two columns with given shares of the bands.
    pub fn cosine_of(&self, (a, of_a): (usize, &DVector<f64>), (b, of_b): (usize, &DVector<f64>)) -> f64 {
        let own = |c: usize, d: &DVector<f64>| d.dot(&(&self.blocks[c] * d));
        let size = (own(a, of_a) * own(b, of_b)).sqrt();
        if size > 1e-12 { of_a.dot(&(self.product(a, b) * of_b)) / size } else { 0.0 }
    }

    /// Slopes that other data would have, given what they differ by from the prediction in each response: of the first `columns`.
    pub fn slopes_of(
        &self,
        columns: usize,
        differences: &[DVector<f64>],
        over: &[DMatrix<f64>],
    ) -> DVector<f64> {
        let width = columns * self.bands;
        let mut slopes = DVector::zeros(width);
        let mut along = DVector::zeros(self.along.nrows());
        for (((_, x_over), y), j_over) in self.pairs.iter().zip(differences).zip(over) {
            slopes += x_over.columns(0, width).tr_mul(y);
            along += j_over.tr_mul(y);
        }
        slopes - self.solved.columns(0, width).tr_mul(&along)
    }
}

#[cfg(test)]
pub(super) mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    /// Responses of a linear model: two bands, `bins` bins, three nuisances known within `sd`, `columns` covariates.
    pub fn linear(seed: u64, pairs: usize, columns: usize) -> (Vec<ScreenPair>, DMatrix<f64>, Vec<f64>) {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (bins, sd) = (24, vec![0.3, 1.0, 2.0]);
        let mut made = Vec::new();
        let mut precision =
            DMatrix::from_diagonal(&DVector::from_iterator(3, sd.iter().map(|s: &f64| s.powi(-2))));
        for _ in 0..pairs {
            let slopes = DMatrix::from_fn(bins, 3, |_, _| normal());
            let shared = DMatrix::from_fn(bins, 2, |_, _| 0.2 * normal());
            // Each column bears on the half of the bins that is its band.
            let x = DMatrix::from_fn(bins, 2 * columns, |i, j| {
                if (i < 12) == (j % 2 == 0) { 1.0 + normal() } else { 0.0 }
            });
            let weights = DVector::from_fn(bins, |i, _| 3.0 + (i % 5) as f64);
            let expansion = Expansion { predicted: DVector::zeros(bins), slopes, weights, shared };
            precision += expansion.products(&expansion.slopes);
            made.push(ScreenPair { expansion, pulls: DVector::zeros(bins), x });
        }
        (made, precision.try_inverse().unwrap(), sd)
    }

    pub fn term(column: usize, shares: &[&[f64]], sd: &[f64]) -> ScreenTerm {
        ScreenTerm {
            column,
            shares: shares.iter().map(|s| DVector::from_row_slice(s)).collect(),
            sd: sd.to_vec(),
            takes_only: false,
            ln_prior: -1.5,
        }
    }

    /// The whole covariance of data and nuisances, written out and inverted.
    #[test]
    fn the_score_is_the_ratio_of_two_normal_densities() {
        let (mut pairs, covariance, sd) = linear(4, 3, 5);
        let bins: usize = pairs.iter().map(|p| p.pulls.len()).sum();
        let mut whole = DMatrix::zeros(bins, bins);
        let (mut j, mut x) = (DMatrix::zeros(bins, 3), DMatrix::zeros(bins, 10));
        for (place, pair) in pairs.iter().enumerate() {
            let e = &pair.expansion;
            let own = DMatrix::from_diagonal(&e.weights.map(|w| 1.0 / w)) + &e.shared * e.shared.transpose();
            whole.view_mut((24 * place, 24 * place), (24, 24)).copy_from(&own);
            j.rows_mut(24 * place, 24).copy_from(&e.slopes);
            x.rows_mut(24 * place, 24).copy_from(&pair.x);
        }
        let known = DMatrix::from_diagonal(&DVector::from_iterator(3, sd.iter().map(|s| s * s)));
        whole += &j * known * j.transpose();
        let y = DVector::from_fn(bins, |i, _| (1.7 * i as f64).sin());
        let pulled = whole.clone().try_inverse().unwrap() * &y;
        for (place, pair) in pairs.iter_mut().enumerate() {
            pair.pulls = pulled.rows(24 * place, 24).into_owned();
        }
        let screen = Screen::new(2, pairs, &covariance);
        let ln_density = |covariance: &DMatrix<f64>| {
            let factor = covariance.clone().cholesky().unwrap();
            let ln_determinant: f64 = 2.0 * factor.l().diagonal().map(f64::ln).sum();
            -0.5 * (y.dot(&factor.solve(&y)) + ln_determinant)
        };
        for (shares, sd) in
            [(vec![&[1.0, 0.4][..]], vec![0.7]), (vec![&[1.0, 1.0][..], &[-1.0, 2.0][..]], vec![0.5, 0.2])]
        {
            for column in 0..5 {
                let ready = screen.ready(term(column, &shares, &sd));
                let mut with = whole.clone();
                for (shares, sd) in shares.iter().zip(&sd) {
                    let moved = x.columns(2 * column, 2) * DVector::from_row_slice(shares) * *sd;
                    with += &moved * moved.transpose();
                }
                let expected = ln_density(&with) - ln_density(&whole) - 1.5;
                let found = screen.nats(&ready, &screen.slopes);
                assert!((found - expected).abs() < 1e-8, "{column}: {found} {expected}");
            }
        }
        // The angle between two columns, nuisances and noise written out.
        let inverse = whole.try_inverse().unwrap();
        let of = |a: usize, b: usize| x.column(2 * a).dot(&(&inverse * x.column(2 * b)));
        let expected = of(1, 3) / (of(1, 1) * of(3, 3)).sqrt();
        let first = DVector::from_row_slice(&[1.0, 0.0]);
        assert!((screen.cosine_of((1, &first), (3, &first)) - expected).abs() < 1e-9);
        let own = screen.ready(term(2, &[&[1.0, 0.0]], &[1.0]));
        assert!((screen.cosine(&own, &own) - 1.0).abs() < 1e-12);
        // As sure of a coefficient as generalised least squares is.
        assert!((screen.sd(&own) * of(2, 2).sqrt() - 1.0).abs() < 1e-9);
    }
}
