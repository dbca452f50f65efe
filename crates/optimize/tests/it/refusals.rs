//! Bad input is refused by name.

use crate::ergodic::Ergodic;
use sabine_acoustics::{Air, Bands, Estimate, Material, OutOfRange, PerBand};
use sabine_optimize::{AbsorptionPrior, Error, FitConfig, FitProblem, MaterialFit, MaterialFitter};
use sabine_paths::PathSet;
use std::ops::ControlFlow;

const OCTAVES: Bands = Bands::SIMULATION;

fn room() -> Ergodic {
    Ergodic { shares: vec![0.7, 0.3], mean_free_path_m: 3.0, rays: 64, duration_s: 0.6 }
}

fn fit(paths: &[&PathSet], priors: &[AbsorptionPrior], target: Estimate) -> Result<MaterialFit, Error> {
    let materials = vec![Material::uniform(OCTAVES, 0.1, 0.5).unwrap(); 2];
    let targets = PerBand::uniform(Bands::T60, target);
    MaterialFitter::new(FitConfig::default())?.fit_t60(
        paths,
        &FitProblem::new(&materials, priors, &Air::default()),
        &targets,
        &(),
    )
}

fn prior(mean: f64, standard_deviation: f64) -> AbsorptionPrior {
    AbsorptionPrior::uniform(OCTAVES, mean, standard_deviation)
}

#[test]
fn targets_that_no_room_has() {
    let paths = room().trace(1);
    let priors = [prior(0.1, 0.1), prior(0.1, 0.1)];
    for value in [f64::NAN, 0.0, -1.0, 30.0, f64::INFINITY, 0.001] {
        let error = fit(&[&paths], &priors, Estimate::exact(value)).unwrap_err();
        assert!(matches!(error, Error::Target { band_hz: 125.0, .. }), "{value}: {error}");
    }
    for error in [f64::NAN, -0.1, f64::INFINITY] {
        let error = fit(&[&paths], &priors, Estimate::new(0.5, error)).unwrap_err();
        assert!(matches!(error, Error::TargetError { .. }), "{error}");
    }
}

#[test]
fn paths_that_end_too_soon() {
    let paths = room().trace(1);
    let error = fit(&[&paths], &[prior(0.1, 0.1), prior(0.1, 0.1)], Estimate::exact(2.0)).unwrap_err();
    assert!(matches!(error, Error::PathsTooShort { band_hz, .. } if band_hz == 62.5), "{error}");
    // Long enough, but not by much: said.
    let fit = fit(&[&paths], &[prior(0.1, 0.1), prior(0.1, 0.1)], Estimate::exact(0.9)).unwrap();
    assert!(!fit.warnings.is_empty());
}

#[test]
fn priors_that_contradict_themselves_or_the_bounds() {
    let paths = room().trace(1);
    let good = prior(0.1, 0.1);
    let run = |bad: AbsorptionPrior| fit(&[&paths], &[good.clone(), bad], Estimate::exact(0.5)).unwrap_err();
    for mean in [f64::NAN, -0.1, 1.1] {
        assert!(matches!(run(prior(mean, 0.1)), Error::Prior { material: 1, field: "mean", .. }));
    }
    for deviation in [f64::NAN, -0.1, f64::INFINITY] {
        assert!(matches!(run(prior(0.1, deviation)), Error::Prior { field: "standard_deviation", .. }));
    }
    assert!(matches!(run(prior(1.0, 0.0)), Error::ContradictoryPrior { material: 1, .. }));
    let other_bands = AbsorptionPrior::uniform(Bands::T60, 0.1, 0.1);
    assert!(matches!(run(other_bands), Error::Acoustics(_)));
    assert!(matches!(
        fit(&[&paths], std::slice::from_ref(&good), Estimate::exact(0.5)),
        Err(Error::Count { .. })
    ));
}

#[test]
fn no_paths_or_those_of_another_room() {
    let priors = [prior(0.1, 0.1), prior(0.1, 0.1)];
    let empty = PathSet::new(2, 100.0);
    let full = room().trace(1);
    let three = Ergodic { shares: vec![0.4, 0.3, 0.3], ..room() }.trace(1);
    let run = |paths: &[&PathSet]| fit(paths, &priors, Estimate::exact(0.5)).unwrap_err();
    assert!(matches!(run(&[]), Error::NoPaths { count: 0, .. }));
    assert!(matches!(run(&[&full, &empty]), Error::NoPaths { index: 1, count: 2 }));
    assert!(matches!(run(&[&three]), Error::Acoustics(sabine_acoustics::Error::MaterialCount { .. })));
}

#[test]
fn settings_out_of_range() {
    let default = FitConfig::default;
    let wrong = [
        ("range_db.0", FitConfig { range_db: (1.0, -30.0), ..default() }),
        ("range_db.1", FitConfig { range_db: (-5.0, -6.0), ..default() }),
        ("bin_s", FitConfig { bin_s: f64::NAN, ..default() }),
        ("bounds.0", FitConfig { bounds: (-0.1, 0.9), ..default() }),
        ("bounds.1", FitConfig { bounds: (0.5, 0.4), ..default() }),
        ("prior_weight", FitConfig { prior_weight: 0.0, ..default() }),
        ("smoothness", FitConfig { smoothness: -1.0, ..default() }),
        ("reflection_error", FitConfig { reflection_error: -0.1, ..default() }),
        ("arrival_error_s", FitConfig { arrival_error_s: f64::NAN, ..default() }),
        ("arrival_error_s", FitConfig { arrival_error_s: 0.02, ..default() }),
        ("max_iterations", FitConfig { max_iterations: 0, ..default() }),
        ("max_rounds", FitConfig { max_rounds: 0, ..default() }),
        ("target_tolerance", FitConfig { target_tolerance: 0.0, ..default() }),
    ];
    for (name, config) in wrong {
        match MaterialFitter::new(config) {
            Err(Error::OutOfRange(OutOfRange { field, .. })) => assert_eq!(field, name),
            other => panic!("{name}: {other:?}"),
        }
    }
}

#[test]
fn the_observer_can_stop_it() {
    let paths = room().trace(1);
    let materials = vec![Material::uniform(OCTAVES, 0.1, 0.5).unwrap(); 2];
    let targets = PerBand::uniform(Bands::T60, Estimate::exact(0.5));
    let stop = |_: &str, done: u64, _: u64| {
        if done >= 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let priors = [prior(0.1, 0.1), prior(0.1, 0.1)];
    let error = MaterialFitter::new(FitConfig::default())
        .unwrap()
        .fit_t60(&[&paths], &FitProblem::new(&materials, &priors, &Air::default()), &targets, &stop)
        .unwrap_err();
    assert!(matches!(error, Error::Acoustics(sabine_acoustics::Error::Cancelled { .. })), "{error}");
}
