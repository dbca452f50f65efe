//! Which of the causes found stand: those that help where they were not fitted, and that beat the discrepancy without a name.

use crate::effect::{Effect, Nuisance, Observable, Parameter};
use crate::effects::RoomModes;
use crate::error::Error;
use crate::extend::extension::changes;
use crate::extend::model_change::ModelChange;
use crate::infer::candidates::Candidate;
use crate::infer::cross_validation::{Folds, Predicted, predict};
use crate::infer::lack_of_fit::{self, Lack};
use crate::infer::law_search::best::{BestFormula, Formulas};
use crate::infer::ray_dependence::{owed_nats, unsettled};
use crate::infer::search::{RIVAL_NATS, Search, State};
use crate::infer::selection::Selection;
use crate::likelihood::decay::WarmStart;
use crate::report::diagnosis::{RayDependence, Verdict};
use sabine_acoustics::{Observer, report};
use web_time::Instant;

/// Evidence by which the unnamed discrepancy must beat all named causes to unseat them, in nats.
const UNNAMED_MARGIN_NATS: f64 = 5.0;
/// A cause helps if it brings the error of decay curves at positions left out below this share of what it was.
const MAX_RMSE_RATIO: f64 = 0.97;
/// What octaves above the Schroeder frequency must say for a cause, in nats.
const LEAST_ABOVE_MODES_NATS: f64 = 1.0;
/// Causes of decays must weigh up what is left if chance makes as much with a lower probability than this ...
const NO_CHANCE: f64 = 1e-3;
/// ... their evidence being so many times its negative logarithm. A choice: of 75 rooms of another program and our own that were looked at,
/// names that were false had 0.7 and 1.4 times as much, and right ones 70 and more (docs/validation/diagnose.md).
const OUTWEIGHS: f64 = 2.0;
/// Dispersion from which nothing is named: measured variance over that expected, causes and smooth discrepancy taken out.
const MAX_DISPERSION: f64 = 100.0;

/// Why a cause for which the data speak is not named.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Doubt {
    /// Only octaves below the Schroeder frequency speak for it.
    Modes,
    /// Other rays do not confirm it.
    Rays(RayDependence),
    /// It does not help at positions left out.
    Elsewhere,
    /// More speaks against the fit with it than for it.
    Misfit,
    /// It says that tables are uncertain, and not they speak for it but the decays.
    Decays,
}

/// What is left of a selection, and why.
pub(crate) struct Confirmation {
    /// Without any cause.
    pub base: State,
    /// With the causes that stand.
    pub state: State,
    pub predicted: Predicted,
    pub lack_before: Lack,
    pub lack_after: Lack,
    pub verdict: Verdict,
    /// Whether bins scatter so far that no name can be trusted.
    pub hopeless: bool,
    /// Whether decays are predicted without the sound that a cause adds.
    pub without_added: bool,
    /// Causes that the discrepancy without a name beats.
    pub unseated: Vec<String>,
    /// Causes that were dropped, and why.
    pub dropped: Vec<(usize, Doubt)>,
    pub predicting_s: f64,
    pub testing_s: f64,
}

impl Confirmation {
    /// Whether a law is worth a search, which holds where the baseline meets the data well enough for a name to be trusted, and decays are
    /// predicted with all sound that causes add: chance does not explain what is left, whether causes stand or none; or a formula would
    /// explain the decays as well as all causes that stand, or what they leave, and by chance none would. `significance` and `naming_nats`
    /// are those of the configuration.
    pub fn calls_for_laws(&self, significance: f64, naming_nats: f64) -> bool {
        if self.hopeless || self.without_added {
            return false;
        }
        match self.verdict {
            Verdict::Adequate => return false,
            Verdict::Unexplained | Verdict::Incomplete => return true,
            _ => {}
        }
        let by_causes = self.state.energy.log_evidence - self.base.energy.log_evidence;
        let formulas = [self.lack_before.formula, self.lack_after.formula];
        rivals_causes(formulas, by_causes, (significance, naming_nats))
    }
}

/// Whether the best formula beside the baseline explains the decays as well as causes do (`by_causes`, in nats), or the best beside them (the
/// second) what they leave.
fn rivals_causes(
    formulas: [Option<BestFormula>; 2],
    by_causes: f64,
    (significance, naming_nats): (f64, f64),
) -> bool {
    let speaks = |best: BestFormula| best.p_value < significance && best.nats > naming_nats;
    let [instead, beside] = formulas.map(|best| best.filter(|best| speaks(*best)));
    instead.is_some_and(|best| best.nats > by_causes - RIVAL_NATS) || beside.is_some()
}

/// Tests the fit, drops causes that do not help at positions left out, and decides on the verdict.
pub(crate) fn confirm(
    search: &Search<'_>,
    found: &mut Selection,
    held: &[usize],
    observer: &dyn Observer,
) -> Result<Confirmation, Error> {
    let (baseline, config) = (search.baseline, &search.baseline.config);
    let started = Instant::now();
    let base = search.state(&[], None)?;
    // From the baseline another top may be reached than the search did: what then explains nothing is no cause.
    let mut state = search.backward(search.state(&found.chosen, Some(&base))?)?;
    for dropped in found.chosen.clone().into_iter().filter(|c| !state.chosen.contains(c)) {
        found.drop(dropped);
    }
    // Receivers that are held out have no say in what is named: causes are confirmed among the others.
    let in_turn = Folds::in_turn(&baseline.survey().responses, &search.used);
    let mut predicted = predict(search, &state, &in_turn, observer)?;
    let predicting_s = started.elapsed().as_secs_f64();

    let started = Instant::now();
    report(observer, "lack of fit", 0, 2)?;
    let formulas = (!baseline.observations.are_tables()).then(|| Formulas::of(baseline)).transpose()?;
    let formulas = formulas.as_ref();
    let lack_before = lack_of_fit::test(search, &base, formulas)?;
    report(observer, "lack of fit", 1, 2)?;
    let mut dropped = Vec::new();
    let lack_after = loop {
        let doubt = doubtful(search, &state, found, &predicted)?;
        let lack = if doubt.is_none() { lack_of(search, &state, formulas)? } else { None };
        let outweighed =
            lack.as_ref().map(|lack| outweighed(search, &state, found, lack)).transpose()?.flatten();
        let doubt = doubt.or(outweighed.map(|worst| (worst, Doubt::Misfit)));
        let Some((worst, doubt)) = doubt else { break lack };
        dropped.push((worst, doubt));
        found.drop(worst);
        // What was worth a name beside it need not be without it.
        state = search.backward(search.state(&found.chosen, Some(&base))?)?;
        for hanger_on in found.chosen.clone().into_iter().filter(|c| !state.chosen.contains(c)) {
            found.drop(hanger_on);
        }
        predicted = predict(search, &state, &in_turn, observer)?;
    };
    // Where bins scatter a hundred times as far as they may, the baseline itself has not been met: no name can be trusted.
    let hopeless = baseline.dispersion.iter().any(|d| *d > MAX_DISPERSION);
    let without_added = adds_unpredicted_sound(search, &state);
    let misfit_left = lack_after.as_ref().is_some_and(|lack| lack.p_value < config.significance);
    let verdict = if hopeless || is_beaten(search, &base, &state, &lack_before) {
        Verdict::Unexplained
    } else if state.chosen.is_empty() {
        if lack_before.p_value < config.significance { Verdict::Unexplained } else { Verdict::Adequate }
    } else {
        of_causes(search, (found, &state, &predicted), misfit_left && !without_added)
    };
    let mut unseated: Vec<String> = Vec::new();
    if verdict == Verdict::Unexplained && !state.chosen.is_empty() {
        unseated = state.chosen.iter().map(|&c| search.candidates[c].id.to_owned()).collect();
        state = base.clone();
        predicted = predict(search, &state, &in_turn, observer)?;
    }
    if !held.is_empty() {
        predicted = predict(
            search,
            &state,
            &Folds::never_fitted(&baseline.survey().responses, &search.used, held),
            observer,
        )?;
    }
    Ok(Confirmation {
        base,
        state,
        predicted,
        lack_after: lack_after.unwrap_or_else(|| lack_before.clone()),
        lack_before,
        verdict,
        hopeless,
        without_added,
        unseated,
        dropped,
        predicting_s,
        testing_s: started.elapsed().as_secs_f64(),
    })
}

/// The verdict on causes that stand, given whether they leave what neither chance nor they explain.
fn of_causes(
    search: &Search<'_>,
    (found, state, predicted): (&Selection, &State, &Predicted),
    misfit_left: bool,
) -> Verdict {
    let of_decays = |&candidate: &usize| is_of_decays_alone(&search.candidates[candidate]);
    if !found.rivals.is_empty() {
        Verdict::Ambiguous
    } else if predicted.gains.is_empty() && state.chosen.iter().any(of_decays) {
        Verdict::Unconfirmed
    } else if misfit_left {
        Verdict::Incomplete
    } else {
        Verdict::Explained
    }
}

/// Whether a cause adds reflections for which no path stands: what they carry is then missing in predicted decays, and no law.
fn adds_unpredicted_sound(search: &Search<'_>, state: &State) -> bool {
    let adds = |candidate: usize| {
        let case = search.candidates[candidate].case;
        case.reflection_term().is_some()
            && !changes(search, state, candidate).iter().any(ModelChange::moves_paths)
    };
    state.chosen.iter().any(|&candidate| adds(candidate))
}

/// The lack of fit under the chosen causes, where there are any.
fn lack_of(search: &Search<'_>, state: &State, formulas: Option<&Formulas>) -> Result<Option<Lack>, Error> {
    if state.chosen.is_empty() {
        return Ok(None);
    }
    lack_of_fit::test(search, state, formulas).map(Some)
}

/// Whether the discrepancy without a name beats all causes. Causes that do not bear on decays are beyond its reach.
fn is_beaten(search: &Search<'_>, base: &State, state: &State, lack_before: &Lack) -> bool {
    let energy_cases = search.cases_of(&state.chosen, Observable::Decay);
    let free_alone = base.energy.log_evidence + lack_before.discrepancy_nats;
    !energy_cases.is_empty()
        && energy_cases.len() == state.chosen.len()
        && free_alone > state.energy.log_evidence + UNNAMED_MARGIN_NATS
}

/// A cause that does not stand, and why.
fn doubtful(
    search: &Search<'_>,
    state: &State,
    found: &Selection,
    predicted: &Predicted,
) -> Result<Option<(usize, Doubt)>, Error> {
    if let Some(worst) = resting_on_modes(search, state)? {
        return Ok(Some((worst, Doubt::Modes)));
    }
    if let Some((worst, rays)) = unsettled(search, state, &found.owed_to_rays)? {
        return Ok(Some((worst, Doubt::Rays(rays))));
    }
    let rests_on_tables = state
        .chosen
        .iter()
        .map(|&candidate| rests_on_tables(search, state, candidate))
        .collect::<Result<Vec<bool>, _>>()?;
    // Decays that come nearer because all tables may be anything have another cause.
    let opens = |c: usize| search.candidates[c].case.opens_several_tables();
    let chosen = state.chosen.iter().copied();
    if let Some((worst, _)) = chosen.zip(&rests_on_tables).find(|&(c, rests)| opens(c) && !rests) {
        return Ok(Some((worst, Doubt::Decays)));
    }
    Ok(least_confirmed(search, state, predicted, &rests_on_tables).map(|worst| (worst, Doubt::Elsewhere)))
}

/// The weakest cause of decays alone, if less speaks for it than against the fit with it: where a model fails otherwise, whatever makes it fail a
/// little less has evidence. What other rays would not confirm does not speak for it.
fn outweighed(
    search: &Search<'_>,
    state: &State,
    found: &Selection,
    lack: &Lack,
) -> Result<Option<usize>, Error> {
    if lack.decays_p_value >= NO_CHANCE {
        return Ok(None);
    }
    let mut weakest = (OUTWEIGHS * -lack.decays_p_value.max(f64::MIN_POSITIVE).ln(), None);
    for &candidate in &state.chosen {
        if !is_of_decays_alone(&search.candidates[candidate]) {
            continue;
        }
        let rest: Vec<usize> = state.chosen.iter().copied().filter(|&c| c != candidate).collect();
        let nats = state.log_evidence() - search.state(&rest, Some(state))?.log_evidence();
        let nats = nats - owed_nats(&found.owed_to_rays, candidate);
        if nats < weakest.0 {
            weakest = (nats, Some(candidate));
        }
    }
    Ok(weakest.1)
}

/// Whether a cause says that a table is wrong, and takes more strain off the tables than it brings the decays nearer: at positions left out a
/// model that strains all tables predicts as well, and only what was stated speaks against it.
fn rests_on_tables(search: &Search<'_>, state: &State, candidate: usize) -> Result<bool, Error> {
    let relaxes = &search.candidates[candidate].case.relaxes;
    if !relaxes.iter().any(|(nuisance, _)| matches!(nuisance, Nuisance::Absorption(_))) {
        return Ok(false);
    }
    let rest: Vec<usize> = state.chosen.iter().copied().filter(|&c| c != candidate).collect();
    let without = search.state(&rest, Some(state))?;
    let decays = state.energy.log_likelihood - without.energy.log_likelihood;
    let all = state.energy.log_posterior - without.energy.log_posterior;
    Ok(all > 0.0 && decays < 0.5 * all)
}

/// A cause that bears on decays alone, and for which those above the Schroeder frequency do not speak. Below it neither paths nor waves
/// between walls of uncertain impedance predict a decay as closely as hundreds of bins can measure it.
fn resting_on_modes(search: &Search<'_>, state: &State) -> Result<Option<usize>, Error> {
    if search.baseline.survey().bands_of_modes == 0 {
        return Ok(None);
    }
    let of = |chosen: &[usize]| {
        let cases = search.cases_of(chosen, Observable::Decay);
        let firsts: &[usize] = if *chosen == *state.chosen { &state.energy_firsts } else { &[] };
        let before = WarmStart { values: &state.energy.values, firsts };
        search.baseline.evidence_above_modes(&cases, &search.used, before)
    };
    let Some(all) = of(&state.chosen)? else { return Ok(None) };
    for &candidate in &state.chosen {
        if !is_of_decays_alone(&search.candidates[candidate]) {
            continue;
        }
        let rest: Vec<usize> = state.chosen.iter().copied().filter(|&c| c != candidate).collect();
        if of(&rest)?.is_some_and(|without| all - without < LEAST_ABOVE_MODES_NATS) {
            return Ok(Some(candidate));
        }
    }
    Ok(None)
}

/// Whether decays alone speak for a cause, and paths explain it.
fn is_of_decays_alone(candidate: &Candidate<'_>) -> bool {
    let case = candidate.case;
    candidate.id != RoomModes.id()
        && case.observable() == Observable::Decay
        && case.channel_change().is_none()
}

/// The cause at work everywhere that gains least at positions which the fit has not seen, if chance may explain even that. One that rests on
/// the tables need not gain there, but may not lose.
fn least_confirmed(
    search: &Search<'_>,
    state: &State,
    predicted: &Predicted,
    rests_on_tables: &[bool],
) -> Option<usize> {
    let everywhere = |c: &usize| {
        let case = search.candidates[*c].case;
        let local = |(nuisance, _): &(Nuisance, f64)| {
            matches!(nuisance, Nuisance::ReceiverPosition(_) | Nuisance::ResponseGain(_))
        };
        let all_local = !case.parameters.is_empty() && case.parameters.iter().all(Parameter::is_local);
        case.channel_change().is_none() && !all_local && !case.relaxes.iter().any(local)
    };
    // A few positions leave a wide interval: a gain in the mean counts where the decays come nearer, too.
    // Two or three groups have no interval worth the name: that all of them gain counts as well.
    let helps = |place: usize| {
        let gain = &predicted.gains[place];
        // No simulation predicts the decay of single modes: octaves that have few do not tell near from far.
        let change = if is_of_decays_alone(&search.candidates[state.chosen[place]]) {
            predicted.diffuse_changes[place]
        } else {
            predicted.decay_changes[place]
        };
        let [before, after] = change.rmse;
        let nearer = after < MAX_RMSE_RATIO * before;
        // Likelier bins under decays that lie farther off: the cause stands for something else.
        let farther = MAX_RMSE_RATIO * after > before && change.is_farther_surely;
        let gains = gain.low > 0.0 || gain.in_every_group;
        (gains && !farther)
            || (gain.nats_per_bin > 0.0 && nearer)
            || (rests_on_tables[place] && gain.high > 0.0 && !farther)
    };
    (0..predicted.gains.len())
        .filter(|&place| everywhere(&state.chosen[place]) && !helps(place))
        .min_by(|&a, &b| predicted.gains[a].nats_per_bin.total_cmp(&predicted.gains[b].nats_per_bin))
        .map(|place| state.chosen[place])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effects::{TimeZeroOffset, TransducerResponse};
    use crate::hand_made::Tables;
    use crate::infer::candidates::cases;
    use crate::infer::cross_validation::DecayChange;
    use crate::report::diagnosis::HeldOutGain;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn a_formula_rivals_causes_that_it_could_replace_or_that_leave_it_something() {
        let best = |nats, p_value| Some(BestFormula { nats, p_value });
        let asked = (0.01, 3.0);
        // As good as the causes within what tells rivals apart, and no chance.
        assert!(rivals_causes([best(22.0, 1e-4), None], 24.0, asked));
        assert!(!rivals_causes([best(22.0, 1e-4), best(0.5, 0.4)], 26.0, asked));
        assert!(!rivals_causes([best(22.0, 0.02), None], 13.0, asked));
        // Causes that do not bear on decays leave it everything; little is not worth a search.
        assert!(rivals_causes([best(8.0, 1e-4), None], 0.0, asked));
        assert!(!rivals_causes([best(2.5, 1e-4), None], 0.0, asked));
        // What causes leave counts by itself.
        assert!(rivals_causes([best(22.0, 1e-4), best(5.0, 1e-3)], 90.0, asked));
        assert!(!rivals_causes([None, best(5.0, 0.03)], 90.0, asked));
    }

    #[test]
    fn what_only_the_octave_of_few_modes_says_is_known_for_that() {
        // The lower of the two octaves lies below the Schroeder frequency.
        for (louder, rests) in [(0, true), (1, false)] {
            let mut tables = Tables::new(Levels::Absolute, TimeZero::Emission);
            for (measured, states) in tables.measured.iter_mut().zip(&tables.states) {
                for (band, (energies, state)) in measured.energies.iter_mut().zip(states).enumerate() {
                    let gain = if band == louder { 4.0 } else { 1.0 };
                    *energies = Some(state.ln_energy.iter().map(|l| gain * l.exp()).collect());
                }
            }
            let baseline = tables.baseline(DiagnoseConfig::default());
            let effects: Vec<Box<dyn Effect>> = vec![Box::new(TransducerResponse)];
            let cases = cases(&effects, baseline.survey());
            let search = Search::new(&baseline, &cases, 1, vec![true; 3]);
            let state = search.state(&[0], None).expect("a fit");
            let without = search.state(&[], None).expect("a fit");
            assert!(state.log_evidence() > without.log_evidence() + 3.0, "{louder}");
            let found = resting_on_modes(&search, &state).expect("fits");
            assert_eq!(found.is_some(), rests, "{louder}");
        }
    }

    #[test]
    fn a_cause_of_decays_must_outweigh_what_it_leaves() {
        let mut tables = Tables::new(Levels::Absolute, TimeZero::Emission);
        for (measured, states) in tables.measured.iter_mut().zip(&tables.states) {
            for (band, (energies, state)) in measured.energies.iter_mut().zip(states).enumerate() {
                let gain = if band == 1 { 16.0 } else { 1.0 };
                *energies = Some(state.ln_energy.iter().map(|l| gain * l.exp()).collect());
            }
        }
        let baseline = tables.baseline(DiagnoseConfig::default());
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(TransducerResponse), Box::new(TimeZeroOffset)];
        let cases = cases(&effects, baseline.survey());
        let search = Search::new(&baseline, &cases, 2, vec![true; 3]);
        let state = search.state(&[0], None).expect("a fit");
        let nats = state.log_evidence() - search.state(&[], None).expect("a fit").log_evidence();
        let left = |decays_p_value: f64| Lack {
            p_value: decays_p_value,
            decays_p_value,
            discrepancy_nats: 0.0,
            levels: lack_of_fit::Levels::default(),
            formula: None,
            tests: Vec::new(),
        };
        let mut found = Selection::default();
        let falls = |state: &State, p: f64| outweighed(&search, state, &found, &left(p)).expect("fits");
        let balance = (-nats / OUTWEIGHS).exp();
        assert!(balance < NO_CHANCE, "{nats}");
        assert_eq!(falls(&state, 0.5 * balance), Some(0));
        assert_eq!(falls(&state, 2.0 * balance), None);
        // What chance leaves speaks against nothing, and causes of arrival times do not answer for decays.
        assert_eq!(falls(&state, 2.0 * NO_CHANCE), None);
        let late = search.state(&[1], None).expect("a fit");
        assert_eq!(falls(&late, 1e-30), None);
        // What other rays do not confirm does not speak for it.
        found.owed_to_rays = vec![(0, RayDependence::new(nats, vec![0.0625 * nats; 4], 0.01))];
        let fallen = outweighed(&search, &state, &found, &left(2.0 * balance)).expect("fits");
        assert_eq!(fallen, Some(0));
    }

    /// Of no bearing where few modes make the decay.
    #[test]
    fn decays_count_as_nearer_or_farther_where_there_are_many_modes() {
        let baseline = Tables::new(Levels::Absolute, TimeZero::Emission).baseline(DiagnoseConfig::default());
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(TransducerResponse)];
        let cases = cases(&effects, baseline.survey());
        let search = Search::new(&baseline, &cases, 1, vec![true; 3]);
        let state = search.state(&[0], None).expect("a fit");
        let gain = HeldOutGain {
            nats_per_bin: 0.1,
            low: 0.05,
            high: 0.15,
            db_rmse_before: 1.0,
            values_jnd: None,
            db_rmse_after: 1.1,
            in_every_group: true,
        };
        // That curves of one group lie far off may be chance.
        for (rmse, is_farther_surely, doubted) in
            [([0.8, 0.8], true, None), ([0.8, 0.85], true, Some(0)), ([0.8, 0.85], false, None)]
        {
            let predicted = Predicted {
                gains: vec![gain.clone()],
                decay_changes: vec![DecayChange { rmse: [1.0, 1.1], is_farther_surely: true }],
                diffuse_changes: vec![DecayChange { rmse, is_farther_surely }],
                ..Predicted::default()
            };
            let found = least_confirmed(&search, &state, &predicted, &[false]);
            assert_eq!(found, doubted, "{rmse:?} {is_farther_surely}");
        }
    }
}
