//! Evidence of causes that neither decays nor arrival times can weigh: from single reflections, and from before the direct sound.

use crate::arrival_model;
use crate::effect::{Case, Evidence};
use crate::gauss_newton::Maximum;
use crate::search::Search;
use crate::workbench::Workbench;
use crate::{FoundParameter, Gate, OwnEvidence};

/// What a fit says of the parameters of its cases.
#[derive(Clone, Copy)]
pub(crate) struct Fitted<'a> {
    pub energy: &'a Maximum,
    pub energy_firsts: &'a [usize],
    pub arrivals: &'a Maximum,
}

/// Gates under the chosen causes.
fn gates(search: &Search<'_>, chosen: &[usize], fitted: Fitted<'_>) -> Vec<Gate> {
    let bench = search.bench;
    let cases = search.cases_of(chosen, Evidence::Energy);
    let values: Vec<Vec<f64>> = cases
        .iter()
        .zip(fitted.energy_firsts)
        .map(|(case, &first)| {
            let count = case.parameters(&bench.survey).len();
            fitted.energy.values[first..first + count].to_vec()
        })
        .collect();
    // What is weighed by the gates themselves must not act on them beforehand.
    let (cases, values): (Vec<&dyn Case>, Vec<Vec<f64>>) =
        cases.into_iter().zip(values).filter(|(c, _)| !c.weighs_gates()).unzip();
    let data = bench.arrival_data();
    let of_times = search.cases_of(chosen, Evidence::Arrivals);
    let model = arrival_model::settled(&data, &of_times, &search.used);
    let shift_s = shifts(bench, &model, &fitted.arrivals.values);
    crate::gates::gates(bench, &cases, &values, &fitted.energy.values, &shift_s)
}

fn shifts(bench: &Workbench, model: &arrival_model::ArrivalModel<'_>, values: &[f64]) -> Vec<Vec<f64>> {
    bench
        .singles
        .iter()
        .enumerate()
        .map(|(pair, (singles, _))| singles.iter().map(|s| model.later_s(values, pair, s)).collect())
        .collect()
}

/// Evidence of each chosen cause from what comes before the direct sound, or from single reflections, of the responses that are used.
pub(crate) fn own(
    search: &Search<'_>,
    chosen: &[usize],
    fitted: Fitted<'_>,
    used: &[bool],
) -> Vec<(usize, OwnEvidence)> {
    let before_direct =
        |c: usize| Some((c, search.candidates[c].case.before_direct(&search.bench.lead_ins, used)?));
    let mut found: Vec<(usize, OwnEvidence)> = chosen.iter().copied().filter_map(before_direct).collect();
    let weighing: Vec<usize> =
        chosen.iter().copied().filter(|&c| search.candidates[c].case.weighs_gates()).collect();
    if weighing.is_empty() {
        return found;
    }
    let mut gates = gates(search, chosen, fitted);
    gates.retain(|g| used[g.response]);
    let of_energy: Vec<usize> = chosen
        .iter()
        .copied()
        .filter(|&c| search.candidates[c].case.evidence().concerns(Evidence::Energy))
        .collect();
    found.extend(weighing.into_iter().filter_map(|c| {
        let order = of_energy.iter().position(|&o| o == c)?;
        let first = *fitted.energy_firsts.get(order)?;
        let count = search.candidates[c].case.parameters(&search.bench.survey).len();
        let own: Vec<(f64, f64)> =
            (first..first + count).map(|i| (fitted.energy.values[i], fitted.energy.sd(i))).collect();
        Some((c, search.candidates[c].case.among_gates(&own, &gates)?))
    }));
    found
}

/// Nats of all of them.
pub(crate) fn sum(found: &[(usize, OwnEvidence)]) -> f64 {
    found.iter().map(|(_, e)| e.nats).sum()
}

/// Parameters from the fit with those from single reflections in the place of their namesakes, and the rest behind.
pub(crate) fn merged(fitted: Vec<FoundParameter>, own: &[FoundParameter]) -> Vec<FoundParameter> {
    let mut all: Vec<FoundParameter> =
        fitted.into_iter().map(|p| own.iter().find(|o| o.name == p.name).cloned().unwrap_or(p)).collect();
    let more: Vec<FoundParameter> =
        own.iter().filter(|o| all.iter().all(|p| p.name != o.name)).cloned().collect();
    all.extend(more);
    all
}
