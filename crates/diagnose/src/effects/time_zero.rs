//! `time_zero`: the first sample is not the instant of emission.

use crate::effect::{Case, Effect, Observable, Parameter};
use crate::simulate::views::ArrivalView;
use crate::survey::Survey;
use sabine_acoustics::TimeZero;

/// One latency in all responses, where the room file says that there is none.
///
/// Mark: all arrivals are late or early by the same time. Mimicked by: the group delay of loudspeaker and converters, which
/// is the same thing to a recording.
#[derive(Clone, Copy, Debug, Default)]
pub struct TimeZeroOffset;

impl Effect for TimeZeroOffset {
    fn id(&self) -> &'static str {
        "time_zero"
    }

    fn explanation(&self) -> &'static str {
        "The recording does not start when the loudspeaker does: a latency was not taken out."
    }

    fn cases(&self, survey: &Survey) -> Vec<Box<dyn Case>> {
        // An unknown latency is fitted anyway where the room file admits to one.
        if survey.measurement().time_zero == TimeZero::Emission { vec![Box::new(*self)] } else { Vec::new() }
    }
}

impl Case for TimeZeroOffset {
    fn observable(&self) -> Observable {
        Observable::Arrivals
    }

    fn parameters(&self, _: &Survey) -> Vec<Parameter> {
        vec![Parameter::new("latency", "ms", 0.0, 10.0, (-200.0, 200.0)).typically(1.0)]
    }

    fn delay_s(&self, values: &[f64], _: &ArrivalView<'_>) -> f64 {
        1e-3 * values[0]
    }
}
