//! `background_noise`: sound that was there without the source.

use crate::Error;
use crate::effect::{Effect, Parameter};
use sabine_acoustics::{EnergyResponse, OctaveBands};

/// The same energy in every time bin, one level for each band, relative to the band's strongest predicted bin.
///
/// Mark: the decay flattens at a level that excitation does not change. Confounder: a coupled volume.
#[derive(Clone, Copy, Debug, Default)]
pub struct BackgroundNoise;

impl Effect for BackgroundNoise {
    fn id(&self) -> &'static str {
        "background_noise"
    }

    fn parameters(&self, bands: OctaveBands) -> Vec<Parameter> {
        bands
            .iter_hz()
            .map(|hz| Parameter {
                name: format!("level_{hz}_hz"),
                unit: "dB re strongest bin",
                // Far below what is compared: absent.
                neutral: -60.0,
                prior_sd: 20.0,
                bounds: (-90.0, 0.0),
            })
            .collect()
    }

    fn apply(&self, values: &[f64], predicted: &EnergyResponse) -> Result<EnergyResponse, Error> {
        let mut energy = Vec::with_capacity(predicted.bands().len() * predicted.bins());
        let mut error = Vec::with_capacity(energy.capacity());
        for (band, level_db) in values.iter().enumerate() {
            let strongest = predicted.band(band).iter().copied().fold(0.0, f64::max);
            let noise = strongest * 10f64.powf(level_db / 10.0);
            energy.extend(predicted.band(band).iter().map(|e| e + noise));
            error.extend_from_slice(predicted.band_standard_error(band));
        }
        Ok(EnergyResponse::new(predicted.bands(), predicted.bin_s(), energy, error)?)
    }
}
