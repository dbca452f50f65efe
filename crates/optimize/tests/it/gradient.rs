//! Gradients against central differences, solvers against each other.

use crate::ergodic::Ergodic;
use argmin::core::Executor;
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use proptest::prelude::*;
use sabine_acoustics::{Air, Bands, Material};
use sabine_optimize::Objective;
use sabine_optimize::{
    FitConfig, ForArgmin, Logit, RegularisedSlope, SlopeEvaluation, SlopeObjective, minimise,
};
use sabine_paths::PathSet;
use std::sync::LazyLock;

/// 2 kHz of [`Bands::SIMULATION`].
const BAND: usize = 5;

static PATHS: LazyLock<[PathSet; 2]> = LazyLock::new(|| {
    let room = Ergodic { shares: vec![0.6, 0.3, 0.1], mean_free_path_m: 3.0, rays: 200, duration_s: 1.5 };
    [room.trace(3), room.trace(4)]
});

fn objective(objective: SlopeObjective, target_s: f64) -> SlopeEvaluation {
    let materials = vec![Material::uniform(Bands::SIMULATION, 0.1, 0.4).unwrap(); 3];
    let config = FitConfig { objective, ..FitConfig::default() };
    let paths: Vec<&PathSet> = PATHS.iter().collect();
    SlopeEvaluation::new(&config, &paths, &materials, &Air::default(), BAND, target_s).unwrap()
}

/// Largest error of the gradient relative to its largest component. Central differences of two steps, extrapolated, so that
/// what is left is rounding.
pub fn gradient_error(objective: &dyn Objective, x: &[f64]) -> f64 {
    let n = objective.dimension();
    let mut gradient = vec![0.0; n];
    objective.value_and_gradient(x, &mut gradient);
    let scale = gradient.iter().fold(0.0f64, |s, g| s.max(g.abs()));
    let scratch = &mut vec![0.0; n];
    let mut worst = 0.0f64;
    for k in 0..n {
        let mut central = |step: f64| {
            let mut at = |delta: f64| {
                let mut moved = x.to_vec();
                moved[k] += delta;
                objective.value_and_gradient(&moved, scratch)
            };
            (at(step) - at(-step)) / (2.0 * step)
        };
        let step = 1e-4 * x[k].min(1.0 - x[k]);
        let difference = (4.0 * central(step / 2.0) - central(step)) / 3.0;
        worst = worst.max((difference - gradient[k]).abs() / scale);
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn single_path_gradients_are_exact(x in prop::array::uniform3(0.01f64..0.98), target_s in 0.2f64..2.5) {
        for kind in [SlopeObjective::Paper, SlopeObjective::Li2018] {
            let error = gradient_error(&objective(kind, target_s), &x);
            prop_assert!(error < 1e-6, "{kind:?} {error}");
        }
    }

    #[test]
    fn decay_curve_gradients_are_exact(x in prop::array::uniform3(0.01f64..0.9), target_s in 0.2f64..2.5) {
        let error = gradient_error(&objective(SlopeObjective::DecayCurve, target_s), &x);
        prop_assert!(error < 1e-6, "{error}");
    }
}

#[test]
fn gradients_are_exact_near_the_bounds() {
    for kind in [SlopeObjective::DecayCurve, SlopeObjective::Paper, SlopeObjective::Li2018] {
        for x in [[0.0051, 0.0051, 0.0051], [0.0051, 0.5, 0.989], [0.9, 0.0052, 0.989], [0.989, 0.989, 0.989]]
        {
            let error = gradient_error(&objective(kind, 0.8), &x);
            assert!(error < 1e-6, "{kind:?} {x:?}: {error}");
        }
    }
}

#[test]
fn a_constructed_optimum_has_no_gradient() {
    let x = [0.1, 0.3, 0.5];
    for kind in [SlopeObjective::DecayCurve, SlopeObjective::Paper, SlopeObjective::Li2018] {
        let slope = objective(kind, 1.0).slope_db_per_s(&x, &mut [0.0; 3]).unwrap();
        let mut gradient = [1.0; 3];
        let cost = objective(kind, -60.0 / slope).value_and_gradient(&x, &mut gradient);
        assert!(cost < 1e-20, "{kind:?}: {cost}");
        assert!(gradient.iter().all(|g| g.abs() < 1e-8), "{kind:?}: {gradient:?}");
    }
}

#[test]
fn argmin_in_logit_variables_reaches_the_same_optimum() {
    let (mean, deviation) = (vec![0.1, 0.2, 0.3], vec![0.05, 0.1, 0.1]);
    let (lower, upper, start) = (vec![0.005; 3], vec![0.99; 3], vec![0.1, 0.2, 0.3]);
    for kind in [SlopeObjective::DecayCurve, SlopeObjective::Paper, SlopeObjective::Li2018] {
        let build =
            || RegularisedSlope::new(objective(kind, 0.6), mean.clone(), deviation.clone(), 1e4).unwrap();
        let bounded = minimise(&build(), &start, &lower, &upper, 200).unwrap();
        let free = Logit { objective: build(), lower: lower.clone(), upper: upper.clone() };
        let begin = free.unbounded(&start);
        let solver = LBFGS::new(MoreThuenteLineSearch::new(), 7);
        let result = Executor::new(ForArgmin(&free), solver)
            .configure(|state| state.param(begin).max_iters(200))
            .run()
            .unwrap();
        let found = free.bounded(result.state.best_param.as_ref().unwrap());
        for (a, b) in bounded.x.iter().zip(&found) {
            assert!((a - b).abs() < 1e-4, "{kind:?}: {:?} {found:?}", bounded.x);
        }
        assert!((result.state.best_cost / bounded.cost - 1.0).abs() < 1e-6, "{kind:?}");
    }
}
