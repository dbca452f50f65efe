//! Turns named causes into a model that renders.

use crate::effect::{FittedCase, Observable};
use crate::extend::extended_model::{ExtendedModel, ModelCause};
use crate::extend::model_change::ModelChange;
use crate::extend::number_slopes::{Input, InputKind, NumberSlopes, Origin};
use crate::extend::uncertainty::absorption_at;
use crate::found_parameter::{HALF_90, interval_90};
use crate::infer::search::{Search, State};
use crate::likelihood::arrivals;
use crate::likelihood::parameters::assignment;
use crate::report::found_parameters::{parameters, place_of};

/// A reflection is confirmed by a peak within this of its instant, in seconds.
const NEAR_S: f64 = 1.5e-4;

/// The model of the named causes, in the order in which they were named.
pub(crate) fn extended_model(search: &Search<'_>, state: &State) -> ExtendedModel {
    let survey = search.baseline.survey();
    let layout = search.baseline.decay_layout();
    let mut model = ExtendedModel::default();
    model.centres_hz = survey.bands.iter_hz().collect();
    let mut numbers = NumberSlopes::default();
    for (m, material) in survey.materials.iter().enumerate() {
        model.absorption.insert(material.clone(), state.energy.values[layout.material(m)].to_vec());
        for (band, parameter) in layout.material(m).enumerate() {
            numbers.add(absorption_at(material, band), Origin::Decays(parameter), 1.0);
        }
    }
    for (place, &candidate) in state.chosen.iter().enumerate() {
        let case = search.candidates[candidate].case;
        let fitted = fitted_case(search, state, candidate);
        numbers.add_case(place, case, &fitted, &inputs(search, state, candidate, (place, &fitted)));
        model.causes.push(ModelCause {
            subject: case.subject.clone(),
            parameters: parameters(search, state, candidate),
            ..ModelCause::new(search.candidates[candidate].id, case.model_changes(&fitted))
        });
    }
    model.uncertainty = numbers.uncertainty(&state.energy.covariance, &state.arrivals.covariance);
    model
}

/// What a chosen candidate changes in the model.
pub(crate) fn changes(search: &Search<'_>, state: &State, candidate: usize) -> Vec<ModelChange> {
    search.candidates[candidate].case.model_changes(&fitted_case(search, state, candidate))
}

/// What the fit of a chosen candidate leaves open, part by part, and how far.
fn inputs(
    search: &Search<'_>,
    state: &State,
    candidate: usize,
    (place, fitted): (usize, &FittedCase<'_>),
) -> Vec<Input> {
    let (baseline, case) = (search.baseline, search.candidates[candidate].case);
    let of_decays = |parameter: usize| (Origin::Decays(parameter), state.energy.sd(parameter));
    let of_arrivals = |parameter: usize| (Origin::Arrivals(parameter), state.arrivals.sd(parameter));
    let mut inputs = Vec::new();
    let mut push = |kind: InputKind, (origin, sd): (Origin, f64)| inputs.push(Input { kind, origin, sd });
    if !fitted.values.is_empty() {
        let (_, first) = place_of(search, state, candidate);
        for i in 0..fitted.values.len() {
            let by_arrivals = case.observable() == Observable::Arrivals;
            push(
                InputKind::Value(i),
                if by_arrivals { of_arrivals(first + i) } else { of_decays(first + i) },
            );
        }
    }
    for (which, (nuisance, _)) in fitted.relaxed.iter().enumerate() {
        let of_decays = baseline.decay_layout().nuisance(*nuisance).map(|own| own.map(of_decays).collect());
        let of_arrivals =
            || baseline.arrival_layout().nuisance(*nuisance).map(|own| own.map(of_arrivals).collect());
        let own: Vec<(Origin, f64)> = of_decays.or_else(of_arrivals).unwrap_or_default();
        own.into_iter().enumerate().for_each(|(i, one)| push(InputKind::Relaxed(which, i), one));
    }
    for (i, parameter) in fitted.auxiliary.iter().enumerate() {
        let sd = (parameter.high - parameter.low) / (2.0 * HALF_90);
        if sd.is_finite() {
            push(InputKind::Auxiliary(i), (Origin::Alone(place, i, sd * sd), sd));
        }
    }
    inputs
}

/// A chosen candidate as the fit left it.
fn fitted_case<'s>(search: &'s Search<'_>, state: &'s State, candidate: usize) -> FittedCase<'s> {
    let (baseline, case) = (search.baseline, search.candidates[candidate].case);
    let survey = baseline.survey();
    let (values, intervals): (&[f64], _) = match case.observable() {
        Observable::Channels | Observable::PreArrival => (&[], Vec::new()),
        Observable::Decay | Observable::Arrivals => {
            let (maximum, first) = place_of(search, state, candidate);
            let places = case.parameters.iter().zip(first..);
            let intervals =
                places.map(|(p, at)| interval_90(maximum.values[at], maximum.sd(at), p.bounds)).collect();
            (&maximum.values[first..first + case.parameters.len()], intervals)
        }
    };
    let (decays, arrivals) = (baseline.decay_layout(), baseline.arrival_layout());
    let relaxed = case.relaxes.iter().map(|&(nuisance, _)| {
        let of_decays = decays.nuisance(nuisance).map(|range| &state.energy.values[range]);
        let of_arrivals = || arrivals.nuisance(nuisance).map(|range| &state.arrivals.values[range]);
        (nuisance, of_decays.or_else(of_arrivals).unwrap_or_default().to_vec())
    });
    let width_s = |band: usize| baseline.simulation.states[0][band].bins.width_s;
    // What is added is fitted as it was recorded; the model has it relative to the direct sound, which was recorded with the common gain.
    let gain = decays.common_gain().map_or(1.0, |index| 10f64.powf(state.energy.values[index] / 10.0));
    let level_per_s = |band: usize| baseline.simulation.reference[band] / width_s(band) / gain;
    let has_auxiliary = state.own.iter().any(|(c, _)| *c == candidate);
    FittedCase {
        survey,
        values,
        intervals,
        relaxed: relaxed.collect(),
        auxiliary: if has_auxiliary { parameters(search, state, candidate) } else { Vec::new() },
        level_per_s: (0..survey.bands.len()).map(level_per_s).collect(),
        materials: &baseline.simulation.materials,
        confirmed: case.reflection_term().map_or_else(Vec::new, |_| confirmed(search, state)),
        levels_db: levels_db(search, state),
    }
}

/// Levels that the fit found beside the prediction, `[response][band]`, in dB.
fn levels_db(search: &Search<'_>, state: &State) -> Vec<Vec<f64>> {
    let baseline = search.baseline;
    let cases = search.cases_of(&state.chosen, Observable::Decay);
    let pairs: Vec<usize> = (0..baseline.pairs()).filter(|&p| search.used[p]).collect();
    let assignment = assignment(baseline.pairs(), cases.iter().copied());
    let mut levels = vec![vec![0.0; baseline.survey().bands.len()]; baseline.pairs()];
    for r in baseline.residuals(&cases, &state.energy.values, &pairs) {
        levels[assignment[r.pair]][r.band] = r.level * 10.0 / std::f64::consts::LN_10;
    }
    levels
}

/// Responses in which a peak lies where an added reflection should come.
fn confirmed(search: &Search<'_>, state: &State) -> Vec<usize> {
    let baseline = search.baseline;
    let data = baseline.arrival_data();
    let cases = search.cases_of(&state.chosen, Observable::Arrivals);
    let model = arrivals::at_fit(&data, &cases, &search.used);
    let is_near = |pair: usize, t: &f64| {
        baseline.observations.measured[pair].peaks_s.iter().any(|p| (p - t).abs() < NEAR_S)
    };
    let seen = |pair: &usize| model.added_s(&state.arrivals.values, *pair).iter().any(|t| is_near(*pair, t));
    (0..baseline.pairs()).filter(seen).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::Effect;
    use crate::effects::{BackgroundNoise, ChannelFault, PositionError, TimeZeroOffset};
    use crate::hand_made::Tables;
    use crate::infer::candidates::cases;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn the_model_holds_what_each_chosen_case_found_and_the_fitted_absorption() {
        let baseline =
            Tables::new(Levels::Common, TimeZero::Emission).late(3e-3).baseline(DiagnoseConfig::default());
        let effects: Vec<Box<dyn Effect>> = vec![
            Box::new(TimeZeroOffset),
            Box::new(BackgroundNoise),
            Box::new(PositionError),
            Box::new(ChannelFault),
        ];
        let cases = cases(&effects, baseline.survey());
        let search = Search::new(&baseline, &cases, effects.len(), vec![true; 3]);
        let place = |id: &str, subject: &str| {
            let is = |c: &crate::infer::candidates::CatalogueCase| {
                c.id == id && c.case.subject.as_deref().unwrap_or("") == subject
            };
            cases.iter().position(is).expect("a case")
        };
        // In an order other than that of the catalogue: each finds its own values.
        let chosen = [
            place("channel_fault", "gain of s0-r1"),
            place("position_error", "r2"),
            place("background_noise", ""),
            place("time_zero", ""),
            place("channel_fault", "polarity of s0-r0"),
        ];
        let state = search.state(&chosen, None).expect("a fit");
        let model = extended_model(&search, &state);
        let (energy, arrivals) = (&state.energy, &state.arrivals);
        let all = model.applied();
        assert!((all.latency_s.expect("a latency") - 3e-3).abs() < 2e-4, "{:?}", all.latency_s);
        let (decays, times) = (baseline.decay_layout(), baseline.arrival_layout());
        assert_eq!(all.response_gain_db["s0-r1"], energy.values[decays.gain(1)]);
        for (k, at) in times.receiver(2).enumerate() {
            let stated = baseline.survey().receivers[2].position_m[k];
            assert_eq!(all.position_m["r2"][k], stated + arrivals.values[at]);
        }
        // Two terms of the decays: the first has no parameters, so that the noise follows the nuisances.
        let width_s = baseline.simulation.states[0][1].bins.width_s;
        let level = baseline.simulation.reference[1] / width_s;
        // Relative to the direct sound, which the common gain makes louder or softer as it was recorded.
        let gain_db = energy.values[decays.common_gain().expect("a gain that is open")];
        assert!(gain_db.abs() > 1e-3, "{gain_db}");
        let noise = level * 10f64.powf((energy.values[decays.len() + 1] - gain_db) / 10.0);
        assert!((all.noise_per_s[1] / noise - 1.0).abs() < 1e-12);
        assert_eq!(all.inverted, ["s0-r0"]);
        assert_eq!(model.absorption["plaster"], energy.values[decays.material(1)]);
        assert_eq!(model.causes.len(), 5);
        assert!(all.gain_db.is_empty() && all.temperature_c.is_none() && all.sheets.is_empty());
    }
}
