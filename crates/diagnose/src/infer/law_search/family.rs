//! How probable the best of all laws is by chance: measurements are drawn without any, and the best of the whole family is
//! looked for in each.
//!
//! Source: parametric bootstrap of a maximum, P. H. Westfall, S. S. Young: Resampling-based multiple testing, 1993.

use super::null_model::NullModel;
use super::screen::{ReadyTerm, Screen};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

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
