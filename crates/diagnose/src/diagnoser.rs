//! The whole diagnosis.

use crate::config::DiagnoseConfig;
use crate::effect::{Effect, Nuisance, Observable};
use crate::effects::catalogue;
use crate::error::Error;
use crate::extend::extension;
use crate::infer::cross_validation::{Folds, decay_curves, predict};
use crate::infer::isolability::isolability;
use crate::infer::lack_of_fit;
use crate::infer::prediction::compare;
use crate::infer::search;
use crate::infer::search::{Search, State};
use crate::infer::selection::Selection;
use crate::infer::workbench::Workbench;
use crate::report::diagnosis::{
    CandidateScore, Cause, Diagnosis, FittedMaterial, HeldOutGain, LackOfFit, Verdict,
};
use crate::report::found_parameters::{at_bounds, parameters};
use crate::report::next_measurement::discriminating_measurement;
use crate::report::notes::{Circumstances, notes};
use crate::report::residual_map::residual_map;
use sabine_acoustics::{MeasuredRoom, Observer, report};
use std::time::Instant;

/// Observable by which the unnamed discrepancy must beat all named causes to unseat them, in nats.
const UNNAMED_MARGIN_NATS: f64 = 5.0;
/// Share of the error of decay curves at positions left out to which a cause must bring it down to count as a help.
const MAX_RMSE_RATIO: f64 = 0.97;
/// Dispersion from which an unexplained misfit looks like another room.
const WARN_DISPERSION: f64 = 3.0;
/// Dispersion from which nothing is named: measured variance over that expected, causes and smooth discrepancy taken out.
const MAX_DISPERSION: f64 = 100.0;

/// Says what is wrong with a simulated room, given what was measured in it.
///
/// 1. Traces every measured pair and fits the baseline: absorption within its stated uncertainty, gains and latencies as
///    `[measurement]` says, places within their tolerance.
/// 2. Fits every case of every effect beside all of these, and the smooth discrepancy that has no name; the evidence of each is its
///    likelihood with all parameters integrated out (Laplace's approximation), which charges for every parameter that is not needed.
/// 3. Names the strongest if its odds, corrected for the number tried, reach [`DiagnoseConfig::naming_nats`]; and so on up to
///    [`DiagnoseConfig::most_causes`]; drops those that later ones made superfluous.
/// 4. Predicts positions that it leaves out.
///
/// Same seed, same diagnosis, on any number of threads.
pub struct Diagnoser {
    pub(crate) config: DiagnoseConfig,
    pub(crate) effects: Vec<Box<dyn Effect>>,
}

impl std::fmt::Debug for Diagnoser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let effects: Vec<&str> = self.effects.iter().map(|e| e.id()).collect();
        f.debug_struct("Diagnoser").field("config", &self.config).field("effects", &effects).finish()
    }
}

impl Diagnoser {
    /// With the whole [`catalogue`].
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting outside its range.
    pub fn new(config: DiagnoseConfig) -> Result<Self, Error> {
        config.check()?;
        Ok(Self { config, effects: catalogue() })
    }

    /// With these effects instead.
    #[must_use]
    pub fn with_effects(self, effects: Vec<Box<dyn Effect>>) -> Self {
        Self { effects, ..self }
    }

    /// With those effects of its catalogue that have these identifiers.
    ///
    /// # Errors
    /// [`Error::UnknownEffect`] for an identifier that none has.
    pub fn with_only(mut self, ids: &[String]) -> Result<Self, Error> {
        if let Some(id) = ids.iter().find(|id| self.effects.iter().all(|e| e.id() != id.as_str())) {
            return Err(Error::UnknownEffect { id: id.clone() });
        }
        self.effects.retain(|e| ids.iter().any(|id| id == e.id()));
        Ok(self)
    }

    /// Diagnoses a measured room. Receivers in `hold_out` are never fitted and only predicted; without any, each group of
    /// receivers is left out in turn for that.
    ///
    /// # Errors
    /// [`Error::NoResponses`], [`Error::NothingToCompare`], [`Error::UnknownHoldOut`], [`Error::AllHeldOut`]; what reading
    /// responses and tracing give; [`sabine_acoustics::Error::Cancelled`] if the observer asks to stop.
    pub fn diagnose(
        &self,
        room: &MeasuredRoom,
        hold_out: &[String],
        observer: &dyn Observer,
    ) -> Result<Diagnosis, Error> {
        let mut held: Vec<usize> = Vec::new();
        for id in hold_out {
            let index = room.receivers().iter().position(|r| r.id == *id);
            let index = index.filter(|&i| room.responses().iter().any(|r| r.receiver == i));
            held.push(index.ok_or_else(|| Error::UnknownHoldOut { id: id.clone() })?);
        }
        if !room.responses().is_empty() && room.responses().iter().all(|r| held.contains(&r.receiver)) {
            return Err(Error::AllHeldOut);
        }
        let wave_solutions = self.config.wave_solutions && self.effects.iter().any(|e| e.needs_waves());
        let config = DiagnoseConfig { wave_solutions, ..self.config.clone() };
        let mut bench = Workbench::new(room, &held, &config, observer)?;
        let used = bench.fitted.clone();
        let cases = search::cases(&self.effects, &bench.survey);

        let started = Instant::now();
        bench.calibrate_dispersion(&[], &used)?;
        let baseline_dispersion = bench.dispersion.clone();
        let mut found = self.name(&mut bench, &cases, &used, observer)?;
        bench.seconds.insert("search", started.elapsed().as_secs_f64());

        let started = Instant::now();
        let search = Search::new(&bench, &cases, self.effects.len(), used.clone());
        let base = search.state(&[], None)?;
        let mut state = search.state(&found.chosen, Some(&base))?;
        // Receivers that are held out have no say in what is named: causes are confirmed among the others.
        let in_turn = Folds::in_turn(&bench);
        let mut predicted = predict(&search, &state, &in_turn, observer)?;
        let predicting_s = started.elapsed().as_secs_f64();

        let started = Instant::now();
        report(observer, "lack of fit", 0, 2)?;
        let lack_before = lack_of_fit::test(&bench, &[], base.before(), &used)?;
        report(observer, "lack of fit", 1, 2)?;
        let lack = |state: &State| -> Result<Option<lack_of_fit::Lack>, Error> {
            let cases = search.cases_of(&state.chosen, Observable::Decay);
            let test = || lack_of_fit::test(&bench, &cases, state.before(), &used);
            (!state.chosen.is_empty()).then(test).transpose()
        };
        let mut lack_after = lack(&state)?;
        // Where chance does not explain what a cause that is at work everywhere leaves, the cause must help where it was not fitted.
        let mut unconfirmed: Vec<&str> = Vec::new();
        while lack_after.as_ref().is_some_and(|l| l.p_value < self.config.significance) {
            let Some(worst) = least_confirmed(&search, &state, &predicted.gains) else { break };
            unconfirmed.push(search.candidates[worst].id);
            found.drop(worst);
            state = search.state(&found.chosen, Some(&base))?;
            predicted = predict(&search, &state, &in_turn, observer)?;
            lack_after = lack(&state)?;
        }
        let lack_after = lack_after.as_ref().unwrap_or(&lack_before);
        let energy_cases = search.cases_of(&state.chosen, Observable::Decay);
        let free_alone = base.energy.log_evidence + lack_before.discrepancy_nats;
        // A name must beat the discrepancy that has none. Causes that do not bear on decays are beyond its reach.
        let beaten = !energy_cases.is_empty()
            && energy_cases.len() == state.chosen.len()
            && free_alone > state.energy.log_evidence + UNNAMED_MARGIN_NATS;
        // Where bins scatter a hundred times as far as they may, the baseline itself has not been met: no name can be trusted.
        let hopeless = bench.dispersion.iter().any(|d| *d > MAX_DISPERSION);
        let verdict = if hopeless || beaten {
            Verdict::Unexplained
        } else if state.chosen.is_empty() {
            if lack_before.p_value < self.config.significance {
                Verdict::Unexplained
            } else {
                Verdict::Adequate
            }
        } else if !found.rivals.is_empty() {
            Verdict::Ambiguous
        } else {
            Verdict::Explained
        };
        let mut unseated: Vec<&str> = Vec::new();
        if verdict == Verdict::Unexplained && !state.chosen.is_empty() {
            unseated = state.chosen.iter().map(|&c| search.candidates[c].id).collect();
            state = base.clone();
            predicted = predict(&search, &state, &in_turn, observer)?;
        }
        if !held.is_empty() {
            predicted = predict(&search, &state, &Folds::never_fitted(&bench, &held), observer)?;
        }
        let testing_s = started.elapsed().as_secs_f64();

        let started = Instant::now();
        let causes: Vec<Cause> = state
            .chosen
            .iter()
            .enumerate()
            .map(|(place, &candidate)| {
                Ok(Cause {
                    effect: search.candidates[candidate].id.to_owned(),
                    subject: search.candidates[candidate].case.subject(),
                    explanation: self.effects[search.candidates[candidate].effect].explanation().to_owned(),
                    probability: found.probability(candidate),
                    nats: without(&search, &state, candidate)?,
                    parameters: parameters(&search, &state, candidate),
                    held_out_gain: predicted.gains.get(place).cloned(),
                })
            })
            .collect::<Result<_, Error>>()?;
        let alternatives: Vec<String> = match verdict {
            Verdict::Ambiguous => found.rivals.iter().map(|r| (*r).to_owned()).collect(),
            _ => Vec::new(),
        };
        let isolability = isolability(&bench, &search.candidates)?;
        let candidates = self.candidate_scores(&search, &state, &found, observer)?;
        let cases_now = search.cases_of(&state.chosen, Observable::Decay);
        let (residuals, dispersion_now) = residual_map(&bench, &base, &cases_now, &state);
        let held_out = predicted.held_out;
        let decays = if held_out.is_some() {
            predicted.decays
        } else {
            let all: Vec<usize> = (0..bench.pairs.len()).collect();
            let before = compare(&bench, &[], &base.energy.values, &all);
            let after = compare(&bench, &cases_now, &state.energy.values, &all);
            decay_curves(&bench, &before, &after, false)
        };
        let model = extension::extended_model(&bench, &search, &state);
        let at_bounds: Vec<(&str, Vec<String>)> = state
            .chosen
            .iter()
            .map(|&c| (search.candidates[c].id, at_bounds(&search, &state, c)))
            .filter(|(_, parameters)| !parameters.is_empty())
            .collect();
        let notes = notes(&Circumstances {
            bench: &bench,
            verdict,
            held_out: held_out.is_some(),
            converged: base.energy.converged && state.energy.converged && state.arrivals.converged,
            misfit_left: lack_after.p_value < self.config.significance,
            hopeless,
            scattered: baseline_dispersion.iter().any(|d| *d > WARN_DISPERSION),
            unseated: &unseated,
            unconfirmed: &unconfirmed,
            at_bounds: &at_bounds,
        });
        let mut seconds: Vec<(String, f64)> =
            bench.seconds.iter().map(|(stage, s)| ((*stage).to_owned(), *s)).collect();
        seconds.push(("lack of fit".into(), testing_s));
        seconds.push(("prediction".into(), predicting_s));
        seconds.push(("report".into(), started.elapsed().as_secs_f64()));
        let common_gain_db = common_gain(&bench, &state);
        Ok(Diagnosis {
            verdict,
            lack_of_fit: LackOfFit {
                p_value: lack_before.p_value,
                p_value_explained: lack_after.p_value,
                discrepancy_nats: lack_before.discrepancy_nats,
                discrepancy_nats_explained: lack_after.discrepancy_nats,
                dispersion: dispersion_now,
            },
            causes,
            would_decide: words_that_decide(&alternatives),
            alternatives,
            candidates,
            isolability,
            materials: fitted_materials(&bench, &base, &state),
            held_out,
            bands: bench.survey.bands,
            residuals,
            decays,
            common_gain_db,
            notes,
            model,
            seconds,
        })
    }

    fn candidate_scores(
        &self,
        search: &Search<'_>,
        state: &State,
        named: &Selection,
        observer: &dyn Observer,
    ) -> Result<Vec<CandidateScore>, Error> {
        let beside = match &named.last {
            _ if state.chosen.is_empty() => None,
            Some((chosen, scores)) if *chosen == state.chosen => Some(scores.clone()),
            _ => Some(search.by_effect(&search.scores(state, observer)?)),
        };
        Ok(named
            .first
            .iter()
            .map(|s| {
                let chosen = state.chosen.iter().any(|&c| search.candidates[c].effect == s.effect);
                let nats_beside_causes = match (&beside, chosen) {
                    (Some(all), false) => all.iter().find(|o| o.effect == s.effect).map(|o| o.nats),
                    _ => None,
                };
                CandidateScore {
                    effect: s.id.to_owned(),
                    subject: search.candidates[s.best].case.subject(),
                    nats: s.nats,
                    d_prime: s.d_prime,
                    nats_beside_causes,
                }
            })
            .collect())
    }
}

/// Observable that a chosen candidate adds to the others.
fn without(search: &Search<'_>, state: &State, candidate: usize) -> Result<f64, Error> {
    let rest: Vec<usize> = state.chosen.iter().copied().filter(|&c| c != candidate).collect();
    Ok(state.log_evidence() - search.state(&rest, Some(state))?.log_evidence())
}

fn common_gain(bench: &Workbench, state: &State) -> Option<f64> {
    bench.decay_layout().common_gain().map(|index| state.energy.values[index])
}

/// The cause at work everywhere that gains least at positions which the fit has not seen, if chance may explain even that.
fn least_confirmed(search: &Search<'_>, state: &State, gains: &[HeldOutGain]) -> Option<usize> {
    let everywhere = |c: &usize| {
        let case = search.candidates[*c].case;
        let local = |(nuisance, _): &(Nuisance, f64)| {
            matches!(nuisance, Nuisance::ReceiverPosition(_) | Nuisance::ResponseGain(_))
        };
        case.exchanged().is_none() && case.inverted().is_none() && !case.relaxes().iter().any(local)
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

/// What would tell each two of the alternatives apart.
fn words_that_decide(alternatives: &[String]) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for (i, a) in alternatives.iter().enumerate() {
        for b in &alternatives[i + 1..] {
            let word = discriminating_measurement(a, b).to_string();
            if !words.contains(&word) {
                words.push(word);
            }
        }
    }
    words
}

fn fitted_materials(bench: &Workbench, base: &State, state: &State) -> Vec<(String, FittedMaterial)> {
    (0..bench.survey.materials.len())
        .map(|m| {
            let bands = bench.survey.bands.len();
            let layout = bench.decay_layout();
            let column = |values: &[f64]| values[layout.material(m)].to_vec();
            let fitted = FittedMaterial {
                stated: bench.priors[m].iter().map(|p| p.mean).collect(),
                absorption_before: column(&base.energy.values),
                absorption: column(&state.energy.values),
                absorption_sd: (0..bands).map(|b| state.energy.sd(layout.absorption(m, b))).collect(),
            };
            (bench.survey.materials[m].clone(), fitted)
        })
        .collect()
}
