//! What becomes of the expected spread of bins where an effect predicts what would else be chance.

use crate::gates::ln_gamma;

/// Step of differences in the logarithm of a shape.
const STEP: f64 = 1e-3;

/// Logarithm of the Gamma density of a shape at its top, in the logarithm of energy.
pub(crate) fn ln_top(shape: f64) -> f64 {
    shape * shape.ln() - shape - ln_gamma(shape)
}

/// Fisher information on the logarithm of the shape in one bin: minus the second derivative of [`ln_top`] less what is linear in the
/// shape, shape^2 (trigamma(shape) - 1 / shape).
pub(crate) fn information(shape: f64) -> f64 {
    let at = |offset: f64| ln_top(shape * (1.0 + offset));
    // The terms linear in the shape have no second difference.
    -(at(STEP) - 2.0 * at(0.0) + at(-STEP)) / (STEP * STEP)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn information_is_that_of_the_trigamma_function() {
        // Abramowitz and Stegun 1964, table 6.1: trigamma(1) = pi^2 / 6, trigamma(2) = pi^2 / 6 - 1.
        let sixth = std::f64::consts::PI.powi(2) / 6.0;
        assert!((information(1.0) - (sixth - 1.0)).abs() < 1e-4);
        assert!((information(2.0) - 4.0 * (sixth - 1.5)).abs() < 1e-4);
    }
}
