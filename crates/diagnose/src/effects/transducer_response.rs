//! `transducer_response`: loudspeaker and microphone do not treat all octaves alike.

use crate::effect::EffectInfo;
use crate::effect::{Case, DecayTerm, Effect, Parameter, Stage};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use sabine_scene::Levels;

/// One gain for each octave, the same in every time bin and at every position. Where levels mean something absolute there is one
/// for every octave; else they are relative to the octave of 1 kHz, whose gain is the common one that every fit leaves open.
///
/// Mark: residuals in dB that are flat over time, alike everywhere. Mimicked by: the level of the source, which is the same in
/// all octaves, and by nothing else: absorption changes decays too.
///
/// Source: ISO 3382-1:2009, 4.2.1 allows a source +-3 to +-6 dB over direction alone; few loudspeakers are flat to 3 dB.
#[derive(Clone, Copy, Debug, Default)]
pub struct TransducerResponse;

/// Standard deviation of a gain, and of its difference to that of another octave, in dB.
const GAIN_SD_DB: f64 = 5.0;
const RELATIVE_SD_DB: f64 = GAIN_SD_DB * std::f64::consts::SQRT_2;
/// What a small loudspeaker loses with each octave away from the middle.
const TYPICAL_DB_PER_OCTAVE: f64 = 1.5;

impl TransducerResponse {
    /// The octave that gains refer to, where only differences mean something.
    fn reference(survey: &Survey) -> Option<usize> {
        if survey.measurement().levels == Levels::Absolute {
            return None;
        }
        let off = |b: &usize| survey.octaves_from_1khz(*b).abs();
        (0..survey.bands().len()).min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// Gain of every octave in dB, that of the reference included.
    fn gains_db(values: &[f64], survey: &Survey) -> Vec<f64> {
        let mut gains = values.to_vec();
        if let Some(reference) = Self::reference(survey) {
            gains.insert(reference, 0.0);
        }
        gains
    }
}

impl Effect for TransducerResponse {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "transducer_response",
            "Loudspeaker or microphone not flat",
            "The loudspeaker or the microphone has more gain in some octaves than in others, the same in every response. Gains are relative to 1 kHz unless levels are absolute.",
        )
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let reference = Self::reference(survey);
        let sd_db = if reference.is_some() { RELATIVE_SD_DB } else { GAIN_SD_DB };
        let parameters = (0..survey.bands().len())
            .filter(|b| Some(*b) != reference)
            .map(|b| {
                let rolled_off = -TYPICAL_DB_PER_OCTAVE * survey.octaves_from_1khz(b).abs();
                Parameter::new("gain", "dB", 0.0, sd_db, (-60.0, 60.0))
                    .typically(rolled_off)
                    .in_band(b, survey)
            })
            .collect();
        vec![Case::decay(parameters, *self).at(Stage::Transducer).changing(|fitted| {
            vec![ModelChange::BandGains(Self::gains_db(fitted.values(), fitted.survey()))]
        })]
    }
}

impl DecayTerm for TransducerResponse {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let band = view.band();
        let gain_db = match Self::reference(view.survey()) {
            Some(reference) if band == reference => return,
            Some(reference) if band > reference => values[band - 1],
            _ => values[band],
        };
        let gain = gain_db * std::f64::consts::LN_10 / 10.0;
        ln_energy.iter_mut().for_each(|l| *l += gain);
    }
}
