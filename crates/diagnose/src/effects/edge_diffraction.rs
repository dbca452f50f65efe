//! `edge_diffraction`: sound bends around edges into the shadow, and the simulation does not.

use super::add_energy;
use crate::effect::EffectInfo;
use crate::effect::FittedCase;
use crate::effect::{Case, Effect, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::survey::Survey;

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
/// P. H. Pathak, Proc. IEEE 62 (1974) 1448 (uniform theory); [`EdgeDiffraction`](sabine_acoustics::EdgeDiffraction) has the formulae.
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

    fn cases(&self, survey: &Survey) -> Vec<Box<dyn Case>> {
        if survey.diffracted_responses().is_empty() { Vec::new() } else { vec![Box::new(*self)] }
    }
}

impl Case for MissingDiffraction {
    fn parameters(&self, _: &Survey) -> Vec<Parameter> {
        vec![Parameter::new("level_over_theory", "dB", 0.0, THEORY_SD_DB, LEVEL_DB)]
    }

    fn energy(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let level = 10f64.powf(values[0] / 10.0);
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            let diffracted = view.diffracted_energy(bin);
            if diffracted > 0.0 {
                *l = add_energy(*l, level * diffracted);
            }
        }
    }

    fn model_changes(&self, _: &FittedCase<'_>) -> Vec<ModelChange> {
        vec![ModelChange::Diffraction]
    }
}
