//! `position_error`: a source or receiver stood elsewhere.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, Effect, Nuisance};
use crate::extend::model_change::ModelChange;
use crate::survey::{Place, Survey};

/// One place is not where the room file says: the prior of its position is opened along all axes.
///
/// Mark: the arrivals of that source or receiver shift with their direction. Mimicked by: the room's dimensions, which move
/// reflections at all places.
#[derive(Clone, Copy, Debug, Default)]
pub struct PositionError;

/// Standard deviation of a position that is not believed, in metres, at least.
const OPEN_SD_M: f64 = 0.3;
/// The same in standard deviations of a position that is believed: what lies within what the room file admits is no error.
const OPEN_RATIO: f64 = 5.0;

impl Effect for PositionError {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "position_error",
            "Wrong source or receiver position",
            "A loudspeaker or microphone was not at the position that the room file states.",
        )
        .decided_by(5, NextMeasurement::Distances)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let sources = survey.sources().iter().enumerate().map(|(i, p)| (Nuisance::SourcePosition(i), p));
        let receivers =
            survey.receivers().iter().enumerate().map(|(i, p)| (Nuisance::ReceiverPosition(i), p));
        sources.chain(receivers).map(|(nuisance, place)| one_place(nuisance, place.clone())).collect()
    }
}

fn one_place(nuisance: Nuisance, stated: Place) -> Case {
    let open_sd_m = OPEN_SD_M.max(OPEN_RATIO * stated.position_sd_m);
    Case::prior(nuisance, open_sd_m).about(stated.id.clone()).changing(move |fitted| {
        let Some(offset_m) = fitted.relaxed(nuisance) else { return Vec::new() };
        let position_m = std::array::from_fn(|k| stated.position_m[k] + offset_m[k]);
        vec![ModelChange::Position { id: stated.id.clone(), position_m }]
    })
}
