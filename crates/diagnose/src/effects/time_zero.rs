//! `time_zero`: the first sample is not the instant of emission.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{ArrivalTerm, Case, Effect, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::ArrivalView;
use crate::survey::Survey;
use sabine_scene::TimeZero;

/// One latency in all responses, where the room file says that there is none.
///
/// Mark: all arrivals are late or early by the same time. Mimicked by: the group delay of loudspeaker and converters, which
/// is the same thing to a recording.
#[derive(Clone, Copy, Debug, Default)]
pub struct TimeZeroOffset;

impl Effect for TimeZeroOffset {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "time_zero",
            "Latency not removed",
            "The recording does not start with the emission: a latency was not removed.",
        )
        .decided_by(4, NextMeasurement::Loopback)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        // An unknown latency is fitted anyway where the room file admits to one.
        if survey.measurement().time_zero != TimeZero::Emission {
            return Vec::new();
        }
        let latency = Parameter::new("latency", "ms", 0.0, 10.0, (-200.0, 200.0)).typically(1.0);
        let case = Case::arrivals(vec![latency], *self);
        vec![case.changing(|fitted| vec![ModelChange::Latency(1e-3 * fitted.values()[0])])]
    }
}

impl ArrivalTerm for TimeZeroOffset {
    fn delay_s(&self, values: &[f64], _: &ArrivalView<'_>) -> f64 {
        1e-3 * values[0]
    }
}
