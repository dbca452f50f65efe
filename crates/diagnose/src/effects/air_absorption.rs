//! `air_absorption`: the air was drier or moister than the room file says.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use sabine_acoustics::Air;

/// Relative humidity other than stated; responses with air of their own shift by as much. Attenuation by ISO 9613-1.
///
/// Mark: an error of the decay that is proportional to time, rises with frequency, and is the same at every position. Mimicked by:
/// surfaces whose absorption rises with frequency, which is why materials are refitted beside it; a second humidity tells them
/// apart. Temperature has its own entry (`sound_speed`): its effect on attenuation is small beside that on arrival times.
#[derive(Clone, Copy, Debug, Default)]
pub struct AirAbsorption;

const DRIEST_PERCENT: f64 = 3.0;
const MOISTEST_PERCENT: f64 = 98.0;

impl Effect for AirAbsorption {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "air_absorption",
            "Air drier or more humid than stated",
            "Air attenuation does not match the stated temperature and humidity.",
        )
        .against(&[
            ("surface_absorption", NextMeasurement::OtherHumidity),
            ("scattering", NextMeasurement::OtherHumidity),
        ])
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let stated = survey.air().relative_humidity_percent();
        let other = if stated > 35.0 { 0.5 * stated } else { 2.0 * stated };
        let bounds = (DRIEST_PERCENT, MOISTEST_PERCENT);
        let humidity = Parameter::new("relative_humidity", "%", stated, 20.0, bounds).typically(other);
        let starts = vec![vec![stated], vec![0.4 * stated], vec![0.5 * (stated + MOISTEST_PERCENT)]];
        let case = Case::decay(vec![humidity], *self).starting(starts);
        vec![case.changing(|fitted| vec![ModelChange::RelativeHumidity(fitted.values()[0])])]
    }
}

impl DecayTerm for AirAbsorption {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let stated = view.pair().air;
        let change = values[0] - view.survey().air().relative_humidity_percent();
        let percent = (stated.relative_humidity_percent() + change).clamp(DRIEST_PERCENT, MOISTEST_PERCENT);
        let Ok(found) = Air::new(stated.temperature_c(), percent, stated.pressure_kpa()) else { return };
        let bands = view.survey().bands();
        let exponent = |air: &Air| air.energy_exponent_per_m(bands).values()[view.band()];
        let per_s = (exponent(&stated) - exponent(&found)) * stated.speed_of_sound_m_s();
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            *l += per_s * view.time_s(bin);
        }
    }
}
