//! Energies and the tracer's own variance at other scattering.

use crate::error::Error;
use crate::simulate::path_chances::EXTRA_SCATTERING as GRID;
use crate::simulate::scattering_share::scattering_more;
use crate::simulate::tables::{Tables, between};
use crate::simulate::traced_views::{TracedPairView, TracedRoomView};
use sabine_acoustics::Material;

/// Place of none in the grid.
const NO_EXTRA: usize = 2;
/// Energy of a bin without paths, as a share of the strongest: it counts as nothing.
const NOTHING: f64 = 1e-12;

/// What other scattering does to the bins of one band and pair, `[grid][bin]`.
#[derive(Clone, Debug)]
pub(super) struct ScatteringTable {
    /// Logarithm of the change of energy.
    change: Vec<Vec<f64>>,
    /// By how much the tracer's own relative variance is more: what scatters is found by chance. None for single reflections.
    variance: Option<Vec<Vec<f64>>>,
}

impl ScatteringTable {
    /// Natural logarithm of the change of a bin's energy if the surfaces scattered more by `extra` (0 to 0.95, share of what they now
    /// reflect specularly) or less (-1 to 0, share of what they now scatter).
    pub fn change(&self, bin: usize, extra: f64) -> f64 {
        between(&GRID, &self.change, bin, extra)
    }

    pub fn variance(&self, bin: usize, extra: f64) -> f64 {
        self.variance.as_ref().map_or(0.0, |variance| between(&GRID, variance, bin, extra))
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
    let mut found =
        vec![ScatteringTable { change: Vec::new(), variance: Some(Vec::new()) }; materials[0].bands().len()];
    let expected = |extra: f64| -> Result<Vec<Expected>, Error> {
        let changed: Vec<Material> =
            materials.iter().map(|m| scattering_more(m, extra)).collect::<Result<_, _>>()?;
        let energies = pair.energies(&changed)?;
        Ok(energies.iter().enumerate().map(|(band, e)| Expected::new(pair, band, e)).collect())
    };
    let stated = expected(GRID[NO_EXTRA])?;
    for (place, &extra) in GRID.iter().enumerate() {
        let changed = if place == NO_EXTRA { stated.clone() } else { expected(extra)? };
        for ((table, now), before) in found.iter_mut().zip(&changed).zip(&stated) {
            let change = now.ln_energy.iter().zip(&before.ln_energy).map(|(now, before)| now - before);
            table.change.push(change.collect());
            let more = now.variance.iter().zip(&before.variance).map(|(now, own)| (now - own).max(0.0));
            table.variance.get_or_insert_default().push(more.collect());
        }
    }
    Ok(found)
}

/// What is to be expected in the bins of one band.
#[derive(Clone)]
struct Expected {
    ln_energy: Vec<f64>,
    /// The tracer's own relative variance.
    variance: Vec<f64>,
}

impl Expected {
    fn new(pair: &TracedPairView<'_>, band: usize, energies: &[f32]) -> Self {
        let (sums, monte_carlo) = pair.expected_energies_and_variance(band, energies);
        let floor = NOTHING * sums.iter().copied().fold(0.0, f64::max).max(1e-30);
        let bins = || sums.iter().map(|s| s.max(floor));
        Self {
            ln_energy: bins().map(f64::ln).collect(),
            variance: bins().zip(&monte_carlo).map(|(e, variance)| variance / (e * e)).collect(),
        }
    }
}

/// A share more of each reflection is scattered, and lost to the mirror; what was scattered never comes back as one.
fn of_reflections(pair: &TracedPairView<'_>) -> Vec<ScatteringTable> {
    let at = |extra: &f64| pair.reflection_orders().map(|n| n as f64 * (1.0 - extra.max(0.0)).ln()).collect();
    let table = ScatteringTable { change: GRID.iter().map(at).collect(), variance: None };
    vec![table; pair.room().materials()[0].bands().len()]
}

#[cfg(test)]
impl ScatteringTable {
    /// Changes in proportion to the extra scattering, other ones in each bin.
    pub fn by_hand(bins: usize) -> Self {
        let change = |extra: &f64| (0..bins).map(|bin| 0.4 * extra * (1.3 * bin as f64).sin()).collect();
        let variance = |extra: &f64| vec![0.05 * extra.abs(); bins];
        Self {
            change: GRID.iter().map(change).collect(),
            variance: Some(GRID.iter().map(variance).collect()),
        }
    }
}
