//! Whether chance explains what is left.

use crate::Error;
use crate::effect::Case;
use crate::energy_model::{Before, BinResidual};
use crate::measured::Measured;
use crate::workbench::Workbench;
use rand::SeedableRng;
use rand_distr::{Distribution, Gamma};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// A bin is odd if its energy is as improbable as a normal deviate beyond this.
const ODD_SD: f64 = 4.5;
/// Odd bins that are put down to chance, on the average: normal deviates would give 0.02 among 3000 bins, pulses that meet more.
const ODD_BY_CHANCE: f64 = 1.5;

/// The two ways in which a fit can lack.
pub(crate) struct Lack {
    /// Probability of as much by chance.
    pub p_value: f64,
    /// Evidence for a smooth discrepancy, in nats.
    pub discrepancy_nats: f64,
}

/// Tests a fitted model: against a smooth discrepancy that all positions share, calibrated on measurements simulated from
/// the model itself; and for single odd bins.
pub(crate) fn test(
    bench: &Workbench,
    cases: &[&dyn Case],
    fitted: Before<'_>,
    used: &[bool],
) -> Result<Lack, Error> {
    let free = bench.free_discrepancy();
    let gain = |measured: &[Measured]| -> Result<(f64, f64), Error> {
        let base = bench.fit_energy_to(measured, cases, used, Some(fitted))?;
        let mut all = cases.to_vec();
        all.push(&free as &dyn Case);
        let more = bench.fit_energy_to(measured, &all, used, Some(fitted))?;
        Ok((more.log_likelihood - base.log_likelihood, more.log_evidence - base.log_evidence))
    };
    let (found, discrepancy_nats) = gain(&bench.measured)?;
    let simulated: Vec<f64> = (0..bench.config.simulations as u64)
        .into_par_iter()
        .map(|i| Ok(gain(&simulate(bench, cases, fitted.values, i))?.0))
        .collect::<Result<_, Error>>()?;
    let smooth = upper_tail(found, &simulated);
    let pairs: Vec<usize> = (0..used.len()).filter(|&p| used[p]).collect();
    let residuals = bench.residuals(cases, fitted.values, &pairs);
    let odd = odd_bins(&residuals, bench.survey.bands.len());
    let p_odd = poisson_tail(odd, ODD_BY_CHANCE);
    Ok(Lack { p_value: (2.0 * smooth.min(p_odd)).min(1.0), discrepancy_nats })
}

/// A measurement as the fitted model expects it.
fn simulate(bench: &Workbench, cases: &[&dyn Case], values: &[f64], number: u64) -> Vec<Measured> {
    let mut random =
        Pcg64Mcg::seed_from_u64(bench.config.seed ^ (number + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let all: Vec<usize> = (0..bench.pairs.len()).collect();
    let mut measured = bench.measured.clone();
    let assignment = bench.assignment(cases);
    for r in bench.residuals(cases, values, &all) {
        let shape = 1.0 / (r.variance * bench.dispersion[r.band]);
        let mean = r.ln_predicted.exp();
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
        ((r.ln_ratio / 3.0).exp() - 1.0 + ninth) / ninth.sqrt()
    };
    (0..bands)
        .map(|band| {
            let own: Vec<&BinResidual> = residuals.iter().filter(|r| r.band == band).collect();
            // Half of the squares of normal deviates lie below 0.455.
            let usual =
                crate::workbench::median(own.iter().map(|r| deviate(r, 1.0).powi(2)).collect()) / 0.455;
            own.iter().filter(|r| deviate(r, usual.max(1.0)).abs() > ODD_SD).count()
        })
        .sum()
}

/// Probability that a variable with the mean and variance of the samples exceeds a value, as a scaled chi-squared variable
/// (Wilson and Hilferty 1931).
fn upper_tail(value: f64, samples: &[f64]) -> f64 {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if mean <= 0.0 || variance <= 0.0 {
        return if value > mean { 0.0 } else { 1.0 };
    }
    let ninth = variance / (9.0 * mean * mean);
    let z = ((value / mean).max(0.0).cbrt() - 1.0 + ninth) / ninth.sqrt();
    // What so few samples cannot tell from chance does not count: Student's t with n - 1 degrees, by its normal approximation.
    let z = z / (1.0 + z * z / (2.0 * (n - 1.0))).sqrt();
    normal_tail(z)
}

/// Probability of a normal deviate above z (Abramowitz and Stegun 1964, 26.2.17: to 7.5e-8).
fn normal_tail(z: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let series = t
        * (0.319_381_530
            + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let tail = (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt() * series;
    if z >= 0.0 { tail } else { 1.0 - tail }
}

/// Probability of at least so many events where `mean` are expected.
fn poisson_tail(count: usize, mean: f64) -> f64 {
    let mut term = (-mean).exp();
    let mut below = 0.0;
    for k in 0..count {
        below += term;
        term *= mean / (k + 1) as f64;
    }
    (1.0 - below).max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_are_those_of_the_tables() {
        assert!((normal_tail(1.644_854) - 0.05).abs() < 1e-6);
        assert!((normal_tail(-1.0) - 0.841_345).abs() < 1e-6);
        // Poisson with mean 1.5: P(N >= 4) = 0.0656.
        assert!((poisson_tail(4, 1.5) - 0.0656).abs() < 1e-3);
    }

    #[test]
    fn a_value_among_the_samples_is_no_surprise_and_one_far_off_is() {
        let samples: Vec<f64> = (0..30).map(|i| 20.0 + f64::from(i % 7)).collect();
        assert!(upper_tail(23.0, &samples) > 0.2);
        assert!(upper_tail(60.0, &samples) < 1e-3);
    }
}
