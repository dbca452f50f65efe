//! The hypotheses between which a measurement is to decide, as fitted to what was measured.

use crate::effect::Observable;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::CatalogueCase;
use crate::infer::search::{Search, State};
use crate::likelihood::laplace::LaplaceFit;
use crate::plan::campaign::{PARTS, is_predicted, shared_arrivals, shared_decay};
use crate::plan::error::PlanError;
use crate::plan::gaussian::Known;
use serde::{Deserialize, Serialize};

/// A cause of the catalogue, with its subject where the effect has several.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// Identifier of the effect.
    pub effect: String,
    /// What it concerns, by name: a material, a receiver ...
    #[serde(default)]
    pub subject: Option<String>,
}

impl Hypothesis {
    /// Of an effect that has one case.
    pub fn of(effect: impl Into<String>) -> Self {
        Self { effect: effect.into(), subject: None }
    }

    /// The case with this name among some; the first of the effect where no subject is asked for.
    pub(crate) fn place(&self, cases: &[CatalogueCase]) -> Option<usize> {
        let is_it = |c: &CatalogueCase| {
            c.id == self.effect && (self.subject.is_none() || c.case.subject == self.subject)
        };
        cases.iter().position(is_it)
    }
}

impl std::fmt::Display for Hypothesis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.subject {
            Some(subject) => write!(f, "{} ({subject})", self.effect),
            None => f.write_str(&self.effect),
        }
    }
}

/// What a diagnosis leaves open: causes that are sure, and those of which one is true.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct OpenQuestion {
    /// Causes that are true whatever the answer.
    pub sure: Vec<Hypothesis>,
    /// The leading hypotheses beside them.
    pub leading: Vec<Hypothesis>,
}

impl OpenQuestion {
    /// Hypotheses that are weighed at most.
    pub const MAX_LEADING: usize = 3;

    /// That of a diagnosis: `causes` and `alternatives` as it has them, and all effects with their subjects, the strongest first. Where one
    /// cause stands for a set, the question is which of the set; else whether it is the last cause or one of the strongest others.
    pub fn of_diagnosis(causes: &[Hypothesis], alternatives: &[String], ranked: &[Hypothesis]) -> Self {
        let (last, sure) = match causes.split_last() {
            Some((last, sure)) => (Some(last.clone()), sure.to_vec()),
            None => (None, Vec::new()),
        };
        let is_other = |r: &&Hypothesis| !causes.iter().any(|c| c.effect == r.effect);
        let others: Vec<Hypothesis> = ranked.iter().filter(is_other).cloned().collect();
        let in_set: Vec<Hypothesis> =
            others.iter().filter(|r| alternatives.contains(&r.effect)).cloned().collect();
        // No measurement is planned for a law that did not stand: where it is all of the set, the strongest others are asked about.
        let others = if in_set.is_empty() { others } else { in_set };
        let leading = last.into_iter().chain(others).take(Self::MAX_LEADING).collect();
        Self { sure, leading }
    }
}

/// A hypothesis as fitted: cases that a measurement elsewhere shows, by part, the values of what it shares with those made, and how well
/// these are known.
pub(crate) struct Fit {
    /// Cases (places) by part.
    pub cases: [Vec<usize>; 2],
    pub values: [Vec<f64>; 2],
    pub known: [Known; 2],
    /// Logarithm of the probability of all that was measured, in nats.
    pub log_evidence: f64,
}

/// Fits the leading hypotheses, each beside those that are sure.
pub(crate) fn fit_all(
    baseline: &Baseline,
    cases: &[CatalogueCase],
    effects: usize,
    question: &OpenQuestion,
) -> Result<Vec<Fit>, PlanError> {
    let unknown = |h: &Hypothesis| PlanError::UnknownHypothesis {
        effect: h.effect.clone(),
        subject: h.subject.clone(),
    };
    let place = |h: &Hypothesis| h.place(cases).ok_or_else(|| unknown(h));
    let sure: Vec<usize> = question.sure.iter().map(place).collect::<Result<_, _>>()?;
    let leading: Vec<usize> = question.leading.iter().map(place).collect::<Result<_, _>>()?;
    if leading.len() < 2 {
        return Err(PlanError::OneHypothesis { found: leading.len() });
    }
    if !leading.iter().any(|&c| is_predicted(&cases[c].case)) {
        let names: Vec<String> = question.leading.iter().map(ToString::to_string).collect();
        return Err(PlanError::NotPredicted { names: names.join(", ") });
    }
    let search = Search::new(baseline, cases, effects, vec![true; baseline.pairs()]);
    let base = search.state(&[], None)?;
    leading
        .into_iter()
        .map(|own| {
            let chosen: Vec<usize> = sure.iter().copied().chain([own]).collect();
            let state = search.state(&chosen, Some(&base))?;
            of_state(baseline, cases, &state)
        })
        .collect()
}

/// Keeps the cases that some hypothesis has, and nothing of the catalogue besides.
pub(crate) fn keep_used(cases: &mut Vec<CatalogueCase>, fits: &mut [Fit], question: &OpenQuestion) {
    let mut asked: Vec<usize> =
        question.sure.iter().chain(&question.leading).filter_map(|h| h.place(cases)).collect();
    asked.sort_unstable();
    asked.dedup();
    let place = |c: usize| asked.iter().filter(|&&other| other < c).count();
    for own in fits.iter_mut().flat_map(|fit| &mut fit.cases) {
        own.iter_mut().for_each(|c| *c = place(*c));
    }
    let mut number = 0..;
    cases.retain(|_| number.next().is_some_and(|c| asked.contains(&c)));
}

fn of_state(baseline: &Baseline, cases: &[CatalogueCase], state: &State) -> Result<Fit, PlanError> {
    let fits: [(&LaplaceFit, &[usize], usize); 2] = [
        (&state.energy, &state.energy_firsts, shared_decay(&baseline.decay_layout())),
        (&state.arrivals, &state.arrival_firsts, shared_arrivals(baseline)),
    ];
    let mut found = Vec::new();
    for (part, (fit, firsts, shared)) in PARTS.into_iter().zip(fits) {
        let concerned: Vec<usize> =
            state.chosen.iter().copied().filter(|&c| cases[c].case.observable().concerns(part)).collect();
        let kept: Vec<(usize, usize)> = concerned
            .iter()
            .copied()
            .zip(firsts.iter().copied())
            .filter(|(c, _)| is_predicted(&cases[*c].case))
            .collect();
        let own = kept.iter().flat_map(|&(c, first)| first..first + cases[c].case.parameters.len());
        let places: Vec<usize> = (0..shared).chain(own).collect();
        let n = places.len();
        let covariance = nalgebra::DMatrix::from_fn(n, n, |i, j| fit.covariance[(places[i], places[j])]);
        let what = if part == Observable::Decay { "decays" } else { "arrival times" };
        let known = Known::of_covariance(covariance).ok_or(crate::error::Error::Singular { what })?;
        let values: Vec<f64> = places.iter().map(|&i| fit.values[i]).collect();
        found.push((kept.into_iter().map(|(c, _)| c).collect::<Vec<usize>>(), values, known));
    }
    let [decay, arrivals] = [found.remove(0), found.remove(0)];
    Ok(Fit {
        cases: [decay.0, arrivals.0],
        values: [decay.1, arrivals.1],
        known: [decay.2, arrivals.2],
        log_evidence: state.log_evidence(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_question_of_a_set_is_which_of_it_and_of_a_name_whether_it_is_that() {
        let [a, b, c, d] = ["a", "b", "c", "d"].map(Hypothesis::of);
        let ranked = [a.clone(), b.clone(), c.clone(), d.clone()];
        let found = OpenQuestion::of_diagnosis(&[d.clone(), b.clone()], &["b".into(), "c".into()], &ranked);
        assert_eq!(found, OpenQuestion { sure: vec![d.clone()], leading: vec![b.clone(), c.clone()] });
        let with_law = ["b".into(), "unknown_law".into()];
        let beside_law = OpenQuestion::of_diagnosis(std::slice::from_ref(&b), &with_law, &ranked);
        assert_eq!(beside_law, OpenQuestion::of_diagnosis(std::slice::from_ref(&b), &[], &ranked));
        let found = OpenQuestion::of_diagnosis(std::slice::from_ref(&b), &[], &ranked);
        assert_eq!(found.leading, [b, a.clone(), c.clone()]);
        let found = OpenQuestion::of_diagnosis(&[], &[], &ranked[2..]);
        assert_eq!(found, OpenQuestion { sure: Vec::new(), leading: vec![c, d] });
    }
}
