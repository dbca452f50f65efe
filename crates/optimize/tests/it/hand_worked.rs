//! The case of `docs/explanation/objective.md`, worked there by hand.

use sabine_acoustics::{Air, Bands, Material};
use sabine_optimize::Objective;
use sabine_optimize::{FitConfig, SlopeEvaluation, SlopeObjective};
use sabine_paths::{Contribution, PathSet, Reflection};

const A: u32 = 0;
const B: u32 = 1;

fn paths() -> PathSet {
    let metres_in_10_ms = 3.432; // 20 C
    let mut paths = PathSet::new(2, 20.0);
    for (n, hits) in [&[][..], &[A], &[A, B], &[A, A, B]].into_iter().enumerate() {
        let chain = hits.iter().fold(PathSet::DIRECT, |c, &m| paths.reflect(c, m, Reflection::Specular));
        let up = [0.0, 0.0, 1.0];
        paths.push(Contribution {
            length_m: metres_in_10_ms * (n + 1) as f64,
            log_weight: 0.0,
            chain,
            tail: PathSet::DIRECT,
            departure: up,
            arrival: up,
            batch: None,
        });
    }
    paths
}

fn evaluation(objective: SlopeObjective) -> SlopeEvaluation {
    let wall = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
    let config = FitConfig { objective, ..FitConfig::default() };
    SlopeEvaluation::new(&config, &[&paths()], &[wall.clone(), wall], &Air::default(), 0, 0.3).unwrap()
}

/// What air takes at 125 Hz, in dB/s: it adds to the slope of every path.
fn air_db_per_s() -> f64 {
    let air = Air::default();
    air.attenuation_db_per_m(Bands::T60.exact_hz(0)) * air.speed_of_sound_m_s()
}

#[test]
fn the_papers_slope_and_gradient() {
    let mut gradient = [0.0; 2];
    let slope = evaluation(SlopeObjective::Paper).slope_db_per_s(&[0.2, 0.5], &mut gradient).unwrap();
    assert!((slope + air_db_per_s() + 178.56).abs() < 0.01, "{slope}");
    assert!((gradient[0] + 325.7).abs() < 0.1, "{gradient:?}");
    assert!((gradient[1] + 347.4).abs() < 0.1, "{gradient:?}");
    let j = evaluation(SlopeObjective::Paper).value_and_gradient(&[0.2, 0.5], &mut gradient);
    let difference = 21.44 - air_db_per_s();
    assert!((j - difference * difference).abs() < 0.5, "{j}");
    assert!((gradient[0] - 2.0 * difference * -325.7).abs() < 10.0, "{gradient:?}");
    assert!((gradient[1] - 2.0 * difference * -347.4).abs() < 10.0, "{gradient:?}");
}

#[test]
fn lis_slope() {
    let slope = evaluation(SlopeObjective::Li2018).slope_db_per_s(&[0.2, 0.5], &mut [0.0; 2]).unwrap();
    assert!((slope + air_db_per_s() + 169.81).abs() < 0.01, "{slope}");
}
