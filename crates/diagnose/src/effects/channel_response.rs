//! `channel_response`: each microphone channel has a frequency response of its own.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, FittedCase, Parameter, Stage};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use std::f64::consts::{LN_10, PI};

/// A smooth gain over the octaves for each response, the same in every time bin: a cosine series over the bands without its constant, the
/// k-th term cos(pi k (b + 1/2) / n) in band b of n with a prior that falls as 1 / sqrt(k). The constant is the gain of the response, which every
/// fit leaves open; what all responses share is `transducer_response`.
///
/// Mark: residuals in dB that are flat over time and differ from response to response, each smooth over the octaves. Mimicked by: the
/// gain of a channel (`channel_fault`), which is the same in all octaves; a directional source or microphone, whose late sound does not
/// change. A channel exchanged with its neighbour's tells: its response goes with it.
///
/// One case for all channels together, and one for each channel alone: a single microphone that differs need not pay for the parameters of
/// the others.
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
        let count = survey.responses().len();
        let mut cases = vec![case((0..count).collect(), survey)];
        // Of two, what one has the other lacks.
        if count > 2 {
            let alone = |r: usize| case(vec![r], survey).about(survey.responses()[r].name.clone());
            cases.extend((0..count).map(alone));
        }
        cases
    }
}

/// Some channels with a response of their own.
fn case(channels: Vec<usize>, survey: &Survey) -> Case {
    let one = |response: &usize| {
        let response = *response;
        (1..=terms(survey)).map(move |k| {
            let (name, sd_db) = (format!("cosine_{k}"), FIRST_SD_DB / (k as f64).sqrt());
            Parameter::new(name, "dB", 0.0, sd_db, (-LARGEST_DB, LARGEST_DB))
                .typically(sd_db)
                .of_response(response, survey)
        })
    };
    let parameters = channels.iter().flat_map(one).collect();
    let own = OwnResponses { channels };
    Case::decay(parameters, own.clone())
        .at(Stage::Transducer)
        .changing(move |fitted| changes(&own.channels, fitted))
}

fn terms(survey: &Survey) -> usize {
    (survey.bands().len() - 1).min(MAX_TERMS)
}

/// Gain in a band of a channel with these terms, in dB.
fn gain_db(own: &[f64], bands: usize, band: usize) -> f64 {
    let place = PI * (band as f64 + 0.5) / bands as f64;
    own.iter().zip(1..).map(|(c, k)| c * (f64::from(k) * place).cos()).sum()
}

fn changes(channels: &[usize], fitted: &FittedCase<'_>) -> Vec<ModelChange> {
    let (survey, bands) = (fitted.survey(), fitted.survey().bands().len());
    let own = fitted.values().chunks(terms(survey));
    let one = |(r, own): (&usize, &[f64])| ModelChange::ResponseBandGains {
        response: survey.responses()[*r].name.clone(),
        // What the terms leave to the level of this response in the octave is its channel's, too.
        gain_db: fitted.per_band(|b| gain_db(own, bands, b) + fitted.level_db(*r, b)),
    };
    channels.iter().zip(own).map(one).collect()
}

/// The channels that a case is about, in the order of its parameters.
#[derive(Clone, Debug)]
struct OwnResponses {
    channels: Vec<usize>,
}

impl DecayTerm for OwnResponses {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let Some(place) = self.channels.iter().position(|c| *c == view.response()) else { return };
        let (count, bands) = (terms(view.survey()), view.survey().bands().len());
        let own = &values[place * count..(place + 1) * count];
        let gain = gain_db(own, bands, view.band()) * LN_10 / 10.0;
        ln_energy.iter_mut().for_each(|l| *l += gain);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn gains_of_a_response_have_no_constant_and_fall_in_the_first_term() {
        let gains: Vec<f64> = (0..7).map(|b| gain_db(&[2.0], 7, b)).collect();
        assert!(gains.iter().sum::<f64>().abs() < 1e-12 && gains[0] > 1.0);
        assert!(gains.windows(2).all(|w| w[1] < w[0]));
    }

    #[test]
    fn one_case_for_all_channels_and_one_for_each() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let cases = ChannelResponse.cases(&survey);
        let subjects: Vec<Option<&str>> = cases.iter().map(|c| c.subject.as_deref()).collect();
        assert_eq!(subjects, [None, Some("s0-r0"), Some("s0-r1"), Some("s0-r2")]);
        assert_eq!(cases[0].parameters.len(), 3 * cases[1].parameters.len());
    }
}
