//! How bins scatter: single odd ones, octaves, responses, and the early sound against the late.

use crate::likelihood::decay::BinResidual;
use crate::statistics::{median, normal_tail};

/// A bin is odd if its energy is as improbable as a normal deviate beyond this.
const ODD_SD: f64 = 4.5;
/// Factor by which bins of an octave may scatter farther than expected: what is expected of them is known no better than to a third.
const KNOWN_WITHIN: f64 = 1.3;

/// How improbable a bin's energy is, as a normal deviate, its band scattering by a factor (Wilson and Hilferty 1931: the cube root of a
/// Gamma variate is nearly normal).
fn deviate(r: &BinResidual, spread: f64) -> f64 {
    let ninth = r.variance * spread / 9.0;
    (((r.ln_ratio - r.offset) / 3.0).exp() - 1.0 + ninth) / ninth.sqrt()
}

/// Bins that chance does not explain, once each band's usual spread is allowed for.
pub(crate) fn odd_bins(residuals: &[BinResidual], bands: usize) -> usize {
    (0..bands)
        .map(|band| {
            let own: Vec<&BinResidual> = residuals.iter().filter(|r| r.band == band).collect();
            // Half of the squares of normal deviates lie below 0.455.
            let usual = median(own.iter().map(|r| deviate(r, 1.0).powi(2)).collect()) / 0.455;
            own.iter().filter(|r| deviate(r, usual.max(1.0)).abs() > ODD_SD).count()
        })
        .sum()
}

/// Probability that the bins of each group scatter as far as they do although a third less at most is expected of them. `group` says to
/// which a bin belongs; the groups are counted from 0.
pub(super) fn by_group(
    residuals: &[BinResidual],
    groups: usize,
    group: impl Fn(&BinResidual) -> usize,
) -> Vec<f64> {
    let mut squares = vec![Vec::new(); groups];
    for r in residuals {
        squares[group(r)].push(deviate(r, 1.0).powi(2));
    }
    let probability = |squares: &Vec<f64>| {
        let n = squares.len() as f64;
        if n < 2.0 {
            return 1.0;
        }
        let mean = squares.iter().sum::<f64>() / n;
        let variance = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
        normal_tail((mean - KNOWN_WITHIN) / (variance / n).sqrt().max(1e-9))
    };
    squares.iter().map(probability).collect()
}

/// By how much the early bins of each pair exceed its late ones, summed over octaves (squares of normal deviates): pairs that occur, in
/// order. `early_bins` says how many bins of a pair and band are early.
pub(super) fn early_against_late(
    residuals: &[BinResidual],
    dispersion: &[f64],
    early_bins: impl Fn(usize, usize) -> usize,
) -> Vec<(usize, f64)> {
    let contrast = |octave: &[BinResidual]| {
        let bins = early_bins(octave[0].pair, octave[0].band);
        let (early, late): (Vec<&BinResidual>, Vec<&BinResidual>) = octave.iter().partition(|r| r.bin < bins);
        let mean = |of: &[&BinResidual]| {
            of.iter().map(|r| deviate(r, dispersion[r.band])).sum::<f64>() / of.len().max(1) as f64
        };
        let (a, b) = (early.len() as f64, late.len() as f64);
        (mean(&early) - mean(&late)).powi(2) * a * b / (a + b)
    };
    residuals
        .chunk_by(|a, b| a.pair == b.pair)
        .map(|own| (own[0].pair, own.chunk_by(|a, b| a.band == b.band).map(contrast).sum()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bin(pair: usize, bin: usize, ln_ratio: f64) -> BinResidual {
        BinResidual {
            pair,
            band: 0,
            bin,
            ln_ratio,
            level: 0.0,
            offset: 0.0,
            ln_predicted: 0.0,
            variance: 0.2,
        }
    }

    fn scatter(i: usize) -> f64 {
        0.4 * (1.7 * i as f64).sin()
    }

    #[test]
    fn a_bin_that_no_spread_of_its_band_explains_is_odd() {
        let mut residuals: Vec<BinResidual> = (0..50).map(|i| bin(0, i, scatter(i))).collect();
        assert_eq!(odd_bins(&residuals, 1), 0);
        residuals[20].ln_ratio = 4.0;
        assert_eq!(odd_bins(&residuals, 1), 1);
        // Where all bins scatter as far, none of them is odd.
        let wide: Vec<BinResidual> = (0..50).map(|i| bin(0, i, 4.0 * scatter(i))).collect();
        assert_eq!(odd_bins(&wide, 1), 0);
    }

    #[test]
    fn a_group_that_scatters_too_far_is_found() {
        let mut residuals: Vec<BinResidual> = (0..200).map(|i| bin(i / 50, i % 50, scatter(i))).collect();
        residuals.iter_mut().filter(|r| r.pair == 1).for_each(|r| r.ln_ratio *= 3.0);
        let found = by_group(&residuals, 4, |r| r.pair);
        assert!(found[1] < 1e-3 && [0, 2, 3].iter().all(|&p| found[p] > 0.5), "{found:?}");
    }

    #[test]
    fn the_response_that_begins_too_loud_stands_out() {
        let mut residuals: Vec<BinResidual> = (0..200).map(|i| bin(i / 50, i % 50, scatter(i))).collect();
        residuals.iter_mut().filter(|r| r.pair == 2 && r.bin < 10).for_each(|r| r.ln_ratio += 0.5);
        let found = early_against_late(&residuals, &[1.0], |_, _| 10);
        assert_eq!(found.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|f| f.0), Some(2));
    }
}
