//! Bands by their nominal centres.

use crate::failure::Failure;
use sabine::acoustics::Bands;

/// Octaves or third octaves, by their nominal centres in Hz.
///
/// # Errors
/// As [`Bands::from_centres_hz`], under the name of the argument.
pub fn bands(centres_hz: &[f64]) -> Result<Bands, Failure> {
    Bands::from_centres_hz(centres_hz).map_err(|error| crate::failure::refused(format!("bands_hz: {error}")))
}

/// Nominal centres, in Hz.
pub fn centres_hz(bands: Bands) -> Vec<f64> {
    bands.iter_hz().collect()
}
