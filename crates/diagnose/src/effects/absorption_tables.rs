//! `absorption_tables`: the tables of all materials are less certain than the room file says.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, Effect, Nuisance};
use crate::survey::Survey;

/// Absorption of each material off by a factor of its own, far beyond the uncertainty that is stated: tables of other products than those on
/// the walls, or a standard deviation that nobody measured. Each prior is widened to half of the material's mean stated absorption, 0.15 at
/// most, and goes together over the octaves as for [`SurfaceAbsorption`](super::SurfaceAbsorption); half is a choice. Materials whose stated
/// deviation is larger stay as they are, and where fewer than two are left there is no case.
///
/// Mark: the tables are strained, and decays are met nearly as well without it; where decays come much nearer, something else acts, and it is
/// not named. Mimicked by: a single material that is far off, and to which the others yield.
#[derive(Clone, Copy, Debug, Default)]
pub struct AbsorptionTables;

/// Standard deviation as a share of the stated absorption.
const SHARE: f64 = 0.5;
/// Greatest standard deviation of absorption.
const MAX_SD: f64 = 0.15;

impl Effect for AbsorptionTables {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "absorption_tables",
            "Absorption tables are less certain than stated",
            "Several materials absorb more or less than their tables state, by more than the stated uncertainty: use what was fitted, or state a larger absorption_sd.",
        )
        .against(&[("surface_absorption", NextMeasurement::AlongWalls)])
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let wider = |material: usize| {
            let prior = survey.absorption_prior(material);
            let stated = prior.absorption.as_ref()?.values();
            let sd = (SHARE * stated.iter().sum::<f64>() / stated.len() as f64).min(MAX_SD);
            prior.absorption_sd.values().iter().any(|known| *known < sd).then_some((material, sd))
        };
        let wider: Vec<(usize, f64)> = (0..survey.materials().len()).filter_map(wider).collect();
        // One material alone is the business of `surface_absorption`.
        let [(first, sd), others @ ..] = &wider[..] else { return Vec::new() };
        if others.is_empty() {
            return Vec::new();
        }
        let one = Case::prior(Nuisance::Absorption(*first), *sd);
        let all = others.iter().fold(one, |case, (m, sd)| case.relaxing(Nuisance::Absorption(*m), *sd));
        vec![all]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{PositionError, SurfaceAbsorption};
    use crate::hand_made;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn one_material_is_part_of_all_and_not_the_other_way_round() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let all = &AbsorptionTables.cases(&survey)[0];
        for one in SurfaceAbsorption.cases(&survey) {
            assert!(one.is_part_of(all) && !all.is_part_of(&one) && !one.is_part_of(&one));
            assert!(all.opens_several_tables() && !one.opens_several_tables());
        }
        let moved = PositionError.cases(&survey);
        assert!(!moved[0].is_part_of(all));
    }

    #[test]
    fn tables_that_state_more_than_half_are_believed() {
        let mut survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let cases = AbsorptionTables.cases(&survey);
        let materials = [Nuisance::Absorption(0), Nuisance::Absorption(1)];
        assert_eq!(cases.len(), 1);
        assert_eq!(cases[0].relaxes.iter().map(|(n, _)| *n).collect::<Vec<_>>(), materials);
        let prior = &mut survey.absorption_priors[1];
        prior.absorption_sd = prior.absorption_sd.map(|_| MAX_SD);
        assert!(AbsorptionTables.cases(&survey).is_empty());
    }
}
