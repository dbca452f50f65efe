//! The search for causes, one name after the other.

use crate::effect::{Case, DecayTerm, Observable};
use crate::error::Error;
use crate::extend::extension::changes;
use crate::extend::model_change::ModelChange;
use crate::infer::arrival_fits::ArrivalFits;
use crate::infer::baseline::{self, Baseline};
use crate::infer::candidates::{CatalogueCase, candidates, price};
use crate::infer::ranking::{Ranking, probability_of_first, rank};
use crate::infer::search::Search;
use crate::infer::selection::Selection;
use sabine_acoustics::Observer;
use std::sync::Arc;

/// Expansions about the fit with one cause more, at most.
const ROUNDS: usize = 4;

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
        let mut ranking = {
            let search = Search::new(baseline, cases, effects, used.to_vec()).knowing(arrival_fits);
            rank(&search, cases, &named, open, observer)?
        };
        if follows_materials(cases, &named.chosen) {
            let compared = ranking.to_be_compared(cases);
            let found =
                where_each_fits(baseline, cases, effects, (&named.chosen, &compared), (used, arrival_fits))?;
            ranking.weigh_again(cases, &found);
        }
        let Ranking { ranked, rivals, interchangeable, threshold, .. } = ranking;
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

/// Whether a cause predicts something else about other materials (sums of pressures do).
fn follows_materials(cases: &[CatalogueCase], chosen: &[usize]) -> bool {
    chosen.iter().any(|&c| cases[c].case.decay_term().is_some_and(DecayTerm::depends_on_expansion))
}

/// Evidence of several cases beside what is named less what each pays, the most first, each with the materials that it asks for: beside a cause
/// that follows materials all but the right one would else be judged by what it predicts about wrong ones. One alone is not compared.
fn where_each_fits(
    baseline: &mut Baseline,
    cases: &[CatalogueCase],
    effects: usize,
    (named, compared): (&[usize], &[usize]),
    fits: (&[bool], &Arc<ArrivalFits>),
) -> Result<Vec<(usize, f64)>, Error> {
    let mut found: Vec<(usize, f64)> = Vec::new();
    if compared.len() < 2 {
        return Ok(found);
    }
    let absorption = baseline.simulation.absorption.clone();
    // Evidence can be compared in the same bins alone.
    let ends = baseline.ends_above_modes().unwrap_or_else(|| baseline.simulation.ends.clone());
    for &candidate in compared {
        let chosen = [named, &[candidate]].concat();
        expand_about_fit(baseline, cases, effects, &chosen, fits)?;
        let evidence = baseline.evidence_within(&ends, &cases_of_decays(cases, &chosen), fits.0, None)?;
        found.push((candidate, evidence - price(&candidates(cases), candidate)));
        baseline.simulation.absorption.clone_from(&absorption);
        baseline.expand(cases, &[named, compared].concat())?;
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    Ok(found)
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

/// Beside a named cause the materials are others: what is compared, and with which spread, follows them. Expands about their fit, where a
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::Effect;
    use crate::effects::{PositionError, SurfaceAbsorption, TimeZeroOffset};
    use crate::hand_made::Tables;
    use crate::infer::candidates::cases;
    use sabine_scene::{Levels, TimeZero};

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
