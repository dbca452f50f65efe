//! `channel_fault`: one channel is wrong.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, ChannelChange, Effect, Nuisance};
use crate::extend::model_change::ModelChange;
use crate::survey::Survey;
use sabine_scene::Levels;

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

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let responses = survey.responses();
        let mut cases: Vec<Case> = Vec::new();
        for (i, response) in responses.iter().enumerate() {
            if responses.len() > 2 {
                cases.push(polarity(i, &response.name));
            }
            if responses.len() > 1 && survey.measurement().levels != Levels::PerResponse {
                cases.push(gain(i, &response.name));
            }
            for (j, other) in responses.iter().enumerate().skip(i + 1) {
                cases.push(exchange((i, j), [&response.name, &other.name]));
            }
        }
        cases
    }
}

fn polarity(response: usize, name: &str) -> Case {
    let inverted = ModelChange::Inverted(name.to_owned());
    Case::channels(ChannelChange::Inverted(response))
        .about(format!("polarity of {name}"))
        .changing(move |_| vec![inverted.clone()])
}

fn gain(response: usize, name: &str) -> Case {
    let (nuisance, name) = (Nuisance::ResponseGain(response), name.to_owned());
    Case::prior(nuisance, OPEN_SD_DB).about(format!("gain of {name}")).changing(move |fitted| {
        let gain_db = fitted.relaxed(nuisance).and_then(|g| g.first().copied());
        let change = |gain_db| ModelChange::ResponseGain { response: name.clone(), gain_db };
        gain_db.map(change).into_iter().collect()
    })
}

fn exchange((a, b): (usize, usize), names: [&str; 2]) -> Case {
    let exchanged = ModelChange::Exchanged(names.map(str::to_owned));
    Case::channels(ChannelChange::Exchanged(a, b))
        .about(format!("{} and {} exchanged", names[0], names[1]))
        .changing(move |_| vec![exchanged.clone()])
}
