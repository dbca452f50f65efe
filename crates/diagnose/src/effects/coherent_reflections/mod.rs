//! `coherent_reflections`: reflections keep their phase, and add as pressures rather than as energies.

mod interference;
mod pressure_sums;

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use interference::Interference;

/// Most of the specular energy whose pressures may add as they should: a few hundredths are left to chance.
const MOST_OF_PRESSURES: f64 = 0.97;

/// Specular reflections add as pressures of the sign of the source, no longer as energies: whether two that arrive together add or cancel
/// is then no chance. Walls that are large, flat and hard do so, and image sources as most programs sum them.
///
/// Energies of the prediction are sums of energies, right in the mean over many places. At one place, even in the band of an octave, the
/// sum of pressures lies up to some decibels above or below for many bins together: late sound between parallel walls comes in groups of
/// images whose distances differ by less than a wave length. As the difference hardly depends on the place, it survives errors of places of
/// a centimetre, far above the Schroeder frequency.
///
/// One parameter P: the share of the energy of each specular path whose pressure adds as it should; the rest has any phase. With A the sum
/// of energies, S that part of it which was not scattered, and C the energy of the sum of pressures, a bin has A - P S + P C, of which
/// r = (A - P S) / (A - P S + P C) is left to chance; its relative variance is 1 - (1 - r)^2 of what it is for sound of any phase. What the
/// uncertainty of places leaves open is added: sums are made at several places drawn within it. In a cuboid (six whole faces, each of one
/// material) all images within the compared time count, up to a million (later bins keep the mean change of the last, and hardly count);
/// in other meshes the exact paths of the tracer, the first 55 ms.
///
/// Mark: energies of single responses above or below the prediction for many bins together, each response and octave in its own, predictable
/// way. Mimicked by: `room_modes`, the same thing below the Schroeder frequency in a room of any shape.
///
/// Source: Allen and Berkley, JASA 65 (1979) 943; Kuttruff, Room Acoustics, 6th ed., 4.1 and 4.5.
#[derive(Clone, Copy, Debug, Default)]
pub struct CoherentReflections;

impl Effect for CoherentReflections {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "coherent_reflections",
            "Reflections add in phase",
            "Reflections keep their phase: pressures add, where the simulation adds energies.",
        )
        .decided_by(17, NextMeasurement::OtherSourcePlace)
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        let share = Parameter::new("share_of_pressures", "", 0.0, 0.7, (0.0, MOST_OF_PRESSURES));
        let parameters = vec![share.typically(0.5).with_ceiling()];
        let starts = vec![vec![0.7], vec![0.2]];
        vec![
            Case::decay(parameters, *self)
                .starting(starts)
                .changing(|_| vec![ModelChange::CoherentReflections]),
        ]
    }
}

impl DecayTerm for CoherentReflections {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        interference::prepare(room)
    }

    /// Sums of pressures cancel, sums of energies do not: each follows absorption in its own way.
    fn depends_on_expansion(&self) -> bool {
        true
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        Some(Box::new(Interference::by_hand(bins)))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        if let Some(table) = view.table::<Interference>() {
            table.add_change(values[0].clamp(0.0, MOST_OF_PRESSURES), ln_energy);
        }
    }

    fn variance(&self, values: &[f64], view: &BandView<'_>, variance: &mut [f64]) {
        if let Some(table) = view.table::<Interference>() {
            table.limit_variance(values[0].clamp(0.0, MOST_OF_PRESSURES), variance);
        }
    }
}
