//! `coupled_volume`: a neighbouring room gives back what it has stored.

use super::add_energy;
use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, FittedCase, Parameter, Stage};
use crate::extend::applied_changes::{BUILD_UP_S, CoupledDecay};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::survey::Survey;

/// A second decay with one decay time and level, each with a slope over the octaves; its level changes from place to place
/// as if it came from an opening: a plane over the receiver's position.
///
/// Mark: decays bend at -15 to -40 dB into one late slope that is the same everywhere. Mimicked by: noise, whose level does not
/// fall; uneven absorption. Responses with the opening closed, or longer ones, tell them apart.
///
/// Source: Cremer and Müller, Principles and Applications of Room Acoustics, 1982, II.3; Xiang and Goggans, JASA 110, 2001.
#[derive(Clone, Copy, Debug, Default)]
pub struct CoupledVolume;

impl Effect for CoupledVolume {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "coupled_volume",
            "Coupled volume (double-slope decay)",
            "A coupled volume (corridor, ceiling void, next room) keeps sounding after the room itself has decayed.",
        )
        .against(&[("background_noise", NextMeasurement::LouderAndLonger)])
        .decided_by(0, NextMeasurement::DoorsClosed)
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        let mut parameters = vec![
            Parameter::new("level_1_khz", "dB", -60.0, 20.0, (-90.0, 0.0)).typically(-25.0),
            Parameter::new("level_per_octave", "dB", 0.0, 2.0, (-10.0, 10.0)),
            Parameter::new("decay_time_1_khz", "s", 1.2, 0.7, (0.2, 6.0)),
            Parameter::new("decay_time_ln_per_octave", "", -0.1, 0.15, (-0.7, 0.7)),
        ];
        for axis in ["x", "y", "z"] {
            let name = format!("level_along_{axis}");
            parameters.push(Parameter::new(name, "dB/m", 0.0, 0.7, (-5.0, 5.0)));
        }
        let starts = [0.7, 1.4].map(|t| vec![-25.0, 0.0, t, -0.1, 0.0, 0.0, 0.0]).to_vec();
        vec![Case::decay(parameters, *self).at(Stage::Added).starting(starts).changing(changes)]
    }
}

impl DecayTerm for CoupledVolume {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let survey = view.survey();
        let octaves = survey.octaves_from_1khz(view.band());
        let count = survey.receivers().len() as f64;
        let position = survey.receivers()[view.pair().receiver].position_m;
        let place_db: f64 = (0..3)
            .map(|k| {
                let mean = survey.receivers().iter().map(|r| r.position_m[k]).sum::<f64>() / count;
                values[4 + k] * (position[k] - mean)
            })
            .sum();
        let level = view.reference_energy() * 10f64.powf((values[0] + values[1] * octaves + place_db) / 10.0);
        let decay_s = (values[2] * (values[3] * octaves).exp()).clamp(0.1, 20.0);
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            let time_s = view.after_direct_s(bin).max(0.0);
            let built = 1.0 - (-time_s / BUILD_UP_S).exp();
            let energy = level * built * (-6.0 * std::f64::consts::LN_10 * time_s / decay_s).exp();
            *l = add_energy(*l, energy);
        }
    }
}

fn changes(fitted: &FittedCase<'_>) -> Vec<ModelChange> {
    let (values, survey) = (fitted.values(), fitted.survey());
    let octaves = |b: usize| survey.octaves_from_1khz(b);
    let level = |b: usize| {
        fitted.level_per_s(b).unwrap_or(0.0) * 10f64.powf((values[0] + values[1] * octaves(b)) / 10.0)
    };
    let receivers = survey.receivers().len() as f64;
    vec![ModelChange::CoupledVolume(CoupledDecay {
        energy_per_s: fitted.per_band(level),
        decay_time_s: fitted.per_band(|b| (values[2] * (values[3] * octaves(b)).exp()).clamp(0.1, 20.0)),
        gradient_db_per_m: [values[4], values[5], values[6]],
        centre_m: std::array::from_fn(|k| {
            survey.receivers().iter().map(|r| r.position_m[k]).sum::<f64>() / receivers
        }),
    })]
}
