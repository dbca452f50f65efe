//! `surface_absorption`: one material is not what its table says.

use crate::effect::{Case, Effect, Nuisance, Parameter};
use crate::survey::Survey;

/// The absorption of one material lies far outside its stated uncertainty: its prior is opened in every octave.
///
/// Mark: decays, and the reflections of that surface. Mimicked by: the other materials, within their own uncertainty.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfaceAbsorption;

/// Standard deviation of absorption once the table is not believed.
const OPEN_SD: f64 = 0.3;

impl Effect for SurfaceAbsorption {
    fn id(&self) -> &'static str {
        "surface_absorption"
    }

    fn explanation(&self) -> &'static str {
        "One surface absorbs far more or less than its table says: another material, or something in front of it."
    }

    fn cases(&self, survey: &Survey) -> Vec<Box<dyn Case>> {
        let one = |(material, name): (usize, &String)| -> Box<dyn Case> {
            Box::new(OneMaterial { material, name: name.clone() })
        };
        survey.materials().iter().enumerate().map(one).collect()
    }
}

struct OneMaterial {
    material: usize,
    name: String,
}

impl Case for OneMaterial {
    fn subject(&self) -> Option<String> {
        Some(self.name.clone())
    }

    fn parameters(&self, _: &Survey) -> Vec<Parameter> {
        Vec::new()
    }

    fn relaxes(&self) -> Vec<(Nuisance, f64)> {
        vec![(Nuisance::Absorption(self.material), OPEN_SD)]
    }
}
