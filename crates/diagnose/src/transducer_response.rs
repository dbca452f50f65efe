//! `transducer_response`: the frequency response of loudspeaker and microphone.

use crate::Error;
use crate::effect::{Effect, Parameter};
use sabine_acoustics::{EnergyResponse, OctaveBands};

/// The same gain in every time bin and at every position, one for each band.
///
/// Mark: a residual that is flat over time. Confounder: the power of the source, which is the mean over the bands.
#[derive(Clone, Copy, Debug, Default)]
pub struct TransducerResponse;

impl Effect for TransducerResponse {
    fn id(&self) -> &'static str {
        "transducer_response"
    }

    fn parameters(&self, bands: OctaveBands) -> Vec<Parameter> {
        bands
            .iter_hz()
            .map(|hz| Parameter {
                name: format!("gain_{hz}_hz"),
                unit: "dB",
                neutral: 0.0,
                prior_sd: 10.0,
                bounds: (-60.0, 60.0),
            })
            .collect()
    }

    fn apply(&self, values: &[f64], predicted: &EnergyResponse) -> Result<EnergyResponse, Error> {
        let scale = |energy: &dyn Fn(usize) -> Vec<f64>| {
            (0..predicted.bands().len())
                .flat_map(|band| {
                    let gain = 10f64.powf(values[band] / 10.0);
                    energy(band).into_iter().map(move |e| e * gain)
                })
                .collect()
        };
        let energy = scale(&|band| predicted.band(band).to_vec());
        let error = scale(&|band| predicted.band_standard_error(band).to_vec());
        Ok(EnergyResponse::new(predicted.bands(), predicted.bin_s(), energy, error)?)
    }
}
