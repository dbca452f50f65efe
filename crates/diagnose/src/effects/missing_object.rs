//! `missing_object`: something box-shaped stands in the room, and the mesh does not have it.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{AuxiliaryEvidence, Case, EarlySoundTerm, Effect, FittedCase};
use crate::extend::model_change::ModelChange;
use crate::extend::standing_box::StandingBox;
use crate::found_parameter::FoundParameter;
use crate::likelihood::standing_boxes::EarlySound;
use crate::likelihood::standing_boxes::sampler::best;
use crate::survey::Survey;

/// A box with upright sides that stands on the floor, free or against a wall: a cupboard, a sofa, a rack. It stands in the way of the direct
/// sound and of reflections, early ones of any order, and its faces reflect, alone and before or after one surface of the mesh. Place, sizes,
/// angle and reflectance are summed over: places are equally probable wherever the floor is free, sides are those of furniture (median 1 m, a
/// factor of 1.65 up or down), four of five stand along a wall.
///
/// Mark: direct sounds or reflections of several surfaces are missing where their ways lead through one place, and peaks that nothing
/// predicted explains come from there. Mimicked by: a hole (`open_patch`), which takes away reflections of one wall alone; the absorption of a
/// wall (`surface_absorption`), which weakens all of its reflections; a flat surface (`extra_reflector`), which adds and takes nothing away; a
/// microphone that stands elsewhere (`position_error`), where the box hides its direct sound; directional receivers and sources, which weaken
/// what comes from, or leaves in, some directions at every place. Objects that hang, are round, or let sound through are none of its cases.
///
/// A box before a wall hides what a hole in it swallows, and is weighed on more of the early sound than the hole is: reflections of all orders,
/// levels of direct sounds, peaks. Decays speak for a hole and not for an object. So it yields to `open_patch`: where decays and single
/// reflections make a hole worth a name, the hole is named, and no object beside it. If the hole does not stand at positions left out, the search
/// goes on without it, and an object may be named.
///
/// Source: shadows: Z. Maekawa, Applied Acoustics 1, 1968; U. J. Kurze, G. S. Anderson, Applied Acoustics 4, 1971. Evidence: P. Del Moral,
/// A. Doucet, A. Jasra, J. R. Statist. Soc. B 68, 2006.
#[derive(Clone, Copy, Debug, Default)]
pub struct MissingObject;

/// Fewer responses cannot contradict a box: it has seven numbers.
const MIN_RESPONSES: usize = 5;
/// Mass of the 90 % interval to either side.
const TAIL: f64 = 0.05;
/// Names and units of what is found.
const NAMES: [(&str, &str); 8] = [
    ("centre_x", "m"),
    ("centre_y", "m"),
    ("floor_z", "m"),
    ("length", "m"),
    ("width", "m"),
    ("height", "m"),
    ("yaw", "deg"),
    ("absorption", ""),
];

impl Effect for MissingObject {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "missing_object",
            "An object that the model lacks",
            "Something like a box stands in the room and is missing from the model: a cupboard, a sofa, a rack.",
        )
        .decided_by(12, NextMeasurement::ObjectsRemoved)
        .yielding_to(&["open_patch"])
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        if survey.responses().len() < MIN_RESPONSES {
            return Vec::new();
        }
        let changes = |fitted: &FittedCase<'_>| found(fitted).map(ModelChange::Object).into_iter().collect();
        vec![Case::early_sound(*self).changing(changes)]
    }
}

/// The most probable box, by the names of its numbers.
fn found(fitted: &FittedCase<'_>) -> Option<StandingBox> {
    let mut numbers = [0.0; NAMES.len()];
    for (number, (name, _)) in numbers.iter_mut().zip(NAMES) {
        *number = fitted.found(name)?;
    }
    let [x, y, z, length, width, height, yaw_deg, absorption] = numbers;
    Some(StandingBox::new([x, y, z], [length, width, height], yaw_deg, absorption))
}

/// In the order of [`NAMES`].
fn numbers(one: &StandingBox) -> [f64; NAMES.len()] {
    let ([x, y, z], [length, width, height]) = (one.base_m, one.sides_m);
    [x, y, z, length, width, height, one.yaw_deg, one.absorption]
}

impl EarlySoundTerm for MissingObject {
    fn weigh(&self, early: &EarlySound, used: &[bool]) -> Option<AuxiliaryEvidence> {
        let sample = early.boxes(used)?;
        let most = numbers(&best(&sample)?.standing_box());
        let drawn: Vec<[f64; NAMES.len()]> =
            sample.boxes.iter().map(|b| numbers(&b.standing_box())).collect();
        let parameter = |(which, (name, unit)): (usize, &(&str, &str))| {
            let value = most[which];
            let mut all: Vec<f64> = drawn.iter().map(|n| nearest_turn(n[which], value, unit)).collect();
            all.sort_by(f64::total_cmp);
            let at = |share: f64| all[((all.len() - 1) as f64 * share).round() as usize];
            FoundParameter {
                name: (*name).to_owned(),
                value,
                low: at(TAIL).min(value),
                high: at(1.0 - TAIL).max(value),
                unit: (*unit).to_owned(),
            }
        };
        let parameters = NAMES.iter().enumerate().map(parameter).collect();
        Some(AuxiliaryEvidence { nats: sample.nats, parameters })
    }
}

/// An angle of a box by half turns nearest to another; other numbers as they are.
fn nearest_turn(value: f64, to: f64, unit: &str) -> f64 {
    if unit == "deg" { value - 180.0 * ((value - to) / 180.0).round() } else { value }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::hand_made;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn few_responses_have_no_case_and_what_is_found_is_what_joins_the_mesh() {
        let mut survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        assert!(MissingObject.cases(&survey).is_empty());
        let more = survey.responses[..2].to_vec();
        survey.responses.extend(more);
        let cases = MissingObject.cases(&survey);
        let one = StandingBox::new([2.0, 1.5, 0.0], [1.8, 0.7, 1.2], -30.0, 0.3);
        let mut fitted = FittedCase::of_values(&survey, &[]);
        assert!(cases[0].model_changes(&fitted).is_empty());
        let parameter = |((name, unit), value): ((&str, &str), f64)| FoundParameter {
            name: name.to_owned(),
            value,
            low: value,
            high: value,
            unit: unit.to_owned(),
        };
        fitted.auxiliary = NAMES.into_iter().zip(numbers(&one)).map(parameter).collect();
        assert_eq!(cases[0].model_changes(&fitted), [ModelChange::Object(one)]);
        assert!((nearest_turn(-89.0, 88.0, "deg") - 91.0).abs() < 1e-12);
    }
}
