//! How probable the best of all laws is by chance: measurements are drawn without any, and the best of the whole family is
//! looked for in each.
//!
//! Source: parametric bootstrap of a maximum, P. H. Westfall, S. S. Young: Resampling-based multiple testing, 1993.

use super::null_model::NullModel;
use super::screen::{ReadyTerm, Screen};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// One in so many of those drawn is taken for the tail.
const IN_TAIL: usize = 10;

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

/// The same, extrapolated beyond what was drawn: what exceeds a high quantile of them falls off as an exponential does, at the rate of those drawn
/// that exceed it. A distribution of all of them says nothing of that: where formulas of which the data know nothing are more probable
/// beforehand than others seem by chance, most of the greatest are one number.
///
/// Source: peaks over a threshold, J. Pickands, Annals of Statistics 3, 1975; an exponential where the tails of single terms are normal or
/// lighter than any power.
pub(crate) fn tail(found: f64, drawn: &[f64]) -> f64 {
    let mut greatest = drawn.to_vec();
    greatest.sort_by(|a, b| b.total_cmp(a));
    let exceeding = greatest.len() / IN_TAIL;
    let Some(&from) = greatest.get(exceeding).filter(|from| exceeding > 0 && found > **from) else {
        return by_chance(found, drawn);
    };
    let mean_excess = greatest[..exceeding].iter().map(|own| own - from).sum::<f64>() / exceeding as f64;
    if mean_excess <= 0.0 {
        return by_chance(found, drawn);
    }
    // Of the greatest of many, the expected number that exceed a value falls so; the share that does is 1 - exp(-number), which makes the mean
    // excess longer by a quarter of the number (to first order).
    let number = -(-(exceeding as f64) / greatest.len() as f64).ln_1p();
    let scale = mean_excess / (1.0 + 0.25 * number);
    -(-number * (-(found - from) / scale).exp()).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantile of the greatest of a thousand exponential variables.
    fn quantile(u: f64) -> f64 {
        -(1.0 - u.powf(1e-3)).ln()
    }

    #[test]
    fn the_tail_of_the_greatest_reaches_beyond_what_was_drawn() {
        let drawn: Vec<f64> = (0..399).map(|i| quantile((f64::from(i) + 0.5) / 399.0)).collect();
        for p in [0.5, 0.1, 1e-2, 1e-4, 1e-6] {
            let found = tail(quantile(1.0 - p), &drawn);
            assert!((found / p).ln().abs() < 0.2, "{p}: {found}");
        }
        assert!((by_chance(quantile(1.0 - 1e-6), &drawn) - 0.0025).abs() < 1e-9);
        assert_eq!((tail(2.0, &[1.0, 1.0]), tail(1.0, &[1.0, 1.0])), (1.0 / 3.0, 1.0));
    }

    /// A formula of which the data know nothing is as probable in every draw: the greatest is seldom less.
    #[test]
    fn what_most_of_the_greatest_have_in_common_says_nothing_of_their_tail() {
        let floored = |u: f64| quantile(u).max(quantile(0.8));
        let drawn: Vec<f64> = (0..399).map(|i| floored((f64::from(i) + 0.5) / 399.0)).collect();
        for p in [1e-2, 1e-4, 1e-6] {
            let found = tail(quantile(1.0 - p), &drawn);
            assert!((found / p).ln().abs() < 0.2, "{p}: {found}");
        }
    }
}
