//! `background_noise`: sound that was there without the source.

use super::add_energy;
use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, FittedCase, Parameter, Stage};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::survey::Survey;

/// The same energy in every time bin and response, one level for each octave, relative to a typical early bin of that octave.
///
/// Mark: decays flatten at a level that the excitation does not change. Mimicked by: a coupled volume, whose level still
/// falls. A longer response, or a louder one, tells them apart.
///
/// Source: Lundeby et al., Acustica 81, 1995.
#[derive(Clone, Copy, Debug, Default)]
pub struct BackgroundNoise;

impl Effect for BackgroundNoise {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "background_noise",
            "Background noise",
            "Noise that does not come from the loudspeaker fills the end of the responses.",
        )
        .against(&[("coupled_volume", NextMeasurement::LouderAndLonger)])
        .decided_by(1, NextMeasurement::LongerWithSilence)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        // Neutral is where it cannot be told from none.
        let level = Parameter::new("level", "dB", -60.0, 20.0, (-90.0, 0.0)).typically(-30.0);
        let levels = (0..survey.bands().len()).map(|b| level.clone().in_band(b, survey)).collect();
        let starts = vec![vec![-35.0; survey.bands().len()]];
        vec![Case::decay(levels, *self).at(Stage::Noise).starting(starts).changing(changes)]
    }
}

fn changes(fitted: &FittedCase<'_>) -> Vec<ModelChange> {
    let level = |b: usize| fitted.level_per_s(b).unwrap_or(0.0) * 10f64.powf(fitted.values()[b] / 10.0);
    vec![ModelChange::Noise(fitted.per_band(level))]
}

impl DecayTerm for BackgroundNoise {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let noise = view.reference_energy() * 10f64.powf(values[view.band()] / 10.0);
        ln_energy.iter_mut().for_each(|l| *l = add_energy(*l, noise));
    }
}
