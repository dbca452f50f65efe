//! Expected evidence where predictions are linear and errors normal: everything has a closed form.
//!
//! Data enter through products over their covariance V alone ([`Expansion::products`](crate::likelihood::expansion::Expansion::products)):
//! those of independent measurements add up, and no matrix is larger than the number of parameters.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::ops::Range;

/// What is known of the parameters of a hypothesis before a measurement: a factor L of their covariance L L'.
#[derive(Clone, Debug)]
pub(crate) struct Known {
    factor: DMatrix<f64>,
}

impl Known {
    /// Independent parameters, each known within a standard deviation.
    pub fn independent(sd: &[f64]) -> Self {
        Self { factor: DMatrix::from_diagonal(&DVector::from_column_slice(sd)) }
    }

    /// Parameters of a covariance; `None` if it is none.
    pub fn of_covariance(covariance: DMatrix<f64>) -> Option<Self> {
        Some(Self { factor: covariance.cholesky()?.unpack() })
    }

    /// 1 + L' J L.
    fn inner(&self, information: &DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
        let mut inner = self.factor.tr_mul(&(information * &self.factor));
        for i in 0..inner.nrows() {
            inner[(i, i)] += 1.0;
        }
        inner.cholesky()
    }

    /// What data with information J on the parameters say of them: 1/2 ln det(1 + C J), in nats (Lindley 1956; D-optimal designs have
    /// the most).
    pub fn information_nats(&self, information: &DMatrix<f64>) -> Option<f64> {
        Some(self.inner(information)?.l_dirty().diagonal().iter().map(|d| d.ln()).sum())
    }

    /// Products of other columns with each other over the covariance V + X C X' of the data to come, X being the slopes with these
    /// parameters: what the parameters may make up for is projected out. `products` are those over V of all columns, of which
    /// `slopes` and `others` are some.
    pub fn projected(
        &self,
        products: &DMatrix<f64>,
        slopes: Range<usize>,
        others: Range<usize>,
    ) -> Option<DMatrix<f64>> {
        let block = |rows: &Range<usize>, columns: &Range<usize>| {
            products.view((rows.start, columns.start), (rows.len(), columns.len())).into_owned()
        };
        let inner = self.inner(&block(&slopes, &slopes))?;
        let onto = self.factor.tr_mul(&block(&slopes, &others));
        Some(block(&others, &others) - onto.tr_mul(&inner.solve(&onto)))
    }
}

/// A hypothesis as columns among the products of a measurement: slopes with its parameters, and what it predicts.
pub(crate) struct Predictive<'a> {
    pub known: &'a Known,
    pub slopes: Range<usize>,
    pub predicted: usize,
}

/// Expected logarithm of the Bayes factor of a hypothesis over another once the measurement is made, the first being true: the
/// Kullback-Leibler divergence of their predictive distributions,
/// 1/2 [D' (V + S)^-1 D + tr((V + S)^-1 (V + T)) - n - ln det((V + S)^-1 (V + T))]
/// (Kullback and Leibler 1951), where D is the difference of their predictions, and T and S are what their parameters leave open. Its first
/// term is the criterion of Box and Hill (1967). In nats; `None` if a figure is none.
pub(crate) fn expected_nats(
    products: &DMatrix<f64>,
    truth: &Predictive<'_>,
    rival: &Predictive<'_>,
) -> Option<f64> {
    let block = |rows: &Range<usize>, columns: &Range<usize>| {
        products.view((rows.start, columns.start), (rows.len(), columns.len())).into_owned()
    };
    let inner = rival.known.inner(&block(&rival.slopes, &rival.slopes))?;
    // Of columns X and Y over V + S.
    let over_rival = |a: &DMatrix<f64>, (xa, xb): (&DMatrix<f64>, &DMatrix<f64>)| {
        let [left, right] = [xa, xb].map(|x| rival.known.factor.tr_mul(x));
        a - left.tr_mul(&inner.solve(&right))
    };
    let difference = |rows: &Range<usize>| -> DMatrix<f64> {
        let column = |c: usize| products.view((rows.start, c), (rows.len(), 1)).into_owned();
        column(truth.predicted) - column(rival.predicted)
    };
    let (t, r) = (truth.predicted, rival.predicted);
    let squared = products[(t, t)] - 2.0 * products[(t, r)] + products[(r, r)];
    let onto = difference(&rival.slopes);
    // Below zero where predictions differ by no more than the tracer's chance, which was taken off.
    let distance = over_rival(&DMatrix::from_element(1, 1, squared), (&onto, &onto))[(0, 0)].max(0.0);
    // tr((V + S)^-1 T) - tr((V + S)^-1 S).
    let spread = |one: &Predictive<'_>| {
        let onto = block(&rival.slopes, &one.slopes);
        let whole = over_rival(&block(&one.slopes, &one.slopes), (&onto, &onto));
        one.known.factor.tr_mul(&(whole * &one.known.factor)).trace()
    };
    let wider = spread(truth) - spread(rival);
    let ln_det = |one: &Predictive<'_>| one.known.information_nats(&block(&one.slopes, &one.slopes));
    Some(0.5 * (distance + wider) + ln_det(rival)? - ln_det(truth)?)
}

/// The size of an effect of one parameter from which the evidence for it is expected to reach so many nats; infinite where the data say
/// nothing of it. `information` is one over the variance with which they give the size, all else projected out; the prior has this variance
/// about its absence. With k = prior variance times information, the expected evidence of a size x is
/// 1/2 [x^2 information k / (1 + k) + k / (1 + k) - ln(1 + k)].
pub(crate) fn size_that_reaches(nats: f64, information: f64, prior_variance: f64) -> f64 {
    let kept = prior_variance * information;
    let share = kept / (1.0 + kept);
    if information * share <= 0.0 {
        return f64::INFINITY;
    }
    ((2.0 * nats + kept.ln_1p() - share).max(0.0) / (information * share)).sqrt()
}

#[cfg(test)]
mod tests;
