//! Whether chance explains what is left.

use crate::effect::Case;
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::likelihood::decay::{BinResidual, WarmStart};
use crate::likelihood::parameters::assignment;
use crate::observe::observed_response::Measured;
use crate::statistics::{median, poisson_tail, upper_tail};
use rand::SeedableRng;
use rand_distr::{Distribution, Gamma};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

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
    Ok(Lack { p_value: (2.0 * smooth.min(p_odd)).min(1.0), discrepancy_nats })
}

/// A measurement as the fitted model expects it.
fn simulate(baseline: &Baseline, cases: &[&Case], values: &[f64], number: u64) -> Vec<Measured> {
    let mut random =
        Pcg64Mcg::seed_from_u64(baseline.config.seed ^ (number + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let all: Vec<usize> = (0..baseline.pairs()).collect();
    let mut measured = baseline.observations.measured.clone();
    let assignment = assignment(baseline.pairs(), cases.iter().copied());
    for r in baseline.residuals(cases, values, &all) {
        let shape = 1.0 / (r.variance * baseline.dispersion[r.band]);
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
            let usual = median(own.iter().map(|r| deviate(r, 1.0).powi(2)).collect()) / 0.455;
            own.iter().filter(|r| deviate(r, usual.max(1.0)).abs() > ODD_SD).count()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bin_that_no_spread_of_its_band_explains_is_odd() {
        let bin = |bin: usize, ln_ratio: f64| BinResidual {
            pair: 0,
            band: 0,
            bin,
            ln_ratio,
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
