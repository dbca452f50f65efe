//! What uncertain absorption leaves open in the parameters, to first order, against a closed form and against draws.

use sabine_acoustics::Error;
use sabine_acoustics::*;
use sabine_paths::*;
use sabine_scene::*;
use std::f64::consts::{LN_10, TAU};

/// A small generator (Marsaglia's xorshift), so that the test shares no code with a tracer.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// Share of the surface that each material has, and metres between reflections.
const SHARES: [f64; 3] = [0.5, 0.3, 0.2];
const FREE_PATH_M: f64 = 3.0;

/// Paths through a diffuse field: whenever a mean free path is over, a surface by chance of its share.
fn paths(count: u32, length_m: f64) -> PathSet {
    let mut random = Random(0x1234_5678_9ABC_DEF1);
    let mut paths = PathSet::new(3, length_m);
    let up = [0.0, 0.0, 1.0];
    for i in 0..count {
        let length_m = 3.0 + (length_m - 3.0) * random.uniform();
        let mut chain = PathSet::DIRECT;
        for _ in 0..(length_m / FREE_PATH_M) as usize {
            let at = random.uniform();
            let material = if at < SHARES[0] {
                0
            } else if at < SHARES[0] + SHARES[1] {
                1
            } else {
                2
            };
            chain = paths.reflect(chain, material, Reflection::Specular);
        }
        let (tail, batch) = (PathSet::DIRECT, Some((i % 32) as u8));
        paths.push(Contribution {
            length_m,
            log_weight: 0.0,
            chain,
            tail,
            departure: up,
            arrival: up,
            batch,
        });
    }
    paths
}

fn bands() -> Bands {
    Bands::octaves(125.0, 125.0).unwrap()
}

fn materials(absorption: [f64; 3]) -> Vec<Material> {
    absorption.map(|a| Material::uniform(bands(), a, 0.0).unwrap()).to_vec()
}

fn sds(sd: [f64; 3]) -> Vec<PerBand<f64>> {
    sd.map(|sd| PerBand::uniform(bands(), sd)).to_vec()
}

fn t30_s(parameters: &PathParameters) -> Estimate {
    parameters.t30_s.values()[0].clone().unwrap()
}

/// Standard deviation of T30 over draws of the absorption, each from a normal distribution cut at 0 and 1.
fn by_draws(paths: &PathSet, mean: [f64; 3], sd: [f64; 3], draws: usize) -> f64 {
    let (mut random, air) = (Random(0xFEED_BEEF_0123_4567), Air::default());
    let mut drawn = |i: usize| loop {
        let value = mean[i] + sd[i] * random.normal();
        if (0.0..=1.0).contains(&value) {
            return value;
        }
    };
    let values: Vec<f64> = (0..draws)
        .map(|_| {
            let walls = materials([drawn(0), drawn(1), drawn(2)]);
            t30_s(&PathParameters::read(paths, &Conditions::new(&walls, &air)).unwrap()).value
        })
        .collect();
    let average = values.iter().sum::<f64>() / draws as f64;
    (values.iter().map(|v| (v - average).powi(2)).sum::<f64>() / (draws - 1) as f64).sqrt()
}

#[test]
fn small_deviations_give_the_closed_form_and_the_spread_of_draws() {
    let (mean, sd, air) = ([0.3, 0.2, 0.1], [0.03, 0.02, 0.02], Air::default());
    let paths = paths(6_000, 180.0);
    let walls = materials(mean);
    let conditions = Conditions::new(&walls, &air);
    let found = t30_s(&PathParameters::read_material_errors(&paths, &conditions, &sds(sd)).unwrap());
    assert_eq!(found.value, t30_s(&PathParameters::read(&paths, &conditions).unwrap()).value);
    // In a diffuse field of many reflections the mean over paths takes 1 - sum of share times absorption at each.
    let absorbed: f64 = (0..3).map(|i| SHARES[i] * mean[i]).sum();
    let rate = -(1.0 - absorbed).ln() / FREE_PATH_M;
    let t_s = 6.0 * LN_10 / (rate * air.speed_of_sound_m_s());
    let slope = |i: usize| t_s * SHARES[i] / (1.0 - absorbed) / -(1.0 - absorbed).ln();
    let expected = (0..3).map(|i| (slope(i) * sd[i]).powi(2)).sum::<f64>().sqrt();
    println!(
        "T30 {:.3} s (diffuse field {t_s:.3}), error {:.4}, expected {expected:.4}",
        found.value, found.standard_error
    );
    assert!((found.standard_error / expected - 1.0).abs() < 0.08, "{found:?} against {expected}");
    // Of 500 draws the standard deviation is known to 3 %; three of these.
    let drawn = by_draws(&paths, mean, sd, 500);
    println!("draws {drawn:.4}");
    assert!((found.standard_error / drawn - 1.0).abs() < 0.10, "{found:?} against {drawn}");
}

#[test]
fn a_guess_leaves_about_what_draws_leave() {
    let (unknown, unknown_sd) = (MaterialPrior::UNKNOWN_ABSORPTION, MaterialPrior::UNKNOWN_ABSORPTION_SD);
    let (mean, sd, air) = ([0.1, unknown, 0.1], [0.02, unknown_sd, 0.02], Air::default());
    let paths = paths(6_000, 700.0);
    let walls = materials(mean);
    let found = t30_s(
        &PathParameters::read_material_errors(&paths, &Conditions::new(&walls, &air), &sds(sd)).unwrap(),
    );
    let drawn = by_draws(&paths, mean, sd, 400);
    println!("T30 {:.3} s, error {:.3}, draws {drawn:.3}", found.value, found.standard_error);
    // To first order only: the decay time is no straight line over so wide a prior.
    let ratio = found.standard_error / drawn;
    assert!(ratio > 0.75 && ratio < 1.25, "{found:?} against {drawn}");
}

#[test]
fn known_materials_leave_nothing_and_wrong_lists_are_refused() {
    let (walls, air) = (materials([0.3, 0.2, 0.1]), Air::default());
    let (paths, conditions) = (paths(500, 180.0), Conditions::new(&walls, &air));
    let known = PathParameters::read_material_errors(&paths, &conditions, &sds([0.0; 3])).unwrap();
    assert_eq!(t30_s(&known).standard_error, 0.0);
    assert_eq!(known.c50_db.values()[0].clone().unwrap().standard_error, 0.0);
    let refused =
        |sd: &[PerBand<f64>]| PathParameters::read_material_errors(&paths, &conditions, sd).unwrap_err();
    assert!(matches!(refused(&sds([0.1; 3])[..2]), Error::MaterialCount { expected: 3, found: 2 }));
    assert!(matches!(refused(&sds([0.1, f64::NAN, 0.1])), Error::OutOfRange(_)));
    let other = vec![PerBand::uniform(Bands::T60, 0.1); 3];
    assert!(matches!(refused(&other), Error::BandMismatch { .. }));
}
