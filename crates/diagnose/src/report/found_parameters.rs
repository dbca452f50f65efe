//! What was found of a cause, with its intervals.

use crate::effect::{Nuisance, Observable};
use crate::found_parameter::{FoundParameter, interval_90};
use crate::infer::direct_evidence::merged;
use crate::infer::search::{Search, State};
use crate::likelihood::laplace::LaplaceFit;

/// The data speak of a parameter if they leave less than this share of what was known of it beforehand.
const TOLD_SHARE: f64 = 0.8;

/// Fitted parameters of a chosen candidate, what it frees among what every fit leaves open included.
pub(crate) fn parameters(search: &Search<'_>, state: &State, candidate: usize) -> Vec<FoundParameter> {
    let baseline = search.baseline;
    let case = search.candidates[candidate].case;
    let mut found = Vec::new();
    let mut push = |name: String, value: f64, sd: f64, bounds: (f64, f64), unit: &str| {
        let [low, high] = interval_90(value, sd, bounds);
        found.push(FoundParameter { name, value, low, high, unit: unit.to_owned() });
    };
    let own = state.own.iter().find(|(c, _)| *c == candidate);
    if case.observable() == Observable::PreArrival {
        return own.map(|(_, own)| own.parameters.clone()).unwrap_or_default();
    }
    let (maximum, first) = place_of(search, state, candidate);
    for (i, p) in case.parameters.iter().enumerate() {
        push(p.name.clone(), maximum.values[first + i], maximum.sd(first + i), p.bounds, &p.unit);
    }
    let bands = baseline.survey().bands;
    let open = (f64::NEG_INFINITY, f64::INFINITY);
    for &(nuisance, _) in &case.relaxes {
        match nuisance {
            Nuisance::Absorption(m) if case.opens_several_tables() => {
                let survey = baseline.survey();
                let Some(stated) = &survey.absorption_prior(m).absorption else { continue };
                let stated: f64 = stated.values().iter().sum();
                let own = baseline.decay_layout().material(m);
                let fitted: f64 = state.energy.values[own.clone()].iter().sum();
                let variance =
                    state.energy.covariance.view((own.start, own.start), (own.len(), own.len())).sum();
                let (factor, sd) = (fitted / stated, variance.max(0.0).sqrt() / stated);
                push(format!("factor_{}", survey.materials()[m]), factor, sd, (0.0, f64::INFINITY), "");
            }
            Nuisance::Absorption(m) => {
                for b in 0..bands.len() {
                    let i = baseline.decay_layout().absorption(m, b);
                    let name = format!("absorption_{}_hz", bands.nominal_hz(b));
                    push(name, state.energy.values[i], state.energy.sd(i), (0.0, 1.0), "");
                }
            }
            Nuisance::SourcePosition(_) | Nuisance::ReceiverPosition(_) => {
                let own = baseline.arrival_layout().nuisance(nuisance).unwrap_or(0..0);
                for (i, axis) in own.zip(["x", "y", "z"]) {
                    let (value, sd) = (state.arrivals.values[i], state.arrivals.sd(i));
                    push(format!("offset_{axis}"), value, sd, open, "m");
                }
            }
            Nuisance::ResponseGain(r) => {
                let i = baseline.decay_layout().gain(r);
                push("gain".into(), state.energy.values[i], state.energy.sd(i), open, "dB");
            }
        }
    }
    match own {
        Some((_, own)) => merged(found, &own.parameters),
        None => found,
    }
}

/// Fitted parameters of a chosen candidate that stand at the end of their range though the data speak of them, each with its value.
pub(crate) fn at_bounds(search: &Search<'_>, state: &State, candidate: usize) -> Vec<String> {
    let case = search.candidates[candidate].case;
    if case.observable() == Observable::PreArrival {
        return Vec::new();
    }
    let (maximum, first) = place_of(search, state, candidate);
    let told = case.parameters.iter().enumerate().filter(|(i, p)| {
        p.may_go_on(maximum.values[first + i]) && maximum.sd(first + i) < TOLD_SHARE * p.prior_sd
    });
    told.map(|(i, p)| format!("{} = {:.3}", p.name, maximum.values[first + i])).collect()
}

/// The fit that holds the parameters of a candidate, and where they start.
pub(crate) fn place_of<'s>(
    search: &Search<'_>,
    state: &'s State,
    candidate: usize,
) -> (&'s LaplaceFit, usize) {
    let part = search.candidates[candidate].case.observable();
    let same = |e: Observable| e == part || e == Observable::Channels;
    let order = state
        .chosen
        .iter()
        .filter(|&&c| same(search.candidates[c].case.observable()))
        .position(|&c| c == candidate)
        .unwrap_or(0);
    if part == Observable::Arrivals {
        (&state.arrivals, state.arrival_firsts[order])
    } else {
        (&state.energy, state.energy_firsts.get(order).copied().unwrap_or(0))
    }
}
