//! Surfaces.

use crate::bands::Bands;
use crate::error::Error;
use crate::out_of_range::OutOfRange;
use crate::per_band::PerBand;

/// How a surface treats sound energy, per octave band.
/// ```
/// use sabine_acoustics::{Bands, Material, PerBand};
/// let bands = Bands::octaves(500.0, 2000.0)?;
/// let curtain = Material::new(PerBand::new(bands, vec![0.4, 0.6, 0.7])?, PerBand::uniform(bands, 0.2))?;
/// assert_eq!(curtain.absorption().at_hz(1000.0), Some(&0.6));
/// assert!(Material::uniform(bands, 1.2, 0.1).is_err()); // more than all energy
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    absorption: PerBand<f64>,
    scattering: PerBand<f64>,
}

impl Material {
    /// Random-incidence absorption (ISO 354) and scattering (ISO 17497-1), each the share of energy, 0 to 1.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] outside 0..=1 or NaN, [`Error::BandMismatch`] if the two belong to different bands.
    pub fn new(absorption: PerBand<f64>, scattering: PerBand<f64>) -> Result<Self, Error> {
        if absorption.bands() != scattering.bands() {
            return Err(Error::BandMismatch { left: absorption.bands(), right: scattering.bands() });
        }
        for &value in absorption.values() {
            OutOfRange::check("absorption", value, 0.0, 1.0, "between 0 and 1")?;
        }
        for &value in scattering.values() {
            OutOfRange::check("scattering", value, 0.0, 1.0, "between 0 and 1")?;
        }
        Ok(Self { absorption, scattering })
    }

    /// The same absorption and scattering in every band.
    ///
    /// # Errors
    /// As [`Material::new`].
    pub fn uniform(bands: Bands, absorption: f64, scattering: f64) -> Result<Self, Error> {
        Self::new(PerBand::uniform(bands, absorption), PerBand::uniform(bands, scattering))
    }

    /// Share of incident energy that does not come back.
    pub fn absorption(&self) -> &PerBand<f64> {
        &self.absorption
    }

    /// Share of reflected energy that leaves away from the specular direction.
    pub fn scattering(&self) -> &PerBand<f64> {
        &self.scattering
    }

    /// The bands.
    pub fn bands(&self) -> Bands {
        self.absorption.bands()
    }

    /// The same surface with other absorption.
    ///
    /// # Errors
    /// As [`Material::new`].
    pub fn with_absorption(&self, absorption: PerBand<f64>) -> Result<Self, Error> {
        Self::new(absorption, self.scattering.clone())
    }

    /// The same surface on another run of bands; a band takes the mean over those that lie in it, or else the nearest one's value.
    #[must_use]
    pub fn resampled(&self, bands: Bands) -> Self {
        Self { absorption: self.absorption.averaged(bands), scattering: self.scattering.averaged(bands) }
    }
}
