//! `sound_speed`: the room was warmer or colder than the room file says.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{ArrivalTerm, Case, Effect, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::ArrivalView;
use crate::survey::Survey;
use sabine_acoustics::Air;

/// Another temperature: all arrival times scale; once it is named, decays are taken at that temperature too.
///
/// Mark: arrivals are late or early in proportion to their path, direct sound and reflections alike. Mimicked by: a sampling
/// clock that is off, which scales the times just so; a thermometer or a loopback click tells them apart.
///
/// Source: ISO 9613-1:1993 (speed of sound with temperature).
#[derive(Clone, Copy, Debug, Default)]
pub struct SoundSpeed;

impl Effect for SoundSpeed {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "sound_speed",
            "Air warmer or colder than stated",
            "The speed of sound does not match the stated temperature.",
        )
        .against(&[("sampling_clock", NextMeasurement::ClockOrThermometer)])
        .decided_by(7, NextMeasurement::Distances)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let stated = survey.air().temperature_c();
        let temperature = Parameter::new("temperature", "deg C", stated, 5.0, (-20.0, 50.0));
        let case = Case::arrivals(vec![temperature.typically(stated + 3.0)], *self);
        vec![case.changing(|fitted| vec![ModelChange::Temperature(fitted.values()[0])])]
    }
}

impl ArrivalTerm for SoundSpeed {
    fn delay_s(&self, values: &[f64], arrival: &ArrivalView<'_>) -> f64 {
        let stated = arrival.pair().air;
        let change = values[0] - arrival.survey().air().temperature_c();
        let temperature_c = (stated.temperature_c() + change).clamp(-40.0, 60.0);
        match Air::new(temperature_c, stated.relative_humidity_percent(), stated.pressure_kpa()) {
            Ok(air) => arrival.length_m() / air.speed_of_sound_m_s() - arrival.time_s(),
            Err(_) => 0.0,
        }
    }
}
