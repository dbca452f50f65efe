//! How probable the best of all laws is by chance: measurements are drawn without any, and the best of the whole family is
//! looked for in each.
//!
//! Source: parametric bootstrap of a maximum, P. H. Westfall, S. S. Young: Resampling-based multiple testing, 1993.

use super::null_model::NullModel;
use super::screen::{ReadyTerm, Screen};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Mean of the standard Gumbel distribution.
const EULER: f64 = 0.577_215_664_901_532_9;

/// The greatest evidence of any term in each of `draws` measurements without a law; terms are of the first `columns`. Each draw has a seed of
/// its own: threads do not matter.
pub(crate) fn largest(
    screen: &Screen,
    terms: &[ReadyTerm],
    columns: usize,
    null: &NullModel,
    (draws, seed): (usize, u64),
) -> Vec<f64> {
    let over = null.over();
    let one = |draw: usize| {
        let mut random =
            Pcg64Mcg::seed_from_u64(seed ^ (draw as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let slopes = screen.slopes_of(columns, &null.draw(&mut random), &over);
        terms.iter().map(|term| screen.nats(term, &slopes)).fold(f64::NEG_INFINITY, f64::max)
    };
    (0..draws).into_par_iter().map(one).collect()
}

/// Probability of as much by chance, given what chance made: never zero.
pub(crate) fn by_chance(found: f64, drawn: &[f64]) -> f64 {
    let as_good = drawn.iter().filter(|own| **own >= found).count();
    (1 + as_good) as f64 / (1 + drawn.len()) as f64
}

/// The same, extrapolated beyond what was drawn: the greatest of many has a Gumbel distribution, here of the mean and variance of those drawn.
///
/// Source: E. J. Gumbel, Statistics of Extremes, 1958, chapter 5.
pub(crate) fn tail(found: f64, drawn: &[f64]) -> f64 {
    let n = drawn.len() as f64;
    let mean = drawn.iter().sum::<f64>() / n;
    let variance = drawn.iter().map(|own| (own - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let scale = (6.0 * variance).sqrt() / std::f64::consts::PI;
    if scale <= 0.0 {
        return if found > mean { 0.0 } else { 1.0 };
    }
    let z = (found - mean) / scale + EULER;
    -(-(-z).exp()).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_of_the_greatest_reaches_beyond_what_was_drawn() {
        // Quantiles of the greatest of a thousand exponential variables.
        let quantile = |u: f64| -(1.0 - u.powf(1e-3)).ln();
        let drawn: Vec<f64> = (0..399).map(|i| quantile((f64::from(i) + 0.5) / 399.0)).collect();
        for p in [0.5, 0.1, 1e-2, 1e-4, 1e-6] {
            let found = tail(quantile(1.0 - p), &drawn);
            assert!((found / p).ln().abs() < 0.2, "{p}: {found}");
        }
        assert!((by_chance(quantile(1.0 - 1e-6), &drawn) - 0.0025).abs() < 1e-9);
        assert_eq!((tail(2.0, &[1.0, 1.0]), tail(1.0, &[1.0, 1.0])), (0.0, 1.0));
    }
}
