//! A law of added sound as a cause.

use super::free_parameters::FittedLaw;
use crate::effect::{DecayTerm, Stage};
use crate::effects::add_energy;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::{Survey, SurveyedResponse};
use sabine_paths::laws::{LawVariable, end_variable};

/// Equal steps of a response at which a law is looked at beforehand.
const CHECKED: usize = 32;
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

    /// Its levels in dB at times after the direct sound in seconds; none where a variable is not known.
    fn levels_db(
        &self,
        fitted: &[f64],
        (survey, response): (&Survey, &SurveyedResponse),
        hz: f64,
        times_s: &[f64],
    ) -> Vec<f64> {
        let variable = |name: &str| match name {
            "frequency_hz" => Some(LawVariable::Same(hz)),
            "time_after_direct_s" => Some(LawVariable::Each(times_s)),
            other => of_survey(survey, (response.source, response.receiver), other).map(LawVariable::Same),
        };
        self.0.law.values(&self.0.values(fitted), times_s.len(), variable).unwrap_or_default()
    }
}

impl DecayTerm for AddedLaw {
    /// Computes nothing: looks at the ends of the intervals of the parameters, where a fit may go, from the direct sound to the end of each
    /// response.
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        let survey = room.survey();
        for response in survey.responses() {
            let end_s = response.sounds_until_s;
            let times: Vec<f64> = (0..=CHECKED).map(|i| end_s * i as f64 / CHECKED as f64).collect();
            for hz in survey.bands().iter_hz() {
                self.0.check(hz, |fitted| self.levels_db(fitted, (survey, response), hz, &times))?;
            }
        }
        Ok(Tables::default())
    }

    /// Its level is relative to the direct sound at 1 m, and so as loud in a recording as the gain makes that.
    fn adds_sound_of_source(&self) -> bool {
        true
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let times: Vec<f64> = (0..ln_energy.len()).map(|bin| view.after_direct_s(bin).max(0.0)).collect();
        let hz = view.survey().bands().nominal_hz(view.band());
        let levels = self.levels_db(values, (view.survey(), view.pair()), hz, &times);
        for (ln, db) in ln_energy.iter_mut().zip(levels) {
            *ln = add_energy(*ln, view.gain() * view.bin_s() * 10f64.powf(db.max(LEAST_DB) / 10.0));
        }
    }
}

/// A variable of a pair as the survey has it: where source and receiver are said to be, and the air of the room.
pub(super) fn of_survey(survey: &Survey, (source, receiver): (usize, usize), name: &str) -> Option<f64> {
    let (from, to) = (&survey.sources()[source], &survey.receivers()[receiver]);
    let (source, receiver) = (from.position_m, to.position_m);
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
        _ => return end_variable(name, [&from.id, &to.id]),
    })
}

#[cfg(test)]
mod tests {
    use crate::effect::Effect;
    use crate::effects::LawEffect;
    use crate::hand_made::Tables;
    use crate::likelihood::decay::EnergyModel;
    use crate::likelihood::laplace::{Model, Slopes};
    use sabine_paths::laws::{Law, LawParameter, LawTarget};
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn what_is_added_is_recorded_with_the_gain_of_the_response() {
        let tables = Tables::new(Levels::Common, TimeZero::Emission);
        let data = tables.energy_data();
        let parameters = [
            ("level", LawParameter::new(13.0, [-40.0, 30.0], "dB")),
            ("slope", LawParameter::new(-20.0, [-90.0, -5.0], "dB/s")),
        ];
        let formula = "level + slope * time_after_direct_s";
        let law = Law::new("hum", LawTarget::Added, None, formula, parameters).unwrap();
        let cases = LawEffect::new(law).unwrap().cases(&tables.survey);
        let cases: Vec<_> = cases.iter().collect();
        let used = vec![true; 3];
        let model = EnergyModel::new(&data, &cases, &used);
        let mut values = model.start(None);
        let own = model.first_of(0);
        values[own..own + 2].copy_from_slice(&[13.0, -20.0]);
        let before = model.prediction(&values, 1);
        // Neither of the gains tells the sound of the paths from what is added.
        let common = model.layout.common_gain().unwrap();
        for (index, gain_db) in [(common, 7.0), (model.layout.gain(1), -1.5)] {
            let mut louder = values.clone();
            louder[index] += gain_db;
            let change = (model.prediction(&louder, 1) - &before) * (10.0 / std::f64::consts::LN_10);
            assert!(change.iter().all(|db| (db - gain_db).abs() < 1e-6), "{change}");
        }
        // It does add something.
        let mut without = values.clone();
        without[own] = -40.0;
        assert!((before - model.prediction(&without, 1)).amax() > 0.1);
        // And the likelihood knows what a gain changes.
        let mut slopes = Slopes::zero(values.len());
        model.log_likelihood(&values, Some(&mut slopes));
        let at = |gain_db: f64| {
            let mut moved = values.clone();
            moved[common] += gain_db;
            model.log_likelihood(&moved, None)
        };
        let expected = (at(1e-3) - at(-1e-3)) / 2e-3;
        let found = slopes.gradient[common];
        assert!((found - expected).abs() < 1e-3 * expected.abs().max(1.0), "{found} {expected}");
    }
}
