//! The level of one response in one octave: interference, the microphone and its place move it by a fraction of a decibel in all bins
//! alike, which bins that scatter by chance do not show. It is fitted with every likelihood, and its uncertainty taken off what the bins
//! say together (a Schur complement), so that no model has a parameter for it.

use crate::likelihood::laplace::Slopes;
use crate::statistics::{HUBER_LOG_RATIO, exp_all, log_density};

/// Steps of Newton's method, at most.
const MAX_STEPS: usize = 50;
/// Longest of them, as a logarithm of energy.
const LONGEST_STEP: f64 = 2.0;
/// Shortest.
const TOLERANCE: f64 = 1e-11;

/// The most probable level beside the prediction, as a logarithm of energy, of bins with these logarithms of measured over predicted
/// energy and these shapes; `sd` is what is known of it.
pub(super) fn most_probable(ln_ratio: &[f64], shapes: &[f64], sd: f64) -> f64 {
    let mut ratios = ln_ratio.to_vec();
    exp_all(&mut ratios);
    let mut offset = 0.0f64;
    for _ in 0..MAX_STEPS {
        let lower = (-offset).exp();
        // Slope of the log-posterior, and the opposite of its curvature.
        let (mut slope, mut curvature) = (-offset / (sd * sd), 1.0 / (sd * sd));
        for ((z, ratio), shape) in ln_ratio.iter().zip(&ratios).zip(shapes) {
            let pull = if z - offset < HUBER_LOG_RATIO {
                curvature += shape * ratio * lower;
                ratio * lower
            } else {
                HUBER_LOG_RATIO.exp()
            };
            slope += shape * (pull - 1.0);
        }
        let step = (slope / curvature).clamp(-LONGEST_STEP, LONGEST_STEP);
        offset += step;
        if step.abs() < TOLERANCE {
            break;
        }
    }
    offset
}

/// Log-likelihood of bins at the most probable level, with what is known of that.
pub(super) fn log_likelihood(ln_ratio: &[f64], shapes: &[f64], (offset, sd): (f64, f64)) -> f64 {
    let bins = ln_ratio.iter().zip(shapes).map(|(z, shape)| shape * log_density(z - offset));
    bins.sum::<f64>() - 0.5 * (offset / sd).powi(2)
}

/// Takes off the information on these parameters what an unknown level has of it. `rows` are changes of the predicted logarithm in each
/// bin.
pub(super) fn take_off(slopes: &mut Slopes, columns: &[usize], rows: &[Vec<f64>], shapes: &[f64], sd: f64) {
    let own: f64 = shapes.iter().sum::<f64>() + 1.0 / (sd * sd);
    let shared: Vec<f64> =
        rows.iter().map(|row| row.iter().zip(shapes).map(|(slope, shape)| slope * shape).sum()).collect();
    for (&a, x) in columns.iter().zip(&shared) {
        for (&b, y) in columns.iter().zip(&shared) {
            slopes.information[(a, b)] -= x * y / own;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_found_as_far_as_its_prior_lets_it() {
        let shapes = [4.0; 60];
        let scatter =
            |level: f64| -> Vec<f64> { (0..60).map(|i| level + 0.3 * (2.3 * f64::from(i)).sin()).collect() };
        let found = most_probable(&scatter(0.4), &shapes, 10.0);
        // The mean of the exponential of the scatter is a little above one.
        assert!((found - 0.4).abs() < 0.05, "{found}");
        let held = most_probable(&scatter(0.4), &shapes, 0.02);
        assert!(held > 0.0 && held < 0.1, "{held}");
        // No other level is more probable, outliers or not.
        let mut wild = scatter(-0.2);
        wild[3] = 9.0;
        for ratios in [scatter(0.4), wild] {
            let best = most_probable(&ratios, &shapes, 0.3);
            let at = |offset: f64| log_likelihood(&ratios, &shapes, (offset, 0.3));
            assert!(at(best) > at(best + 0.01) && at(best) > at(best - 0.01));
        }
    }

    #[test]
    fn what_moves_all_bins_alike_is_known_no_better_than_the_level() {
        let mut slopes = Slopes::zero(2);
        let (shapes, sd) = (vec![5.0; 1000], 0.1);
        let rows = [vec![1.0; 1000], (0..1000).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect()];
        for (a, row) in rows.iter().enumerate() {
            slopes.information[(a, a)] = row.iter().map(|s| 5.0 * s * s).sum();
        }
        take_off(&mut slopes, &[0, 1], &rows, &shapes, sd);
        // One over the variance of the level; and what moves bins against each other is known as before.
        assert!((slopes.information[(0, 0)] - 1.0 / (sd * sd)).abs() < 3.0);
        assert!((slopes.information[(1, 1)] - 5000.0).abs() < 1e-9);
    }
}
