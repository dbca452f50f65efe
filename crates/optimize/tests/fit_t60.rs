//! The fit to reverberation times, against Eyring's formula in rooms that obey it.

mod ergodic;

use ergodic::Ergodic;
use sabine_acoustics::{Air, Estimate, Material, OctaveBands, PerBand};
use sabine_optimize::{AbsorptionPrior, FitConfig, MaterialFit, MaterialFitter, UnreachableReason};

const OCTAVES: OctaveBands = OctaveBands::SIMULATION;

fn room() -> Ergodic {
    Ergodic {
        shares: vec![0.35, 0.3, 0.2, 0.1, 0.04, 0.01],
        mean_free_path_m: 3.0,
        rays: 4000,
        duration_s: 2.0,
    }
}

fn materials(count: usize) -> Vec<Material> {
    vec![Material::uniform(OCTAVES, 0.1, 0.5).unwrap(); count]
}

fn priors(count: usize) -> Vec<AbsorptionPrior> {
    vec![AbsorptionPrior::uniform(OCTAVES, 0.15, 0.1); count]
}

fn fit(room: &Ergodic, targets_s: [f64; 7]) -> MaterialFit {
    let paths = room.trace(1);
    let targets = PerBand::new(OctaveBands::T60, targets_s.map(Estimate::exact).to_vec()).unwrap();
    let count = room.shares.len();
    MaterialFitter::new(FitConfig::default())
        .unwrap()
        .fit_t60(&[&paths], &materials(count), &priors(count), &Air::default(), &targets, &())
        .unwrap()
}

#[test]
fn reachable_targets_are_met_and_eyring_agrees() {
    let room = room();
    let targets = [1.4, 1.2, 1.0, 0.8, 0.7, 0.6, 0.4];
    let start = std::time::Instant::now();
    let fit = fit(&room, targets);
    eprintln!("{:?} iterations {} cost {}", start.elapsed(), fit.iterations, fit.cost);
    assert!(fit.unreachable.is_empty(), "{:?}", fit.unreachable);
    let all: Vec<f64> = std::iter::once(targets[0]).chain(targets).collect();
    for (b, target) in all.iter().enumerate() {
        let predicted = fit.predicted_t60_s.values()[b].clone().unwrap();
        assert!((predicted.value / target - 1.0).abs() < 0.005, "band {b}: {predicted:?} for {target}");
        let absorption: Vec<f64> = fit.materials.iter().map(|m| m.absorption().values()[b]).collect();
        let eyring = room.eyring_s(&absorption, &Air::default(), OCTAVES.exact_hz(b));
        let error = predicted.standard_error.max(1e-4);
        eprintln!("{b}: {predicted:?} eyring {eyring}, {absorption:?}");
        // The direct sound bends the beginning of the curve a little, hence 1 % beside four standard errors.
        assert!(
            (predicted.value - eyring).abs() < 4.0 * error + 0.01 * eyring,
            "band {b}: {predicted:?} {eyring}"
        );
    }
}

#[test]
fn beyond_the_limit_of_air_the_reason_is_air() {
    let fit = fit(&room(), [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.1]);
    let [only] = &fit.unreachable[..] else { panic!("{:?}", fit.unreachable) };
    assert_eq!(only.band_hz, 8000.0);
    assert!(
        matches!(only.reason, UnreachableReason::AirLimit { limit_s, .. } if (limit_s - 1.66).abs() < 0.04)
    );
}
