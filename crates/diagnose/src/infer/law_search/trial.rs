//! What laws that were chosen must stand before they are named.

use super::features::Features;
use super::law_screen::{Family, LawScreen};
use crate::effect::{Case, Observable};
use crate::effects::Grammar;
use crate::error::Error;
use crate::infer::cross_validation::{Folds, predict};
use crate::infer::search::{Search, State};
use sabine_acoustics::{Observer, report};

/// What a law must gain at the vault, in nats: it must make positions that had no say in its choice more probable than they are without it.
/// Nothing more is asked, for the vault is a fourth test beside evidence, the probability of the whole family and shams, and two receivers
/// leave few nats to weak laws.
const LEAST_VAULT_NATS: f64 = 0.0;
/// Probability, by chance, of as good a law anywhere in the family from which on none is named.
const MAX_FAMILY_P: f64 = 0.01;
/// A sham that comes as near takes the name away, in nats.
const SHAM_NATS: f64 = 3.0;
/// Shams that are fitted, at most: those for which the screen says most.
const FITTED_SHAMS: usize = 4;
/// Laws that are listed as not told apart, at most.
const MAX_LISTED: usize = 20;

/// How a chosen law fared.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    pub candidate: usize,
    /// Evidence of the decays for it beside the other causes, times its probability beforehand, in nats.
    pub nats: f64,
    /// Probability of as good a law anywhere in the family where no law acts.
    pub family_p: f64,
    pub sham: Option<FittedSham>,
    /// What the data do not tell it from, in words.
    pub not_told_from: Vec<String>,
    /// Logarithm of how much more probable it makes the responses of the vault, predicted from all others; none without a vault, and where it
    /// has fallen before.
    pub vault_gain_nats: Option<f64>,
}

/// A sham, fitted as the law is.
#[derive(Clone, Debug)]
pub(crate) struct FittedSham {
    pub words: String,
    /// Evidence of the decays for it, times its probability beforehand, in nats.
    pub nats: f64,
}

/// Why a law is not named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    Chance,
    Sham,
    Vault,
}

impl Trial {
    /// What speaks against it.
    pub fn fault(&self) -> Option<Fault> {
        if self.family_p > MAX_FAMILY_P {
            Some(Fault::Chance)
        } else if self.sham.as_ref().is_some_and(|sham| sham.nats > self.nats - SHAM_NATS) {
            Some(Fault::Sham)
        } else {
            self.vault_gain_nats.filter(|gain| *gain <= LEAST_VAULT_NATS).map(|_| Fault::Vault)
        }
    }
}

/// Tries the chosen candidates that are laws, each beside all other causes, and opens the vault for those that stand so far: all parameters
/// are fitted to the other responses.
pub(crate) fn trials(
    search: &Search<'_>,
    state: &State,
    laws: &[usize],
    vault: &[usize],
    observer: &dyn Observer,
) -> Result<Vec<Trial>, Error> {
    if laws.is_empty() {
        return Ok(Vec::new());
    }
    let survey = search.baseline.survey();
    let grammar = Grammar::of(survey);
    let features = Features::gather(search.baseline, &grammar)?;
    let mut found = Vec::new();
    for (done, &candidate) in laws.iter().enumerate() {
        report(observer, "trials of laws", done as u64, laws.len() as u64)?;
        let own = search.candidates[candidate].formula;
        let Some(formula) = grammar.formulas.iter().position(|f| Some(*f) == own) else { continue };
        let rest: Vec<usize> = state.chosen.iter().copied().filter(|&c| c != candidate).collect();
        let without = search.state(&rest, Some(state))?;
        let cases = search.cases_of(&rest, Observable::Decay);
        let family = Family { grammar: &grammar, features: &features, from_band: 0, shams: true };
        let screen = LawScreen::of(search.baseline, family, &cases, &without.energy, &search.used)?;
        let others =
            screen.not_told_from(formula).into_iter().map(|f| grammar.subject(&grammar.formulas[f], survey));
        // Waves of one period have one name, whatever their phase.
        let mut not_told_from: Vec<String> = Vec::new();
        for other in others {
            if not_told_from.len() < MAX_LISTED && !not_told_from.contains(&other) {
                not_told_from.push(other);
            }
        }
        let ln_prior = grammar.formulas[formula].ln_prior;
        found.push(Trial {
            candidate,
            nats: state.energy.log_evidence - without.energy.log_evidence + ln_prior,
            family_p: screen.family_p(formula),
            sham: best_sham(search, (&grammar, &features, &screen), &cases, &without)?,
            not_told_from,
            vault_gain_nats: None,
        });
    }
    if vault.is_empty() || found.iter().all(|trial| trial.fault().is_some()) {
        return Ok(found);
    }
    let responses = &survey.responses;
    let gains =
        predict(search, state, &Folds::never_fitted(responses, &search.used, vault), observer)?.gains_nats;
    for trial in found.iter_mut().filter(|trial| trial.fault().is_none()) {
        let place = state.chosen.iter().position(|&c| c == trial.candidate);
        trial.vault_gain_nats = place.and_then(|place| gains.get(place).copied());
    }
    Ok(found)
}

/// The sham that does best beside other cases, among those for which the screen says most. A screen is the first step of a fit: where something
/// strong is missing, it says too little for what is right and too much for what merely has its course over time.
fn best_sham(
    search: &Search<'_>,
    (grammar, features, screen): (&Grammar, &Features, &LawScreen<'_>),
    cases: &[&Case],
    without: &State,
) -> Result<Option<FittedSham>, Error> {
    let (baseline, survey) = (search.baseline, search.baseline.survey());
    let mut best: Option<FittedSham> = None;
    for sham in screen.shams().iter().take(FITTED_SHAMS) {
        let formula = &grammar.formulas[sham.formula];
        let case =
            screen.case((features, survey), (sham.formula, Some(sham.sham)), &baseline.simulation.ends);
        let all: Vec<&Case> = cases.iter().copied().chain([&case]).collect();
        let (fit, _) = baseline.fit_energy(&all, &search.used, Some(without.before()))?;
        let nats = fit.log_evidence - without.energy.log_evidence + formula.ln_prior;
        if best.as_ref().is_none_or(|best| nats > best.nats) {
            let words = format!("{}, {}", grammar.subject(formula, survey), sham.sham.words());
            best = Some(FittedSham { words, nats });
        }
    }
    Ok(best)
}
