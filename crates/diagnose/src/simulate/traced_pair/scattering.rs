//! What it changes if surfaces scatter more or less, and how far chance has a say in it.

use super::{BandState, NO_EXTRA, NOTHING, SCATTERING_GRID, TracedPair};
use crate::observe::band_pulse::{BandPulse, CELL_S};
use crate::observe::time_bins::Bins;
use sabine_acoustics::{Bands, Conditions, Error, Material, PathSet, PerBand};

impl TracedPair {
    /// Energies and the tracer's own variance at other scattering.
    pub(super) fn tabulate_scattering(
        &self,
        materials: &[Material],
        kernels: &[BandPulse],
        duration_s: f64,
        states: &mut [BandState],
    ) -> Result<(), Error> {
        for (place, &extra) in SCATTERING_GRID.iter().enumerate() {
            if place == NO_EXTRA {
                for state in states.iter_mut() {
                    state.scattering.push(vec![0.0; state.ln_energy.len()]);
                    state.scattering_variance.push(vec![0.0; state.ln_energy.len()]);
                }
                continue;
            }
            let changed: Vec<Material> =
                materials.iter().map(|m| scattering_more(m, extra)).collect::<Result<_, _>>()?;
            let energies = self.paths.energies_under(&Conditions::new(&changed, &self.air))?;
            for ((state, kernel), energies) in states.iter_mut().zip(kernels).zip(&energies) {
                let (sums, monte_carlo_variance) =
                    self.sums_and_variance(energies, state.bins, kernel, duration_s);
                let floor = NOTHING * sums.iter().copied().fold(0.0, f64::max).max(1e-30);
                let bins = || sums.iter().map(|s| s.max(floor)).zip(&state.ln_energy);
                let change: Vec<f64> = bins().map(|(e, l)| e.ln() - l).collect();
                let more = |((e, _), (monte_carlo_variance, own)): ((f64, _), (&f64, &f64))| {
                    (monte_carlo_variance / (e * e) - own).max(0.0)
                };
                let variance =
                    bins().zip(monte_carlo_variance.iter().zip(&state.monte_carlo)).map(more).collect();
                state.scattering.push(change);
                state.scattering_variance.push(variance);
            }
        }
        Ok(())
    }

    /// Energy of each bin, and its variance by chance, from the scatter between batches of rays.
    pub(super) fn sums_and_variance(
        &self,
        energies: &[f32],
        bins: Bins,
        kernel: &BandPulse,
        duration_s: f64,
    ) -> (Vec<f64>, Vec<f64>) {
        let count = bins.count(duration_s);
        let cells = (duration_s / CELL_S).ceil() as usize + 1;
        let batches = usize::from(PathSet::BATCHES);
        let mut exact = vec![0.0f64; cells];
        let mut by_batch = vec![0.0f32; cells * batches];
        for (i, (&cell, &e)) in self.cells.iter().zip(energies).enumerate() {
            let cell = usize::from(cell);
            if cell >= cells {
                continue;
            }
            match self.paths.batch(i) {
                Some(batch) => by_batch[cell * batches + usize::from(batch)] += e,
                None => exact[cell] += f64::from(e),
            }
        }
        let mut sums = vec![0.0f64; count];
        for &i in &self.isolated {
            let (time_s, e) = (f64::from(self.times_s[i as usize]), f64::from(energies[i as usize]));
            Self::shares(time_s, bins, kernel, count, |bin, share| sums[bin] += share * e);
        }
        let mut sampled = vec![0.0f64; count * batches];
        for (cell, parts) in by_batch.chunks(batches).enumerate() {
            let time_s = (cell as f64 + 0.5) * CELL_S;
            let own = exact[cell];
            if own > 0.0 || parts.iter().any(|e| *e > 0.0) {
                Self::shares(time_s, bins, kernel, count, |bin, share| {
                    sums[bin] += share * own;
                    let target = &mut sampled[bin * batches..(bin + 1) * batches];
                    target.iter_mut().zip(parts).for_each(|(s, r)| *s += share * f64::from(*r));
                });
            }
        }
        let monte_carlo_variance = sampled.chunks(batches).map(variance_of_sum).collect();
        sums.iter_mut().zip(sampled.chunks(batches)).for_each(|(s, parts)| *s += parts.iter().sum::<f64>());
        (sums, monte_carlo_variance)
    }
}

/// Variance of the sum of independent batches, from their scatter.
fn variance_of_sum(batches: &[f64]) -> f64 {
    let count = batches.len() as f64;
    let mean = batches.iter().sum::<f64>() / count;
    batches.iter().map(|b| (b - mean).powi(2)).sum::<f64>() * count / (count - 1.0)
}

/// A material that scatters more (of what it reflects specularly) or less (of what it scatters).
pub(crate) fn scattering_more(material: &Material, extra: f64) -> Result<Material, Error> {
    let bands: Bands = material.bands();
    let changed = PerBand::from_fn(bands, |b| {
        let s = material.scattering().values()[b];
        (if extra >= 0.0 { s + (1.0 - s) * extra } else { s * (1.0 + extra) }).clamp(0.0, 1.0)
    });
    Material::new(material.absorption().clone(), changed)
}
