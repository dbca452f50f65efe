//! Puts a diagnosis together from what was found.

use crate::effect::info::discriminating_measurement;
use crate::effect::{Effect, Observable};
use crate::error::Error;
use crate::extend::extension;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::EffectScore;
use crate::infer::confirmation::{Confirmation, Doubt};
use crate::infer::cross_validation::decay_curves;
use crate::infer::isolability::isolability;
use crate::infer::lack_of_fit::{Levels, Test};
use crate::infer::prediction::compare;
use crate::infer::search::{Search, State};
use crate::infer::selection::Selection;
use crate::report::compared_values::compared_values;
use crate::report::diagnosis::{
    CandidateScore, Cause, Diagnosis, FitTest, FittedMaterial, HeldOutGain, LackOfFit, Verdict,
};
use crate::report::found_parameters::{at_bounds, parameters};
use crate::report::moved_reflections::moved_reflections;
use crate::report::notes::{Circumstances, notes};
use crate::report::recording_order;
use crate::report::residual_map::residual_map;
use sabine_acoustics::Observer;
use web_time::Instant;

/// Dispersion from which an unexplained misfit looks like another room.
const WARN_DISPERSION: f64 = 3.0;
/// Drift of single responses from which a warning is due, in dB.
const WARN_DRIFT_DB: f64 = 1.0;
/// A cause is slight if decays at positions left out come nearer by less than this share ...
const SLIGHT_SHARE: f64 = 0.03;
/// ... and this, in dB, ...
const SLIGHT_DB: f64 = 1.0;
/// ... and their bins become more probable by less than this: what changes the early sound leaves decays as they are.
const SLIGHT_NATS_PER_BIN: f64 = 0.01;
/// Logarithm of energy in one decibel.
const LN_PER_DB: f64 = std::f64::consts::LN_10 / 10.0;

/// The whole answer. `first_dispersion` is that of the baseline before any cause was named.
pub(crate) fn compose(
    effects: &[Box<dyn Effect>],
    search: &Search<'_>,
    found: &Selection,
    confirmed: Confirmation,
    first_dispersion: &[f64],
    observer: &dyn Observer,
) -> Result<Diagnosis, Error> {
    let started = Instant::now();
    let baseline = search.baseline;
    let Confirmation { base, state, verdict, lack_before, lack_after, .. } = &confirmed;
    let causes = causes(effects, search, found, &confirmed)?;
    let alternatives: Vec<String> = match verdict {
        Verdict::Ambiguous => found.rivals.iter().map(|r| (*r).to_owned()).collect(),
        _ => Vec::new(),
    };
    let isolability = isolability(baseline, &search.candidates, effects)?;
    let candidates = candidate_scores(search, state, found, observer)?;
    let cases_now = search.cases_of(&state.chosen, Observable::Decay);
    let (residuals, dispersion) = residual_map(baseline, base, &cases_now, state);
    let (decays, values) = if confirmed.predicted.held_out.is_some() {
        (confirmed.predicted.decays.clone(), confirmed.predicted.values.clone())
    } else {
        let all: Vec<usize> = (0..baseline.pairs()).collect();
        let before = compare(baseline, &[], &base.energy.values, &all);
        let after = compare(baseline, &cases_now, &state.energy.values, &all);
        let values = compared_values(baseline, &before, &after, false);
        (decay_curves(baseline, &before, &after, false), values)
    };
    let model = extension::extended_model(search, state);
    let notes = notes_on(search, &confirmed, first_dispersion, (&candidates, &alternatives));
    let mut seconds: Vec<(String, f64)> =
        baseline.seconds.iter().map(|(stage, s)| ((*stage).to_owned(), *s)).collect();
    seconds.push(("lack of fit".into(), confirmed.testing_s));
    seconds.push(("prediction".into(), confirmed.predicting_s));
    seconds.push(("report".into(), started.elapsed().as_secs_f64()));
    let common_gain = baseline.decay_layout().common_gain();
    Ok(Diagnosis {
        verdict: *verdict,
        lack_of_fit: LackOfFit {
            p_value: lack_before.p_value,
            p_value_explained: lack_after.p_value,
            discrepancy_nats: lack_before.discrepancy_nats,
            discrepancy_nats_explained: lack_after.discrepancy_nats,
            dispersion,
            drift_sd_db: baseline.drift_sd.iter().map(|sd| sd / LN_PER_DB).collect(),
            tests: lack_after.tests.iter().map(fit_test).collect(),
        },
        causes,
        laws: Vec::new(),
        law_search: None,
        would_decide: words_that_decide(effects, &alternatives),
        alternatives,
        candidates,
        isolability,
        materials: fitted_materials(baseline, base, state),
        held_out: confirmed.predicted.held_out.clone(),
        bands: baseline.survey().bands,
        residuals,
        decays,
        values,
        moved_reflections: moved_reflections(search, base, state),
        common_gain_db: common_gain.map(|index| state.energy.values[index]),
        notes,
        model,
        seconds,
    })
}

fn causes(
    effects: &[Box<dyn Effect>],
    search: &Search<'_>,
    found: &Selection,
    confirmed: &Confirmation,
) -> Result<Vec<Cause>, Error> {
    let state = &confirmed.state;
    let one = |(place, &candidate): (usize, &usize)| {
        let own = &search.candidates[candidate];
        let gain = confirmed.predicted.gains.get(place);
        Ok(Cause {
            effect: own.id.to_owned(),
            subject: own.case.subject.clone(),
            other_subjects: found
                .interchangeable(candidate)
                .iter()
                .filter_map(|&other| search.candidates[other].case.subject.clone())
                .collect(),
            explanation: effects[own.effect].info().explanation.into_owned(),
            probability: found.probability(candidate),
            nats: without(search, state, candidate)?,
            rays: found.owed_to_rays.iter().find(|(c, _)| *c == candidate).map(|(_, rays)| rays.clone()),
            parameters: parameters(search, state, candidate),
            slight: own.case.observable() == Observable::Decay && gain.is_some_and(is_slight),
            held_out_gain: gain.cloned(),
        })
    };
    state.chosen.iter().enumerate().map(one).collect()
}

fn is_slight(gain: &HeldOutGain) -> bool {
    // Just-noticeable differences of the values of a table count as decibels do.
    let [before, after] = gain.values_jnd.unwrap_or([gain.db_rmse_before, gain.db_rmse_after]);
    let nearer = before - after;
    nearer < SLIGHT_SHARE * before && nearer < SLIGHT_DB && gain.nats_per_bin < SLIGHT_NATS_PER_BIN
}

fn notes_on(
    search: &Search<'_>,
    confirmed: &Confirmation,
    first_dispersion: &[f64],
    (candidates, alternatives): (&[CandidateScore], &[String]),
) -> Vec<String> {
    let Confirmation { base, state, .. } = confirmed;
    let baseline = search.baseline;
    let at_bounds: Vec<(&str, Vec<String>)> = state
        .chosen
        .iter()
        .map(|&c| (search.candidates[c].id, at_bounds(search, state, c)))
        .filter(|(_, parameters)| !parameters.is_empty())
        .collect();
    let dropped: Vec<(&str, &Doubt)> =
        confirmed.dropped.iter().map(|(c, doubt)| (search.candidates[*c].id, doubt)).collect();
    let of_decays =
        state.chosen.iter().filter(|&&c| search.candidates[c].case.observable() == Observable::Decay).count();
    let most = of_decays.max(state.chosen.len() - of_decays) >= baseline.config.most_causes;
    let more = if most || !alternatives.is_empty() {
        speaking(search, confirmed, candidates, alternatives)
    } else {
        Vec::new()
    };
    let mut notes = notes(&Circumstances {
        baseline,
        verdict: confirmed.verdict,
        held_out: confirmed.predicted.held_out.is_some(),
        converged: base.energy.converged && state.energy.converged && state.arrivals.converged,
        misfit_left: confirmed.lack_after.p_value < search.baseline.config.significance,
        hopeless: confirmed.hopeless,
        without_added: confirmed.without_added,
        scattered: first_dispersion.iter().any(|d| *d > WARN_DISPERSION),
        unseated: &confirmed.unseated,
        dropped: &dropped,
        not_sought: (most, &more),
        drift: drift_in_words(baseline),
        levels: levels_in_words(search.baseline, &confirmed.lack_after.levels),
        at_bounds: &at_bounds,
    });
    notes.extend(recording_order::notes(baseline, state));
    notes
}

/// Effects that the data speak for beside the causes that stand.
fn speaking<'c>(
    search: &Search<'_>,
    confirmed: &Confirmation,
    candidates: &'c [CandidateScore],
    alternatives: &[String],
) -> Vec<&'c str> {
    let fell = |id: &str| confirmed.dropped.iter().any(|(c, _)| search.candidates[*c].id == id);
    let worth = |c: &&CandidateScore| {
        c.nats_beside_causes.is_some_and(|nats| nats >= search.threshold())
            && !alternatives.contains(&c.effect)
            && !fell(&c.effect)
    };
    candidates.iter().filter(worth).map(|c| c.effect.as_str()).collect()
}

/// How far single responses drift at most, in dB, and in which octave.
fn drift_in_words(baseline: &Baseline) -> Option<(f64, f64)> {
    let bands = baseline.survey().bands;
    let largest = baseline.drift_sd.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let (band, db) = (largest.0, largest.1 / LN_PER_DB);
    (db >= WARN_DRIFT_DB).then(|| (db, bands.nominal_hz(band)))
}

/// Levels by octave that scatter too far, and where most.
fn levels_in_words(baseline: &Baseline, levels: &Levels) -> Option<(f64, String)> {
    let (pair, band) = levels.largest.filter(|_| levels.p_value < baseline.config.significance)?;
    let (name, hz) = (&baseline.survey().responses[pair].name, baseline.survey().bands.nominal_hz(band));
    Some((levels.rms_db, format!("{name} at {hz} Hz")))
}

fn fit_test(test: &Test) -> FitTest {
    FitTest { name: test.name.to_owned(), subject: test.subject.clone(), p_value: test.p_value }
}

fn candidate_scores(
    search: &Search<'_>,
    state: &State,
    found: &Selection,
    observer: &dyn Observer,
) -> Result<Vec<CandidateScore>, Error> {
    let beside = match &found.last {
        _ if state.chosen.is_empty() => None,
        Some((chosen, scores)) if *chosen == state.chosen => Some(scores.clone()),
        _ => Some(search.by_effect(&search.scores(state, observer)?)),
    };
    let one = |s: &EffectScore| {
        let chosen = state.chosen.iter().any(|&c| search.candidates[c].effect == s.effect);
        let nats_beside_causes = match (&beside, chosen) {
            (Some(all), false) => all.iter().find(|o| o.effect == s.effect).map(|o| o.nats),
            _ => None,
        };
        CandidateScore {
            effect: s.id.to_owned(),
            subject: search.candidates[s.best].case.subject.clone(),
            nats: s.nats,
            d_prime: s.d_prime,
            nats_beside_causes,
        }
    };
    Ok(found.first.iter().map(one).collect())
}

/// Evidence that a chosen candidate adds to the others.
fn without(search: &Search<'_>, state: &State, candidate: usize) -> Result<f64, Error> {
    let rest: Vec<usize> = state.chosen.iter().copied().filter(|&c| c != candidate).collect();
    Ok(state.log_evidence() - search.state(&rest, Some(state))?.log_evidence())
}

/// What would tell each two of the alternatives apart.
pub(crate) fn words_that_decide(effects: &[Box<dyn Effect>], alternatives: &[String]) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for (i, a) in alternatives.iter().enumerate() {
        for b in &alternatives[i + 1..] {
            let info = |id: &String| effects.iter().map(|e| e.info()).find(|info| info.id == **id);
            let (Some(a), Some(b)) = (info(a), info(b)) else { continue };
            let word = discriminating_measurement(&a, &b).to_string();
            if !words.contains(&word) {
                words.push(word);
            }
        }
    }
    words
}

fn fitted_materials(baseline: &Baseline, base: &State, state: &State) -> Vec<(String, FittedMaterial)> {
    (0..baseline.survey().materials.len())
        .map(|m| {
            let bands = baseline.survey().bands.len();
            let layout = baseline.decay_layout();
            let column = |values: &[f64]| values[layout.material(m)].to_vec();
            let fitted = FittedMaterial {
                stated: baseline.priors[m].iter().map(|p| p.mean).collect(),
                absorption_before: column(&base.energy.values),
                absorption: column(&state.energy.values),
                absorption_sd: (0..bands).map(|b| state.energy.sd(layout.absorption(m, b))).collect(),
            };
            (baseline.survey().materials[m].clone(), fitted)
        })
        .collect()
}
