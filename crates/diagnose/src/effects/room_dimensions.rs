//! `room_dimensions`: the room is longer, wider or higher than its model.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{ArrivalTerm, Case, Effect, Parameter};
use crate::extend::applied_changes::Dimensions;
use crate::extend::model_change::ModelChange;
use crate::simulate::views::ArrivalView;
use crate::survey::Survey;

/// Scale of the room along each axis, and a shift of it against sources and receivers, which stay where they are.
///
/// A path of length L along which the component of the unit vector along an axis keeps its size c lengthens by L c2 per unit
/// of scale: exact between walls parallel to the axes, an approximation between others.
///
/// Mark: reflections shift with their order along an axis, the direct sound does not. Mimicked by: the speed of sound, which
/// moves the direct sound too.
#[derive(Clone, Copy, Debug, Default)]
pub struct RoomDimensions;

/// A change from which a search starts: reflections then find partners up to twice as far off.
const START_PERCENT: f64 = 2.5;

impl Effect for RoomDimensions {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "room_dimensions",
            "Wrong room dimensions",
            "Walls, floor or ceiling are not where the model has them.",
        )
        .decided_by(6, NextMeasurement::Distances)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let axes = ["x", "y", "z"];
        let scale =
            axes.map(|a| Parameter::new(format!("scale_{a}"), "%", 0.0, 2.0, (-15.0, 15.0)).typically(1.0));
        let shift = axes.map(|a| Parameter::new(format!("shift_{a}"), "m", 0.0, 0.05, (-0.5, 0.5)));
        let parameters = scale.into_iter().chain(shift).collect();
        vec![Case::arrivals(parameters, *self).starting(starts(survey)).changing(|fitted| {
            let values = fitted.values();
            let scale = std::array::from_fn(|k| 1.0 + 0.01 * values[k]);
            vec![ModelChange::Dimensions(Dimensions::new(scale, std::array::from_fn(|k| values[3 + k])))]
        })]
    }
}

fn starts(survey: &Survey) -> Vec<Vec<f64>> {
    let [low, high] = survey.box_m();
    let mut starts = vec![vec![0.0; 6]];
    for k in 0..3 {
        for percent in [-START_PERCENT, START_PERCENT] {
            // One wall moves, or the other, or both.
            for side in [-0.5, 0.0, 0.5] {
                let mut start = vec![0.0; 6];
                start[k] = percent;
                start[3 + k] = side * 0.01 * percent * (high[k] - low[k]);
                starts.push(start);
            }
        }
    }
    starts
}

impl ArrivalTerm for RoomDimensions {
    fn delay_s(&self, values: &[f64], arrival: &ArrivalView<'_>) -> f64 {
        let survey = arrival.survey();
        let [low, high] = survey.box_m();
        let source = survey.sources()[arrival.pair().source].position_m;
        let receiver = survey.receivers()[arrival.pair().receiver].position_m;
        let (out, back) = (arrival.departure(), arrival.arrival());
        let longer_m: f64 = (0..3)
            .map(|k| {
                let middle = 0.5 * (low[k] + high[k]);
                let squared = 0.5 * (out[k] * out[k] + back[k] * back[k]);
                // Everything grows; then source and receiver go back to where they stand.
                let per_scale = arrival.length_m() * squared
                    + out[k] * (source[k] - middle)
                    + back[k] * (receiver[k] - middle);
                0.01 * values[k] * per_scale + values[3 + k] * (out[k] + back[k])
            })
            .sum();
        longer_m / arrival.speed_m_s()
    }
}
