//! `angle_dependent_absorption`: walls absorb by the angle at which sound meets them.

mod local_reaction;

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use local_reaction::LocalReactionTable;

/// All walls react locally by a share: the logarithm of what a wall reflects lies so far between that of its random-incidence absorption,
/// the same at all angles, and that of the real impedance which has this absorption averaged over all angles.
///
/// Mark: paths that graze the walls live longer, and those that meet them at some 50 to 70 degrees from the normal die sooner (a hard wall
/// absorbs most near grazing and nothing at it), so that decays bend and differ between positions. Mimicked by: absorption, which is refitted beside it; an open patch or
/// another material on one wall; scattering, which straightens decays.
///
/// The share comes out low, by about a fifth where all walls react locally (docs/validation/diagnose.md): more paths do not change that.
///
/// Source: H. Kuttruff, Room Acoustics, 6th ed., 2.3 and 2.5; E. T. Paris, Phil. Mag. 5, 1928.
#[derive(Clone, Copy, Debug, Default)]
pub struct AngleDependentAbsorption;

impl Effect for AngleDependentAbsorption {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "angle_dependent_absorption",
            "Absorption depends on the angle of incidence",
            "The walls absorb as locally reacting surfaces do: absorption depends on the angle of incidence, whereas the tables hold for random incidence.",
        )
        .decided_by(10, NextMeasurement::AlongWalls)
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        let share = Parameter::new("locally_reacting_share", "", 0.0, 0.5, (-0.5, 1.3)).typically(1.0);
        vec![
            Case::decay(vec![share], *self)
                .starting(vec![vec![0.1], vec![0.9]])
                .changing(|fitted| vec![ModelChange::LocalReaction(fitted.values()[0])]),
        ]
    }
}

impl DecayTerm for AngleDependentAbsorption {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        Ok(local_reaction::prepare(room)?)
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        Some(Box::new(LocalReactionTable::by_hand(bins)))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let Some(table) = view.table::<LocalReactionTable>() else { return };
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            *l += table.change(bin, values[0]);
        }
    }
}
