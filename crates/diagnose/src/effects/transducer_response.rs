//! `transducer_response`: loudspeaker and microphone do not treat all octaves alike.

use crate::{BandView, Case, Effect, Parameter, Stage, Survey};

/// One gain for each octave, the same in every time bin and at every position.
///
/// Mark: residuals in dB that are flat over time, alike everywhere. Mimicked by: the level of the source, which is the mean
/// over the octaves, and by nothing else: absorption changes decays too. The file's common gain is fitted beside it.
///
/// Source: ISO 3382-1:2009, 4.2.1 allows a source +-3 to +-6 dB over direction alone; few loudspeakers are flat to 3 dB.
#[derive(Clone, Copy, Debug, Default)]
pub struct TransducerResponse;

impl Effect for TransducerResponse {
    fn id(&self) -> &'static str {
        "transducer_response"
    }

    fn explanation(&self) -> &'static str {
        "The loudspeaker or the microphone favours some octaves over others, alike in every response."
    }

    fn cases(&self, _: &Survey) -> Vec<Box<dyn Case>> {
        vec![Box::new(*self)]
    }
}

impl Case for TransducerResponse {
    fn stage(&self) -> Stage {
        Stage::Transducer
    }

    fn parameters(&self, survey: &Survey) -> Vec<Parameter> {
        (0..survey.bands().len())
            .map(|b| Parameter::new("gain", "dB", 0.0, 5.0, (-60.0, 60.0)).in_band(b, survey))
            .collect()
    }

    fn energy(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let gain = values[view.band()] * std::f64::consts::LN_10 / 10.0;
        ln_energy.iter_mut().for_each(|l| *l += gain);
    }
}
