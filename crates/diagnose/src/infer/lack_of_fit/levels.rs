//! Levels of single responses by octave: whether they scatter farther than is known of them, and whether they go with anything.

use crate::likelihood::decay::BinResidual;
use crate::statistics::{chi_squared_tail, upper_tail};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use std::f64::consts::LN_10;

/// Orders of the responses that are drawn to see what chance does.
const PERMUTATIONS: usize = 400;
/// Responses below which nothing can be said of what levels go with.
const LEAST_RESPONSES: usize = 6;

/// How far the levels of responses by octave lie from what is predicted.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Levels {
    /// Probability of as much by chance.
    pub p_value: f64,
    /// Root mean square, in dB.
    pub rms_db: f64,
    /// Pair and band of the one that lies farthest from what is expected.
    pub largest: Option<(usize, usize)>,
}

/// Whether the fitted levels of responses by octave scatter as what is known of them says (their prior's deviation, by band).
pub(super) fn levels(residuals: &[BinResidual], dispersion: &[f64], level_sd: &[f64]) -> Levels {
    let (mut sum, mut squares, mut count, mut largest) = (0.0, 0.0, 0, (0.0, None));
    for one in residuals.chunk_by(|a, b| (a.pair, a.band) == (b.pair, b.band)) {
        let (level, place) = (one[0].level, (one[0].pair, one[0].band));
        let sd = level_sd[one[0].band];
        // A level is drawn towards zero by its prior: its variance is that share of the prior's.
        let information: f64 = one.iter().map(|r| 1.0 / (r.variance * dispersion[r.band])).sum();
        let share = information / (information + 1.0 / (sd * sd));
        sum += level * level / (sd * sd * share);
        squares += level * level;
        count += 1;
        if level.abs() / sd > largest.0 {
            largest = (level.abs() / sd, Some(place));
        }
    }
    let rms_db = (squares / f64::from(count.max(1))).sqrt() * 10.0 / LN_10;
    Levels { p_value: chi_squared_tail(sum, f64::from(count)), rms_db, largest: largest.1 }
}

/// Whether levels go with something that is known of each response (`columns`, a row for each pair): probability that any order of the
/// responses would do as well. The same order serves all octaves, whose levels go together. None where too few responses are left to tell.
pub(super) fn go_with(
    residuals: &[BinResidual],
    bands: usize,
    columns: &[Vec<f64>],
    seed: u64,
) -> Option<f64> {
    let mut by_pair: Vec<(usize, Vec<Option<f64>>)> = Vec::new();
    for one in residuals.chunk_by(|a, b| (a.pair, a.band) == (b.pair, b.band)) {
        if by_pair.last().is_none_or(|last| last.0 != one[0].pair) {
            by_pair.push((one[0].pair, vec![None; bands]));
        }
        if let Some((_, levels)) = by_pair.last_mut() {
            levels[one[0].band] = Some(one[0].level);
        }
    }
    let width = columns.first().map_or(0, Vec::len);
    if by_pair.len() < LEAST_RESPONSES.max(width + 3) || width == 0 {
        return None;
    }
    // Octaves that all responses share, their mean taken out and their scatter made one.
    let mut octaves: Vec<Vec<f64>> = Vec::new();
    for band in 0..bands {
        let Some(own) = by_pair.iter().map(|(_, l)| l[band]).collect::<Option<Vec<f64>>>() else { continue };
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        let scatter = own.iter().map(|l| (l - mean).powi(2)).sum::<f64>().sqrt();
        if scatter > 0.0 {
            octaves.push(own.iter().map(|l| (l - mean) / scatter).collect());
        }
    }
    let rows: Vec<&Vec<f64>> = by_pair.iter().map(|(pair, _)| &columns[*pair]).collect();
    let means: Vec<f64> =
        (0..width).map(|k| rows.iter().map(|r| r[k]).sum::<f64>() / rows.len() as f64).collect();
    let known = DMatrix::from_fn(rows.len(), width, |i, k| rows[i][k] - means[k]);
    // An orthonormal base of the columns: what they explain of a vector is the sum of its squared components.
    let svd = known.svd(true, false);
    let base = svd.u?;
    let rank = svd.singular_values.iter().filter(|s| **s > 1e-6 * svd.singular_values[0].max(1e-12)).count();
    let explained = |order: &[usize]| -> f64 {
        let share = |octave: &Vec<f64>| -> f64 {
            (0..rank)
                .map(|k| order.iter().zip(base.column(k)).map(|(&i, b)| octave[i] * b).sum::<f64>().powi(2))
                .sum()
        };
        octaves.iter().map(share).sum()
    };
    let mut order: Vec<usize> = (0..rows.len()).collect();
    let found = explained(&order);
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0x1E7E15);
    let by_chance: Vec<f64> = (0..PERMUTATIONS)
        .map(|_| {
            order.shuffle(&mut random);
            explained(&order)
        })
        .collect();
    (rank > 0 && !octaves.is_empty()).then(|| upper_tail(found, &by_chance))
}

#[cfg(test)]
pub(super) mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    /// Forty bins of one response in one octave, all of one level.
    fn bins(pair: usize, level: f64) -> impl Iterator<Item = BinResidual> {
        (0..40).map(move |bin| BinResidual {
            pair,
            band: 0,
            bin,
            ln_ratio: level,
            level,
            offset: level,
            ln_predicted: 0.0,
            variance: 0.1,
        })
    }

    #[test]
    fn levels_that_scatter_farther_than_is_known_of_them_are_no_chance() {
        let found = |sd_db: f64| {
            let one = |pair| bins(pair, sd_db * LN_10 / 10.0 * (1.9 * pair as f64).sin() * 2f64.sqrt());
            levels(&(0..30).flat_map(one).collect::<Vec<_>>(), &[1.0], &[0.7 * LN_10 / 10.0])
        };
        assert!(found(0.6).p_value > 0.2 && (found(0.6).rms_db - 0.6).abs() < 0.05);
        assert!(found(1.4).p_value < 1e-6);
    }

    #[test]
    fn levels_that_go_with_something_known_are_told_from_those_that_do_not() {
        let columns: Vec<Vec<f64>> = (0..12).map(|i| vec![(0.7 * i as f64).cos()]).collect();
        let scatter = |pair: usize| 0.05 * (2.9 * pair as f64 + 1.0).sin();
        let with = |slope: f64| {
            let one = |pair: usize| bins(pair, slope * columns[pair][0] + scatter(pair));
            let residuals: Vec<BinResidual> = (0..12).flat_map(one).collect();
            go_with(&residuals, 1, &columns, 1).unwrap()
        };
        assert!(with(0.0) > 0.05, "{}", with(0.0));
        assert!(with(0.2) < 0.01, "{}", with(0.2));
        assert_eq!(go_with(&bins(0, 0.1).collect::<Vec<_>>(), 1, &columns, 1), None);
    }

    #[test]
    fn levels_without_a_reason_are_put_down_to_chance_as_often_as_the_probability_says() {
        use rand_distr::{Distribution, StandardNormal};
        let mut random = Pcg64Mcg::seed_from_u64(8);
        let columns: Vec<Vec<f64>> =
            (0..10).map(|i| vec![(i as f64).cos(), (1.7 * i as f64).sin()]).collect();
        let tenths = (0..300).filter(|&seed| {
            let residuals: Vec<BinResidual> = (0..10)
                .flat_map(|pair| {
                    bins(
                        pair,
                        0.1 * {
                            let z: f64 = StandardNormal.sample(&mut random);
                            z
                        },
                    )
                })
                .collect();
            go_with(&residuals, 1, &columns, seed).unwrap() < 0.1
        });
        // 30 are expected, give or take 5.
        let found = tenths.count();
        assert!((15..48).contains(&found), "{found}");
    }
}
