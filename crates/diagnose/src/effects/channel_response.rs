//! `channel_response`: each microphone channel has a frequency response of its own.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, FittedCase, Parameter, Stage};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::survey::{Survey, SurveyedResponse};
use std::f64::consts::{LN_10, PI};

/// A smooth gain over the octaves for each response, the same in every time bin: a cosine series over the bands without its constant, the
/// k-th term cos(pi k (b + 1/2) / n) in band b of n with a prior that falls as 1 / k. The constant is the gain of the response, which every
/// fit leaves open; what all responses share is `transducer_response`.
///
/// Mark: residuals in dB that are flat over time and differ from response to response, each smooth over the octaves. Mimicked by: the
/// gain of a channel (`channel_fault`), which is the same in all octaves; a directional source or microphone, whose late sound does not
/// change. A channel exchanged with its neighbour's tells: its response goes with it.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChannelResponse;

/// Terms of the series: all that octaves have; of thirds, what is smooth.
const MAX_TERMS: usize = 6;
/// Standard deviation of the first term, in dB.
const FIRST_SD_DB: f64 = 3.0;
const LARGEST_DB: f64 = 40.0;

impl Effect for ChannelResponse {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "channel_response",
            "Microphone channels with different frequency responses",
            "Each microphone channel has a frequency response of its own: microphones of different models, or channels that are not calibrated.",
        )
        .decided_by(16, NextMeasurement::ExchangedChannel)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        // What a single response has is the loudspeaker's as well.
        if survey.responses().len() < 2 || terms(survey) == 0 {
            return Vec::new();
        }
        let one = |response: usize| {
            (1..=terms(survey)).map(move |k| {
                let (name, sd_db) = (format!("cosine_{k}"), FIRST_SD_DB / k as f64);
                Parameter::new(name, "dB", 0.0, sd_db, (-LARGEST_DB, LARGEST_DB))
                    .typically(sd_db)
                    .of_response(response, survey)
            })
        };
        let parameters = (0..survey.responses().len()).flat_map(one).collect();
        vec![Case::decay(parameters, *self).at(Stage::Transducer).changing(changes)]
    }
}

fn terms(survey: &Survey) -> usize {
    (survey.bands().len() - 1).min(MAX_TERMS)
}

/// Gain of a response in a band, in dB.
fn gain_db(values: &[f64], survey: &Survey, response: usize, band: usize) -> f64 {
    let count = terms(survey);
    let place = PI * (band as f64 + 0.5) / survey.bands().len() as f64;
    let own = &values[response * count..(response + 1) * count];
    own.iter().zip(1..).map(|(c, k)| c * (f64::from(k) * place).cos()).sum()
}

fn changes(fitted: &FittedCase<'_>) -> Vec<ModelChange> {
    let (values, survey) = (fitted.values(), fitted.survey());
    let one = |(r, response): (usize, &SurveyedResponse)| ModelChange::ResponseBandGains {
        response: response.name.clone(),
        gain_db: fitted.per_band(|b| gain_db(values, survey, r, b)),
    };
    survey.responses().iter().enumerate().map(one).collect()
}

impl DecayTerm for ChannelResponse {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let gain = gain_db(values, view.survey(), view.response(), view.band()) * LN_10 / 10.0;
        ln_energy.iter_mut().for_each(|l| *l += gain);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn gains_of_a_response_have_no_constant_and_are_its_own() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let (bands, count) = (survey.bands().len(), terms(&survey));
        let mut values = vec![0.0; 3 * count];
        values[count] = 2.0;
        let gains: Vec<f64> = (0..bands).map(|b| gain_db(&values, &survey, 1, b)).collect();
        assert!(gains.iter().sum::<f64>().abs() < 1e-12 && gains[0] > 1.0);
        assert!((0..bands).all(|b| gain_db(&values, &survey, 2, b) == 0.0));
    }
}
