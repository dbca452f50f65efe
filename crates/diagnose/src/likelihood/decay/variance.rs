//! What becomes of the expected spread of bins where an effect predicts what would else be chance.

use super::{EnergyModel, STEP};
use crate::likelihood::laplace::Slopes;
use crate::simulate::reflection_reweighting::HitChanges;
use crate::statistics::{ln_gamma, log_density};

/// Step of differences in the logarithm of a shape.
const SHAPE_STEP: f64 = 1e-3;

/// Logarithm of the Gamma density of a shape at its top, in the logarithm of energy.
fn ln_top(shape: f64) -> f64 {
    shape * shape.ln() - shape - ln_gamma(shape)
}

/// Fisher information on the logarithm of the shape in one bin, shape^2 (trigamma(shape) - 1 / shape), by recurrence and the
/// asymptotic series (Abramowitz and Stegun 1964, 6.4.6 and 6.4.12).
fn information(shape: f64) -> f64 {
    let (mut x, mut trigamma) = (shape, 0.0);
    while x < 8.0 {
        trigamma += 1.0 / (x * x);
        x += 1.0;
    }
    trigamma += 1.0 / x + 1.0 / (2.0 * x * x) + 1.0 / (6.0 * x.powi(3)) - 1.0 / (30.0 * x.powi(5));
    shape * shape * (trigamma - 1.0 / shape)
}

impl EnergyModel<'_> {
    /// Expected relative variances of the bins of a pair and band, dispersion left out.
    pub(super) fn variances(&self, values: &[f64], pair: usize, band: usize, count: usize) -> Vec<f64> {
        let mut variances = self.data.states[pair][band].variance[..count].to_vec();
        let changes = HitChanges::default();
        let view = self.view((pair, band), self.gain_db(values, pair), &changes);
        for placed in &self.terms {
            if let Some(term) = placed.case.decay_term() {
                term.variance(placed.own(values), &view.with_table(placed.case.slot), &mut variances);
            }
        }
        variances
    }

    /// Of the normalisation of all bins what effects change.
    pub(super) fn tops(&self, (pair, band): (usize, usize), variances: &[f64]) -> f64 {
        let top = |variance: f64| ln_top(1.0 / (variance * self.data.dispersion[band]));
        let stated = &self.data.states[pair][band].variance;
        let changed = variances.iter().zip(stated).filter(|(now, stated)| now != stated);
        changed.map(|(now, stated)| top(*now) - top(*stated)).sum()
    }

    /// Adds what the likelihood owes to the spread's change with the parameters of effects. Mean and shape of a Gamma distribution
    /// share no information.
    pub(super) fn add_variance_slopes(
        &self,
        values: &[f64],
        (pair, band): (usize, usize),
        variances: &[f64],
        ln_ratio: &[f64],
        slopes: &mut Slopes,
    ) {
        let mut rows: Vec<(usize, Vec<f64>)> = Vec::new();
        for placed in &self.terms {
            for (i, p) in placed.case.parameters.iter().enumerate() {
                if !self.bears_on(p, pair, band) {
                    continue;
                }
                let index = placed.first + i;
                let prior = self.priors[index];
                let at = |offset: f64| {
                    let mut moved = values.to_vec();
                    moved[index] = (moved[index] + offset * prior.sd).clamp(prior.low, prior.high);
                    (moved[index], self.variances(&moved, pair, band, variances.len()))
                };
                let ((high, up), (low, down)) = (at(STEP), at(-STEP));
                if high > low && up != down {
                    // Of the logarithm of the shape.
                    let slope = |(u, d): (&f64, &f64)| -(u / d).ln() / (high - low);
                    rows.push((index, up.iter().zip(&down).map(slope).collect()));
                }
            }
        }
        if rows.is_empty() {
            return;
        }
        for (bin, variance) in variances.iter().enumerate() {
            let shape = 1.0 / (variance * self.data.dispersion[band]);
            let value = |shape: f64| shape * log_density(ln_ratio[bin]) + ln_top(shape);
            let pull =
                (value(shape * (1.0 + SHAPE_STEP)) - value(shape * (1.0 - SHAPE_STEP))) / (2.0 * SHAPE_STEP);
            let weight = information(shape);
            for (a, own) in &rows {
                slopes.gradient[*a] += pull * own[bin];
                for (b, other) in &rows {
                    slopes.information[(*a, *b)] += weight * own[bin] * other[bin];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn information_is_that_of_the_trigamma_function() {
        // Abramowitz and Stegun 1964, 6.4.2: trigamma(1) = pi^2 / 6, trigamma(2) = pi^2 / 6 - 1.
        let sixth = std::f64::consts::PI.powi(2) / 6.0;
        assert!((information(1.0) - (sixth - 1.0)).abs() < 1e-6);
        assert!((information(2.0) - 4.0 * (sixth - 1.5)).abs() < 1e-6);
    }
}
