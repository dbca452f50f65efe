//! `surface_absorption`: one material is not what its table says.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, Effect, Nuisance};
use crate::survey::Survey;

/// The absorption of one material lies far outside its stated uncertainty: its prior is opened in every octave, and what it may be goes together
/// over the octaves as the surfaces of the material library do (a correlation of 0.88 from one to the next), so that narrower bands are worth
/// no more free values.
///
/// Mark: decays, and the reflections of that surface. Mimicked by: the other materials, within their own uncertainty.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfaceAbsorption;

/// Standard deviation of absorption once the table is not believed.
const OPEN_SD: f64 = 0.3;

impl Effect for SurfaceAbsorption {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "surface_absorption",
            "Absorption of one material is wrong",
            "One material absorbs far more or less than its table states: another material, or something in front of it.",
        )
        .against(&[("air_absorption", NextMeasurement::OtherHumidity)])
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let one = |(material, name): (usize, &String)| {
            Case::prior(Nuisance::Absorption(material), OPEN_SD).about(name.clone())
        };
        survey.materials().iter().enumerate().map(one).collect()
    }
}
