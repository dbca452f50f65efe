//! Energies and the tracer's own variance at other scattering.

use crate::error::Error;
use crate::simulate::path_chances::EXTRA_SCATTERING as GRID;
use crate::simulate::scattering_share::scattering_more;
use crate::simulate::tables::{Tables, between, place_in};
use crate::simulate::traced_views::{ExpectedBins, TracedPairView, TracedRoomView};
use sabine_acoustics::Material;

/// Place of none in the grid.
const NO_EXTRA: usize = 2;
/// Variance of a logarithm below which nothing is left to chance.
const NO_CHANCE: f64 = 1e-12;

/// What other scattering does to the bins of one band and pair, `[grid][bin]`.
#[derive(Clone, Debug, Default)]
pub(super) struct ScatteringTable {
    /// Logarithm of the change of energy.
    change: Vec<Vec<f64>>,
    /// By how much the tracer's own relative variance is more: what scatters is found by chance. None for single reflections.
    variance: Vec<Vec<f64>>,
    /// The tracer's own variance at this place of the grid, that at the next, and the covariance of both, as shares of that without extra
    /// scattering. None for single reflections.
    chance: Vec<Vec<[f64; 3]>>,
}

impl ScatteringTable {
    /// Natural logarithm of the change of a bin's energy if the surfaces scattered more by `extra` (0 to 0.95, share of what they now
    /// reflect specularly) or less (-1 to 0, share of what they now scatter).
    pub fn change(&self, bin: usize, extra: f64) -> f64 {
        between(&GRID, &self.change, bin, extra)
    }

    pub fn variance(&self, bin: usize, extra: f64) -> f64 {
        if self.variance.is_empty() { 0.0 } else { between(&GRID, &self.variance, bin, extra) }
    }

    /// The tracer's own variance as a share of what it is as stated: between two places of the grid the prediction is a mixture of both,
    /// and chance of the one is not that of the other.
    pub fn chance(&self, bin: usize, extra: f64) -> f64 {
        let (lower, share) = place_in(&GRID, extra);
        let Some(bins) = self.chance.get(lower) else { return 1.0 };
        let [here, next, both] = bins[bin];
        (1.0 - share).powi(2) * here + share.powi(2) * next + 2.0 * share * (1.0 - share) * both
    }
}

/// Tables for all bins and early reflections.
pub(super) fn prepare(room: &TracedRoomView<'_>) -> Result<Tables, Error> {
    let bins = room.by_pair(of_bins)?;
    let reflections = room.by_pair(|pair| Ok(of_reflections(pair)))?;
    Ok(Tables::of_bins(bins).with_reflections(reflections))
}

fn of_bins(pair: &TracedPairView<'_>) -> Result<Vec<ScatteringTable>, Error> {
    let materials = pair.room().materials();
    let at = |extra: &f64| -> Result<Vec<ExpectedBins>, Error> {
        let changed: Vec<Material> =
            materials.iter().map(|m| scattering_more(m, *extra)).collect::<Result<_, _>>()?;
        let energies = pair.energies(&changed)?;
        Ok(energies.iter().enumerate().map(|(band, e)| pair.expected_energies(band, e)).collect())
    };
    // `[grid][band]`.
    let all: Vec<Vec<ExpectedBins>> = GRID.iter().map(at).collect::<Result<_, _>>()?;
    let of_band = |band: usize| -> ScatteringTable {
        let stated = &all[NO_EXTRA][band];
        let mut table = ScatteringTable::default();
        for bands in &all {
            let now = &bands[band];
            table.change.push(differences(&now.ln_energy, &stated.ln_energy).collect());
            table
                .variance
                .push(differences(&now.variance, &stated.variance).map(|more| more.max(0.0)).collect());
        }
        table.chance =
            all.windows(2).map(|two| chance_between([&two[0][band], &two[1][band]], stated)).collect();
        table
    };
    Ok((0..materials[0].bands().len()).map(of_band).collect())
}

fn differences(of: &[f64], from: &[f64]) -> impl Iterator<Item = f64> {
    of.iter().zip(from).map(|(a, b)| a - b)
}

/// What chance the bins have of their own at two places of the grid, and together, as shares of that as stated.
fn chance_between([here, next]: [&ExpectedBins; 2], stated: &ExpectedBins) -> Vec<[f64; 3]> {
    let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let of_bin = |bin: usize| {
        let [here, next, stated] = [here, next, stated].map(|at| &at.chance[bin][..]);
        let whole = product(stated, stated);
        let share = |a: &[f64], b: &[f64]| if whole > NO_CHANCE { product(a, b) / whole } else { 1.0 };
        [share(here, here), share(next, next), share(here, next)]
    };
    (0..stated.chance.len()).map(of_bin).collect()
}

/// A share more of each reflection is scattered, and lost to the mirror; what was scattered never comes back as one.
fn of_reflections(pair: &TracedPairView<'_>) -> Vec<ScatteringTable> {
    let at = |extra: &f64| pair.reflection_orders().map(|n| n as f64 * (1.0 - extra.max(0.0)).ln()).collect();
    let table = ScatteringTable { change: GRID.iter().map(at).collect(), ..ScatteringTable::default() };
    vec![table; pair.room().materials()[0].bands().len()]
}

#[cfg(test)]
impl ScatteringTable {
    /// Changes in proportion to the extra scattering, other ones in each bin.
    pub fn by_hand(bins: usize) -> Self {
        let change = |extra: &f64| (0..bins).map(|bin| 0.4 * extra * (1.3 * bin as f64).sin()).collect();
        let variance = |extra: &f64| vec![0.05 * extra.abs(); bins];
        // Two places of the grid have half of their chance in common.
        let chance = |places: &[f64]| -> Vec<[f64; 3]> {
            let own = |extra: f64| (1.0 + 0.4 * extra).powi(2);
            let (here, next) = (own(places[0]), own(places[1]));
            vec![[here, next, 0.5 * (here * next).sqrt()]; bins]
        };
        Self {
            change: GRID.iter().map(change).collect(),
            variance: GRID.iter().map(variance).collect(),
            chance: GRID.windows(2).map(chance).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chance_between_two_places_of_the_grid_is_that_of_their_mixture() {
        // Errors of four batches in one bin: as stated, and with a tenth more scattered.
        let (stated, more) = ([0.3, -0.1, -0.1, -0.1], [0.05, 0.1, -0.2, 0.05]);
        let at = |chance: [f64; 4]| ExpectedBins {
            ln_energy: vec![0.0],
            variance: vec![chance.iter().map(|d| d * d).sum()],
            chance: vec![chance.to_vec()],
        };
        let all = [at(stated), at(more)];
        let mut table = ScatteringTable::default();
        for places in GRID.windows(2) {
            let of = |extra: f64| &all[usize::from(extra != GRID[NO_EXTRA])];
            table.chance.push(chance_between([of(places[0]), of(places[1])], &all[0]));
        }
        for (extra, share) in [(0.0, 0.0), (0.03, 0.3), (0.08, 0.8), (0.1, 1.0)] {
            let squares = |mixed: &dyn Fn(usize) -> f64| -> f64 { (0..4).map(|i| mixed(i).powi(2)).sum() };
            let expected =
                squares(&|i| (1.0 - share) * stated[i] + share * more[i]) / squares(&|i| stated[i]);
            let found = table.chance(0, extra);
            assert!((found - expected).abs() < 1e-9, "{extra}: {found} {expected}");
        }
        // Where nothing is left to chance, nothing changes.
        assert_eq!(chance_between([&at([0.0; 4]), &at([0.0; 4])], &at([0.0; 4])), [[1.0; 3]]);
    }
}
