//! Walls that react locally, against a plain loop over the meetings of random paths.

use super::effect_on_paths::{bands, known_paths, path_set};
use proptest::prelude::*;
use sabine_acoustics::{Air, Error, Material};
use sabine_paths::{Conditions, Contribution, PathSet, Reflection};

/// Impedance whose absorption, averaged over a half sphere by the midpoint rule, is this: on the side of hard walls.
fn impedance_of(absorption: f64) -> f64 {
    let absorbed = |z: f64| {
        let steps = 4000;
        let at = |i: usize| {
            let cosine = (i as f64 + 0.5) / steps as f64;
            2.0 * cosine * (1.0 - ((z * cosine - 1.0) / (z * cosine + 1.0)).powi(2)) / steps as f64
        };
        (0..steps).map(at).sum::<f64>()
    };
    let (mut low, mut high) = (1.6f64, 1e5f64);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if absorbed(middle) > absorption { low = middle } else { high = middle }
    }
    low
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Against a plain loop over meetings, with impedances of the test's own.
    #[test]
    fn walls_that_react_locally_reflect_by_the_angle(known in known_paths(), share in 0.0f64..1.2) {
        let paths = path_set(&known);
        let absorptions = [0.05, 0.1, 0.2, 0.35, 0.5, 0.7];
        let walls = absorptions.map(|a| Material::uniform(bands(), a, 0.3).unwrap());
        let impedances = absorptions.map(impedance_of);
        let air = Air::default();
        let plain = Conditions::new(&walls, &air);
        let reacting = plain.with_local_reaction(share, &walls);
        let (before, after) = (paths.energies(&plain).unwrap(), paths.energies(&reacting).unwrap());
        for (i, path) in known.iter().enumerate() {
            let expected: f64 = path.meetings.iter().map(|&(m, _, cosine)| {
                let x = impedances[m as usize] * cosine;
                let reflected = ((x - 1.0) / (x + 1.0)).powi(2).max(1e-3);
                share * (reflected.ln() - (1.0 - absorptions[m as usize]).ln())
            }).sum();
            for band in [0, 5] {
                let found = f64::from(after[band][i] / before[band][i]).ln();
                prop_assert!(before[band][i] < 1e-30 || (found - expected).abs() < 2e-3, "{found} {expected}");
            }
        }
        // Impedances stay where absorption is varied.
        let others = walls.clone().map(|w| w.with_absorption(w.absorption().map(|_| 0.15)).unwrap());
        let varied = paths.energies(&reacting.with_materials(&others)).unwrap();
        let without = paths.energies(&plain.with_materials(&others)).unwrap();
        for i in 0..known.len() {
            let (a, b) = (varied[2][i] / without[2][i], after[2][i] / before[2][i]);
            prop_assert!(before[2][i] < 1e-30 || without[2][i] < 1e-30 || (a / b - 1.0).abs() < 1e-3, "{a} {b}");
        }
    }
}

#[test]
fn walls_react_locally_only_where_angles_are_known() {
    let walls: [Material; 2] = std::array::from_fn(|_| Material::uniform(bands(), 0.2, 0.1).unwrap());
    let air = Air::default();
    let mut paths = PathSet::new(2, 100.0);
    let chain = paths.reflect(PathSet::DIRECT, 1, Reflection::Specular);
    paths.push(Contribution {
        length_m: 5.0,
        log_weight: 0.0,
        chain,
        tail: PathSet::DIRECT,
        departure: [1.0, 0.0, 0.0],
        arrival: [0.0, 1.0, 0.0],
        batch: None,
    });
    let plain = Conditions::new(&walls, &air);
    let refused = paths.energies(&plain.with_local_reaction(1.0, &walls));
    assert!(matches!(refused, Err(Error::AngleNotRecorded { material: 1 })), "{refused:?}");
    for share in [f64::NAN, 5.0] {
        assert!(matches!(
            paths.energies(&plain.with_local_reaction(share, &walls)),
            Err(Error::OutOfRange(_))
        ));
    }
    assert!(matches!(
        paths.energies(&plain.with_local_reaction(1.0, &walls[..1])),
        Err(Error::MaterialCount { .. })
    ));
}
