//! What it changes if walls react locally: they then absorb by the angle at which sound meets them.

use crate::error::Error;
use crate::simulate::tables::{Tables, between};
use crate::simulate::traced_views::{TracedPairView, TracedRoomView};
use sabine_acoustics::LocalReaction;

/// Shares of local reaction at which energies are tabulated: multiples of a half, so that one exponential serves all.
const GRID: [f64; 5] = [-0.5, 0.0, 0.5, 1.0, 1.5];
/// The same in halves.
const HALVES: [i32; 5] = [-1, 0, 1, 2, 3];
/// Octaves whose changes are summed along the paths together.
const OCTAVES: usize = 4;
/// Place of none in the grid.
const NO_SHARE: usize = 1;

/// Logarithm of the change of the energy of each bin of one band and pair, `[grid][bin]`.
pub(super) struct LocalReactionTable(Vec<Vec<f64>>);

impl LocalReactionTable {
    /// The change if the walls reacted locally by a share (-0.5 to 1.3; 1 is all of it): each reflection's logarithm moves by so much from
    /// that of random-incidence absorption towards that of a real impedance.
    pub fn change(&self, bin: usize, share: f64) -> f64 {
        between(&GRID, &self.0, bin, share)
    }

    #[cfg(test)]
    pub fn by_hand(bins: usize) -> Self {
        let at = |share: &f64| (0..bins).map(|bin| 0.4 * share * (1.3 * bin as f64 + 2.0).sin()).collect();
        Self(GRID.iter().map(at).collect())
    }
}

/// Tables for all bins. Single reflections stay as they are.
pub(super) fn prepare(room: &TracedRoomView<'_>) -> Result<Tables, Error> {
    Ok(Tables::of_bins(room.by_pair(of_bins)?))
}

fn of_bins(pair: &TracedPairView<'_>) -> Result<Vec<LocalReactionTable>, Error> {
    let materials = pair.room().materials();
    let energies = pair.expanded_energies()?;
    let mut found = Vec::with_capacity(energies.len());
    for first in (0..energies.len()).step_by(OCTAVES) {
        let walls: Vec<[LocalReaction; OCTAVES]> = materials
            .iter()
            .map(|m| {
                std::array::from_fn(|i| {
                    LocalReaction::new(m.absorption().values()[(first + i).min(energies.len() - 1)])
                })
            })
            .collect();
        let log_changes = pair
            .paths()
            .sums_by_angle(|material, cosine| walls[material].map(|wall| wall.log_change(cosine)));
        for band in first..energies.len().min(first + OCTAVES) {
            let halves: Vec<f32> = log_changes.iter().map(|c| (0.5 * c[band - first]).exp()).collect();
            let one = |(place, &power): (usize, &i32)| {
                if place == NO_SHARE {
                    return vec![0.0; pair.ln_energy(band).len()];
                }
                let changed: Vec<f32> =
                    energies[band].iter().zip(&halves).map(|(e, half)| e * half.powi(power)).collect();
                pair.ln_changes(band, &changed)
            };
            found.push(LocalReactionTable(HALVES.iter().enumerate().map(one).collect()));
        }
    }
    Ok(found)
}
