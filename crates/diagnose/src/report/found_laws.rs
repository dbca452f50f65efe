//! What is told of laws that were searched for.

use crate::error::Error;
use crate::extend::extension::changes;
use crate::extend::model_change::ModelChange;
use crate::found_parameter::FoundParameter;
use crate::infer::law_search::plot::points;
use crate::infer::law_search::trial::{Fault, Trial};
use crate::infer::search::{Search, State};
use crate::report::diagnosis::FoundLaw;
use sabine_paths::laws::{Law, LawParameter};

/// The law of a chosen candidate, as the fit left it.
fn law_of(search: &Search<'_>, state: &State, candidate: usize) -> Option<Law> {
    changes(search, state, candidate).into_iter().find_map(|change| match change {
        ModelChange::Law(law) => Some(*law),
        _ => None,
    })
}

/// A chosen law with what its trial gave; `evidence_nats` beside the other causes.
pub(crate) fn found_law(
    search: &Search<'_>,
    state: &State,
    trial: &Trial,
    evidence_nats: f64,
    vault: &[usize],
) -> Result<Option<FoundLaw>, Error> {
    let candidate = trial.candidate;
    let Some(law) = law_of(search, state, candidate) else { return Ok(None) };
    let Some(formula) = &search.candidates[candidate].formula else { return Ok(None) };
    let parameter = |(name, p): (&str, &LawParameter)| FoundParameter {
        name: name.to_owned(),
        value: p.value,
        low: p.low,
        high: p.high,
        unit: p.unit.clone(),
    };
    Ok(Some(FoundLaw {
        id: law.id().to_owned(),
        target: law.target().to_string(),
        surface: law.surface().map(str::to_owned),
        formula: law.printed(),
        words: law.words().to_owned(),
        parameters: law.parameters().map(parameter).collect(),
        evidence_nats,
        prior_nats: search.price(trial.candidate),
        family_p: trial.family_p,
        vault_gain_nats: trial.vault_gain_nats,
        sham_nats: trial.sham.as_ref().map(|sham| trial.nats - sham.nats),
        not_told_from: trial.not_told_from.clone(),
        points: points(search, state, (candidate, formula), vault)?,
    }))
}

/// Why a law does not stand, in words.
pub(crate) fn reason(trial: &Trial) -> String {
    match trial.fault() {
        Some(Fault::Chance) => format!(
            "the best of as many formulas is as good by chance with probability {:.3} where no law acts",
            trial.family_p
        ),
        Some(Fault::Sham) => {
            let sham = trial.sham.as_ref().map_or("", |sham| sham.words.as_str());
            format!("what stands in no relation to the room does as well ({sham})")
        }
        _ => format!(
            "it fits the positions among which it was chosen, and makes those that had no say no more probable ({:.1} nats)",
            trial.vault_gain_nats.unwrap_or(0.0)
        ),
    }
}
