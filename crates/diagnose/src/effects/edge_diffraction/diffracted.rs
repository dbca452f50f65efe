//! Sound that bends around an edge of the mesh, beside the traced paths.

use crate::error::Error;
use crate::simulate::tables::Tables;
use crate::simulate::traced_views::{TracedPairView, TracedRoomView};
use sabine_paths::Conditions;

/// Energy of diffracted paths in the bins of one band: of its own octave and of those from which its filter lets something in.
#[derive(Default)]
pub(super) struct DiffractedEnergy {
    /// Octave, and energy of each bin.
    columns: Vec<(usize, Vec<f64>)>,
}

impl DiffractedEnergy {
    /// Energy of an octave in a bin, by theory.
    pub fn of(&self, octave: usize, bin: usize) -> f64 {
        let column = self.columns.iter().find(|(o, _)| *o == octave);
        column.and_then(|(_, energies)| energies.get(bin)).copied().unwrap_or(0.0)
    }
}

/// Tables for all bins; empty for pairs that see each other. Single reflections stay as they are.
pub(super) fn prepare(room: &TracedRoomView<'_>) -> Result<Tables, Error> {
    Ok(Tables::of_bins(room.by_pair(of_bins)?))
}

fn of_bins(pair: &TracedPairView<'_>) -> Result<Vec<DiffractedEnergy>, Error> {
    let materials = pair.room().materials();
    let bands = materials[0].bands().len();
    let Some(diffracted) = pair.diffracted_paths() else {
        return Ok((0..bands).map(|_| DiffractedEnergy::default()).collect());
    };
    let air = pair.air();
    let energies = diffracted.energies(&Conditions::new(materials, &air))?;
    let speed_m_s = air.speed_of_sound_m_s();
    let times_s: Vec<f64> =
        diffracted.lengths_m().iter().map(|l| f64::from(*l) / speed_m_s - pair.direct_s()).collect();
    let column = |octave: usize, band: usize| {
        let mut sums = vec![0.0; pair.ln_energy(band).len()];
        for (&time_s, &e) in times_s.iter().zip(&energies[octave]) {
            pair.spread_pulse(band, time_s, |bin, share| sums[bin] += share * f64::from(e));
        }
        (octave, sums)
    };
    let of_band = |band: usize| DiffractedEnergy {
        columns: (0..bands)
            .filter(|&octave| pair.filter_share(band, octave).is_some())
            .map(|octave| column(octave, band))
            .collect(),
    };
    Ok((0..bands).map(of_band).collect())
}

#[cfg(test)]
impl DiffractedEnergy {
    /// Slower decays than those of the paths, in two octaves.
    pub fn by_hand(bins: usize) -> Self {
        let energies =
            |octave: usize| (0..bins).map(|bin| 0.1 * (-0.1 * (bin + octave) as f64).exp()).collect();
        Self { columns: (0..2).map(|octave| (octave, energies(octave))).collect() }
    }
}
