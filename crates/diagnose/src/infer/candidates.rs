//! The cases that compete to explain the observations.

use crate::effect::{Case, Effect, Observable};
use crate::effects::Formula;
use crate::survey::Survey;
use std::borrow::Cow;

/// One case of one effect of the catalogue.
pub(crate) struct Candidate<'a> {
    pub effect: usize,
    pub id: &'a str,
    pub case: &'a Case,
    /// The formula that it is, for a law that was searched for.
    pub formula: Option<Formula>,
    /// Logarithm of how much more probable it is beforehand, because others that were weighed are not: of a formula.
    pub inherited_nats: f64,
}

/// A case with the number and identifier of its effect.
#[derive(Debug)]
pub(crate) struct CatalogueCase {
    pub effect: usize,
    pub id: Cow<'static, str>,
    pub case: Case,
    /// The formula that it is, for a law that was searched for.
    pub formula: Option<Formula>,
    /// As in [`Candidate`].
    pub inherited_nats: f64,
}

/// All cases of some effects, each with a slot for its tables.
pub(crate) fn cases(effects: &[Box<dyn Effect>], survey: &Survey) -> Vec<CatalogueCase> {
    let mut all: Vec<CatalogueCase> = Vec::new();
    for (effect, own) in effects.iter().enumerate() {
        let id = own.id();
        for mut case in own.cases(survey) {
            case.slot = Some(all.len());
            all.push(CatalogueCase { effect, id: id.clone(), case, formula: None, inherited_nats: 0.0 });
        }
    }
    all
}

/// The cases as candidates.
pub(crate) fn candidates<'a>(cases: &'a [CatalogueCase]) -> Vec<Candidate<'a>> {
    let one = |own: &'a CatalogueCase| {
        let CatalogueCase { effect, id, case, formula, inherited_nats } = own;
        Candidate { effect: *effect, id, case, formula: *formula, inherited_nats: *inherited_nats }
    };
    cases.iter().map(one).collect()
}

/// What a candidate pays for being one of many, in nats: each case of an effect is as probable beforehand as the others, and a formula as
/// probable as the grammar says, and more so where it inherits.
pub(crate) fn price(candidates: &[Candidate<'_>], candidate: usize) -> f64 {
    let own = &candidates[candidate];
    let count = || candidates.iter().filter(|c| c.effect == own.effect).count() as f64;
    own.formula.map_or_else(|| count().ln(), |formula| -formula.ln_prior - own.inherited_nats)
}

/// The chosen cases that take part in one fit, in their order.
pub(crate) fn cases_of<'a>(
    candidates: &[Candidate<'a>],
    chosen: &[usize],
    part: Observable,
) -> Vec<&'a Case> {
    chosen.iter().map(|&c| candidates[c].case).filter(|c| c.observable().concerns(part)).collect()
}

/// What a candidate would add.
#[derive(Clone, Debug)]
pub(crate) struct Score {
    pub candidate: usize,
    /// Evidence that it adds, in nats.
    pub nats: f64,
    /// Its size in units of its standard deviation, everything else left free.
    pub d_prime: f64,
}

/// The evidence of one effect: its best case, and all cases together.
#[derive(Clone, Debug)]
pub(crate) struct EffectScore {
    pub effect: usize,
    pub id: String,
    pub best: usize,
    /// Log odds against its absence, corrected for the number of cases, in nats.
    pub nats: f64,
    /// Size of the best case in units of its standard deviation.
    pub d_prime: f64,
}

/// Evidence by effect, the strongest first. An effect with many cases pays for their number, a formula for its length.
pub(crate) fn by_effect(candidates: &[Candidate<'_>], effects: usize, scores: &[Score]) -> Vec<EffectScore> {
    let mut found: Vec<EffectScore> = Vec::new();
    for effect in 0..effects {
        let own: Vec<(&Score, f64)> = scores
            .iter()
            .filter(|s| candidates[s.candidate].effect == effect)
            .map(|s| (s, s.nats - price(candidates, s.candidate)))
            .collect();
        let Some((best, most)) = own.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        let sum: f64 = own.iter().map(|(_, nats)| (nats - most).exp()).sum();
        found.push(EffectScore {
            effect,
            id: candidates[best.candidate].id.to_owned(),
            best: best.candidate,
            nats: most + sum.ln(),
            d_prime: best.d_prime,
        });
    }
    found.sort_by(|a, b| b.nats.total_cmp(&a.nats));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{PositionError, TimeZeroOffset};
    use crate::hand_made;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn an_effect_with_many_cases_pays_for_their_number() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(PositionError), Box::new(TimeZeroOffset)];
        let all = cases(&effects, &survey);
        let candidates = candidates(&all);
        // One source and three receivers; one latency.
        assert_eq!(candidates.len(), 5);
        let scored = |nats: [f64; 5]| {
            let one = |(candidate, nats): (usize, f64)| Score { candidate, nats, d_prime: 1.0 };
            by_effect(&candidates, 2, &nats.into_iter().enumerate().map(one).collect::<Vec<_>>())
        };
        let found = scored([0.0, 10.0, -200.0, -200.0, 9.0]);
        // 10 nats over one of four places are less than 9 nats over none.
        assert_eq!(found[0].id, "time_zero");
        assert!((found[1].nats - (10.0 - 4f64.ln())).abs() < 1e-3 && found[1].best == 1);
        // Four places that explain as much as each other are four times as probable as one.
        let found = scored([10.0, 10.0, 10.0, 10.0, 9.0]);
        assert!(found[0].id == "position_error" && (found[0].nats - 10.0).abs() < 1e-9);
    }

    #[test]
    fn cases_take_part_in_the_fits_that_they_bear_on() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let effects = crate::effects::catalogue();
        let all = cases(&effects, &survey);
        let candidates = candidates(&all);
        let chosen: Vec<usize> = (0..candidates.len()).collect();
        let [decays, arrivals] =
            [Observable::Decay, Observable::Arrivals].map(|part| cases_of(&candidates, &chosen, part).len());
        let both = candidates.iter().filter(|c| c.case.observable() == Observable::Channels).count();
        let neither = candidates.iter().filter(|c| c.case.observable() == Observable::PreArrival).count();
        assert!(both > 0 && decays + arrivals - both + neither == candidates.len());
    }
}
