//! Energies and the tracer's own variance at other scattering.

use crate::error::Error;
use crate::simulate::path_chances::EXTRA_SCATTERING as GRID;
use crate::simulate::scattering_share::scattering_more;
use crate::simulate::tables::{Tables, between, place_in};
use crate::simulate::traced_views::{ExpectedBins, TracedPairView, TracedRoomView};
use sabine_acoustics::Material;
#[cfg(test)]
use sabine_paths::PathSet;

/// Place of none in the grid.
const NO_EXTRA: usize = 2;

/// What other scattering does to the bins of one band and pair, `[grid][bin]`.
#[derive(Clone, Debug, Default)]
pub(super) struct ScatteringTable {
    /// Logarithm of the change of energy.
    change: Vec<Vec<f64>>,
    /// By how much the tracer's own relative variance is more: what scatters is found by chance. None for single reflections.
    variance: Vec<Vec<f64>>,
    /// What each batch of rays moves the logarithm of energy by, `[grid][bin * batches + batch]`. None for single reflections.
    chance: Vec<Vec<f32>>,
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

    /// What each batch of rays moves the logarithm of energy by, `[bin * batches + batch]`: between two places of the grid the prediction is a
    /// mixture of both, and chance of the one is not that of the other.
    pub fn chance(&self, extra: f64) -> Vec<f64> {
        let (lower, share) = place_in(&GRID, extra);
        let [Some(here), Some(next)] = [lower, lower + 1].map(|place| self.chance.get(place)) else {
            return Vec::new();
        };
        let mixed = |(a, b): (&f32, &f32)| (1.0 - share) * f64::from(*a) + share * f64::from(*b);
        here.iter().zip(next).map(mixed).collect()
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
        let found;
        let energies = if changed == materials {
            pair.expanded_energies()?
        } else {
            found = pair.energies(&changed)?;
            &found
        };
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
        table.chance = all.iter().map(|bands| bands[band].chance.clone()).collect();
        table
    };
    Ok((0..materials[0].bands().len()).map(of_band).collect())
}

fn differences(of: &[f64], from: &[f64]) -> impl Iterator<Item = f64> {
    of.iter().zip(from).map(|(a, b)| a - b)
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
        // Each place of the grid has a chance of its own.
        let batches = usize::from(PathSet::BATCHES);
        let chance = |extra: &f64| -> Vec<f32> {
            (0..bins * batches)
                .map(|i| (0.05 * (1.0 + 0.4 * extra) * (0.7 * i as f64 + 2.0 * extra).sin()) as f32)
                .collect()
        };
        Self {
            change: GRID.iter().map(change).collect(),
            variance: GRID.iter().map(variance).collect(),
            chance: GRID.iter().map(chance).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chance_between_two_places_of_the_grid_is_that_of_their_mixture() {
        let table = ScatteringTable::by_hand(3);
        let at = |place: usize, i: usize| f64::from(table.chance[place][i]);
        for (extra, share) in [(0.0, 0.0), (0.03, 0.3), (0.08, 0.8), (0.1, 1.0)] {
            let found = table.chance(extra);
            assert_eq!(found.len(), 3 * usize::from(PathSet::BATCHES));
            for (i, found) in found.iter().enumerate() {
                let expected = (1.0 - share) * at(NO_EXTRA, i) + share * at(NO_EXTRA + 1, i);
                assert!((found - expected).abs() < 1e-9, "{extra}: {found} {expected}");
            }
        }
        assert!(ScatteringTable::default().chance(0.1).is_empty());
    }
}
