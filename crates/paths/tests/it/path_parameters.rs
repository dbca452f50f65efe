//! Parameters of paths against closed forms, and their standard errors against what happens when everything is repeated.

use sabine_acoustics::*;
use sabine_paths::*;
use std::f64::consts::LN_10;

const UP: [f64; 3] = [0.0, 0.0, 1.0];
const T60_S: f64 = 0.8;

/// A small generator (Marsaglia's xorshift), so that the test shares no code with a tracer.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn path(length_m: f64, energy: f64, batch: Option<u8>) -> Contribution {
    let (chain, tail) = (PathSet::DIRECT, PathSet::DIRECT);
    Contribution { length_m, log_weight: energy.ln(), chain, tail, departure: UP, arrival: UP, batch }
}

/// Direct sound of energy 0.01 and reverberation of energy 0.05, thrown at random times with random strengths.
fn thrown(seed: u64, count: u32, speed_m_s: f64) -> PathSet {
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    // The first numbers of small seeds are small.
    for _ in 0..20 {
        random.uniform();
    }
    let duration_s = 1.0;
    let mut paths = PathSet::new(1, (0.02 + duration_s) * speed_m_s);
    paths.push(path(0.02 * speed_m_s, 0.01, None));
    let rate = 6.0 * LN_10 / T60_S;
    for i in 0..count {
        let time_s = duration_s * random.uniform();
        // Exponential strengths of mean one: more uneven than those of most rays.
        let strength = -(1.0 - random.uniform()).ln();
        let energy = 0.05 * rate * (-rate * time_s).exp() * duration_s / f64::from(count) * strength;
        paths.push(path((0.02 + time_s) * speed_m_s, energy, Some((i % 32) as u8)));
    }
    paths
}

/// Air and walls that take nothing: 62.5 Hz in dry air, short paths.
fn nothing_lost() -> ([Material; 1], Air) {
    let bands = Bands::octaves(62.5, 62.5).unwrap();
    ([Material::uniform(bands, 0.0, 0.0).unwrap()], Air::default())
}

fn readings(parameters: &PathParameters) -> [(&'static str, &Reading); 8] {
    [
        ("EDT", &parameters.edt_s.values()[0]),
        ("T20", &parameters.t20_s.values()[0]),
        ("T30", &parameters.t30_s.values()[0]),
        ("C50", &parameters.c50_db.values()[0]),
        ("C80", &parameters.c80_db.values()[0]),
        ("D50", &parameters.d50.values()[0]),
        ("Ts", &parameters.centre_time_s.values()[0]),
        ("DRR", &parameters.drr_db.values()[0]),
    ]
}

#[test]
fn many_paths_give_the_closed_forms() {
    let (wall, air) = nothing_lost();
    let speed_m_s = air.speed_of_sound_m_s();
    let found = PathParameters::read(&thrown(5, 200_000, speed_m_s), &Conditions::new(&wall, &air)).unwrap();
    let rate = 6.0 * LN_10 / T60_S;
    let late = |time_s: f64| 0.05 * (-rate * time_s).exp();
    let clarity = |time_s: f64| 10.0 * ((0.06 - late(time_s)) / late(time_s)).log10();
    let expected = [
        ("T20", T60_S),
        ("T30", T60_S),
        ("C50", clarity(0.05)),
        ("C80", clarity(0.08)),
        ("D50", 1.0 - late(0.05) / 0.06),
        ("Ts", 0.05 / rate / 0.06),
        ("DRR", clarity(0.0025)),
    ];
    for (name, value) in expected {
        let (_, reading) = readings(&found).into_iter().find(|(n, _)| *n == name).unwrap();
        let estimate = reading.clone().unwrap();
        // Four standard errors, and 0.05 % for what 1.1 s of air take at 62.5 Hz.
        let limit = 4.0 * estimate.standard_error + 5e-4 * value.abs();
        assert!((estimate.value - value).abs() < limit, "{name}: {estimate:?} against {value}");
        assert!(estimate.standard_error < 0.1 * value.abs().max(1.0), "{name}: {estimate:?}");
    }
}

#[test]
fn the_predicted_standard_error_is_the_spread_over_seeds() {
    let (wall, air) = nothing_lost();
    let conditions = Conditions::new(&wall, &air);
    let repeats = 300;
    let mut values = vec![Vec::new(); 8];
    let mut variances = [0.0; 8];
    for seed in 0..repeats {
        let found =
            PathParameters::read(&thrown(seed + 1, 6_400, air.speed_of_sound_m_s()), &conditions).unwrap();
        for (i, (_, reading)) in readings(&found).into_iter().enumerate() {
            let estimate = reading.clone().unwrap();
            values[i].push(estimate.value);
            variances[i] += estimate.standard_error.powi(2) / repeats as f64;
        }
    }
    let names = ["EDT", "T20", "T30", "C50", "C80", "D50", "Ts", "DRR"];
    for ((name, values), variance) in names.iter().zip(&values).zip(variances) {
        let mean = values.iter().sum::<f64>() / repeats as f64;
        let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (repeats - 1) as f64).sqrt();
        let ratio = variance.sqrt() / spread;
        println!("{name}: spread {spread:.5}, predicted {:.5}, ratio {ratio:.3}", variance.sqrt());
        assert!((ratio - 1.0).abs() < 0.2, "{name}: spread {spread}, predicted {}", variance.sqrt());
    }
}

#[test]
fn exact_paths_have_no_random_error() {
    let (wall, air) = nothing_lost();
    let mut paths = PathSet::new(1, 400.0);
    for i in 0..390 {
        paths.push(path(5.0 + f64::from(i), 10f64.powf(-0.02 * f64::from(i)), None));
    }
    let found = PathParameters::read(&paths, &Conditions::new(&wall, &air)).unwrap();
    for (name, reading) in readings(&found) {
        assert_eq!(reading.clone().unwrap().standard_error, 0.0, "{name}");
    }
}

/// Paths that end before the decay has fallen far enough give the times that they can give, and say what the others need.
#[test]
fn short_traces_say_what_is_missing() {
    let (wall, air) = nothing_lost();
    let speed_m_s = air.speed_of_sound_m_s();
    let whole = thrown(3, 60_000, speed_m_s);
    let mut short = PathSet::new(1, (0.02 + 0.5) * speed_m_s);
    for i in 0..whole.len() {
        let length_m = f64::from(whole.lengths_m()[i]);
        if length_m <= short.max_length_m() {
            short.push(path(length_m, f64::from(whole.log_weights()[i]).exp(), whole.batch(i)));
        }
    }
    let found = PathParameters::read(&short, &Conditions::new(&wall, &air)).unwrap();
    // 37.5 dB of decay: T20 ends at -25 dB, and what follows the end is known well enough.
    let t20 = found.t20_s.values()[0].clone().unwrap();
    assert!((t20.value - T60_S).abs() < 4.0 * t20.standard_error + 0.002, "{t20:?}");
    assert!(t20.standard_error < 0.03);
    assert!(matches!(found.t30_s.values()[0], Err(NoReading::DynamicRange { needed_db: 45.0, .. })));
    let none = PathParameters::read(&PathSet::new(1, 100.0), &Conditions::new(&wall, &air)).unwrap();
    assert_eq!(none.c80_db.values()[0], Err(NoReading::NoOnset));
    let black = [Material::uniform(Bands::octaves(62.5, 62.5).unwrap(), 1.0, 0.0).unwrap()];
    let mut direct = PathSet::new(1, 100.0);
    direct.push(path(2.0, 0.25, None));
    let dry = PathParameters::read(&direct, &Conditions::new(&black, &air)).unwrap();
    assert!(matches!(dry.c80_db.values()[0], Err(NoReading::DynamicRange { .. })));
    assert!(dry.t30_s.values()[0].is_err());
}
