//! The search for causes, one name after the other.

use crate::effect::{Case, DecayTerm, Observable};
use crate::error::Error;
use crate::extend::extension::changes;
use crate::extend::model_change::ModelChange;
use crate::infer::arrival_fits::ArrivalFits;
use crate::infer::baseline::{self, Baseline};
use crate::infer::candidates::{CatalogueCase, EffectScore, Score};
use crate::infer::ray_dependence::MoreWithHalf;
use crate::infer::search::{RIVAL_NATS, Search, State};
use sabine_acoustics::Observer;
use std::sync::Arc;

/// Expansions about the fit with one cause more, at most.
const ROUNDS: usize = 4;
/// Cases of one effect that are compared each with the materials that it asks for, at most: each takes up to so many expansions.
const MOST_COMPARED: usize = 4;

/// What the search found.
#[derive(Default)]
pub(crate) struct Selection {
    pub chosen: Vec<usize>,
    /// Those of them that were given, and not found.
    given: Vec<usize>,
    probabilities: Vec<(usize, f64)>,
    /// The last cause and those that explain as much: a set.
    pub rivals: Vec<String>,
    /// All effects beside the baseline, and beside the causes that were given.
    pub first: Vec<EffectScore>,
    /// Causes at the end of the search, and all other effects beside them, where none of these was worth a name.
    pub last: Option<(Vec<usize>, Vec<EffectScore>)>,
    /// Effects of these candidates are named no more: they did not help at positions left out.
    pub without: Vec<usize>,
    /// What half of the rays say more for a cause.
    pub more_with_half: Vec<MoreWithHalf>,
    /// Each cause, and cases of the same effect that explained as much when it was named.
    interchangeable: Vec<(usize, Vec<usize>)>,
}

impl Selection {
    /// Takes a name back, and the set that it stands for.
    pub fn drop(&mut self, candidate: usize) {
        if self.chosen.last() == Some(&candidate) {
            self.rivals.clear();
        }
        self.chosen.retain(|&c| c != candidate);
    }

    /// Of which observables more causes may be named: so many of decays (`most`), and as many of all others, for these speak of other data.
    pub fn open(&self, cases: &[CatalogueCase], most: usize) -> Open {
        let found = || self.chosen.iter().filter(|c| !self.given.contains(c));
        let of_decays = found().filter(|&&c| is_of_decays(cases, c)).count();
        Open { decays: of_decays < most, others: found().count() - of_decays < most }
    }

    pub fn probability(&self, candidate: usize) -> f64 {
        self.probabilities.iter().find(|p| p.0 == candidate).map_or(0.0, |p| p.1)
    }

    /// Cases of the same effect that explained as much as a cause when it was named.
    pub fn interchangeable(&self, candidate: usize) -> &[usize] {
        self.interchangeable.iter().find(|i| i.0 == candidate).map_or(&[], |i| &i.1)
    }
}

/// Whether more causes may be named that bear on decays alone, and others.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Open {
    pub decays: bool,
    pub others: bool,
}

fn is_of_decays(cases: &[CatalogueCase], candidate: usize) -> bool {
    cases[candidate].case.observable() == Observable::Decay
}

/// Puts causes that are given to work, one after the other, as if each had been named; their probabilities are those against their absence.
pub(crate) fn give(
    baseline: &mut Baseline,
    cases: &[CatalogueCase],
    effects: usize,
    (used, arrival_fits): (&[bool], &Arc<ArrivalFits>),
    given: &[usize],
) -> Result<Selection, Error> {
    let mut named = Selection::default();
    for &candidate in given {
        baseline.prepare_rest(cases)?;
        let odds = {
            let search = Search::new(baseline, cases, effects, used.to_vec()).knowing(arrival_fits);
            let without = search.state(&named.chosen, None)?;
            let with = search.with(&without, candidate)?;
            let nats = with.log_evidence() - without.log_evidence() - search.price(candidate);
            nats - (search.threshold() - baseline.config.naming_nats)
        };
        named.probabilities.push((candidate, 1.0 / (1.0 + (-odds).exp())));
        named.chosen.push(candidate);
        named.given.push(candidate);
        put_to_work(baseline, cases, effects, &named.chosen, (used, arrival_fits))?;
    }
    Ok(named)
}

/// Greedy naming beside what is named already, the scatter estimated again after each name, and a backward check. A set of causes that cannot be
/// told apart ends it, but for one that moves paths: causes of decays are then named before it.
pub(crate) fn select(
    baseline: &mut Baseline,
    cases: &[CatalogueCase],
    effects: usize,
    (used, arrival_fits): (&[bool], &Arc<ArrivalFits>),
    mut named: Selection,
    observer: &dyn Observer,
) -> Result<Selection, Error> {
    // The cause that stands for a set of those that move paths.
    let mut stands_for_set: Option<usize> = None;
    loop {
        let mut open = named.open(cases, baseline.config.most_causes);
        // Whichever of a set moves the paths, decays say the same of what they alone tell.
        open.others &= stands_for_set.is_none();
        if !open.decays && !open.others {
            break;
        }
        baseline.prepare_rest(cases)?;
        let Ranking { mut ranked, rivals, mut interchangeable, near, threshold } = {
            let search = Search::new(baseline, cases, effects, used.to_vec()).knowing(arrival_fits);
            rank(&search, cases, &named, open, observer)?
        };
        if near.len() > 1 && follows_materials(cases, &named.chosen) {
            (ranked[0].best, interchangeable) =
                best_where_each_fits(baseline, cases, effects, (&named.chosen, &near), (used, arrival_fits))?;
        }
        if named.first.is_empty() {
            named.first.clone_from(&ranked);
            named.first.sort_by(|a, b| b.nats.total_cmp(&a.nats));
        }
        // A second set beside the first has no name: which of one it is may hang on which of the other.
        let second_set = stands_for_set.is_some() && !rivals.is_empty();
        let Some(best) = ranked.first().filter(|b| b.nats >= threshold && !second_set) else {
            let all_were_weighed = open.decays && open.others;
            named.last = all_were_weighed.then(|| (named.chosen.clone(), ranked));
            break;
        };
        let nothing_nats = threshold - baseline.config.naming_nats;
        named.probabilities.push((best.best, probability_of_first(&ranked, nothing_nats, cases)));
        named.chosen.push(best.best);
        named.interchangeable.push((best.best, interchangeable));
        if !rivals.is_empty() {
            named.rivals = std::iter::once(best).chain(&rivals).map(|r| r.id.clone()).collect();
            if cases[best.best].case.observable() != Observable::Arrivals {
                break;
            }
            stands_for_set = Some(best.best);
        }
        put_to_work(baseline, cases, effects, &named.chosen, (used, arrival_fits))?;
    }
    if let Some(last) = stands_for_set {
        named.chosen.retain(|&c| c != last);
        named.chosen.push(last);
    }
    baseline.prepare_rest(cases)?;
    let search = Search::new(baseline, cases, effects, used.to_vec()).knowing(arrival_fits);
    let state = search.backward(search.state(&named.chosen, None)?)?;
    if named.chosen.last() != state.chosen.last() {
        // The set stands for a cause that has turned out to be superfluous.
        named.rivals.clear();
    }
    named.chosen = state.chosen;
    Ok(named)
}

/// What the data speak for beside what is named.
struct Ranking {
    /// The best case of each effect, the one to be named first.
    ranked: Vec<EffectScore>,
    /// Effects that explain as much as the first.
    rivals: Vec<EffectScore>,
    /// Cases of the first effect that explain as much as the best.
    interchangeable: Vec<usize>,
    /// Cases of the first effect that would each be worth a name, the best first.
    near: Vec<usize>,
    /// What a name asks for.
    threshold: f64,
}

fn rank(
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
fn probability_of_first(ranked: &[EffectScore], nothing_nats: f64, cases: &[CatalogueCase]) -> f64 {
    let best = &ranked[0];
    let strongest = best.nats.max(0.0);
    // One that was put first competes with those that bear on the same data.
    let of_decays = |r: &EffectScore| is_of_decays(cases, r.best);
    let competes = |r: &&EffectScore| of_decays(best) || !of_decays(r) || r.nats <= best.nats;
    let sum: f64 = ranked.iter().filter(competes).map(|r| (r.nats - strongest).exp()).sum::<f64>()
        + (nothing_nats - strongest).exp();
    (best.nats - strongest).exp() / sum
}

/// Whether a cause predicts something else about other materials (sums of pressures do).
fn follows_materials(cases: &[CatalogueCase], chosen: &[usize]) -> bool {
    chosen.iter().any(|&c| cases[c].case.decay_term().is_some_and(DecayTerm::depends_on_expansion))
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

/// The best of several cases of one effect beside what is named, and those that explain as much, each with the materials that it asks for:
/// beside a cause that follows materials all but the right one would else be judged by what it predicts about wrong ones.
fn best_where_each_fits(
    baseline: &mut Baseline,
    cases: &[CatalogueCase],
    effects: usize,
    (named, near): (&[usize], &[usize]),
    fits: (&[bool], &Arc<ArrivalFits>),
) -> Result<(usize, Vec<usize>), Error> {
    let absorption = baseline.simulation.absorption.clone();
    // Evidence can be compared in the same bins alone.
    let ends = baseline.ends_above_modes().unwrap_or_else(|| baseline.simulation.ends.clone());
    let mut found: Vec<(usize, f64)> = Vec::new();
    for &candidate in near {
        let chosen = [named, &[candidate]].concat();
        expand_about_fit(baseline, cases, effects, &chosen, fits)?;
        found.push((
            candidate,
            baseline.evidence_within(&ends, &cases_of_decays(cases, &chosen), fits.0, None)?,
        ));
        baseline.simulation.absorption.clone_from(&absorption);
        baseline.expand(cases, &[named, near].concat())?;
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let (best, most) = found[0];
    let as_good = |(_, nats): &&(usize, f64)| most - nats < RIVAL_NATS;
    Ok((best, found[1..].iter().filter(as_good).map(|(candidate, _)| *candidate).collect()))
}

fn cases_of_decays<'c>(cases: &'c [CatalogueCase], chosen: &[usize]) -> Vec<&'c Case> {
    chosen.iter().map(|&c| &cases[c].case).filter(|c| c.observable().concerns(Observable::Decay)).collect()
}

/// Takes the cause named last into paths, expansion and scatter.
fn put_to_work(
    baseline: &mut Baseline,
    cases: &[CatalogueCase],
    effects: usize,
    chosen: &[usize],
    fits: (&[bool], &Arc<ArrivalFits>),
) -> Result<(), Error> {
    for change in &expand_about_fit(baseline, cases, effects, chosen, fits)? {
        baseline.retrace(change, cases, chosen)?;
    }
    baseline.calibrate_scatter(&cases_of_decays(cases, chosen), fits.0)
}

/// With a cause at work the materials are others: what is compared, and with which spread, follows them. Expands about their fit, where a
/// cause's tables ask for it until it stays or explains less than before, and gives the changes of the cause named last.
fn expand_about_fit(
    baseline: &mut Baseline,
    cases: &[CatalogueCase],
    effects: usize,
    chosen: &[usize],
    (used, arrival_fits): (&[bool], &Arc<ArrivalFits>),
) -> Result<Vec<ModelChange>, Error> {
    let Some(&last) = chosen.last() else { return Ok(Vec::new()) };
    let again = follows_materials(cases, chosen);
    // Of the expansion before: evidence, absorption, changes.
    let mut before: Option<(f64, Vec<Vec<f64>>, Vec<ModelChange>)> = None;
    let mut round = 0;
    loop {
        let (changes, evidence, fitted) = {
            let search = Search::new(baseline, cases, effects, used.to_vec()).knowing(arrival_fits);
            let state = search.state(chosen, None)?;
            (changes(&search, &state, last), state.log_evidence(), state.energy.values)
        };
        if !cases[last].case.observable().concerns(Observable::Decay) {
            return Ok(changes);
        }
        if let Some((_, absorption, changes)) = before.take_if(|(most, ..)| evidence < *most) {
            baseline.simulation.absorption = absorption;
            baseline.expand(cases, chosen)?;
            return Ok(changes);
        }
        if round == ROUNDS {
            return Ok(changes);
        }
        // The first fit stands far from its expansion: its evidence is no measure.
        if round > 0 {
            before = Some((evidence, baseline.simulation.absorption.clone(), changes.clone()));
        }
        // Where a whole step overshoots to and fro, half of it does not.
        let share = if round == 0 { 1.0 } else { 0.5 };
        let moved = baseline.expand_towards((&fitted, share), cases, chosen)?;
        if !again || moved < baseline::TOLERANCE {
            return Ok(changes);
        }
        round += 1;
    }
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
    use crate::config::DiagnoseConfig;
    use crate::effect::Effect;
    use crate::effects::{PositionError, SurfaceAbsorption, TimeZeroOffset};
    use crate::hand_made::Tables;
    use crate::infer::candidates::cases;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn a_set_falls_with_the_cause_that_stands_for_it_and_with_no_other() {
        let all = || Selection {
            chosen: vec![4, 7],
            rivals: vec!["a".to_owned(), "b".to_owned()],
            ..Selection::default()
        };
        let mut without_last = all();
        without_last.drop(7);
        assert!(without_last.chosen == [4] && without_last.rivals.is_empty());
        let mut without_first = all();
        without_first.drop(4);
        assert!(without_first.chosen == [7] && without_first.rivals == ["a", "b"]);
    }

    /// Names among few effects in rooms made by hand.
    fn named(tables: Tables) -> (Vec<(String, Option<String>)>, Selection) {
        let mut baseline = tables.baseline(DiagnoseConfig::default());
        let effects: Vec<Box<dyn Effect>> =
            vec![Box::new(PositionError), Box::new(TimeZeroOffset), Box::new(SurfaceAbsorption)];
        let cases = cases(&effects, baseline.survey());
        let used = vec![true; baseline.pairs()];
        let found =
            select(&mut baseline, &cases, effects.len(), (&used, &Arc::default()), Selection::default(), &())
                .expect("fits");
        let chosen =
            found.chosen.iter().map(|&c| (cases[c].id.to_string(), cases[c].case.subject.clone())).collect();
        (chosen, found)
    }

    #[test]
    fn what_moves_all_responses_is_named_a_latency_and_nothing_is_named_where_nothing_moves() {
        let tables = || Tables::new(Levels::Common, TimeZero::Emission);
        let (names, found) = named(tables());
        assert!(names.is_empty() && found.first.len() == 3, "{names:?}");
        let (names, found) = named(tables().late(3e-3));
        assert_eq!(names, [("time_zero".to_owned(), None)]);
        assert!(found.probability(found.chosen[0]) > 0.95);
    }
}
