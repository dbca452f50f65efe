//! How sources radiate and microphones hear in different directions.

use crate::bands::{bands, centres_hz};
use crate::failure::{Failure, refused};
use numpy::PyArray2;
use pyo3::prelude::*;
use sabine::acoustics::{Bands, Directivity as Pattern, Orientation, PerBand};

/// Energy gain over direction and band.
#[pyclass(frozen)]
pub struct Directivity(Pattern);

#[pymethods]
impl Directivity {
    /// One of the patterns of first order that have a name.
    #[staticmethod]
    fn named(name: &str) -> Result<Self, Failure> {
        let omni_share = match name {
            "omni" => Pattern::OMNIDIRECTIONAL,
            "subcardioid" => Pattern::SUBCARDIOID,
            "cardioid" => Pattern::CARDIOID,
            "supercardioid" => Pattern::SUPERCARDIOID,
            "hypercardioid" => Pattern::HYPERCARDIOID,
            "figure_of_eight" => Pattern::FIGURE_OF_EIGHT,
            other => {
                return Err(refused(format!(
                    "name: {other:?} is none of omni, subcardioid, cardioid, supercardioid, hypercardioid, figure_of_eight"
                )));
            }
        };
        Ok(Self(Pattern::first_order(omni_share)?))
    }

    /// The same in all bands, or with a share for each.
    #[staticmethod]
    fn first_order(omni_share: Vec<f64>, bands_hz: Option<Vec<f64>>) -> Result<Self, Failure> {
        let pattern = match (bands_hz, omni_share.as_slice()) {
            (None, &[share]) => Pattern::first_order(share)?,
            (None, shares) => {
                return Err(refused(format!("omni_share: {} values, and no bands_hz", shares.len())));
            }
            (Some(hz), _) => Pattern::first_order_per_band(&PerBand::new(bands(&hz)?, omni_share)?)?,
        };
        Ok(Self(pattern))
    }

    /// Levels at angles to the axis, a list for each band.
    #[staticmethod]
    fn axisymmetric(
        angles_deg: Vec<f64>,
        levels_db: Vec<Vec<f64>>,
        bands_hz: Vec<f64>,
    ) -> Result<Self, Failure> {
        let levels_db = PerBand::new(bands(&bands_hz)?, levels_db)?;
        Ok(Self(Pattern::axisymmetric(&angles_deg, &levels_db)?))
    }

    /// Levels on a grid, for each band one after the other, elevation by elevation.
    #[staticmethod]
    fn table(
        azimuths: usize,
        elevations: usize,
        levels_db: Vec<Vec<f64>>,
        bands_hz: Vec<f64>,
    ) -> Result<Self, Failure> {
        let levels_db = PerBand::new(bands(&bands_hz)?, levels_db)?;
        Ok(Self(Pattern::table(azimuths, elevations, &levels_db)?))
    }

    /// None where the pattern is the same in all bands.
    #[getter]
    fn bands_hz(&self) -> Option<Vec<f64>> {
        self.0.bands().map(centres_hz)
    }

    /// Energy gains in unit directions (forward, left, up), a row for each direction.
    fn energy_gains<'py>(
        &self,
        py: Python<'py>,
        directions: Vec<[f64; 3]>,
    ) -> Result<Bound<'py, PyArray2<f64>>, Failure> {
        let gains = |direction: &[f64; 3]| {
            let mut gains = vec![0.0; self.columns()];
            self.0.energy_gains(*direction, &mut gains);
            gains
        };
        Ok(PyArray2::from_vec2(py, &directions.iter().map(gains).collect::<Vec<_>>())?)
    }

    /// Directivity index of each band; one where all have the same pattern.
    fn index_db(&self, py: Python<'_>) -> Vec<f64> {
        py.detach(|| (0..self.columns()).map(|band| self.0.index_db(band)).collect())
    }
}

impl Directivity {
    /// Bands, or one where the pattern is the same in all.
    fn columns(&self) -> usize {
        self.0.bands().map_or(1, |bands| bands.len())
    }
}

/// A pattern on the bands of a room, turned along an axis.
///
/// # Errors
/// The axis is zero or not finite.
pub fn turned(
    pattern: &Directivity,
    axis: [f64; 3],
    bands: Bands,
) -> Result<(Pattern, Orientation), sabine::acoustics::Error> {
    Ok((pattern.0.resampled(bands), Orientation::towards(axis)?))
}
