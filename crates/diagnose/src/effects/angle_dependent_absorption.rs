//! `angle_dependent_absorption`: walls absorb by the angle at which sound meets them.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, Effect, Parameter};
use crate::simulate::views::BandView;
use crate::survey::Survey;

/// All walls react locally by a share: the logarithm of what a wall reflects lies so far between that of its random-incidence absorption,
/// the same at all angles, and that of the real impedance which has this absorption in the mean over all angles.
///
/// Mark: paths that graze the walls live longer, and those that meet them at some 50 to 70 degrees from the normal die sooner (a hard wall
/// absorbs most near grazing and nothing at it), so that decays bend and differ between positions. Mimicked by: absorption, which is refitted beside it; an open patch or
/// another material on one wall; scattering, which straightens decays. The extended model keeps random-incidence absorption: what was found
/// is said, not rendered.
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

    fn cases(&self, _: &Survey) -> Vec<Box<dyn Case>> {
        vec![Box::new(*self)]
    }
}

impl Case for AngleDependentAbsorption {
    fn parameters(&self, _: &Survey) -> Vec<Parameter> {
        vec![Parameter::new("locally_reacting_share", "", 0.0, 0.5, (-0.5, 1.3)).typically(1.0)]
    }

    fn starts(&self, _: &Survey) -> Vec<Vec<f64>> {
        vec![vec![0.1], vec![0.9]]
    }

    fn energy(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            *l += view.local_reaction_change(bin, values[0]);
        }
    }
}
