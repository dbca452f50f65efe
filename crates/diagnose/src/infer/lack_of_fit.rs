//! Whether chance explains what is left: a critic of many small tests (posterior predictive checks: Gelman, Meng and Stern 1996).

mod levels;
mod scatter;
mod simulated;
mod stated;
mod table_values;

pub(crate) use levels::Levels;
pub(crate) use scatter::odd_bins;

use crate::effect::Observable;
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::infer::law_search::best::{BestFormula, Formulas};
use crate::infer::search::{Search, State};
use crate::likelihood::arrivals::ArrivalModel;
use crate::likelihood::decay::{BinResidual, EnergyModel};
use crate::observe::observed_response::Measured;
use crate::statistics::{poisson_tail, upper_tail};
use rayon::prelude::*;
use sabine_scene::Levels as StatedLevels;
use std::ops::Range;

/// Odd bins that are put down to chance, on the average: normal deviates would give 0.02 among 3000 bins, pulses that meet more.
const ODD_BY_CHANCE: f64 = 1.5;
/// Sound is early until this long after the direct sound (ISO 3382-1: speech), in seconds.
const EARLY_S: f64 = 0.05;

/// One way in which a fit may lack.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Test {
    /// What was tested.
    pub name: &'static str,
    /// Where it stands out most, if that can be said.
    pub subject: Option<String>,
    /// Probability of as much by chance, corrected for the places that were looked at.
    pub p_value: f64,
}

/// The ways in which a fit lacks.
#[derive(Clone, Debug)]
pub(crate) struct Lack {
    /// Probability of as much by chance.
    pub p_value: f64,
    /// The same of how decays fit alone, whatever was stated.
    pub decays_p_value: f64,
    /// Evidence for a smooth discrepancy, in nats.
    pub discrepancy_nats: f64,
    /// The responses' own levels by octave.
    pub levels: Levels,
    /// What the search for laws would make of what is left.
    pub formula: Option<BestFormula>,
    /// What was tested.
    pub tests: Vec<Test>,
}

/// Tests a fitted model: on measurements simulated from the model itself, on what is known of levels, on what was stated, and on
/// whether they go with an angle, a length, a direction or a time.
pub(crate) fn test(search: &Search<'_>, state: &State, formulas: Option<&Formulas>) -> Result<Lack, Error> {
    let baseline = search.baseline;
    let bands = baseline.survey().bands.len();
    let pairs: Vec<usize> = (0..search.used.len()).filter(|&p| search.used[p]).collect();
    let cases = search.cases_of(&state.chosen, Observable::Decay);
    let residuals = baseline.residuals(&cases, &state.energy.values, &pairs);
    let (mut tests, discrepancy_nats) = against_simulated(search, state, &pairs)?;
    let p_odd = poisson_tail(odd_bins(&residuals, bands), ODD_BY_CHANCE);
    let hz = |band: usize| format!("{} Hz", baseline.survey().bands.nominal_hz(band));
    let response = |pair: usize| baseline.survey().responses[pair].name.clone();
    if baseline.observations.are_tables() {
        tests.push(Test { name: "single odd values", subject: None, p_value: p_odd });
        let (by_octave, by_pair) = table_values::misfits(baseline, &residuals);
        tests.push(least("values of the tables by octave", by_octave.into_iter().enumerate(), hz));
        tests.push(least("values of the tables by pair", by_pair.into_iter().enumerate(), response));
        return Ok(with_statements(search, state, (tests, discrepancy_nats)));
    }
    tests.push(Test { name: "single odd bins", subject: None, p_value: p_odd });
    // Below the Schroeder frequency few modes decide how far bins scatter.
    let mut diffuse = residuals.clone();
    diffuse.retain(|r| r.band >= baseline.survey().bands_of_modes);
    let by_band = scatter::by_group(&diffuse, bands, |r| r.band);
    let by_pair = scatter::by_group(&diffuse, baseline.pairs(), |r| r.pair);
    tests.push(least("scatter of bins by octave", by_band.into_iter().enumerate(), hz));
    tests.push(least("scatter of bins by response", by_pair.into_iter().enumerate(), response));
    let levels = levels::levels(&residuals, &baseline.dispersion, &baseline.level_sd);
    let farthest = levels.largest.map(|(pair, band)| place(baseline, pair, band));
    let name = "levels of single responses by octave";
    tests.push(Test { name, subject: farthest, p_value: levels.p_value });
    tests.extend(what_levels_go_with(baseline, &residuals));
    let before = (&state.energy, &state.energy_firsts[..]);
    let found = formulas.map(|all| all.best(baseline, &cases, before, &search.used)).transpose()?.flatten();
    let (subject, formula) = found.unzip();
    tests.extend(formula.map(|best: BestFormula| goes_with(subject, best.p_value)));
    Ok(Lack { levels, formula, ..with_statements(search, state, (tests, discrepancy_nats)) })
}

/// What tests of decays say, and those of what was stated beside them.
fn with_statements(
    search: &Search<'_>,
    state: &State,
    (mut tests, discrepancy_nats): (Vec<Test>, f64),
) -> Lack {
    let decays_p_value = corrected(&tests);
    tests.extend(against_statements(search, state));
    let p_value = corrected(&tests);
    Lack { p_value, decays_p_value, discrepancy_nats, levels: Levels::default(), formula: None, tests }
}

/// The least probability of several tests, corrected for their number (Bonferroni).
fn corrected(tests: &[Test]) -> f64 {
    let worst = tests.iter().map(|t| t.p_value).fold(1.0, f64::min);
    (tests.len() as f64 * worst).min(1.0)
}

fn place(baseline: &Baseline, pair: usize, band: usize) -> String {
    let survey = baseline.survey();
    format!("{} at {} Hz", survey.responses[pair].name, survey.bands.nominal_hz(band))
}

/// The smallest of several probabilities, corrected for their number, and what it is of.
fn least(
    name: &'static str,
    all: impl ExactSizeIterator<Item = (usize, f64)>,
    subject: impl Fn(usize) -> String,
) -> Test {
    let count = all.len() as f64;
    let worst = all.min_by(|a, b| a.1.total_cmp(&b.1));
    Test {
        name,
        subject: worst.map(|(i, _)| subject(i)),
        p_value: worst.map_or(1.0, |(_, p)| (count * p).min(1.0)),
    }
}

/// What a measurement is compared in with those that the fitted model makes.
struct Compared {
    /// Gain of a smooth difference that all responses share, in log-likelihood and in evidence.
    smooth: (f64, f64),
    /// Sum over responses of the squared contrasts of early and late sound.
    early: f64,
    /// Pair of the largest contrast.
    largest: Option<usize>,
}

/// Tests against measurements that are simulated from the fitted model; the evidence for a smooth difference, in nats.
fn against_simulated(search: &Search<'_>, state: &State, pairs: &[usize]) -> Result<(Vec<Test>, f64), Error> {
    let baseline = search.baseline;
    let cases = search.cases_of(&state.chosen, Observable::Decay);
    let free = baseline.free_discrepancy();
    let of_tables = baseline.observations.are_tables();
    let mut all = cases.clone();
    all.push(&free);
    let early_bins = |pair: usize, band: usize| baseline.simulation.states[pair][band].bins.count(EARLY_S);
    let compare = |measured: &[Measured]| -> Result<Compared, Error> {
        let base = baseline.fit_energy_to(measured, &cases, &search.used, Some(state.before()))?;
        let more = baseline.fit_energy_to(measured, &all, &search.used, Some(state.before()))?;
        let early = if of_tables {
            Vec::new()
        } else {
            let residuals = baseline.residuals_of(measured, &cases, &base.values, pairs);
            scatter::early_against_late(&residuals, &baseline.dispersion, early_bins)
        };
        Ok(Compared {
            smooth: (more.log_likelihood - base.log_likelihood, more.log_evidence - base.log_evidence),
            early: early.iter().map(|(_, contrast)| contrast).sum(),
            largest: early.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(pair, _)| *pair),
        })
    };
    let found = compare(&baseline.observations.measured)?;
    let simulated: Vec<Compared> = (0..baseline.config.simulations as u64)
        .into_par_iter()
        .map(|i| compare(&simulated::simulate(baseline, &cases, &state.energy.values, i)))
        .collect::<Result<_, Error>>()?;
    let tail =
        |of: fn(&Compared) -> f64| upper_tail(of(&found), &simulated.iter().map(of).collect::<Vec<f64>>());
    let response = found.largest.map(|p| baseline.survey().responses[p].name.clone());
    let test = |name, subject, p_value| Test { name, subject, p_value };
    let smooth = tail(|c| c.smooth.0);
    let tests = if of_tables {
        vec![test("a smooth difference that all pairs share", None, smooth)]
    } else {
        vec![
            test("a smooth difference that all responses share", None, smooth),
            test("early sound against late in single responses", response, tail(|c| c.early)),
        ]
    };
    Ok((tests, found.smooth.1))
}

/// Whether levels of single responses go with distance, directions, sources or receivers.
fn what_levels_go_with(baseline: &Baseline, residuals: &[BinResidual]) -> Vec<Test> {
    let survey = baseline.survey();
    let line = |pair: usize| -> (f64, [f64; 3]) {
        let response = &survey.responses[pair];
        let (from, to) =
            (survey.sources[response.source].position_m, survey.receivers[response.receiver].position_m);
        let offset: [f64; 3] = std::array::from_fn(|k| to[k] - from[k]);
        let far = offset.iter().map(|o| o * o).sum::<f64>().sqrt();
        (far, offset.map(|o| o / far))
    };
    let indicator =
        |of: usize, count: usize| -> Vec<f64> { (0..count).map(|i| f64::from(u8::from(i == of))).collect() };
    let pairs = 0..survey.responses.len();
    let of_each =
        |columns: &dyn Fn(usize) -> Vec<f64>| -> Vec<Vec<f64>> { pairs.clone().map(columns).collect() };
    let known = [
        ("levels that go with the distance", of_each(&|p| vec![line(p).0.ln()])),
        ("levels that go with the direction between source and receiver", of_each(&|p| line(p).1.to_vec())),
        (
            "levels that go with the source",
            of_each(&|p| indicator(survey.responses[p].source, survey.sources.len())),
        ),
        (
            "levels that go with the receiver",
            of_each(&|p| indicator(survey.responses[p].receiver, survey.receivers.len())),
        ),
    ];
    let test = |(name, columns): (&'static str, Vec<Vec<f64>>)| {
        let p_value = levels::go_with(residuals, survey.bands.len(), &columns, baseline.config.seed)?;
        Some(Test { name, subject: None, p_value })
    };
    known.into_iter().filter_map(test).collect()
}

/// Whether what is left goes with an angle, a length, a direction or a time: whether the best of all formulas of the search for laws is better
/// than chance makes the best of them.
fn goes_with(subject: Option<String>, p_value: f64) -> Test {
    Test { name: "decays go with a quantity of paths or places", subject, p_value }
}

/// Whether fitted absorption, gains and places contradict the room file.
fn against_statements(search: &Search<'_>, state: &State) -> Vec<Test> {
    let (baseline, survey) = (search.baseline, search.baseline.survey());
    let (energy_data, arrival_data) = (baseline.energy_data(), baseline.arrival_data());
    let decay_cases = search.cases_of(&state.chosen, Observable::Decay);
    let decays = EnergyModel::new(&energy_data, &decay_cases, &search.used);
    let arrival_cases = search.cases_of(&state.chosen, Observable::Arrivals);
    let arrivals = ArrivalModel::new(&arrival_data, &arrival_cases, &search.used);
    let (layout, places) = (baseline.decay_layout(), baseline.arrival_layout());
    // Below the Schroeder frequency absorption makes up for modes.
    let of_material = |m: usize| -> Vec<usize> {
        (survey.bands_of_modes..survey.bands.len()).map(|b| layout.absorption(m, b)).collect()
    };
    let absorption = (0..survey.materials.len())
        .map(|m| (m, stated::contradiction(&state.energy, &decays, &of_material(m))));
    let mut tests = vec![least("absorption against the tables", absorption, |m| survey.materials[m].clone())];
    // Parameters of decays say nothing of gains and places.
    if baseline.observations.are_tables() {
        return tests;
    }
    if survey.measurement.levels != StatedLevels::PerResponse {
        let gains: Vec<usize> = (0..survey.responses.len()).map(|r| layout.gain(r)).collect();
        let p_value = stated::contradiction(&state.energy, &decays, &gains);
        tests.push(Test { name: "gains of responses against what is stated", subject: None, p_value });
    }
    let sources = survey.sources.len();
    let of_place = |i: usize| -> Range<usize> {
        if i < sources { places.source(i) } else { places.receiver(i - sources) }
    };
    let stated = (0..sources + survey.receivers.len()).map(|i| {
        let own: Vec<usize> = of_place(i).collect();
        (i, stated::contradiction(&state.arrivals, &arrivals, &own))
    });
    let name = |i: usize| {
        if i < sources { survey.sources[i].id.clone() } else { survey.receivers[i - sources].id.clone() }
    };
    tests.push(least("places against what is stated", stated, name));
    tests
}
