//! A law of added sound as a cause.

use super::free_parameters::FittedLaw;
use crate::effect::{DecayTerm, Stage};
use crate::effects::add_energy;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use sabine_paths::laws::LawVariable;

/// Least level that is added, in dB: what has no value adds nothing.
const LEAST_DB: f64 = -300.0;

/// Sound that joins from elsewhere: energy per second, re the direct sound at 1 m.
#[derive(Clone, Debug)]
pub(super) struct AddedLaw(pub FittedLaw);

impl AddedLaw {
    /// Its place in the chain: what falls off in time is of the room, what does not is noise.
    pub fn stage(&self) -> Stage {
        if self.0.law.is_uniform() { Stage::Noise } else { Stage::Added }
    }
}

impl DecayTerm for AddedLaw {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let (survey, pair) = (view.survey(), view.pair());
        let times: Vec<f64> = (0..ln_energy.len()).map(|bin| view.after_direct_s(bin).max(0.0)).collect();
        let hz = survey.bands().nominal_hz(view.band());
        let variable = |name: &str| match name {
            "frequency_hz" => Some(LawVariable::Same(hz)),
            "time_after_direct_s" => Some(LawVariable::Each(&times)),
            other => of_survey(survey, (pair.source, pair.receiver), other).map(LawVariable::Same),
        };
        let Ok(levels) = self.0.law.values(&self.0.values(values), times.len(), variable) else { return };
        for (ln, db) in ln_energy.iter_mut().zip(levels) {
            *ln = add_energy(*ln, view.bin_s() * 10f64.powf(db.max(LEAST_DB) / 10.0));
        }
    }
}

/// A variable of a pair as the survey has it: where source and receiver are said to be, and the air of the room.
pub(super) fn of_survey(survey: &Survey, (source, receiver): (usize, usize), name: &str) -> Option<f64> {
    let (source, receiver) = (survey.sources()[source].position_m, survey.receivers()[receiver].position_m);
    Some(match name {
        "distance_m" => (0..3).map(|k| (source[k] - receiver[k]).powi(2)).sum::<f64>().sqrt(),
        "source_x_m" => source[0],
        "source_y_m" => source[1],
        "source_z_m" => source[2],
        "receiver_x_m" => receiver[0],
        "receiver_y_m" => receiver[1],
        "receiver_z_m" => receiver[2],
        "temperature_c" => survey.air().temperature_c(),
        "relative_humidity_percent" => survey.air().relative_humidity_percent(),
        _ => return None,
    })
}
