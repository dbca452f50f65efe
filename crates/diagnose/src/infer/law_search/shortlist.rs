//! The few laws that are fitted: those for which the screen says most, and that can be told apart.

use super::features::Features;
use super::law_screen::{Family, LawScreen};
use crate::effect::{Case, Observable};
use crate::effects::{Formula, Grammar};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::CatalogueCase;
use crate::infer::search::State;
use std::borrow::Cow;

/// Laws that are fitted, at most.
const MAX_FITTED: usize = 10;
/// A law that lags behind the best by more is not fitted, in nats.
const MAX_BEHIND_NATS: f64 = 25.0;

/// The most promising laws beside the chosen cases of a state, as cases of an effect (its number and identifier), with slots from `slot` on;
/// none that is among the cases already. They inherit `inherited_nats`.
pub(crate) fn shortlist(
    baseline: &Baseline,
    cases: &[CatalogueCase],
    state: &State,
    used: &[bool],
    (effect, id, slot, inherited_nats): (usize, &Cow<'static, str>, usize, f64),
) -> Result<Vec<CatalogueCase>, Error> {
    let survey = baseline.survey();
    let grammar = Grammar::of(survey);
    let features = Features::gather(baseline, &grammar)?;
    let of_decays: Vec<&Case> = state
        .chosen
        .iter()
        .map(|&c| &cases[c].case)
        .filter(|case| case.observable().concerns(Observable::Decay))
        .collect();
    let family = Family { grammar: &grammar, features: &features, from_band: 0, shams: false };
    let screen = LawScreen::of(baseline, family, &of_decays, &state.energy, used)?;
    let classes = screen.classes(MAX_FITTED);
    let best = classes.first().map_or(0.0, |class| class.nats);
    let known = |formula: &Formula| cases.iter().any(|own| own.formula.as_ref() == Some(formula));
    let mut found = Vec::new();
    for class in classes.iter().filter(|class| best - class.nats < MAX_BEHIND_NATS) {
        let formula = grammar.formulas[class.formula];
        if known(&formula) {
            continue;
        }
        // A formula that is no law (a name of a surface that none may have) is not weighed.
        let Ok(mut case) = grammar.case(&formula, survey) else { continue };
        case.slot = Some(slot + found.len());
        found.push(CatalogueCase { effect, id: id.clone(), case, formula: Some(formula), inherited_nats });
    }
    Ok(found)
}
