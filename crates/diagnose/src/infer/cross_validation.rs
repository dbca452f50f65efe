//! Positions that are left out and predicted.

use crate::effect::{Case, Observable};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::infer::direct_evidence;
use crate::infer::direct_evidence::Fitted;
use crate::infer::prediction::{Compared, Errors, compare, decay_db, squared_errors};
use crate::infer::search::{Search, State};
use crate::likelihood::decay::WarmStart;
use crate::likelihood::polarity;
use crate::report::compared_values::{ComparedValue, compared_values};
use crate::report::diagnosis::{DecayCurves, HeldOut, HeldOutGain};
use crate::statistics;
use crate::survey::{Survey, SurveyedResponse};
use rayon::prelude::*;
use sabine_acoustics::{Observer, report};
use std::sync::atomic::{AtomicU64, Ordering};

/// Groups of receivers that are left out in turn, at most: with eight, the quantile of Student's t is 1.9, with four it was 2.4, and the
/// whole is fitted once for all.
const FOLDS: usize = 8;

/// Receivers that are predicted from others.
pub(crate) struct Folds {
    /// Pairs fitted, and pairs predicted.
    splits: Vec<(Vec<bool>, Vec<usize>)>,
    receivers: Vec<usize>,
    /// Whether no fit ever sees them.
    never_fitted: bool,
}

impl Folds {
    /// Receivers that no fit sees; `fitted` flags the responses that may be fitted.
    pub fn never_fitted(responses: &[SurveyedResponse], fitted: &[bool], held: &[usize]) -> Self {
        let groups = held.iter().map(|&r| vec![r]).collect();
        Self::new(responses, groups, &|_| fitted.to_vec(), true)
    }

    /// Groups of the receivers that are fitted, each left out in turn; none with fewer than two.
    pub fn in_turn(responses: &[SurveyedResponse], fitted: &[bool]) -> Self {
        let seen = responses.iter().zip(fitted).filter(|(_, fitted)| **fitted);
        let mut receivers: Vec<usize> = seen.map(|(r, _)| r.receiver).collect();
        receivers.sort_unstable();
        receivers.dedup();
        let count = if receivers.len() < 2 { 0 } else { receivers.len().min(FOLDS) };
        let groups = (0..count).map(|g| receivers.iter().copied().skip(g).step_by(count).collect()).collect();
        let rest = |group: &[usize]| {
            let used = responses.iter().zip(fitted);
            used.map(|(r, fitted)| *fitted && !group.contains(&r.receiver)).collect()
        };
        Self::new(responses, groups, &rest, false)
    }

    fn new(
        responses: &[SurveyedResponse],
        groups: Vec<Vec<usize>>,
        used: &dyn Fn(&[usize]) -> Vec<bool>,
        never_fitted: bool,
    ) -> Self {
        let pairs = |group: &[usize]| {
            (0..responses.len()).filter(|&p| group.contains(&responses[p].receiver)).collect()
        };
        let splits = groups.iter().map(|group| (used(group), pairs(group))).collect();
        Self { splits, receivers: groups.into_iter().flatten().collect(), never_fitted }
    }
}

/// Gains of one split: of all causes and of the free discrepancy over the baseline, and of each cause over the others; the bins
/// compared; and what was predicted in each case.
struct SplitGain {
    named: f64,
    free: f64,
    each: Vec<f64>,
    bins: f64,
    predicted: [Vec<Compared>; 3],
    without_each: Vec<Vec<Compared>>,
}

/// What comes of predicting the receivers that were left out: nothing where none could be.
#[derive(Default)]
pub(crate) struct Predicted {
    pub held_out: Option<HeldOut>,
    /// Of each cause.
    pub gains: Vec<HeldOutGain>,
    /// Of each cause, summed over all bins of the receivers that were left out, in nats.
    pub gains_nats: Vec<f64>,
    /// What each cause does to decay curves at positions left out, in all octaves and in those above the Schroeder frequency; in all where
    /// none lies above it.
    pub decay_changes: Vec<DecayChange>,
    pub diffuse_changes: Vec<DecayChange>,
    pub decays: Vec<DecayCurves>,
    pub values: Vec<ComparedValue>,
}

/// Decay curves at positions left out, without a cause and with it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DecayChange {
    /// Their errors in dB; those of the values of tables in just-noticeable differences.
    pub rmse: [f64; 2],
    /// Whether they lie farther off beyond chance: the 90 % interval of the change over groups of positions has its lower end above zero, or
    /// every group is farther off.
    pub is_farther_surely: bool,
}

impl DecayChange {
    /// From squared errors without and with the cause and their number, for each group.
    fn of(groups: &[[(f64, f64); 2]]) -> Self {
        let rmse = [0, 1].map(|k| {
            let (squares, points) = groups.iter().fold((0.0, 0.0), |(s, n), g| (s + g[k].0, n + g[k].1));
            if points > 0.0 { (squares / points).sqrt() } else { 0.0 }
        });
        let more: Vec<(f64, f64)> =
            groups.iter().map(|[before, after]| (after.0 - before.0, after.1)).collect();
        let [low, _] = statistics::ratio_interval(&more);
        Self { rmse, is_farther_surely: low > 0.0 || more.iter().all(|(more, _)| *more > 0.0) }
    }
}

/// What positions are predicted by: a set of causes, and the discrepancy without a name where it joins them.
struct Predictor<'a> {
    chosen: Vec<usize>,
    free: Option<&'a Case>,
}

/// A fit to some of the responses, and the logarithm of their probability with all parameters integrated out.
struct Density {
    nats: f64,
    values: Vec<f64>,
}

/// Predicts the receivers that were left out.
pub(crate) fn predict(
    search: &Search<'_>,
    state: &State,
    folds: &Folds,
    observer: &dyn Observer,
) -> Result<Predicted, Error> {
    let Some((used, pairs)) = folds.splits.first() else { return Ok(Predicted::default()) };
    let free = search.baseline.free_discrepancy();
    let predictors = predictors(&state.chosen, &free);
    // Receivers that are left out in turn leave the same whole: one fit of each predictor serves all splits.
    let whole = joined(used, pairs);
    let same = folds.splits.iter().all(|(used, pairs)| joined(used, pairs) == whole);
    let total = folds.splits.len() as u64;
    report(observer, "held-out positions", 0, total)?;
    let wholes: Option<Vec<Density>> = same
        .then(|| predictors.par_iter().map(|p| density(search, state, p, &whole)).collect())
        .transpose()?;
    let done = AtomicU64::new(0);
    let splits: Vec<SplitGain> = folds
        .splits
        .par_iter()
        .map(|(used, pairs)| {
            report(observer, "held-out positions", done.fetch_add(1, Ordering::Relaxed), total)?;
            split_gain(search, state, (used, pairs), &predictors, wholes.as_deref())
        })
        .collect::<Result<_, _>>()?;
    Ok(summary(search.baseline, state.chosen.len(), folds, &splits))
}

/// The baseline, the free discrepancy, all causes together, and all but each in turn. One that repeats another is left out: the causes
/// where there are none, and all but the only one.
fn predictors<'a>(chosen: &[usize], free: &'a Case) -> Vec<Predictor<'a>> {
    let causes = |chosen: Vec<usize>| Predictor { chosen, free: None };
    let mut found = vec![causes(Vec::new()), Predictor { chosen: Vec::new(), free: Some(free) }];
    if !chosen.is_empty() {
        found.push(causes(chosen.to_vec()));
    }
    if chosen.len() > 1 {
        let all_but = |c: &usize| causes(chosen.iter().copied().filter(|o| o != c).collect());
        found.extend(chosen.iter().map(all_but));
    }
    found
}

/// The responses that are fitted, and those that are predicted.
fn joined(used: &[bool], pairs: &[usize]) -> Vec<bool> {
    let mut whole = used.to_vec();
    pairs.iter().for_each(|&p| whole[p] = true);
    whole
}

/// Predicts the pairs of one split from the responses that are used. `wholes` are the fits to both, where they are known.
fn split_gain(
    search: &Search<'_>,
    state: &State,
    (used, pairs): (&[bool], &[usize]),
    predictors: &[Predictor<'_>],
    wholes: Option<&[Density]>,
) -> Result<SplitGain, Error> {
    let whole = joined(used, pairs);
    let mut nats = Vec::with_capacity(predictors.len());
    let mut predicted = Vec::with_capacity(predictors.len());
    for (i, predictor) in predictors.iter().enumerate() {
        let fitted = density(search, state, predictor, used)?;
        let all_nats = match wholes {
            Some(wholes) => wholes[i].nats,
            None => density(search, state, predictor, &whole)?.nats,
        };
        // What the evidence grows by when the new positions come in is the logarithm of their predictive density.
        nats.push(all_nats - fitted.nats);
        let cases = predictor.decay_cases(search);
        predicted.push(compare(search.baseline, &cases, &fitted.values, pairs));
    }
    let causes = state.chosen.len();
    // Where predictors repeat each other, see `predictors`.
    let named = if causes == 0 { 0 } else { 2 };
    let all_but = |i: usize| if causes == 1 { 0 } else { 3 + i };
    Ok(SplitGain {
        named: nats[named] - nats[0],
        free: nats[1] - nats[0],
        each: (0..causes).map(|i| nats[named] - nats[all_but(i)]).collect(),
        bins: predicted[0].iter().map(|c| c.measured.len() as f64).sum(),
        without_each: (0..causes).map(|i| predicted[all_but(i)].clone()).collect(),
        predicted: [predicted[0].clone(), predicted[named].clone(), predicted[1].clone()],
    })
}

impl<'a> Predictor<'a> {
    fn decay_cases(&self, search: &Search<'a>) -> Vec<&'a Case> {
        let mut cases = search.cases_of(&self.chosen, Observable::Decay);
        cases.extend(self.free);
        cases
    }
}

/// Fits the responses that are used.
fn density(
    search: &Search<'_>,
    state: &State,
    predictor: &Predictor<'_>,
    used: &[bool],
) -> Result<Density, Error> {
    let (baseline, chosen) = (search.baseline, &predictor.chosen);
    let firsts: &[usize] = if *chosen == state.chosen { &state.energy_firsts } else { &[] };
    let before = WarmStart { values: &state.energy.values, firsts };
    let (energy, energy_firsts) = baseline.fit_energy(&predictor.decay_cases(search), used, Some(before))?;
    let arrivals = search.fit_arrivals(chosen, used)?.0;
    let fitted = Fitted { energy: &energy, energy_firsts: &energy_firsts, arrivals: &arrivals };
    let candidates = (&search.candidates[..], &search.used[..]);
    let own = direct_evidence::own(baseline, candidates, chosen, fitted, used);
    let signs = polarity::log_likelihood(&baseline.observations.measured, &search.all_cases(chosen), used);
    let nats = energy.log_evidence + arrivals.log_evidence + signs + direct_evidence::sum(&own);
    Ok(Density { nats, values: energy.values })
}

/// The lowest octave above the Schroeder frequency; where there is none, the lowest of all, so that decays are compared in some.
fn first_diffuse_band(survey: &Survey) -> usize {
    if survey.bands_of_modes < survey.bands.len() { survey.bands_of_modes } else { 0 }
}

/// Gains, errors and curves over all splits.
fn summary(baseline: &Baseline, causes: usize, folds: &Folds, splits: &[SplitGain]) -> Predicted {
    let bins: f64 = splits.iter().map(|s| s.bins).sum();
    let are_tables = baseline.observations.are_tables();
    let mean = |gain: &dyn Fn(&SplitGain) -> f64| splits.iter().map(gain).sum::<f64>() / bins;
    let interval = |gain: &dyn Fn(&SplitGain) -> f64| {
        let gains: Vec<(f64, f64)> = splits.iter().map(|s| (gain(s), s.bins)).collect();
        statistics::ratio_interval(&gains)
    };
    let errors: Vec<Errors> = (0..3)
        .map(|k| Errors::of(&splits.iter().flat_map(|s| s.predicted[k].iter().cloned()).collect::<Vec<_>>()))
        .collect();
    let three = |value: fn(&Errors) -> f64| [value(&errors[0]), value(&errors[1]), value(&errors[2])];
    let held_out = HeldOut {
        receivers: folds.receivers.iter().map(|&r| baseline.survey().receivers[r].id.clone()).collect(),
        never_fitted: folds.never_fitted,
        db_rmse: three(|e| e.db_rmse),
        t20_jnd: three(|e| e.t20_jnd),
        c50_jnd: three(|e| e.c50_jnd),
        values_jnd: are_tables.then(|| three(|e| e.values_jnd)),
        nats_per_bin: [mean(&|s| s.named), mean(&|s| s.free)],
        nats_interval: [interval(&|s| s.named), interval(&|s| s.free)],
    };
    let changes = |first: usize| -> Vec<DecayChange> {
        let squares = |c: &[Compared]| squared_errors(c.iter().filter(|c| c.band >= first));
        let groups = |i: usize| -> Vec<_> {
            splits.iter().map(|s| [squares(&s.without_each[i]), squares(&s.predicted[1])]).collect()
        };
        (0..causes).map(|i| DecayChange::of(&groups(i))).collect()
    };
    let decay_changes = changes(0);
    let gains = (0..causes)
        .map(|i| {
            let [low, high] = interval(&|s| s.each[i]);
            let rmse = decay_changes[i].rmse;
            let [db_rmse_before, db_rmse_after] = if are_tables { [f64::NAN; 2] } else { rmse };
            let values_jnd = are_tables.then_some(rmse);
            let in_every_group = splits.iter().all(|s| s.each[i] > 0.0);
            let nats_per_bin = mean(&|s| s.each[i]);
            HeldOutGain { nats_per_bin, low, high, db_rmse_before, db_rmse_after, values_jnd, in_every_group }
        })
        .collect();
    let curves = |s: &SplitGain| decay_curves(baseline, &s.predicted[0], &s.predicted[1], true);
    let values = |s: &SplitGain| compared_values(baseline, &s.predicted[0], &s.predicted[1], true);
    Predicted {
        held_out: Some(held_out),
        gains,
        gains_nats: (0..causes).map(|i| splits.iter().map(|s| s.each[i]).sum()).collect(),
        decay_changes,
        diffuse_changes: changes(first_diffuse_band(baseline.survey())),
        decays: splits.iter().flat_map(curves).collect(),
        values: splits.iter().flat_map(values).collect(),
    }
}

/// Curves of what was measured, and predicted before and after.
pub(crate) fn decay_curves(
    baseline: &Baseline,
    before: &[Compared],
    after: &[Compared],
    held_out: bool,
) -> Vec<DecayCurves> {
    before
        .iter()
        .zip(after)
        .filter(|(b, _)| !b.is_table())
        .map(|(b, a)| {
            let total = b.measured.iter().sum::<f64>().max(1e-300);
            DecayCurves {
                response: baseline.survey().responses[b.pair].name.clone(),
                band_hz: baseline.survey().bands.nominal_hz(b.band),
                time_s: b.times_s.clone(),
                measured_db: decay_db(&b.measured, total),
                before_db: decay_db(&b.predicted, total),
                after_db: decay_db(&a.predicted, total),
                held_out,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::Effect;
    use crate::effects::TimeZeroOffset;
    use crate::hand_made::{self, Tables};
    use crate::infer::candidates::cases;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn a_room_of_modes_alone_is_compared_in_all_octaves() {
        let mut survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        assert_eq!((survey.bands.len(), survey.bands_of_modes, first_diffuse_band(&survey)), (2, 1, 1));
        survey.bands_of_modes = 2;
        assert_eq!(first_diffuse_band(&survey), 0);
    }

    #[test]
    fn decays_are_surely_farther_off_where_groups_agree() {
        // Mean squared errors with a cause, by group; without it they are 1 dB2 in 100 points.
        let of = |after: &[f64]| {
            let groups: Vec<_> = after.iter().map(|s| [(100.0, 100.0), (100.0 * s, 100.0)]).collect();
            DecayChange::of(&groups)
        };
        // One group far off says nothing of others, however far.
        let one = of(&[0.99, 0.98, 2.0, 0.97]);
        assert!(!one.is_farther_surely && (one.rmse[1] - (0.25f64 * 4.94).sqrt()).abs() < 1e-12, "{one:?}");
        assert!(of(&[1.1, 1.12, 1.09, 1.11, 1.1, 0.999]).is_farther_surely);
        // Two groups have no interval worth the name.
        assert!(of(&[1.1, 1.5]).is_farther_surely && !of(&[1.5, 0.99]).is_farther_surely);
        assert!(!of(&[0.9, 0.91, 0.92]).is_farther_surely);
    }

    #[test]
    fn every_receiver_that_is_fitted_is_left_out_once_and_never_used_meanwhile() {
        let mut responses = hand_made::survey(Levels::Common, TimeZero::Emission).responses;
        let more: Vec<SurveyedResponse> =
            (3..9).map(|receiver| SurveyedResponse { receiver, ..responses[0].clone() }).collect();
        responses.extend(more);
        let fitted: Vec<bool> = (0..responses.len()).map(|r| r != 4).collect();
        let folds = Folds::in_turn(&responses, &fitted);
        assert_eq!(folds.splits.len(), FOLDS);
        let mut left_out: Vec<usize> = Vec::new();
        for (used, pairs) in &folds.splits {
            assert!(!used[4] && !pairs.contains(&4), "a receiver that is held out has no say");
            for pair in (0..responses.len()).filter(|&p| fitted[p]) {
                assert_eq!(used[pair], !pairs.contains(&pair));
            }
            left_out.extend(pairs);
        }
        left_out.sort_unstable();
        assert_eq!(left_out, [0, 1, 2, 3, 5, 6, 7, 8]);
        assert!(!folds.never_fitted);
    }

    #[test]
    fn a_single_receiver_leaves_nothing_to_predict_it_from() {
        let responses = hand_made::survey(Levels::Common, TimeZero::Emission).responses;
        assert!(Folds::in_turn(&responses, &[true, false, false]).splits.is_empty());
        let folds = Folds::never_fitted(&responses, &[true, false, true], &[1]);
        assert!(folds.never_fitted);
        assert_eq!(folds.splits, [(vec![true, false, true], vec![1])]);
    }

    #[test]
    fn a_latency_helps_at_receivers_that_were_left_out_and_an_absent_one_does_not() {
        for (latency_s, helps) in [(3e-3, true), (0.0, false)] {
            let tables = Tables::new(Levels::Common, TimeZero::Emission).late(latency_s);
            let baseline = tables.baseline(DiagnoseConfig::default());
            let effects: Vec<Box<dyn Effect>> = vec![Box::new(TimeZeroOffset)];
            let cases = cases(&effects, baseline.survey());
            let search = Search::new(&baseline, &cases, 1, vec![true; 3]);
            let state = search.state(&[0], None).expect("a fit");
            let folds = Folds::in_turn(&baseline.survey().responses, &search.used);
            let found = predict(&search, &state, &folds, &()).expect("predictions");
            let held_out = found.held_out.expect("receivers that were left out");
            assert_eq!(held_out.receivers.len(), 3);
            assert_eq!(found.gains.len(), 1);
            let gain = &found.gains[0];
            assert_eq!(gain.low > 0.0, helps, "{latency_s} s: {gain:?}");
            // A latency says nothing on decays.
            assert!((gain.db_rmse_after - gain.db_rmse_before).abs() < 1e-9);
            // Every response is predicted once in each band.
            assert_eq!(found.decays.len(), 6);
        }
    }
}
