//! Measurements as a fitted model expects them.

use crate::effect::Case;
use crate::infer::baseline::Baseline;
use crate::likelihood::decay::{DRIFTS, unit_drift};
use crate::likelihood::parameters::assignment;
use crate::observe::observed_response::Measured;
use rand::SeedableRng;
use rand_distr::{Distribution, Gamma, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// A measurement as the fitted model expects it.
pub(super) fn simulate(baseline: &Baseline, cases: &[&Case], values: &[f64], number: u64) -> Vec<Measured> {
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
