//! What the data speak for beside what is named, in order.

use super::selection::{Open, Selection, is_of_decays};
use crate::effect::Observable;
use crate::error::Error;
use crate::extend::extension::changes;
use crate::extend::model_change::ModelChange;
use crate::infer::candidates::{CatalogueCase, EffectScore, Score};
use crate::infer::search::{RIVAL_NATS, Search, State};
use sabine_acoustics::Observer;

/// Cases of one effect that are compared each with the materials that it asks for, at most, and as many rivals: each takes up to so many
/// expansions.
const MOST_COMPARED: usize = 4;

/// What the data speak for beside what is named.
pub(super) struct Ranking {
    /// The best case of each effect, the one to be named first.
    pub ranked: Vec<EffectScore>,
    /// Effects that explain as much as the first.
    pub rivals: Vec<EffectScore>,
    /// Cases of the first effect that explain as much as the best.
    pub interchangeable: Vec<usize>,
    /// Cases of the first effect that would each be worth a name, the best first.
    near: Vec<usize>,
    /// What a name asks for.
    pub threshold: f64,
}

impl Ranking {
    /// Cases that explain as much about the same materials, and need not about their own: those of the first effect, and rivals that bear on decays
    /// alone.
    pub fn to_be_compared(&self, cases: &[CatalogueCase]) -> Vec<usize> {
        if self.near.is_empty() {
            return Vec::new();
        }
        let rivals = self.rivals.iter().map(|r| r.best).filter(|&c| is_of_decays(cases, c));
        self.near.iter().copied().chain(rivals.take(MOST_COMPARED)).collect()
    }

    /// Puts first what explains most of those that were compared (with their evidence, the most first), and beside it what explains as much.
    pub fn weigh_again(&mut self, cases: &[CatalogueCase], found: &[(usize, f64)]) {
        let Some(&(best, most)) = found.first() else { return };
        let strongest = self.ranked[0].nats;
        let as_good = |&&(_, nats): &&(usize, f64)| most - nats < RIVAL_NATS;
        let behind: Vec<usize> = found[1..].iter().filter(as_good).map(|(c, _)| *c).collect();
        let place = self.ranked.iter().position(|r| r.effect == cases[best].effect).unwrap_or(0);
        let mut first = self.ranked.remove(place);
        first.best = best;
        self.ranked.insert(0, first);
        // The one for which most speaks has what was said for the first about the same materials; others have so much less.
        for (candidate, nats) in found.iter().rev() {
            if let Some(own) = self.ranked.iter_mut().find(|r| r.effect == cases[*candidate].effect) {
                own.nats = strongest - (most - nats);
            }
        }
        let was_compared = |effect: usize| found.iter().any(|(c, _)| cases[*c].effect == effect);
        let rivals = |effect: usize| behind.iter().any(|&c| cases[c].effect == effect);
        let others = self.rivals.iter().filter(|r| !was_compared(r.effect)).cloned();
        self.rivals = self.ranked[1..].iter().filter(|r| rivals(r.effect)).cloned().chain(others).collect();
        self.interchangeable =
            behind.into_iter().filter(|&c| cases[c].effect == cases[best].effect).collect();
    }
}

pub(super) fn rank(
    search: &Search<'_>,
    cases: &[CatalogueCase],
    named: &Selection,
    open: Open,
    observer: &dyn Observer,
) -> Result<Ranking, Error> {
    let base = search.state(&[], None)?;
    let state = search.state(&named.chosen, Some(&base))?;
    let mut scores = search.scores(&state, observer)?;
    // What a cause stands for as well is not named beside it.
    scores.retain(|s| named.interchangeable.iter().all(|(_, others)| !others.contains(&s.candidate)));
    scores.retain(|s| named.without.iter().all(|&w| cases[w].effect != cases[s.candidate].effect));
    scores.retain(|s| if is_of_decays(cases, s.candidate) { open.decays } else { open.others });
    let mut ranked: Vec<EffectScore> = search
        .by_effect(&scores)
        .into_iter()
        .filter(|s| {
            named.chosen.iter().all(|&c| {
                search.candidates[c].effect != s.effect || search.candidates[c].case.subject.is_some()
            })
        })
        .collect();
    let threshold = search.threshold();
    put_first_what_moves_paths(search, &state, &mut ranked)?;
    let named_now = ranked.first().is_some_and(|best| best.nats >= threshold);
    let (mut rivals, mut interchangeable, mut near) = (Vec::new(), Vec::new(), Vec::new());
    if named_now {
        near = worth_a_name(search, &scores, &ranked[0]);
        (ranked[0], interchangeable) = search.best_case(&state, &scores, &ranked[0])?;
        rivals = search.rivals(&state, &ranked)?;
    }
    Ok(Ranking { ranked, rivals, interchangeable, near, threshold })
}

/// Of the first of ranked effects, among all that compete with it and none of them (`nothing_nats`).
pub(super) fn probability_of_first(
    ranked: &[EffectScore],
    nothing_nats: f64,
    cases: &[CatalogueCase],
) -> f64 {
    let best = &ranked[0];
    let strongest = best.nats.max(0.0);
    // One that was put first competes with those that bear on the same data.
    let of_decays = |r: &EffectScore| is_of_decays(cases, r.best);
    let competes = |r: &&EffectScore| of_decays(best) || !of_decays(r) || r.nats <= best.nats;
    let sum: f64 = ranked.iter().filter(competes).map(|r| (r.nats - strongest).exp()).sum::<f64>()
        + (nothing_nats - strongest).exp();
    (best.nats - strongest).exp() / sum
}

/// Cases of an effect that bear on decays alone and each would be worth a name, the best first.
fn worth_a_name(search: &Search<'_>, scores: &[Score], effect: &EffectScore) -> Vec<usize> {
    let least = search.threshold() + search.price(effect.best);
    let mut own: Vec<&Score> = scores
        .iter()
        .filter(|s| search.candidates[s.candidate].effect == effect.effect && s.nats >= least)
        .filter(|s| search.candidates[s.candidate].case.observable() == Observable::Decay)
        .collect();
    own.sort_by(|a, b| b.nats.total_cmp(&a.nats));
    own.iter().take(MOST_COMPARED).map(|s| s.candidate).collect()
}

/// Puts a cause that moves paths before those of decays alone, if it is worth a name by arrival times. Arrival times do not depend on what
/// decays; decays are predicted along the paths, and in a room whose walls stand elsewhere they speak for causes that are none.
fn put_first_what_moves_paths(
    search: &Search<'_>,
    state: &State,
    ranked: &mut Vec<EffectScore>,
) -> Result<(), Error> {
    let observable = |r: &EffectScore| search.candidates[r.best].case.observable();
    let Some(place) = ranked.iter().position(|r| observable(r) != Observable::Decay) else { return Ok(()) };
    let first = &ranked[place];
    if place == 0 || first.nats < search.threshold() || observable(first) != Observable::Arrivals {
        return Ok(());
    }
    let with_it = search.with(state, first.best)?;
    if changes(search, &with_it, first.best).iter().any(ModelChange::moves_paths) {
        let first = ranked.remove(place);
        ranked.insert(0, first);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::effects::{AirAbsorption, Scattering, SurfaceAbsorption};
    use crate::hand_made;
    use crate::infer::candidates::cases;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn what_each_says_about_its_own_materials_decides() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let effects: Vec<Box<dyn Effect>> =
            vec![Box::new(SurfaceAbsorption), Box::new(AirAbsorption), Box::new(Scattering)];
        let cases = cases(&effects, &survey);
        let of = |effect: usize| -> Vec<usize> {
            (0..cases.len()).filter(|&c| cases[c].effect == effect).collect()
        };
        let (materials, air, scattering) = (of(0), of(1)[0], of(2)[0]);
        let score = |effect: usize, best: usize, nats: f64| {
            let id = cases[best].id.to_string();
            EffectScore { effect, id, best, nats, d_prime: 1.0 }
        };
        let ranking = || Ranking {
            ranked: vec![score(0, materials[0], 30.0), score(1, air, 28.0), score(2, scattering, 27.0)],
            rivals: vec![score(1, air, 28.0), score(2, scattering, 27.0)],
            interchangeable: vec![materials[1]],
            near: vec![materials[0], materials[1]],
            threshold: 6.0,
        };
        assert_eq!(ranking().to_be_compared(&cases), [materials[0], materials[1], air, scattering]);

        // The second material, and air as well as it; the first and scattering fall behind.
        let mut weighed = ranking();
        let found = [(materials[1], 110.0), (air, 109.0), (materials[0], 90.0), (scattering, 80.0)];
        weighed.weigh_again(&cases, &found);
        assert_eq!((weighed.ranked[0].best, weighed.ranked[0].nats), (materials[1], 30.0));
        assert!(weighed.interchangeable.is_empty());
        assert_eq!(weighed.rivals.iter().map(|r| (r.best, r.nats)).collect::<Vec<_>>(), [(air, 29.0)]);

        // Another effect than the one that led; both materials fall behind.
        let mut weighed = ranking();
        let found = [(air, 110.0), (materials[0], 104.0), (materials[1], 103.0), (scattering, 80.0)];
        weighed.weigh_again(&cases, &found);
        assert_eq!((weighed.ranked[0].best, weighed.ranked[0].nats), (air, 30.0));
        let own = weighed.ranked.iter().find(|r| r.effect == 0).expect("it stays in the ranking");
        assert_eq!((own.best, own.nats), (materials[0], 24.0));
        assert!(weighed.rivals.is_empty() && weighed.interchangeable.is_empty());
    }
}
