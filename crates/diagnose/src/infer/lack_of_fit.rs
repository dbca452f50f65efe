//! Whether chance explains what is left.

use crate::effect::Case;
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::likelihood::decay::{BinResidual, DRIFTS, WarmStart, unit_drift};
use crate::likelihood::parameters::assignment;
use crate::observe::observed_response::Measured;
use crate::statistics::{chi_squared_tail, median, poisson_tail, upper_tail};
use rand::SeedableRng;
use rand_distr::{Distribution, Gamma, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::f64::consts::LN_10;

/// A bin is odd if its energy is as improbable as a normal deviate beyond this.
const ODD_SD: f64 = 4.5;
/// Odd bins that are put down to chance, on the average: normal deviates would give 0.02 among 3000 bins, pulses that meet more.
const ODD_BY_CHANCE: f64 = 1.5;

/// The two ways in which a fit can lack.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lack {
    /// Probability of as much by chance.
    pub p_value: f64,
    /// Evidence for a smooth discrepancy, in nats.
    pub discrepancy_nats: f64,
    /// The responses' own levels by octave.
    pub levels: Levels,
    /// What was tested, and the probability of each.
    pub tests: [(&'static str, f64); 3],
}

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

/// Tests a fitted model: against a smooth discrepancy that all positions share, calibrated on measurements simulated from
/// the model itself; and for single odd bins.
pub(crate) fn test(
    baseline: &Baseline,
    cases: &[&Case],
    fitted: WarmStart<'_>,
    used: &[bool],
) -> Result<Lack, Error> {
    let free = baseline.free_discrepancy();
    let gain = |measured: &[Measured]| -> Result<(f64, f64), Error> {
        let base = baseline.fit_energy_to(measured, cases, used, Some(fitted))?;
        let mut all = cases.to_vec();
        all.push(&free);
        let more = baseline.fit_energy_to(measured, &all, used, Some(fitted))?;
        Ok((more.log_likelihood - base.log_likelihood, more.log_evidence - base.log_evidence))
    };
    let (found, discrepancy_nats) = gain(&baseline.observations.measured)?;
    let simulated: Vec<f64> = (0..baseline.config.simulations as u64)
        .into_par_iter()
        .map(|i| Ok(gain(&simulate(baseline, cases, fitted.values, i))?.0))
        .collect::<Result<_, Error>>()?;
    let smooth = upper_tail(found, &simulated);
    let pairs: Vec<usize> = (0..used.len()).filter(|&p| used[p]).collect();
    let residuals = baseline.residuals(cases, fitted.values, &pairs);
    let odd = odd_bins(&residuals, baseline.survey().bands.len());
    let p_odd = poisson_tail(odd, ODD_BY_CHANCE);
    let levels = levels(&residuals, &baseline.dispersion, &baseline.level_sd);
    let tests = [
        ("a smooth difference that all responses share", smooth),
        ("single odd bins", p_odd),
        ("levels of single responses by octave", levels.p_value),
    ];
    // Corrected for their number (Bonferroni).
    let least = tests.iter().map(|t| t.1).fold(1.0, f64::min);
    Ok(Lack { p_value: (tests.len() as f64 * least).min(1.0), discrepancy_nats, levels, tests })
}

/// Whether the fitted levels of responses by octave scatter as what is known of them says (their prior's deviation, by band).
fn levels(residuals: &[BinResidual], dispersion: &[f64], level_sd: &[f64]) -> Levels {
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

/// A measurement as the fitted model expects it.
fn simulate(baseline: &Baseline, cases: &[&Case], values: &[f64], number: u64) -> Vec<Measured> {
    let mut random =
        Pcg64Mcg::seed_from_u64(baseline.config.seed ^ (number + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let all: Vec<usize> = (0..baseline.pairs()).collect();
    let mut measured = baseline.observations.measured.clone();
    let assignment = assignment(baseline.pairs(), cases.iter().copied());
    // Each response has a level and a drift of its own in each octave, and its prediction the errors of other rays.
    let mut level = (usize::MAX, 0, 0.0f64);
    let mut drift = [0.0f64; DRIFTS];
    let mut chance: (usize, Vec<f64>) = (usize::MAX, Vec::new());
    for r in baseline.residuals(cases, values, &all) {
        let modes = &baseline.simulation.states[r.pair][r.band].modes;
        if chance.0 != r.pair {
            chance = (r.pair, (0..modes.count()).map(|_| StandardNormal.sample(&mut random)).collect());
        }
        if (level.0, level.1) != (r.pair, r.band) {
            let deviate: f64 = StandardNormal.sample(&mut random);
            level = (r.pair, r.band, baseline.level_sd[r.band] * deviate);
            drift = std::array::from_fn(|_| StandardNormal.sample(&mut random));
        }
        let unit = unit_drift(r.bin, baseline.simulation.ends[r.pair][r.band]);
        let drifted = baseline.drift_sd[r.band] * unit.iter().zip(&drift).map(|(u, z)| u * z).sum::<f64>();
        let offset = drifted + modes.of(r.bin).iter().zip(&chance.1).map(|(m, z)| m * z).sum::<f64>();
        let shape = 1.0 / (r.variance * baseline.dispersion[r.band]);
        let mean = (r.ln_predicted + level.2 + offset).exp();
        let drawn = Gamma::new(shape, mean / shape).map_or(mean, |g| g.sample(&mut random));
        if let Some(energies) = &mut measured[assignment[r.pair]].energies[r.band] {
            energies[r.bin] = drawn;
        }
    }
    measured
}

/// Bins that chance does not explain, once each band's usual spread is allowed for.
pub(crate) fn odd_bins(residuals: &[BinResidual], bands: usize) -> usize {
    // Wilson and Hilferty 1931: the cube root of a Gamma variate is nearly normal.
    let deviate = |r: &BinResidual, spread: f64| {
        let ninth = r.variance * spread / 9.0;
        (((r.ln_ratio - r.offset) / 3.0).exp() - 1.0 + ninth) / ninth.sqrt()
    };
    (0..bands)
        .map(|band| {
            let own: Vec<&BinResidual> = residuals.iter().filter(|r| r.band == band).collect();
            // Half of the squares of normal deviates lie below 0.455.
            let usual = median(own.iter().map(|r| deviate(r, 1.0).powi(2)).collect()) / 0.455;
            own.iter().filter(|r| deviate(r, usual.max(1.0)).abs() > ODD_SD).count()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_that_scatter_farther_than_is_known_of_them_are_no_chance() {
        let found = |sd_db: f64| {
            let one = |pair: usize| {
                let level = sd_db * LN_10 / 10.0 * (1.9 * pair as f64).sin() * 2f64.sqrt();
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
            };
            levels(&(0..30).flat_map(one).collect::<Vec<_>>(), &[1.0], &[0.7 * LN_10 / 10.0])
        };
        assert!(found(0.6).p_value > 0.2 && (found(0.6).rms_db - 0.6).abs() < 0.05);
        assert!(found(1.4).p_value < 1e-6);
    }

    #[test]
    fn a_bin_that_no_spread_of_its_band_explains_is_odd() {
        let bin = |bin: usize, ln_ratio: f64| BinResidual {
            pair: 0,
            band: 0,
            bin,
            ln_ratio,
            level: 0.0,
            offset: 0.0,
            ln_predicted: 0.0,
            variance: 0.2,
        };
        let scatter = |i: usize| 0.4 * (1.7 * i as f64).sin();
        let mut residuals: Vec<BinResidual> = (0..50).map(|i| bin(i, scatter(i))).collect();
        assert_eq!(odd_bins(&residuals, 1), 0);
        residuals[20].ln_ratio = 4.0;
        assert_eq!(odd_bins(&residuals, 1), 1);
        // Where all bins scatter as far, none of them is odd.
        let wide: Vec<BinResidual> = (0..50).map(|i| bin(i, 4.0 * scatter(i))).collect();
        assert_eq!(odd_bins(&wide, 1), 0);
    }
}
