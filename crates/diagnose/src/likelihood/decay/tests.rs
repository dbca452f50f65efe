//! The likelihood of the decays on tables made by hand.

use super::*;
use crate::effect::Effect;
use crate::effects::{
    AirAbsorption, AngleDependentAbsorption, BackgroundNoise, CoherentReflections, CoupledVolume,
    MissingDiffraction, RoomModes, Scattering, SourceDirectivity, TransducerResponse, Truncation,
};
use crate::hand_made::Tables as HandMade;
use sabine_scene::TimeZero;

/// Away from the expansion and from all neutral values and bounds.
fn somewhere(model: &EnergyModel<'_>) -> Vec<f64> {
    let one = |(i, p): (usize, &Prior)| {
        let sd = p.sd.min(0.2 * (p.high - p.low)).min(3.0);
        (p.mean + 0.3 * sd * (1.0 + (i as f64).sin())).clamp(p.low + 0.1 * sd, p.high - 0.1 * sd)
    };
    model.priors.iter().enumerate().map(one).collect()
}

#[test]
fn the_gradient_is_that_of_central_differences() {
    let effects: [&dyn Effect; 11] = [
        &AirAbsorption,
        &AngleDependentAbsorption,
        &BackgroundNoise,
        &CoherentReflections,
        &CoupledVolume,
        &MissingDiffraction,
        &RoomModes,
        &Scattering,
        &SourceDirectivity,
        &TransducerResponse,
        &Truncation,
    ];
    for levels in [Levels::Common, Levels::Absolute, Levels::PerResponse] {
        let mut tables = HandMade::new(levels, TimeZero::Emission);
        tables.survey.diffracted = vec![0, 1, 2];
        for state in tables.states.iter_mut().flatten() {
            state.monte_carlo = state.variance.iter().map(|v| 0.4 * v).collect();
        }
        for effect in effects {
            assert_gradient(&tables, effect, &format!("{} {levels:?}", effect.id()));
        }
    }
}

/// The gradient of the likelihood of an effect's cases, away from their neutral values, against central differences.
fn assert_gradient(tables: &HandMade, effect: &dyn Effect, name: &str) {
    let mut cases = effect.cases(&tables.survey);
    let prepared = tables.prepared(&mut cases);
    let data = EnergyData { tables: &prepared, ..tables.energy_data() };
    let cases: Vec<&Case> = cases.iter().collect();
    let model = EnergyModel::new(&data, &cases, &[true; 3]);
    let values = somewhere(&model);
    let mut slopes = Slopes::zero(values.len());
    assert!(model.log_likelihood(&values, Some(&mut slopes)).is_finite(), "{name}");
    for i in 0..values.len() {
        let step = 1e-5 * model.priors[i].sd.min(1.0);
        let at = |offset: f64| {
            let mut moved = values.clone();
            moved[i] += offset;
            model.log_likelihood(&moved, None)
        };
        let expected = (at(step) - at(-step)) / (2.0 * step);
        let found = slopes.gradient[i];
        let off = (found - expected).abs();
        // Slopes of effects are differences themselves, rounded at 1e-6 of the likelihood's size.
        assert!(off < 1e-3 * expected.abs() + 2e-3, "{name} {i}: {found} {expected}");
    }
}

#[test]
fn the_gradient_of_tables_is_that_of_central_differences() {
    let tables = HandMade::new(Levels::Common, TimeZero::Emission).with_parameters();
    let effects: [&dyn Effect; 6] = [
        &AirAbsorption,
        &AngleDependentAbsorption,
        &CoherentReflections,
        &CoupledVolume,
        &Scattering,
        &SourceDirectivity,
    ];
    for effect in effects {
        assert_gradient(&tables, effect, &effect.id());
    }
}

/// The normal distribution about what is predicted, with the covariance of the measurement, of interference and of the rays.
#[test]
fn tables_are_as_probable_as_their_covariance_says() {
    use nalgebra::{DMatrix, DVector};
    let mut tables = HandMade::new(Levels::Absolute, TimeZero::Emission).with_parameters();
    // A band by itself: the chance of the rays is that of all bands of a pair together.
    tables.measured.iter_mut().for_each(|m| m.energies[1] = None);
    let data = EnergyData { dispersion: &[1.0; 2], ..tables.energy_data() };
    let used = [false, true, false];
    let model = EnergyModel::new(&data, &[], &used);
    let chance = tables.states[1][0].table.as_ref().unwrap();
    let stated = tables.measured[1].table.as_ref().unwrap()[0].clone();
    let own = stated.iter().zip(&chance.by_width_of_bins).map(|(s, width)| s.ln_sd.powi(2) + width.powi(2));
    let measurement = DVector::from_iterator(stated.len(), own);
    let covariance = chance.covariance(stated.len()) + DMatrix::from_diagonal(&measurement);
    let inverse = covariance.try_inverse().unwrap();
    let [here, there] = [0.0, 0.15].map(|more| {
        let mut values = model.start(None);
        values[model.layout.absorption(1, 0)] += more;
        let predicted = model.predicted(&values, 1, 0, stated.len());
        let measured = model.compared(1, 0).unwrap().iter().map(|q| q.ln());
        let off = DVector::from_iterator(stated.len(), measured.zip(predicted).map(|(m, p)| m - p));
        (model.log_likelihood(&values, None), -0.5 * off.dot(&(&inverse * &off)))
    });
    let (found, expected) = (there.0 - here.0, there.1 - here.1);
    assert!(expected.abs() > 0.1 && (found / expected - 1.0).abs() < 0.05, "{found} {expected}");
}

#[test]
fn a_response_that_does_not_count_has_no_say() {
    let tables = HandMade::new(Levels::Absolute, TimeZero::Emission);
    let data = tables.energy_data();
    let likelihood = |used: [bool; 3]| {
        let model = EnergyModel::new(&data, &[], &used);
        model.log_likelihood(&model.start(None), None)
    };
    let [first, second] = [[true, false, false], [false, true, true]].map(likelihood);
    assert!((likelihood([true; 3]) - first - second).abs() < 1e-9);
}

#[test]
fn a_drift_is_estimated_in_the_band_in_which_responses_drift() {
    let mut tables = HandMade::new(Levels::Absolute, TimeZero::Emission);
    for pair in 0..3 {
        for band in 0..2 {
            let predicted = &tables.states[pair][band].ln_energy;
            let drift = |bin: usize| [0.8, -0.7, 0.6][pair] * unit_drift(bin, predicted.len())[0];
            let off =
                |bin: usize| 0.1 * ((3 * bin + pair) as f64).sin() + if band == 1 { drift(bin) } else { 0.0 };
            let energies = predicted.iter().enumerate().map(|(bin, ln)| (ln + off(bin)).exp()).collect();
            tables.measured[pair].energies[band] = Some(energies);
        }
    }
    let data = EnergyData { drift_sd: &[0.0, 0.0], dispersion: &[1.0, 1.0], ..tables.energy_data() };
    let model = EnergyModel::new(&data, &[], &[true; 3]);
    let found = model.most_probable_drift(&model.start(None));
    assert_eq!(found[0], 0.0);
    // The root mean square of what was hidden is 0.7.
    assert!((0.4..1.2).contains(&found[1]), "{found:?}");
    // Without the response that counts for nothing there is as much.
    let used = [true, true, false];
    assert!(EnergyModel::new(&data, &[], &used).most_probable_drift(&model.start(None))[1] > 0.3);
}
