//! Sound that bends around an edge of the mesh, beside the traced paths.

use super::TracedPair;
use crate::observe::band_pulse::BandPulse;
use crate::observe::time_bins::Bins;
use sabine_acoustics::{Conditions, Error, Material};

/// Energy of diffracted paths in the bins of one band: of its own octave and of those from which its filter lets something in.
#[derive(Clone, Debug, Default)]
pub(crate) struct DiffractedEnergy {
    /// Octave, and energy of each bin.
    columns: Vec<(usize, Vec<f64>)>,
}

impl DiffractedEnergy {
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    pub fn of(&self, band: usize, bin: usize) -> f64 {
        let column = self.columns.iter().find(|(b, _)| *b == band);
        column.and_then(|(_, energies)| energies.get(bin)).copied().unwrap_or(0.0)
    }
}

impl TracedPair {
    /// Whether source and receiver do not see each other, and sound bends around an edge between them.
    pub fn is_diffracted(&self) -> bool {
        self.diffracted.is_some()
    }

    /// Energy of the diffracted paths in the bins of each band.
    pub fn diffracted_energies(
        &self,
        materials: &[Material],
        kernels: &[BandPulse],
        duration_s: f64,
    ) -> Result<Vec<DiffractedEnergy>, Error> {
        let bands = materials[0].bands();
        let Some(diffracted) = &self.diffracted else {
            return Ok(vec![DiffractedEnergy::default(); bands.len()]);
        };
        let energies = diffracted.energies_under(&Conditions::new(materials, &self.air))?;
        let times_s: Vec<f64> =
            diffracted.lengths_m().iter().map(|l| f64::from(*l) / self.speed_m_s - self.direct_s).collect();
        let sums = |octave: usize, band: usize| {
            let bins = Bins::new(bands, band);
            let mut sums = vec![0.0; bins.count(duration_s)];
            for (&time_s, &e) in times_s.iter().zip(&energies[octave]) {
                Self::shares(time_s, bins, &kernels[band], sums.len(), |bin, share| {
                    sums[bin] += share * f64::from(e);
                });
            }
            (octave, sums)
        };
        let heard =
            |band: usize, octave: usize| octave == band || kernels[band].shares[octave] > super::MIN_LEAK;
        Ok((0..bands.len())
            .map(|band| DiffractedEnergy {
                columns: (0..bands.len()).filter(|&o| heard(band, o)).map(|o| sums(o, band)).collect(),
            })
            .collect())
    }
}
