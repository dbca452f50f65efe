//! Turns named causes into a model that renders.

use crate::effect::{FittedCase, Observable};
use crate::extend::extended_model::ExtendedModel;
use crate::extend::model_change::ModelChange;
use crate::infer::search::{Search, State};
use crate::likelihood::arrivals;
use crate::report::found_parameters::{parameters, place_of};

/// A reflection is confirmed by a peak within this of its instant, in seconds.
const NEAR_S: f64 = 1.5e-4;

/// The overlay of the named causes over the room file.
pub(crate) fn extended_model(search: &Search<'_>, state: &State) -> ExtendedModel {
    let survey = search.baseline.survey();
    let layout = search.baseline.decay_layout();
    let absorption =
        |(m, name): (usize, &String)| (name.clone(), state.energy.values[layout.material(m)].to_vec());
    let mut model = ExtendedModel {
        centres_hz: survey.bands.iter_hz().collect(),
        absorption: survey.materials.iter().enumerate().map(absorption).collect(),
        ..ExtendedModel::default()
    };
    for &candidate in &state.chosen {
        model.causes.push(search.candidates[candidate].id.to_owned());
        for change in changes(search, state, candidate) {
            model.apply(change);
        }
    }
    model
}

/// What a chosen candidate changes in the model.
pub(crate) fn changes(search: &Search<'_>, state: &State, candidate: usize) -> Vec<ModelChange> {
    let (baseline, case) = (search.baseline, search.candidates[candidate].case);
    let survey = baseline.survey();
    let values: &[f64] = match case.observable() {
        Observable::Channels | Observable::PreArrival => &[],
        Observable::Decay | Observable::Arrivals => {
            let (maximum, first) = place_of(search, state, candidate);
            &maximum.values[first..first + case.parameters(survey).len()]
        }
    };
    let (decays, arrivals) = (baseline.decay_layout(), baseline.arrival_layout());
    let relaxed = case.relaxes().into_iter().map(|(nuisance, _)| {
        let of_decays = decays.nuisance(nuisance).map(|range| &state.energy.values[range]);
        let of_arrivals = || arrivals.nuisance(nuisance).map(|range| &state.arrivals.values[range]);
        (nuisance, of_decays.or_else(of_arrivals).unwrap_or_default().to_vec())
    });
    let width_s = |band: usize| baseline.simulation.states[0][band].bins.width_s;
    let level_per_s = |band: usize| baseline.simulation.reference[band] / width_s(band);
    let has_auxiliary = state.own.iter().any(|(c, _)| *c == candidate);
    let fitted = FittedCase {
        survey,
        values,
        relaxed: relaxed.collect(),
        auxiliary: if has_auxiliary { parameters(search, state, candidate) } else { Vec::new() },
        level_per_s: (0..survey.bands.len()).map(level_per_s).collect(),
        materials: &baseline.simulation.materials,
        confirmed: if case.seeks() { confirmed(search, state) } else { Vec::new() },
    };
    case.model_changes(&fitted)
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
