//! `sampling_clock`: player and recorder do not count seconds alike.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{ArrivalTerm, Case, Effect, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::ArrivalView;
use crate::survey::Survey;

/// Deviation of the recorder's clock in parts per million, up to a thousand: all arrival times scale.
///
/// Mark and mimic: as `sound_speed`; 1000 ppm are what 0.6 K do. What sets it apart is only that clocks are better than
/// thermometers are. A loopback click at the end of the recording tells them apart.
#[derive(Clone, Copy, Debug, Default)]
pub struct SamplingClock;

impl Effect for SamplingClock {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "sampling_clock",
            "Sampling clock off",
            "The sampling clock of the recorder runs fast or slow against that of the player.",
        )
        .against(&[("sound_speed", NextMeasurement::ClockOrThermometer)])
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        let deviation = Parameter::new("deviation", "ppm", 0.0, 400.0, (-1000.0, 1000.0)).typically(800.0);
        let case = Case::arrivals(vec![deviation], *self);
        vec![case.changing(|fitted| vec![ModelChange::Clock(fitted.values()[0])])]
    }
}

impl ArrivalTerm for SamplingClock {
    fn delay_s(&self, values: &[f64], arrival: &ArrivalView<'_>) -> f64 {
        arrival.time_s() * values[0] * 1e-6
    }
}
