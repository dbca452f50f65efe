//! Which of the causes found stand: those that help where they were not fitted, and that beat the discrepancy without a name.

use crate::effect::{Nuisance, Observable, Parameter};
use crate::error::Error;
use crate::infer::cross_validation::{Folds, Predicted, predict};
use crate::infer::lack_of_fit::{self, Lack};
use crate::infer::search::{Search, State};
use crate::infer::selection::Selection;
use crate::report::diagnosis::{HeldOutGain, Verdict};
use sabine_acoustics::{Observer, report};
use std::time::Instant;

/// Evidence by which the unnamed discrepancy must beat all named causes to unseat them, in nats.
const UNNAMED_MARGIN_NATS: f64 = 5.0;
/// A cause helps if it brings the error of decay curves at positions left out below this share of what it was.
const MAX_RMSE_RATIO: f64 = 0.97;
/// Dispersion from which nothing is named: measured variance over that expected, causes and smooth discrepancy taken out.
const MAX_DISPERSION: f64 = 100.0;

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
    /// Causes that the discrepancy without a name beats.
    pub unseated: Vec<&'static str>,
    /// Causes that do not help at positions left out.
    pub unconfirmed: Vec<&'static str>,
    pub predicting_s: f64,
    pub testing_s: f64,
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
    let lack_before = lack_of_fit::test(baseline, &[], base.before(), &search.used)?;
    report(observer, "lack of fit", 1, 2)?;
    let mut lack_after = lack_of(search, &state)?;
    // Where chance does not explain what a cause that is at work everywhere leaves, the cause must help where it was not fitted.
    let mut unconfirmed: Vec<&'static str> = Vec::new();
    while lack_after.is_some_and(|l| l.p_value < config.significance) {
        let Some(worst) = least_confirmed(search, &state, &predicted.gains) else { break };
        unconfirmed.push(search.candidates[worst].id);
        found.drop(worst);
        state = search.state(&found.chosen, Some(&base))?;
        predicted = predict(search, &state, &in_turn, observer)?;
        lack_after = lack_of(search, &state)?;
    }
    // Where bins scatter a hundred times as far as they may, the baseline itself has not been met: no name can be trusted.
    let hopeless = baseline.dispersion.iter().any(|d| *d > MAX_DISPERSION);
    let verdict = if hopeless || is_beaten(search, &base, &state, &lack_before) {
        Verdict::Unexplained
    } else if state.chosen.is_empty() {
        if lack_before.p_value < config.significance { Verdict::Unexplained } else { Verdict::Adequate }
    } else if !found.rivals.is_empty() {
        Verdict::Ambiguous
    } else {
        Verdict::Explained
    };
    let mut unseated: Vec<&'static str> = Vec::new();
    if verdict == Verdict::Unexplained && !state.chosen.is_empty() {
        unseated = state.chosen.iter().map(|&c| search.candidates[c].id).collect();
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
        lack_before,
        lack_after: lack_after.unwrap_or(lack_before),
        verdict,
        hopeless,
        unseated,
        unconfirmed,
        predicting_s,
        testing_s: started.elapsed().as_secs_f64(),
    })
}

/// The lack of fit under the chosen causes, where there are any.
fn lack_of(search: &Search<'_>, state: &State) -> Result<Option<Lack>, Error> {
    if state.chosen.is_empty() {
        return Ok(None);
    }
    let cases = search.cases_of(&state.chosen, Observable::Decay);
    lack_of_fit::test(search.baseline, &cases, state.before(), &search.used).map(Some)
}

/// Whether the discrepancy without a name beats all causes. Causes that do not bear on decays are beyond its reach.
fn is_beaten(search: &Search<'_>, base: &State, state: &State, lack_before: &Lack) -> bool {
    let energy_cases = search.cases_of(&state.chosen, Observable::Decay);
    let free_alone = base.energy.log_evidence + lack_before.discrepancy_nats;
    !energy_cases.is_empty()
        && energy_cases.len() == state.chosen.len()
        && free_alone > state.energy.log_evidence + UNNAMED_MARGIN_NATS
}

/// The cause at work everywhere that gains least at positions which the fit has not seen, if chance may explain even that.
fn least_confirmed(search: &Search<'_>, state: &State, gains: &[HeldOutGain]) -> Option<usize> {
    let everywhere = |c: &usize| {
        let case = search.candidates[*c].case;
        let local = |(nuisance, _): &(Nuisance, f64)| {
            matches!(nuisance, Nuisance::ReceiverPosition(_) | Nuisance::ResponseGain(_))
        };
        let all_local = !case.parameters.is_empty() && case.parameters.iter().all(Parameter::is_local);
        case.channel_change().is_none() && !all_local && !case.relaxes.iter().any(local)
    };
    // A few positions leave a wide interval: a gain in the mean counts where the decays come nearer, too.
    let helps = |gain: &HeldOutGain| {
        let nearer = gain.db_rmse_after < MAX_RMSE_RATIO * gain.db_rmse_before;
        // Likelier bins under decays that lie farther off: the cause stands for something else.
        let farther = gain.db_rmse_after > gain.db_rmse_before;
        (gain.low > 0.0 && !farther) || (gain.nats_per_bin > 0.0 && nearer)
    };
    let doubtful = state.chosen.iter().zip(gains).filter(|(c, gain)| everywhere(c) && !helps(gain));
    doubtful.min_by(|a, b| a.1.nats_per_bin.total_cmp(&b.1.nats_per_bin)).map(|(c, _)| *c)
}
