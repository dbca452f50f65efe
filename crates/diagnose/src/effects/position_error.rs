//! `position_error`: a source or receiver stood elsewhere.

use crate::effect::{Case, Effect, Nuisance, Observable, Parameter};
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
    fn id(&self) -> &'static str {
        "position_error"
    }

    fn explanation(&self) -> &'static str {
        "A loudspeaker or microphone stood elsewhere than the room file says."
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
}
