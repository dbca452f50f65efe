//! Residuals of band energy over time, each with the spread that chance alone would give it.

use crate::Error;
use sabine_acoustics::EnergyResponse;

/// One time bin of one band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Band index.
    pub band: usize,
    /// Time bin.
    pub bin: usize,
    /// Measured level less predicted level, in dB.
    pub level_db: f64,
    /// Standard deviation of that difference if the prediction were right, in dB.
    pub expected_sd_db: f64,
}

/// Measured against predicted energy at one source-receiver pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Misfit {
    residuals: Vec<Residual>,
}

impl Misfit {
    /// Compares all bins in which both energies lie within `range_db` of the band's strongest predicted bin.
    ///
    /// The spread of a bin has two parts. A band of width B has about 2 B dt degrees of freedom in a bin of width dt, so
    /// that its energy scatters by sqrt(1 / (B dt)) about its mean (Kuttruff, Room Acoustics, 6th ed., section 3.5); to that
    /// the prediction adds its own Monte-Carlo error. Bins shorter than 1 / B count as one degree of freedom pair.
    ///
    /// # Errors
    /// [`Error::Layout`] if bands or bin widths differ, [`Error::NothingToCompare`] if no bin qualifies.
    pub fn between(
        measured: &EnergyResponse,
        predicted: &EnergyResponse,
        range_db: f64,
    ) -> Result<Self, Error> {
        if measured.bands() != predicted.bands() {
            return Err(Error::Layout { what: "bands" });
        }
        if (measured.bin_s() / predicted.bin_s() - 1.0).abs() > 1e-9 {
            return Err(Error::Layout { what: "bin width" });
        }
        let bands = measured.bands();
        let mut residuals = Vec::new();
        for band in 0..bands.len() {
            let (low_hz, high_hz) = bands.edges_hz(band);
            let chance = 1.0 / ((high_hz - low_hz) * measured.bin_s()).max(1.0);
            let strongest = predicted.band(band).iter().copied().fold(0.0, f64::max);
            let floor = strongest * 10f64.powf(-range_db / 10.0);
            let errors = predicted.band_standard_error(band);
            for (bin, (&m, &p)) in measured.band(band).iter().zip(predicted.band(band)).enumerate() {
                if m > 0.0 && p > floor && floor > 0.0 {
                    let monte_carlo = errors[bin] / p;
                    residuals.push(Residual {
                        band,
                        bin,
                        level_db: 10.0 * (m / p).log10(),
                        expected_sd_db: 10.0 / std::f64::consts::LN_10
                            * (chance + monte_carlo * monte_carlo).sqrt(),
                    });
                }
            }
        }
        if residuals.is_empty() { Err(Error::NothingToCompare { range_db }) } else { Ok(Self { residuals }) }
    }

    /// The residuals, band after band.
    pub fn residuals(&self) -> &[Residual] {
        &self.residuals
    }

    /// Root mean square of the residuals in dB.
    pub fn rmse_db(&self) -> f64 {
        let sum: f64 = self.residuals.iter().map(|r| r.level_db * r.level_db).sum();
        (sum / self.residuals.len() as f64).sqrt()
    }

    /// Mean square of the residuals in units of their expected spread: about 1 where only chance is at work.
    pub fn reduced_chi_squared(&self) -> f64 {
        let sum: f64 = self.residuals.iter().map(|r| (r.level_db / r.expected_sd_db).powi(2)).sum();
        sum / self.residuals.len() as f64
    }
}
