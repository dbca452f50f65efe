//! `edge_diffraction`: sound bends around edges into the shadow, and the simulation does not.

mod diffracted;

use crate::effect::EffectInfo;
use crate::effect::{Case, DecayTerm, Effect, Parameter};
use crate::effects::add_energy;
use crate::extend::model_change::ModelChange;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use diffracted::DiffractedEnergy;

/// First-order diffraction by the free and convex edges of the mesh, where source and receiver do not see each other: exact for rigid
/// wedges, its level open by some decibels, for what the theory leaves out (ways over two edges, reflections before and after,
/// absorption of the faces, interference of the edges).
///
/// Mark: energy at shadowed receivers before the first reflection that the mesh allows and with it, stronger in low octaves, in the bins
/// in which a path over an edge arrives; none where the source is in sight. Mimicked by: a directional source, if all that is in the shadow
/// lies in one direction; a misplaced receiver; a gain of single responses, which lifts all bins alike.
///
/// Rooms whose mesh has no edge between a source and a receiver have no case.
///
/// Source: U. P. Svensson, R. I. Fred and J. Vanderkooy, JASA 106 (1999) 2331 (the integral over the edge); R. G. Kouyoumjian and
/// P. H. Pathak, Proc. IEEE 62 (1974) 1448 (uniform theory); [`EdgeDiffraction`](sabine_paths::EdgeDiffraction) has the formulae.
#[derive(Clone, Copy, Debug, Default)]
pub struct MissingDiffraction;

/// How far off first-order theory is taken to be, one standard deviation in dB.
const THEORY_SD_DB: f64 = 2.5;
/// Below this level nothing bends; above the greatest it is no diffraction.
const LEVEL_DB: (f64, f64) = (-40.0, 10.0);

impl Effect for MissingDiffraction {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "edge_diffraction",
            "Diffraction at edges",
            "Sound is diffracted around edges into the shadow; the simulation has no diffraction.",
        )
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        if survey.diffracted_responses().is_empty() {
            return Vec::new();
        }
        let level = Parameter::new("level_over_theory", "dB", 0.0, THEORY_SD_DB, LEVEL_DB);
        vec![Case::decay(vec![level], *self).changing(|_| vec![ModelChange::Diffraction])]
    }
}

impl DecayTerm for MissingDiffraction {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        Ok(diffracted::prepare(room)?)
    }

    fn adds_sound_of_source(&self) -> bool {
        true
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        Some(Box::new(DiffractedEnergy::by_hand(bins)))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let Some(table) = view.table::<DiffractedEnergy>() else { return };
        let level = 10f64.powf(values[0] / 10.0);
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            let diffracted = view.gain() * table.of(view.band(), bin);
            if diffracted > 0.0 {
                *l = add_energy(*l, level * diffracted);
            }
        }
    }
}
