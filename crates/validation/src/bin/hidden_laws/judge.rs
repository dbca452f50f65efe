//! Whether an answer is right.

use crate::agreement::{Agreement, agreement, law_of};
use crate::kinds::Kind;
use crate::worlds::{Contents, NUISANCES};
use sabine::diagnose::{Cause, Diagnosis, FoundLaw, Verdict};
use sabine_testkit::Truth;
use sabine_validation::AnyError;
use serde::{Deserialize, Serialize};

/// Name of a law that was searched for, among the causes.
const SEARCHED: &str = "unknown_law";
/// Tests of the lack of fit below this probability say something.
const TELLING_P: f64 = 0.01;

/// An answer in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// A law of the right target, surface and covariate.
    RightLaw,
    /// Laws, none of which is right.
    WrongLaw,
    /// A set of a cause and a law that did not stand, the law being right.
    InSet,
    /// No law, but the effect of the catalogue that is the truth, alone or in a set of alternatives.
    Catalogue,
    /// No law, and other effects of the catalogue.
    WrongName,
    /// Something is wrong, and nothing is named.
    Unexplained,
    /// Nothing is said to be wrong, beyond nuisances that are there.
    Adequate,
}

/// What an answer is worth.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    pub outcome: Outcome,
    /// Laws that are none, or not the hidden one.
    pub false_laws: usize,
    /// Named effects of the catalogue that do not act in the room.
    pub false_names: usize,
    /// Whether a test of the lack of fit speaks of the right covariate (and surface); none where no law is hidden.
    pub misfit_is_right: Option<bool>,
    pub agreement: Agreement,
}

/// Words of a text: letters, digits and underscores.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_')
}

fn speaks_of(text: &str, covariates: &[&str]) -> bool {
    words(text).any(|word| covariates.contains(&word))
}

/// Whether a law that was found is of the kind that is hidden.
fn is_right(law: &FoundLaw, kind: &Kind, surface: Option<&str>) -> bool {
    kind.targets.contains(&law.target.as_str())
        && surface.is_none_or(|surface| law.surface.as_deref() == Some(surface))
        && speaks_of(&law.formula, kind.covariates)
}

/// Whether what a law goes with, in words, is of the kind that is hidden.
fn tells(words: &str, kind: &Kind, surface: Option<&str>) -> bool {
    speaks_of(words, kind.covariates) && surface.is_none_or(|surface| speaks_of(words, &[surface]))
}

/// Judges a diagnosis of a room of a kind.
///
/// # Errors
/// For bands that are none.
pub fn judge(
    found: &Diagnosis,
    kind: &Kind,
    contents: &Contents,
    truth: &Truth,
) -> Result<Judgement, AnyError> {
    let hidden = contents.hidden.first().filter(|_| contents.law);
    let surface = hidden.and_then(|hidden| kind.surface_of(hidden, truth));
    let right: Option<&FoundLaw> =
        found.laws.iter().find(|law| hidden.is_some() && is_right(law, kind, surface));
    let wrong_laws =
        found.laws.iter().filter(|law| hidden.is_none() || !is_right(law, kind, surface)).count();
    let is_true = |cause: &Cause| match hidden {
        Some(_) => kind.is_in_catalogue(cause, surface),
        None => contents.cause == Some(cause.effect.as_str()),
    };
    let named: Vec<&Cause> = found.causes.iter().filter(|cause| cause.effect != SEARCHED).collect();
    let mut fallen = found.law_search.iter().flat_map(|search| &search.fallen);
    let law_in_set = hidden.is_some()
        && found.verdict == Verdict::Ambiguous
        && found.alternatives.iter().any(|id| id == SEARCHED)
        && fallen.any(|law| tells(&law.goes_with, kind, surface));
    // The last cause of a set stands for all of it.
    let in_set = |cause: &Cause| {
        found.verdict == Verdict::Ambiguous
            && found.causes.last() == Some(cause)
            && (law_in_set
                || found.alternatives.iter().any(|id| match hidden {
                    Some(_) => kind.catalogue.contains(&id.as_str()),
                    None => contents.cause == Some(id.as_str()),
                }))
    };
    let excused = |cause: &Cause| contents.hidden.len() > 1 && NUISANCES.contains(&cause.effect.as_str());
    let holds = named.iter().any(|cause| is_true(cause) || in_set(cause));
    let false_names =
        named.iter().filter(|cause| !is_true(cause) && !in_set(cause) && !excused(cause)).count();
    let outcome = match found.verdict {
        _ if right.is_some() => Outcome::RightLaw,
        _ if wrong_laws > 0 => Outcome::WrongLaw,
        _ if law_in_set => Outcome::InSet,
        _ if holds => Outcome::Catalogue,
        _ if false_names > 0 => Outcome::WrongName,
        Verdict::Unexplained => Outcome::Unexplained,
        _ => Outcome::Adequate,
    };
    let agreement = match (hidden, right.and_then(law_of)) {
        (Some(hidden), Some(law)) => agreement(&law, hidden, kind.edge, truth.bands()?, truth.responses()),
        _ => Agreement::default(),
    };
    let misfit_is_right = hidden.map(|_| {
        found.lack_of_fit.tests.iter().filter(|test| test.p_value < TELLING_P).any(|test| {
            tells(&format!("{} {}", test.name, test.subject.as_deref().unwrap_or_default()), kind, surface)
        })
    });
    Ok(Judgement { outcome, false_laws: wrong_laws, false_names, misfit_is_right, agreement })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::kinds::KINDS;

    fn law(target: &str, surface: Option<&str>, formula: &str) -> FoundLaw {
        let text = serde_json::json!({
            "id": "law", "target": target, "surface": surface, "formula": formula, "words": "", "parameters": [],
            "evidence_nats": 9.0, "prior_nats": 6.0, "family_p": 0.01, "vault_gain_nats": 5.0,
        });
        serde_json::from_value(text).unwrap()
    }

    #[test]
    fn a_law_is_right_by_target_surface_and_covariate() {
        let grazing = &KINDS[5];
        let formula = "-4 * (1 - cos_incidence)^2";
        assert!(is_right(&law("reflection", Some("floor"), formula), grazing, Some("floor")));
        assert!(!is_right(&law("reflection", Some("door"), formula), grazing, Some("floor")));
        assert!(!is_right(
            &law("reflection", Some("floor"), "-4 * above(frequency_hz, 500)"),
            grazing,
            Some("floor")
        ));
        let fog = &KINDS[2];
        assert!(is_right(&law("path", None, "-0.1 * length_m"), fog, None));
        assert!(!is_right(&law("path", None, "-0.1 * reflections"), fog, None));
        assert!(!is_right(&law("path", None, "-0.1 * length_metres"), fog, None));
    }
}
