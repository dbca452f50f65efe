//! The whole diagnosis.

use crate::diagnosis::{
    CandidateScore, Cause, DecayCurves, Diagnosis, FittedMaterial, FoundParameter, HeldOut, HeldOutGain,
    LackOfFit, ResidualCell, Verdict,
};
use crate::effect::{Case, Effect, Evidence, Nuisance};
use crate::energy_model::Before;
use crate::gauss_newton::Maximum;
use crate::isolability::{isolability, would_decide};
use crate::lack_of_fit;
use crate::own_evidence::{self, Fitted, merged};
use crate::prediction::{Compared, Errors, compare, decay_db};
use crate::search::{self, EffectScore, Search, State};
use crate::workbench::{Workbench, dispersion};
use crate::{DiagnoseConfig, Error, catalogue, extension};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use sabine_acoustics::{MeasuredRoom, Observer, report};
use std::time::Instant;

/// Half the width of a 90 % interval in standard deviations.
const HALF_90: f64 = 1.645;
/// Groups of receivers that are left out in turn, at most.
const FOLDS: usize = 4;
/// Draws of the bootstrap over positions.
const BOOTSTRAP: usize = 2000;
/// Evidence by which the unnamed discrepancy must beat all named causes to unseat them, in nats.
const UNSEAT_NATS: f64 = 5.0;
/// Dispersion from which nothing is named: measured variance over that expected, causes and smooth discrepancy taken out.
const HOPELESS: f64 = 100.0;

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
    config: DiagnoseConfig,
    effects: Vec<Box<dyn Effect>>,
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
        let mut bench = Workbench::new(room, &self.config, observer)?;
        let used: Vec<bool> = bench.survey.responses.iter().map(|r| !held.contains(&r.receiver)).collect();
        let cases = search::cases(&self.effects, &bench.survey);

        let started = Instant::now();
        bench.calibrate_dispersion(&[], &used)?;
        let baseline_dispersion = bench.dispersion.clone();
        let found = self.name(&mut bench, &cases, &used, observer)?;
        bench.seconds.insert("search", started.elapsed().as_secs_f64());

        let started = Instant::now();
        report(observer, "lack of fit", 0, 2)?;
        let search = Search::new(&bench, &cases, self.effects.len(), used.clone());
        let base = search.state(&[], None)?;
        let state = search.state(&found.chosen, Some(&base))?;
        let lack_before = lack_of_fit::test(&bench, &[], base.before(), &used)?;
        report(observer, "lack of fit", 1, 2)?;
        let energy_cases = search.cases_of(&state.chosen, Evidence::Energy);
        let lack_after = if state.chosen.is_empty() {
            None
        } else {
            Some(lack_of_fit::test(&bench, &energy_cases, state.before(), &used)?)
        };
        let lack_after = lack_after.as_ref().unwrap_or(&lack_before);
        let free_alone = base.energy.log_evidence + lack_before.discrepancy_nats;
        // A name must beat the discrepancy that has none. Causes that do not bear on decays are beyond its reach.
        let beaten = !energy_cases.is_empty()
            && energy_cases.len() == state.chosen.len()
            && free_alone > state.energy.log_evidence + UNSEAT_NATS;
        let testing_s = started.elapsed().as_secs_f64();

        let started = Instant::now();
        // Where bins scatter a hundred times as far as they may, the baseline itself has not been met: no name can be trusted.
        let hopeless = bench.dispersion.iter().any(|d| *d > HOPELESS);
        let verdict = if hopeless {
            Verdict::Unexplained
        } else if state.chosen.is_empty() {
            if lack_before.p_value < self.config.significance {
                Verdict::Unexplained
            } else {
                Verdict::Adequate
            }
        } else if beaten {
            Verdict::Unexplained
        } else if !found.rivals.is_empty() {
            Verdict::Ambiguous
        } else {
            Verdict::Explained
        };
        let state = if verdict == Verdict::Unexplained { base.clone() } else { state };
        let unseated: Vec<&str> = match verdict {
            Verdict::Unexplained => found.chosen.iter().map(|&c| search.candidates[c].id).collect(),
            _ => Vec::new(),
        };

        let fold = Folds::new(&bench, &held);
        let (held_out, gains) = predict(&search, &state, &fold, &held, observer)?;
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
                    held_out_gain: gains.get(place).cloned().flatten(),
                })
            })
            .collect::<Result<_, Error>>()?;
        let alternatives: Vec<String> = match verdict {
            Verdict::Ambiguous => found.rivals.iter().map(|r| (*r).to_owned()).collect(),
            _ => Vec::new(),
        };
        let mut decides: Vec<String> = Vec::new();
        for (i, a) in alternatives.iter().enumerate() {
            for b in &alternatives[i + 1..] {
                let word = would_decide(a, b).to_owned();
                if !decides.contains(&word) {
                    decides.push(word);
                }
            }
        }
        let isolability = isolability(&bench, &search.candidates)?;
        let candidates = self.candidate_scores(&search, &state, &found, observer)?;
        let cases_now = search.cases_of(&state.chosen, Evidence::Energy);
        let (residuals, dispersion_now) = residual_map(&bench, &base, &cases_now, &state);
        let decays = match &held_out {
            Some(_) => fold.decays(&search, &state)?,
            None => decays_of(
                &bench,
                &(0..bench.pairs.len()).collect::<Vec<_>>(),
                (&[], &base.energy.values),
                (&cases_now, &state.energy.values),
                false,
            ),
        };
        let model = extension::extended_model(&bench, &search, &state);
        let mut notes = bench.notes.clone();
        if bench.survey.air_assumed {
            notes.push("The room file states no climate: 20 degrees and 50 % humidity were assumed.".into());
        }
        if bench.survey.responses.len() == 1 {
            notes.push(
                "One response only: what is the same at every position cannot be told from what is not."
                    .into(),
            );
        }
        if held_out.is_none() {
            notes.push("Too few receivers to hold any out: no gain at new positions can be given.".into());
        }
        if hopeless {
            notes.push(
                "The simulation could not be fitted to these responses at all: stated materials, places or mesh may be far off. No \
                 cause is named."
                    .into(),
            );
        } else if !unseated.is_empty() {
            notes.push(format!(
                "{} would help, but a smooth discrepancy without a name explains more: the cause is not in the catalogue.",
                unseated.join(" and ")
            ));
        }
        if !(base.energy.settled && state.energy.settled && state.arrivals.settled) {
            notes.push(
                "A fit had not come to rest after its last step: take its figures with caution.".into(),
            );
        }
        if verdict == Verdict::Explained && lack_after.p_value < self.config.significance {
            notes.push("A significant misfit is left that none of the named causes explains.".into());
        }
        if bench.arrivals.iter().any(Vec::is_empty) {
            notes.push("Where the direct line is blocked, arrival times are not compared.".into());
        }
        if baseline_dispersion.iter().any(|d| *d > 3.0) && verdict == Verdict::Unexplained {
            notes.push(
                "The responses scatter far more than this room would: are they of another room?".into(),
            );
        }
        let materials = (0..bench.survey.materials.len())
            .map(|m| {
                let bands = bench.survey.bands.len();
                let column = |values: &[f64]| values[m * bands..(m + 1) * bands].to_vec();
                let fitted = FittedMaterial {
                    stated: bench.priors[m].iter().map(|p| p.mean).collect(),
                    absorption_before: column(&base.energy.values),
                    absorption: column(&state.energy.values),
                    absorption_sd: (0..bands).map(|b| state.energy.sd(m * bands + b)).collect(),
                };
                (bench.survey.materials[m].clone(), fitted)
            })
            .collect();
        let mut seconds: Vec<(String, f64)> =
            bench.seconds.iter().map(|(stage, s)| ((*stage).to_owned(), *s)).collect();
        seconds.push(("lack of fit".into(), testing_s));
        seconds.push(("prediction".into(), started.elapsed().as_secs_f64()));
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
            alternatives,
            would_decide: decides,
            candidates,
            isolability,
            materials,
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

    /// Greedy naming, the dispersion estimated anew after each name, and a backward check.
    fn name(
        &self,
        bench: &mut Workbench,
        cases: &[(usize, &'static str, Box<dyn Case>)],
        used: &[bool],
        observer: &dyn Observer,
    ) -> Result<Named, Error> {
        let mut named = Named::default();
        while named.chosen.len() < self.config.most_causes {
            let (ranked, rivals, threshold) = {
                let search = Search::new(bench, cases, self.effects.len(), used.to_vec());
                let base = search.state(&[], None)?;
                let state = search.state(&named.chosen, Some(&base))?;
                let ranked: Vec<EffectScore> = search
                    .by_effect(&search.scores(&state, observer)?)
                    .into_iter()
                    .filter(|s| {
                        named.chosen.iter().all(|&c| {
                            search.candidates[c].effect != s.effect
                                || search.candidates[c].case.subject().is_some()
                        })
                    })
                    .collect();
                let threshold = search.threshold();
                let named_now = ranked.first().is_some_and(|best| best.nats >= threshold);
                let rivals = if named_now { search.rivals(&state, &ranked)? } else { Vec::new() };
                (ranked, rivals, threshold)
            };
            if named.first.is_empty() {
                named.first.clone_from(&ranked);
            }
            let Some(best) = ranked.first().filter(|b| b.nats >= threshold) else { break };
            let strongest = best.nats.max(0.0);
            let sum: f64 = ranked.iter().map(|r| (r.nats - strongest).exp()).sum::<f64>()
                + (threshold - self.config.naming_nats - strongest).exp();
            named.probabilities.push((best.best, (best.nats - strongest).exp() / sum));
            named.chosen.push(best.best);
            if !rivals.is_empty() {
                named.rivals = std::iter::once(best.id).chain(rivals.iter().map(|r| r.id)).collect();
                break;
            }
            let (moved, warmer_k, absorption) = {
                let search = Search::new(bench, cases, self.effects.len(), used.to_vec());
                let state = search.state(&named.chosen, None)?;
                let offset = |first: usize| std::array::from_fn(|k| state.arrivals.values[first + k]);
                let moved: Vec<(Nuisance, [f64; 3])> = cases[best.best]
                    .2
                    .widens()
                    .into_iter()
                    .filter_map(|(place, _)| match place {
                        Nuisance::SourcePosition(i) => Some((place, offset(3 * i))),
                        Nuisance::ReceiverPosition(i) => {
                            Some((place, offset(3 * (bench.survey.sources.len() + i))))
                        }
                        _ => None,
                    })
                    .collect();
                let (maximum, first) = place_of(&search, &state, best.best);
                let case = &cases[best.best].2;
                let own = maximum.values.get(first..first + case.parameters(&bench.survey).len());
                let warmer_k = own.map_or(0.0, |values| case.warmer_by_k(values, &bench.survey));
                (moved, warmer_k, state.energy.values)
            };
            // With the cause at work the materials are others: what is compared, and with which spread, follows them.
            if cases[best.best].2.evidence() != Evidence::Arrivals {
                bench.expand_about(&absorption)?;
            }
            if warmer_k != 0.0 {
                bench.warm(warmer_k)?;
            }
            for (place, offset_m) in moved {
                bench.move_place(place, offset_m)?;
            }
            let chosen: Vec<&dyn Case> = named
                .chosen
                .iter()
                .map(|&c| &*cases[c].2)
                .filter(|c| c.evidence() != Evidence::Arrivals)
                .collect();
            bench.calibrate_dispersion(&chosen, used)?;
        }
        let search = Search::new(bench, cases, self.effects.len(), used.to_vec());
        let state = search.backward(search.state(&named.chosen, None)?)?;
        named.chosen = state.chosen;
        Ok(named)
    }

    fn candidate_scores(
        &self,
        search: &Search<'_>,
        state: &State,
        named: &Named,
        observer: &dyn Observer,
    ) -> Result<Vec<CandidateScore>, Error> {
        let beside = if state.chosen.is_empty() {
            None
        } else {
            Some(search.by_effect(&search.scores(state, observer)?))
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
                    nats_beside_causes,
                }
            })
            .collect())
    }
}

/// What the search found.
#[derive(Default)]
struct Named {
    chosen: Vec<usize>,
    probabilities: Vec<(usize, f64)>,
    /// The last cause and those that explain as much.
    rivals: Vec<&'static str>,
    /// All effects beside the baseline.
    first: Vec<EffectScore>,
}

impl Named {
    fn probability(&self, candidate: usize) -> f64 {
        self.probabilities.iter().find(|p| p.0 == candidate).map_or(0.0, |p| p.1)
    }
}

/// Evidence that a chosen candidate adds to the others.
fn without(search: &Search<'_>, state: &State, candidate: usize) -> Result<f64, Error> {
    let rest: Vec<usize> = state.chosen.iter().copied().filter(|&c| c != candidate).collect();
    Ok(state.log_evidence() - search.state(&rest, Some(state))?.log_evidence())
}

/// Fitted parameters of a chosen candidate, what it frees among what every fit leaves open included.
pub(crate) fn parameters(search: &Search<'_>, state: &State, candidate: usize) -> Vec<FoundParameter> {
    let bench = search.bench;
    let case = search.candidates[candidate].case;
    let mut found = Vec::new();
    let mut push = |name: String, value: f64, sd: f64, bounds: (f64, f64), unit: &str| {
        found.push(FoundParameter {
            name,
            value,
            low: (value - HALF_90 * sd).max(bounds.0),
            high: (value + HALF_90 * sd).min(bounds.1),
            unit: unit.to_owned(),
        });
    };
    let (maximum, first) = place_of(search, state, candidate);
    let own = state.own.iter().find(|(c, _)| *c == candidate);
    for (i, p) in case.parameters(&bench.survey).into_iter().enumerate() {
        push(p.name, maximum.values[first + i], maximum.sd(first + i), p.bounds, p.unit);
    }
    let bands = bench.survey.bands;
    let open = (f64::NEG_INFINITY, f64::INFINITY);
    for (nuisance, _) in case.widens() {
        match nuisance {
            Nuisance::Absorption(m) => {
                for b in 0..bands.len() {
                    let i = m * bands.len() + b;
                    let name = format!("absorption_{}_hz", bands.nominal_hz(b));
                    push(name, state.energy.values[i], state.energy.sd(i), (0.0, 1.0), "");
                }
            }
            Nuisance::SourcePosition(_) | Nuisance::ReceiverPosition(_) => {
                let first = match nuisance {
                    Nuisance::SourcePosition(i) => 3 * i,
                    Nuisance::ReceiverPosition(i) => 3 * (bench.survey.sources.len() + i),
                    _ => continue,
                };
                for (k, axis) in ["x", "y", "z"].iter().enumerate() {
                    let (value, sd) = (state.arrivals.values[first + k], state.arrivals.sd(first + k));
                    push(format!("offset_{axis}"), value, sd, open, "m");
                }
            }
            Nuisance::ResponseGain(r) => {
                let i = state.energy_gain(search, r);
                push("gain".into(), state.energy.values[i], state.energy.sd(i), open, "dB");
            }
        }
    }
    match own {
        Some((_, own)) => merged(found, &own.parameters),
        None => found,
    }
}

/// The fit that holds the parameters of a candidate, and where they start.
pub(crate) fn place_of<'s>(
    search: &Search<'_>,
    state: &'s State,
    candidate: usize,
) -> (&'s crate::gauss_newton::Maximum, usize) {
    let part = search.candidates[candidate].case.evidence();
    let same = |e: Evidence| e == part || e == Evidence::Assignment;
    let order = state
        .chosen
        .iter()
        .filter(|&&c| same(search.candidates[c].case.evidence()))
        .position(|&c| c == candidate)
        .unwrap_or(0);
    if part == Evidence::Arrivals {
        (&state.arrivals, state.arrival_firsts[order])
    } else {
        (&state.energy, state.energy_firsts.get(order).copied().unwrap_or(0))
    }
}

fn common_gain(bench: &Workbench, state: &State) -> Option<f64> {
    let index = bench.priors.len() * bench.survey.bands.len();
    (bench.survey.measurement.levels == sabine_acoustics::Levels::Common).then(|| state.energy.values[index])
}

/// Receivers that are predicted from others.
struct Folds {
    /// Pairs fitted, and pairs predicted.
    splits: Vec<(Vec<bool>, Vec<usize>)>,
    receivers: Vec<usize>,
}

impl Folds {
    fn new(bench: &Workbench, held: &[usize]) -> Self {
        let responses = &bench.survey.responses;
        let mut receivers: Vec<usize> = responses.iter().map(|r| r.receiver).collect();
        receivers.sort_unstable();
        receivers.dedup();
        let never = !held.is_empty();
        let groups: Vec<Vec<usize>> = if never {
            held.iter().map(|&r| vec![r]).collect()
        } else if receivers.len() < 2 {
            Vec::new()
        } else {
            let count = receivers.len().min(FOLDS);
            (0..count).map(|g| receivers.iter().copied().skip(g).step_by(count).collect()).collect()
        };
        let splits = groups
            .iter()
            .map(|group| {
                let out = |r: usize| if never { held.contains(&r) } else { group.contains(&r) };
                let used = responses.iter().map(|r| !out(r.receiver)).collect();
                let pairs =
                    (0..responses.len()).filter(|&p| group.contains(&responses[p].receiver)).collect();
                (used, pairs)
            })
            .collect();
        Self { splits, receivers: groups.into_iter().flatten().collect() }
    }

    fn decays(&self, search: &Search<'_>, state: &State) -> Result<Vec<DecayCurves>, Error> {
        let cases = search.cases_of(&state.chosen, Evidence::Energy);
        let parts: Vec<Vec<DecayCurves>> = self
            .splits
            .par_iter()
            .map(|(used, pairs)| {
                let before = search.bench.fit_energy(&[], used, None)?.0;
                let after = search.bench.fit_energy(&cases, used, Some(state.before()))?.0;
                Ok(decays_of(search.bench, pairs, (&[], &before.values), (&cases, &after.values), true))
            })
            .collect::<Result<_, Error>>()?;
        Ok(parts.into_iter().flatten().collect())
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

/// Predicts the receivers that were left out.
fn predict(
    search: &Search<'_>,
    state: &State,
    folds: &Folds,
    held: &[usize],
    observer: &dyn Observer,
) -> Result<(Option<HeldOut>, Vec<Option<HeldOutGain>>), Error> {
    let bench = search.bench;
    if folds.splits.is_empty() {
        return Ok((None, vec![None; state.chosen.len()]));
    }
    let free = bench.free_discrepancy();
    let total = folds.splits.len() as u64;
    let done = std::sync::atomic::AtomicU64::new(0);
    let splits: Vec<SplitGain> = folds
        .splits
        .par_iter()
        .map(|(used, pairs)| {
            let behind = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            report(observer, "held-out positions", behind, total)?;
            let mut whole = used.clone();
            pairs.iter().for_each(|&p| whole[p] = true);
            // The logarithm of the predictive density is what the evidence grows by when the new positions come in.
            let predictive =
                |chosen: &[usize], free: Option<&dyn Case>| -> Result<(f64, Vec<Compared>), Error> {
                    let mut cases = search.cases_of(chosen, Evidence::Energy);
                    cases.extend(free);
                    let arrivals = search.cases_of(chosen, Evidence::Arrivals);
                    let firsts: &[usize] = if *chosen == *state.chosen { &state.energy_firsts } else { &[] };
                    let before = Before { values: &state.energy.values, firsts };
                    let (fitted, firsts) = bench.fit_energy(&cases, used, Some(before))?;
                    let with = bench.fit_energy(&cases, &whole, Some(before))?.0;
                    let energy = with.log_evidence - fitted.log_evidence;
                    let all_times = bench.fit_arrivals(&arrivals, &whole)?.0;
                    let seen_times = bench.fit_arrivals(&arrivals, used)?.0;
                    let times = all_times.log_evidence - seen_times.log_evidence;
                    let single = |energy: &Maximum, arrivals: &Maximum, used: &[bool]| {
                        let fitted = Fitted { energy, energy_firsts: &firsts, arrivals };
                        own_evidence::sum(&own_evidence::own(search, chosen, fitted, used))
                    };
                    let singles = single(&with, &all_times, &whole) - single(&fitted, &seen_times, used);
                    let all = search.all_cases(chosen);
                    let signs = bench.polarity(&all, &whole) - bench.polarity(&all, used);
                    Ok((energy + times + signs + singles, compare(bench, &cases, &fitted.values, pairs)))
                };
            let (base, before) = predictive(&[], None)?;
            let (free, discrepant) = predictive(&[], Some(&free))?;
            let (named, after) = if state.chosen.is_empty() {
                (base, compare_again(&before))
            } else {
                predictive(&state.chosen, None)?
            };
            let mut each = Vec::new();
            let mut without_each = Vec::new();
            for &c in &state.chosen {
                let rest: Vec<usize> = state.chosen.iter().copied().filter(|&o| o != c).collect();
                let (lacking, predicted) =
                    if rest.is_empty() { (base, compare_again(&before)) } else { predictive(&rest, None)? };
                each.push(named - lacking);
                without_each.push(predicted);
            }
            let bins = before.iter().map(|c| c.measured.len() as f64).sum();
            Ok(SplitGain {
                named: named - base,
                free: free - base,
                each,
                bins,
                predicted: [before, after, discrepant],
                without_each,
            })
        })
        .collect::<Result<_, Error>>()?;
    let bins: f64 = splits.iter().map(|s| s.bins).sum();
    let mean = |gain: &dyn Fn(&SplitGain) -> f64| splits.iter().map(gain).sum::<f64>() / bins;
    let interval = |gain: &dyn Fn(&SplitGain) -> f64| bootstrap(&splits, gain, bench.config.seed);
    let errors: Vec<Errors> = (0..3)
        .map(|k| Errors::of(&splits.iter().flat_map(|s| s.predicted[k].iter().map(copy)).collect::<Vec<_>>()))
        .collect();
    let three = |value: fn(&Errors) -> f64| [value(&errors[0]), value(&errors[1]), value(&errors[2])];
    let held_out = HeldOut {
        receivers: folds.receivers.iter().map(|&r| bench.survey.receivers[r].id.clone()).collect(),
        never_fitted: !held.is_empty(),
        db_rmse: three(|e| e.db_rmse),
        t20_jnd: three(|e| e.t20_jnd),
        c50_jnd: three(|e| e.c50_jnd),
        nats_per_bin: [mean(&|s| s.named), mean(&|s| s.free)],
        nats_interval: [interval(&|s| s.named), interval(&|s| s.free)],
    };
    let gains = (0..state.chosen.len())
        .map(|i| {
            let [low, high] = interval(&|s| s.each[i]);
            let before: Vec<Compared> =
                splits.iter().flat_map(|s| s.without_each[i].iter().map(copy)).collect();
            Some(HeldOutGain {
                nats_per_bin: mean(&|s| s.each[i]),
                low,
                high,
                db_rmse_before: Errors::of(&before).db_rmse,
                db_rmse_after: errors[1].db_rmse,
            })
        })
        .collect();
    Ok((Some(held_out), gains))
}

fn copy(c: &Compared) -> Compared {
    Compared {
        pair: c.pair,
        band: c.band,
        times_s: c.times_s.clone(),
        measured: c.measured.clone(),
        predicted: c.predicted.clone(),
    }
}

fn compare_again(all: &[Compared]) -> Vec<Compared> {
    all.iter().map(copy).collect()
}

/// 90 % interval of the mean gain per bin if other positions had been measured (Efron 1979).
fn bootstrap(splits: &[SplitGain], gain: &dyn Fn(&SplitGain) -> f64, seed: u64) -> [f64; 2] {
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0xB007);
    let mut means: Vec<f64> = (0..BOOTSTRAP)
        .map(|_| {
            let (mut sum, mut bins) = (0.0, 0.0);
            for _ in 0..splits.len() {
                let s = &splits[random.random_range(0..splits.len())];
                sum += gain(s);
                bins += s.bins;
            }
            sum / bins
        })
        .collect();
    means.sort_by(f64::total_cmp);
    [means[BOOTSTRAP / 20], means[BOOTSTRAP - 1 - BOOTSTRAP / 20]]
}

type Model<'a> = (&'a [&'a dyn Case], &'a [f64]);

fn decays_of(
    bench: &Workbench,
    pairs: &[usize],
    before: Model<'_>,
    after: Model<'_>,
    held_out: bool,
) -> Vec<DecayCurves> {
    let before = compare(bench, before.0, before.1, pairs);
    let after = compare(bench, after.0, after.1, pairs);
    before
        .iter()
        .zip(&after)
        .map(|(b, a)| {
            let total = b.measured.iter().sum::<f64>().max(1e-300);
            DecayCurves {
                response: bench.survey.responses[b.pair].name.clone(),
                band_hz: bench.survey.bands.nominal_hz(b.band),
                time_s: b.times_s.clone(),
                measured_db: decay_db(&b.measured, total),
                before_db: decay_db(&b.predicted, total),
                after_db: decay_db(&a.predicted, total),
                held_out,
            }
        })
        .collect()
}

/// Residuals by response, octave and bin, their mean over responses, and the dispersion under the causes.
fn residual_map(
    bench: &Workbench,
    base: &State,
    cases: &[&dyn Case],
    state: &State,
) -> (Vec<ResidualCell>, Vec<f64>) {
    let all: Vec<usize> = (0..bench.pairs.len()).collect();
    let before = bench.residuals(&[], &base.energy.values, &all);
    let after = bench.residuals(cases, &state.energy.values, &all);
    let db = |ln: f64| ln * 10.0 / std::f64::consts::LN_10;
    let mut cells = Vec::new();
    let mut means: std::collections::BTreeMap<(usize, usize), (f64, f64, f64, f64)> =
        std::collections::BTreeMap::new();
    for (b, a) in before.iter().zip(&after) {
        let bins = bench.states[b.pair][b.band].bins;
        cells.push(ResidualCell {
            response: Some(bench.survey.responses[b.pair].name.clone()),
            band_hz: bench.survey.bands.nominal_hz(b.band),
            time_s: bins.centre_s(b.bin),
            before_db: db(b.ln_ratio),
            after_db: db(a.ln_ratio),
            expected_sd_db: db(b.variance.sqrt()),
        });
        let mean = means.entry((b.band, b.bin)).or_default();
        mean.0 += b.ln_ratio.min(20.0).exp();
        mean.1 += a.ln_ratio.min(20.0).exp();
        mean.2 += b.variance;
        mean.3 += 1.0;
    }
    for ((band, bin), (b, a, variance, n)) in means {
        let Some(pair) = (0..bench.pairs.len()).find(|&p| bench.ends[p][band] > bin) else { continue };
        cells.push(ResidualCell {
            response: None,
            band_hz: bench.survey.bands.nominal_hz(band),
            time_s: bench.states[pair][band].bins.centre_s(bin),
            before_db: db((b / n).max(1e-9).ln()),
            after_db: db((a / n).max(1e-9).ln()),
            expected_sd_db: db((variance / n / n).sqrt()),
        });
    }
    (cells, dispersion(&after, bench.survey.bands.len()))
}
