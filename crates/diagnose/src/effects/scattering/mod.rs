//! `scattering`: the surfaces are rougher (or smoother) than the room file says.

mod tables;

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, FittedCase, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::scattering_share::scattering_more;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use sabine_acoustics::Material;
use tables::ScatteringTable;

/// All surfaces scatter a share more of what they now reflect specularly (or, below zero, less of what they scatter), with one
/// slope over frequency.
///
/// Mark: early specular energy is missing, decays are straighter and differ less between positions. Mimicked by: absorption,
/// which is refitted beside it.
///
/// Source: Vorländer, Auralization, 2008, 11.3; energy moves from the specular to the Lambert part and none is lost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scattering;

impl Effect for Scattering {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "scattering",
            "Scattering differs from the model",
            "The surfaces, or furniture that the model omits, scatter more or less sound than stated.",
        )
        .against(&[("air_absorption", NextMeasurement::OtherHumidity)])
        .decided_by(14, NextMeasurement::MorePositions)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        // Where nothing is scattered already, nothing can be taken away.
        let least = if survey.declared_scattering > 0.01 { -1.0 } else { 0.0 };
        let parameters = vec![
            Parameter::new("extra_share_1_khz", "", 0.0, 0.3, (least, 0.95)).typically(0.25),
            Parameter::new("extra_share_per_octave", "", 0.0, 0.05, (-0.2, 0.2)).typically(0.02),
        ];
        let starts = vec![vec![0.05, 0.0], vec![0.3, 0.0]];
        vec![Case::decay(parameters, *self).starting(starts).changing(changes)]
    }
}

fn changes(fitted: &FittedCase<'_>) -> Vec<ModelChange> {
    let (values, survey) = (fitted.values(), fitted.survey());
    let scattered = |m: &Material| {
        fitted.per_band(|b| {
            let extra = (values[0] + values[1] * survey.octaves_from_1khz(b)).clamp(-1.0, 0.95);
            scattering_more(m, extra).map_or(0.0, |m| m.scattering().values()[b])
        })
    };
    let all = survey.materials().iter().zip(fitted.materials());
    vec![ModelChange::Scattering(all.map(|(name, m)| (name.clone(), scattered(m))).collect())]
}

impl DecayTerm for Scattering {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        Ok(tables::prepare(room)?)
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        Some(Box::new(ScatteringTable::by_hand(bins)))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let Some(table) = view.table::<ScatteringTable>() else { return };
        let extra = extra(values, view);
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            *l += table.change(bin, extra);
        }
    }

    fn variance(&self, values: &[f64], view: &BandView<'_>, variance: &mut [f64]) {
        let Some(table) = view.table::<ScatteringTable>() else { return };
        let extra = extra(values, view);
        for (bin, v) in variance.iter_mut().enumerate() {
            *v += table.variance(bin, extra);
        }
    }

    fn chance(&self, values: &[f64], view: &BandView<'_>) -> Option<Vec<f64>> {
        Some(view.table::<ScatteringTable>()?.chance(extra(values, view)))
    }
}

/// Extra share in the octave of a view.
fn extra(values: &[f64], view: &BandView<'_>) -> f64 {
    let extra = values[0] + values[1] * view.survey().octaves_from_1khz(view.band());
    if view.survey().declared_scattering > 0.01 { extra } else { extra.max(0.0) }
}
