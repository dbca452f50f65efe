//! Energy over time: what a geometric simulation gives before it becomes pressure.

use crate::bands::Bands;
use crate::error::Error;
use crate::estimate::NoReading;

/// Energy per time bin and band. **Not** a pressure response: it must not be convolved with sound.
///
/// Scaled so that the direct sound of an omnidirectional source at 1 m carries energy 1 in every band.
/// `sabine_paths::PathSet::energy_response` makes one; [`EnergyResponse::decay_curve`] reads it.
#[derive(Clone, Debug, PartialEq)]
pub struct EnergyResponse {
    bands: Bands,
    bin_s: f64,
    bins: usize,
    energy: Vec<f64>,
    standard_error: Vec<f64>,
}

impl EnergyResponse {
    /// Takes energies and their Monte-Carlo standard errors, band after band (`band * bins + bin`).
    ///
    /// # Errors
    /// [`Error::BandCount`] if a length is not a multiple of the number of bands or the two differ,
    /// [`Error::OutOfRange`] for a bin width that is not positive.
    pub fn new(bands: Bands, bin_s: f64, energy: Vec<f64>, standard_error: Vec<f64>) -> Result<Self, Error> {
        crate::out_of_range::OutOfRange::check("bin width (s)", bin_s, 1e-6, 10.0, "between 1 us and 10 s")?;
        let bins = energy.len() / bands.len();
        if bins * bands.len() != energy.len() {
            return Err(Error::BandCount { expected: bins * bands.len(), found: energy.len() });
        }
        if standard_error.len() != energy.len() {
            return Err(Error::BandCount { expected: energy.len(), found: standard_error.len() });
        }
        Ok(Self { bands, bin_s, bins, energy, standard_error })
    }

    /// The bands.
    pub fn bands(&self) -> Bands {
        self.bands
    }

    /// Width of a time bin in seconds; bin 0 starts at the instant of emission.
    pub fn bin_s(&self) -> f64 {
        self.bin_s
    }

    /// Number of time bins.
    pub fn bins(&self) -> usize {
        self.bins
    }

    /// Energy of each time bin of a band.
    ///
    /// # Panics
    /// If there is no such band.
    pub fn band(&self, band: usize) -> &[f64] {
        &self.energy[band * self.bins..(band + 1) * self.bins]
    }

    /// Monte-Carlo standard error of each time bin of a band.
    ///
    /// # Panics
    /// If there is no such band.
    pub fn band_standard_error(&self, band: usize) -> &[f64] {
        &self.standard_error[band * self.bins..(band + 1) * self.bins]
    }

    /// Backward-integrated energy of a band.
    ///
    /// # Panics
    /// If there is no such band.
    pub fn decay_curve(&self, band: usize) -> EnergyDecayCurve {
        EnergyDecayCurve::from_energy(self.band(band), self.bin_s)
    }
}

/// The energy still to come after each instant (Schroeder 1965; ISO 3382-1, 5.3.3): never rising.
///
/// ```
/// use sabine_acoustics::EnergyDecayCurve;
/// // A decay of 60 dB in 0.8 s, in steps of 1 ms.
/// let energy: Vec<f64> = (0..2000).map(|i| 10f64.powf(-6.0 * i as f64 * 1e-3 / 0.8)).collect();
/// let curve = EnergyDecayCurve::from_energy(&energy, 1e-3);
/// let t30_s = curve.decay_time_s(-5.0, -35.0).unwrap();
/// assert!((t30_s - 0.8).abs() < 1e-3);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct EnergyDecayCurve {
    remaining: Vec<f64>,
    step_s: f64,
}

impl EnergyDecayCurve {
    /// Sums energies (of bins `step_s` wide) from the end to the beginning.
    pub fn from_energy(energy: &[f64], step_s: f64) -> Self {
        let mut remaining = energy.to_vec();
        let mut sum = 0.0;
        for value in remaining.iter_mut().rev() {
            sum += *value;
            *value = sum;
        }
        Self { remaining, step_s }
    }

    /// Sums energies from the end to the beginning, less the noise that each of them holds, starting from the energy that is
    /// still to come after the last of them (subtraction and correction of ISO 3382-1, 5.3.3, and Guski 2015).
    ///
    /// Where noise outweighs what is left, the curve stays level: it never rises.
    pub fn without_noise(energy: &[f64], step_s: f64, noise: f64, tail: f64) -> Self {
        let mut remaining = energy.to_vec();
        let (mut sum, mut most) = (tail, tail.max(0.0));
        for value in remaining.iter_mut().rev() {
            sum += *value - noise;
            most = most.max(sum);
            *value = most;
        }
        Self { remaining, step_s }
    }

    /// Energy from the start of each step to the end.
    pub fn remaining(&self) -> &[f64] {
        &self.remaining
    }

    /// Width of a step in seconds.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Level relative to the total energy at the start of each step, in dB; minus infinity where nothing is left.
    pub fn level_db(&self) -> Vec<f64> {
        let total = self.remaining.first().copied().unwrap_or(0.0);
        self.remaining.iter().map(|&e| 10.0 * (e / total).log10()).collect()
    }

    /// Time that 60 dB of decay take, from the least-squares line through the curve between two levels
    /// (ISO 3382-1, 5.3.3: -5 and -25 dB for T20, -5 and -35 dB for T30, 0 and -10 dB for EDT).
    ///
    /// # Errors
    /// [`NoReading::DynamicRange`] where the curve ends above `end_db`, [`NoReading::NoDecay`] where it does not fall or
    /// holds fewer than three points between the levels.
    pub fn decay_time_s(&self, start_db: f64, end_db: f64) -> Result<f64, NoReading> {
        let total = self.remaining.first().copied().unwrap_or(0.0);
        if total <= 0.0 {
            return Err(NoReading::NoOnset);
        }
        let last = self.remaining.iter().rev().find(|&&e| e > 0.0).copied().unwrap_or(total);
        let available_db = -10.0 * (last / total).log10();
        if available_db < -end_db {
            return Err(NoReading::DynamicRange { needed_db: -end_db, available_db });
        }
        let (mut n, mut sum_t, mut sum_y, mut sum_tt, mut sum_ty) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (i, &energy) in self.remaining.iter().enumerate() {
            let level_db = 10.0 * (energy / total).log10();
            if level_db > start_db {
                continue;
            }
            if level_db < end_db {
                break;
            }
            let t = i as f64 * self.step_s;
            n += 1.0;
            sum_t += t;
            sum_y += level_db;
            sum_tt += t * t;
            sum_ty += t * level_db;
        }
        let slope = (n * sum_ty - sum_t * sum_y) / (n * sum_tt - sum_t * sum_t);
        if n < 3.0 || slope.is_nan() || slope >= 0.0 {
            return Err(NoReading::NoDecay);
        }
        Ok(-60.0 / slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_that_ends_early_says_so() {
        let energy: Vec<f64> = (0..100).map(|i| 10f64.powf(-6.0 * i as f64 * 1e-3 / 1.0)).collect();
        let curve = EnergyDecayCurve::from_energy(&energy[..20], 1e-3);
        assert!(matches!(curve.decay_time_s(-5.0, -35.0), Err(NoReading::DynamicRange { .. })));
        assert_eq!(
            EnergyDecayCurve::from_energy(&[0.0; 9], 1e-3).decay_time_s(-5.0, -35.0),
            Err(NoReading::NoOnset)
        );
        assert_eq!(
            EnergyDecayCurve::from_energy(&[], 1e-3).decay_time_s(-5.0, -35.0),
            Err(NoReading::NoOnset)
        );
    }
}
