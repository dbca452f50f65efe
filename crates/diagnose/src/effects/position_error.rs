//! `position_error`: a source or receiver stood elsewhere.

use crate::effect::EffectInfo;
use crate::effect::FittedCase;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, Effect, Nuisance, Observable, Parameter};
use crate::extend::model_change::ModelChange;
use crate::survey::Survey;

/// One place is not where the room file says: the prior of its position is opened along all axes.
///
/// Mark: the arrivals of that source or receiver shift with their direction. Mimicked by: the room's dimensions, which move
/// reflections at all places.
#[derive(Clone, Copy, Debug, Default)]
pub struct PositionError;

/// Standard deviation of a position that is not believed, in metres.
const OPEN_SD_M: f64 = 0.3;

impl Effect for PositionError {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "position_error",
            "Wrong source or receiver position",
            "A loudspeaker or microphone was not at the position that the room file states.",
        )
        .decided_by(5, NextMeasurement::Distances)
    }

    fn cases(&self, survey: &Survey) -> Vec<Box<dyn Case>> {
        let sources = survey.sources().iter().enumerate().map(|(i, p)| (Nuisance::SourcePosition(i), &p.id));
        let receivers =
            survey.receivers().iter().enumerate().map(|(i, p)| (Nuisance::ReceiverPosition(i), &p.id));
        sources
            .chain(receivers)
            .map(|(place, id)| -> Box<dyn Case> { Box::new(OnePlace { place, id: id.clone() }) })
            .collect()
    }
}

struct OnePlace {
    place: Nuisance,
    id: String,
}

impl Case for OnePlace {
    fn subject(&self) -> Option<String> {
        Some(self.id.clone())
    }

    fn observable(&self) -> Observable {
        Observable::Arrivals
    }

    fn parameters(&self, _: &Survey) -> Vec<Parameter> {
        Vec::new()
    }

    fn relaxes(&self) -> Vec<(Nuisance, f64)> {
        vec![(self.place, OPEN_SD_M)]
    }

    fn model_changes(&self, fitted: &FittedCase<'_>) -> Vec<ModelChange> {
        let survey = fitted.survey();
        let stated = match self.place {
            Nuisance::SourcePosition(i) => &survey.sources()[i],
            Nuisance::ReceiverPosition(i) => &survey.receivers()[i],
            Nuisance::Absorption(_) | Nuisance::ResponseGain(_) => return Vec::new(),
        };
        let Some(offset_m) = fitted.relaxed(self.place) else { return Vec::new() };
        let position_m = std::array::from_fn(|k| stated.position_m[k] + offset_m[k]);
        vec![ModelChange::Position { id: stated.id.clone(), position_m }]
    }
}
