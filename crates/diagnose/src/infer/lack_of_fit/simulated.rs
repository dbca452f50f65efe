//! Measurements as a fitted model expects them.

use crate::effect::Case;
use crate::infer::baseline::Baseline;
use crate::likelihood::decay::{BinResidual, DRIFTS, unit_drift};
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
    let residuals = baseline.residuals(cases, values, &all);
    if baseline.observations.are_tables() {
        draw_tables(baseline, &residuals, &assignment, &mut measured, &mut random);
        return measured;
    }
    for r in residuals {
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

/// The same of tables: what interference, rays and the measurement itself leave open.
fn draw_tables(
    baseline: &Baseline,
    residuals: &[BinResidual],
    assignment: &[usize],
    measured: &mut [Measured],
    random: &mut Pcg64Mcg,
) {
    let mut draw = || -> f64 { StandardNormal.sample(random) };
    let mut rays: (usize, Vec<f64>) = (usize::MAX, Vec::new());
    for octave in residuals.chunk_by(|a, b| (a.pair, a.band) == (b.pair, b.band)) {
        let (pair, band) = (octave[0].pair, octave[0].band);
        let Some(chance) = &baseline.simulation.states[pair][band].table else { continue };
        if rays.0 != pair {
            rays = (pair, (0..chance.modes.count()).map(|_| draw()).collect());
        }
        let own: Vec<f64> = (0..chance.count()).map(|_| draw()).collect();
        let along = |moves: &[f64], by: &[f64]| moves.iter().zip(by).map(|(m, z)| m * z).sum::<f64>();
        let Some(quantities) = &mut measured[assignment[pair]].energies[band] else { continue };
        for r in octave {
            let by_chance = along(chance.of_value(r.bin), &own) + along(chance.modes.of(r.bin), &rays.1);
            let by_measurement = (r.variance * baseline.dispersion[band]).sqrt() * draw();
            quantities[r.bin] = (r.ln_predicted + by_chance + by_measurement).exp();
        }
    }
}
