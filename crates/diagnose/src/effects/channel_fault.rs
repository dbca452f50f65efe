//! `channel_fault`: one channel is wrong.

use crate::effect::EffectInfo;
use crate::effect::FittedCase;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, Effect, Nuisance, Observable, Parameter};
use crate::extend::model_change::ModelChange;
use crate::survey::Survey;
use sabine_acoustics::Levels;

/// One response has the wrong sign or another gain, or two responses were exchanged.
///
/// Mark: one response only; an exchange explains two at once, levels and times. Mimicked by: directivity (a gain).
#[derive(Clone, Copy, Debug, Default)]
pub struct ChannelFault;

/// Standard deviation of the gain of a channel that is wrong, in dB.
const OPEN_SD_DB: f64 = 10.0;

impl Effect for ChannelFault {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "channel_fault",
            "Fault of one channel",
            "One microphone channel has the wrong polarity or gain, or two channels were exchanged.",
        )
        .decided_by(8, NextMeasurement::ExchangedChannel)
    }

    fn cases(&self, survey: &Survey) -> Vec<Box<dyn Case>> {
        let responses = survey.responses();
        let mut cases: Vec<Box<dyn Case>> = Vec::new();
        for (i, response) in responses.iter().enumerate() {
            let name = &response.name;
            if responses.len() > 2 {
                cases.push(Box::new(Polarity { response: i, name: name.clone() }));
            }
            if responses.len() > 1 && survey.measurement().levels != Levels::PerResponse {
                cases.push(Box::new(Gain { response: i, name: name.clone() }));
            }
            for (j, other) in responses.iter().enumerate().skip(i + 1) {
                let name = format!("{name} and {}", other.name);
                cases.push(Box::new(Exchange { responses: (i, j), name }));
            }
        }
        cases
    }
}

struct Polarity {
    response: usize,
    name: String,
}

impl Case for Polarity {
    fn subject(&self) -> Option<String> {
        Some(format!("polarity of {}", self.name))
    }

    fn observable(&self) -> Observable {
        Observable::Channels
    }

    fn parameters(&self, _: &Survey) -> Vec<Parameter> {
        Vec::new()
    }

    fn inverted(&self) -> Option<usize> {
        Some(self.response)
    }

    fn model_changes(&self, _: &FittedCase<'_>) -> Vec<ModelChange> {
        vec![ModelChange::Inverted(self.name.clone())]
    }
}

struct Gain {
    response: usize,
    name: String,
}

impl Case for Gain {
    fn subject(&self) -> Option<String> {
        Some(format!("gain of {}", self.name))
    }

    fn parameters(&self, _: &Survey) -> Vec<Parameter> {
        Vec::new()
    }

    fn relaxes(&self) -> Vec<(Nuisance, f64)> {
        vec![(Nuisance::ResponseGain(self.response), OPEN_SD_DB)]
    }

    fn model_changes(&self, fitted: &FittedCase<'_>) -> Vec<ModelChange> {
        let gain_db = fitted.relaxed(Nuisance::ResponseGain(self.response)).and_then(|g| g.first().copied());
        let response = self.name.clone();
        gain_db.map(|gain_db| ModelChange::ResponseGain { response, gain_db }).into_iter().collect()
    }
}

struct Exchange {
    responses: (usize, usize),
    name: String,
}

impl Case for Exchange {
    fn subject(&self) -> Option<String> {
        Some(format!("{} exchanged", self.name))
    }

    fn observable(&self) -> Observable {
        Observable::Channels
    }

    fn parameters(&self, _: &Survey) -> Vec<Parameter> {
        Vec::new()
    }

    fn exchanged(&self) -> Option<(usize, usize)> {
        Some(self.responses)
    }

    fn model_changes(&self, fitted: &FittedCase<'_>) -> Vec<ModelChange> {
        let (a, b) = self.responses;
        let name = |r: usize| fitted.survey().responses()[r].name.clone();
        vec![ModelChange::Exchanged([name(a), name(b)])]
    }
}
