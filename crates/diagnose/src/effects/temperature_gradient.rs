//! `temperature_gradient`: the air is warmer, or colder, the higher it is.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{ArrivalTerm, Case, Effect, Parameter};
use crate::simulate::views::ArrivalView;
use crate::survey::Survey;
use crate::survey::planes::apart_m;

/// Absolute temperature of 0 degrees Celsius.
const ZERO_C_K: f64 = 273.15;
/// Temperatures below this have no speed of sound that means anything, in kelvins.
const LEAST_K: f64 = 200.0;

/// What tells it from another temperature at all heights.
const THERMOMETERS: NextMeasurement =
    NextMeasurement::Other("Read one thermometer at the floor and one at the ceiling.");
/// Where the thermometer hung that the room file quotes is not stated: about where sources and receivers stand, give or take so many metres.
const STATED_SD_M: f64 = 0.7;

/// The temperature rises evenly with height, and is as stated at some height. Each direct sound and reflection takes as long as its straight legs do
/// in such air. That rays bend is left out: at 3 K/m over 10 m the arc is a millimetre longer than its chord. Decays stay as they are.
///
/// Mark: what comes by the ceiling is early and what comes by the floor late, the more the farther it went. Mimicked by: a floor and a ceiling that
/// stand elsewhere; distances by other means than sound, or two thermometers, tell them apart. It is named and not rendered: traced paths record no
/// heights, and a tenth of a millisecond is much.
///
/// Source: the speed of sound of an ideal gas goes with the root of the absolute temperature (ISO 9613-1:1993), integrated along each leg.
#[derive(Clone, Copy, Debug, Default)]
pub struct TemperatureGradient;

impl Effect for TemperatureGradient {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "temperature_gradient",
            "Air warmer or colder the higher it is",
            "The temperature is not the same at all heights: sound by the ceiling and sound by the floor take other times than stated.",
        )
        .against(&[
            ("surface_displacement", NextMeasurement::Distances),
            ("room_dimensions", NextMeasurement::Distances),
        ])
        .decided_by(21, THERMOMETERS)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let [low, high] = survey.box_m().map(|corner| corner[2]);
        let at_m = mean_height_m(survey).clamp(low, high);
        let parameters = vec![
            Parameter::new("gradient", "K/m", 0.0, 1.5, (-10.0, 10.0)).typically(2.0),
            Parameter::new("stated_at", "m", at_m, STATED_SD_M, (low, high)),
        ];
        vec![Case::arrivals(parameters, *self)]
    }
}

impl ArrivalTerm for TemperatureGradient {
    fn delay_s(&self, values: &[f64], arrival: &ArrivalView<'_>) -> f64 {
        let &[k_per_m, stated_at_m] = values else { return 0.0 };
        let stated_k = arrival.pair().air.temperature_c() + ZERO_C_K;
        let root = |stop: [f64; 3]| (stated_k + k_per_m * (stop[2] - stated_at_m)).max(LEAST_K).sqrt();
        let longer = |leg: &[[f64; 3]]| {
            // The mean of 1 / sqrt(T) over temperatures from a to b is 2 / (sqrt(a) + sqrt(b)).
            let slowness = 2.0 * stated_k.sqrt() / (root(leg[0]) + root(leg[1]));
            apart_m(leg[0], leg[1]) * (slowness - 1.0)
        };
        arrival.stops().windows(2).map(longer).sum::<f64>() / arrival.speed_m_s()
    }
}

/// Mean height of all sources and receivers.
fn mean_height_m(survey: &Survey) -> f64 {
    let heights = || survey.sources().iter().chain(survey.receivers()).map(|place| place.position_m[2]);
    heights().sum::<f64>() / heights().count().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made::Tables;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn a_path_takes_as_long_as_all_its_parts_in_the_air_about_them() {
        let tables = Tables::new(Levels::Common, TimeZero::Emission);
        let (survey, gradient, stated_at_m) = (&tables.survey, 6.0, 1.1);
        let mut later = Vec::new();
        for (pair, arrivals) in tables.arrivals.iter().enumerate() {
            let air = survey.responses[pair].air;
            for arrival in arrivals {
                let view = ArrivalView {
                    survey,
                    pair,
                    length_m: arrival.length_m,
                    speed_m_s: air.speed_of_sound_m_s(),
                    departure: arrival.departure,
                    arrival: arrival.arrival,
                    surfaces: &arrival.surfaces,
                };
                // From the source on, as far as the height turns about at floor (0 m) and ceiling (2.5 m).
                let rise = arrival.departure[2];
                let from_m = survey.sources[survey.responses[pair].source].position_m[2];
                let parts = 20_000;
                let part_m = arrival.length_m / f64::from(parts);
                let time_s = (0..parts).map(|i| {
                    let unfolded = (from_m + (f64::from(i) + 0.5) * part_m * rise).rem_euclid(5.0);
                    let height = if unfolded > 2.5 { 5.0 - unfolded } else { unfolded };
                    let kelvin = air.temperature_c() + 273.15 + gradient * (height - stated_at_m);
                    part_m / air.speed_of_sound_m_s() * ((air.temperature_c() + 273.15) / kelvin).sqrt()
                });
                let expected = time_s.sum::<f64>() - arrival.length_m / air.speed_of_sound_m_s();
                let found = TemperatureGradient.delay_s(&[gradient, stated_at_m], &view);
                assert!((found - expected).abs() < 1e-9, "{found} {expected}");
                later.push(found);
            }
        }
        assert!(later.iter().any(|s| *s > 2e-5) && later.iter().any(|s| *s < -2e-5), "{later:?}");
    }
}
