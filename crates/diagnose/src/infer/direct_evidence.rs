//! Evidence of causes that neither decays nor arrival times can weigh: from single reflections, and from before the direct sound.

use crate::effect::reflection_gate::ReflectionGate;
use crate::effect::{AuxiliaryEvidence, Case, Observable, ReflectionEvidence};
use crate::found_parameter::FoundParameter;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::{Candidate, cases_of};
use crate::likelihood::arrivals;
use crate::likelihood::laplace::LaplaceFit;

/// What a fit says of the parameters of its cases.
#[derive(Clone, Copy)]
pub(crate) struct Fitted<'a> {
    pub energy: &'a LaplaceFit,
    pub energy_firsts: &'a [usize],
    pub arrivals: &'a LaplaceFit,
}

/// What single reflections say for a case, where they weigh it.
fn reflection_evidence(case: &Case) -> Option<&dyn ReflectionEvidence> {
    case.decay_term()?.reflection_evidence()
}

/// Gates under the chosen causes.
fn gates(
    baseline: &Baseline,
    (candidates, fit_used): (&[Candidate<'_>], &[bool]),
    chosen: &[usize],
    fitted: Fitted<'_>,
) -> Vec<ReflectionGate> {
    let cases = cases_of(candidates, chosen, Observable::Decay);
    let values: Vec<Vec<f64>> = cases
        .iter()
        .zip(fitted.energy_firsts)
        .map(|(case, &first)| {
            let count = case.parameters.len();
            fitted.energy.values[first..first + count].to_vec()
        })
        .collect();
    // What is weighed by the gates themselves must not act on them beforehand.
    let (cases, values): (Vec<&Case>, Vec<Vec<f64>>) =
        cases.into_iter().zip(values).filter(|(case, _)| reflection_evidence(case).is_none()).unzip();
    let data = baseline.arrival_data();
    let of_times = cases_of(candidates, chosen, Observable::Arrivals);
    let model = arrivals::at_fit(&data, &of_times, fit_used);
    let shift_s = shifts(baseline, &model, &fitted.arrivals.values);
    crate::likelihood::reflection_gates::gates(
        &baseline.observations,
        &baseline.simulation,
        &cases,
        &values,
        &fitted.energy.values,
        &shift_s,
    )
}

fn shifts(baseline: &Baseline, model: &arrivals::ArrivalModel<'_>, values: &[f64]) -> Vec<Vec<f64>> {
    baseline
        .simulation
        .isolated_reflections
        .iter()
        .enumerate()
        .map(|(pair, (isolated_reflections, _))| {
            isolated_reflections.iter().map(|s| model.later_s(values, pair, s)).collect()
        })
        .collect()
}

/// Evidence of each chosen cause from what comes before the direct sound, or from single reflections, of the responses that are used.
pub(crate) fn own(
    baseline: &Baseline,
    (candidates, fit_used): (&[Candidate<'_>], &[bool]),
    chosen: &[usize],
    fitted: Fitted<'_>,
    used: &[bool],
) -> Vec<(usize, AuxiliaryEvidence)> {
    let pre_arrival = |c: usize| {
        let term = candidates[c].case.pre_arrival_term()?;
        Some((c, term.weigh(&baseline.observations.pre_arrival, used)?))
    };
    let mut found: Vec<(usize, AuxiliaryEvidence)> = chosen.iter().copied().filter_map(pre_arrival).collect();
    let weighing: Vec<usize> =
        chosen.iter().copied().filter(|&c| reflection_evidence(candidates[c].case).is_some()).collect();
    if weighing.is_empty() {
        return found;
    }
    let mut gates = gates(baseline, (candidates, fit_used), chosen, fitted);
    gates.retain(|g| used[g.response]);
    let of_energy: Vec<usize> = chosen
        .iter()
        .copied()
        .filter(|&c| candidates[c].case.observable().concerns(Observable::Decay))
        .collect();
    found.extend(weighing.into_iter().filter_map(|c| {
        let order = of_energy.iter().position(|&o| o == c)?;
        let first = *fitted.energy_firsts.get(order)?;
        let count = candidates[c].case.parameters.len();
        let own: Vec<(f64, f64)> =
            (first..first + count).map(|i| (fitted.energy.values[i], fitted.energy.sd(i))).collect();
        Some((c, reflection_evidence(candidates[c].case)?.weigh(&own, &gates)?))
    }));
    found
}

/// Nats of all of them.
pub(crate) fn sum(found: &[(usize, AuxiliaryEvidence)]) -> f64 {
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
