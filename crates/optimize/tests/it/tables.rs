//! Fits to tables of parameters. The tables are read from the pressure of image sources (testkit) by the parameters of
//! `sabine-acoustics`, the paths are a ray tracer's: none shares code with what is tested.

use crate::mirrors::{self, Hearing, RECEIVERS, SOURCES};
use rand::{Rng, SeedableRng};
use sabine_acoustics::{Air, Bands, ImpulseResponse, Material, ParameterKind, RoomParameters};
use sabine_optimize::{
    AbsorptionPrior, Error, FitConfig, FitProblem, MaterialFitter, MeasuredDecay, MeasuredPair,
    MeasuredParameter, MeasuredTable, TableFit, TableMisfit,
};
use sabine_paths::{Conditions, Contribution, PathParameters, PathSet, Propagator};
use sabine_propagate::{PathTracer, TracerConfig};
use sabine_scene::{Levels, Measurement, Receiver, Scene, Source, TimeZero};

const DURATION_S: f64 = 0.7;
const RATE_HZ: u32 = 16_000;
const RAYS: usize = 8_000;
/// Walls, floor and ceiling in two octaves.
const THREE: [[f64; 2]; 3] = [[0.12, 0.12], [0.3, 0.35], [0.25, 0.2]];

fn octaves() -> Bands {
    Bands::octaves(1000.0, 2000.0).unwrap()
}

fn room() -> Scene {
    let absorption: Vec<Vec<f64>> = THREE.iter().map(|a| a.to_vec()).collect();
    mirrors::room(octaves(), [0, 0, 0, 0, 1, 2], &absorption)
}

/// A pair: what was measured, and the paths.
struct Pair {
    response: ImpulseResponse,
    values: Vec<MeasuredParameter>,
    paths: PathSet,
}

impl Pair {
    fn table(&self) -> MeasuredTable<'_> {
        MeasuredTable { values: &self.values, paths: &self.paths }
    }
}

/// Every parameter of a response that can be read.
fn parameters(response: &ImpulseResponse) -> Vec<MeasuredParameter> {
    let measured = RoomParameters::measure(response, octaves()).unwrap();
    let mut values = Vec::new();
    for kind in ParameterKind::ALL {
        for (band_hz, reading) in kind.of(&measured).iter() {
            if let Ok(estimate) = reading {
                let value = estimate.value;
                values.push(MeasuredParameter { band_hz, kind, value, standard_deviation: None });
            }
        }
    }
    values
}

fn pairs(count: usize, seed: u64) -> Vec<Pair> {
    let truth = room();
    let of = |i: usize| {
        let source = Source::omni("s", SOURCES[i % SOURCES.len()]).unwrap();
        let receiver = Receiver::omni("r", RECEIVERS[(i / SOURCES.len() + i) % RECEIVERS.len()]).unwrap();
        let seed = seed + i as u64;
        let hearing = Hearing { octaves: octaves(), rate_hz: RATE_HZ, duration_s: DURATION_S };
        let samples = hearing.pressure(&truth, &source, &receiver, seed);
        let response = ImpulseResponse::new(samples, RATE_HZ).unwrap();
        let config = TracerConfig { rays: RAYS, duration_s: DURATION_S, seed, ..TracerConfig::default() };
        let tracer = PathTracer::new(config).unwrap();
        let paths = tracer.trace(&truth, &source, &receiver, &Air::default(), &()).unwrap();
        Pair { values: parameters(&response), response, paths }
    };
    (0..count).map(of).collect()
}

fn guess() -> (Vec<Material>, Vec<AbsorptionPrior>) {
    (
        vec![Material::uniform(octaves(), 0.2, 0.0).unwrap(); 3],
        vec![AbsorptionPrior::uniform(octaves(), 0.2, 0.25); 3],
    )
}

fn fitter() -> MaterialFitter {
    // These walls are mirrors where they are said to be.
    MaterialFitter::new(FitConfig { reflection_error: 0.05, ..FitConfig::default() }).unwrap()
}

fn fit(tables: &[MeasuredTable<'_>]) -> TableFit {
    let ((materials, priors), air) = (guess(), Air::default());
    fitter().fit_tables(tables, &FitProblem::new(&materials, &priors, &air), &()).unwrap()
}

/// Error of each absorption over its standard error.
fn standardised(fit: &TableFit) -> Vec<f64> {
    let of = |k: usize, b: usize| {
        let found = &fit.of_responses.fit;
        let error = found.absorption_standard_error[k].values()[b];
        (found.materials[k].absorption().values()[b] - THREE[k][b]) / error
    };
    (0..3).flat_map(|k| (0..2).map(move |b| (k, b))).map(|(k, b)| of(k, b)).collect()
}

#[test]
fn hidden_absorption_comes_back_within_its_interval() {
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in [100, 200, 300] {
        let pairs = pairs(6, seed);
        let tables: Vec<MeasuredTable<'_>> = pairs.iter().map(Pair::table).collect();
        let fit = fit(&tables);
        assert!(fit.left_out.is_empty(), "{:?}", fit.left_out);
        let dispersion: Vec<f64> = fit.dispersion.values().iter().map(|d| d.unwrap()).collect();
        println!("seed {seed}: standardised {:.2?}, dispersion {dispersion:.2?}", standardised(&fit));
        // The model explains what it made: its errors are not too small.
        assert!(dispersion.iter().all(|d| *d < 1.5), "{dispersion:?}");
        for z in standardised(&fit) {
            assert!(z.abs() < 3.5, "seed {seed}: {z}");
            squares += z * z;
            count += 1.0;
        }
        // The walls, which most of the decay depends on, are found, not believed.
        let walls = &fit.of_responses.fit;
        assert!(walls.absorption_standard_error[0].values()[0] < 0.05);
    }
    let mean: f64 = squares / count;
    println!("mean square {mean:.2} of {count}");
    assert!(mean < 1.6, "intervals are too narrow: {mean}");
}

#[test]
fn a_wrong_value_is_pointed_at() {
    let mut pairs = pairs(6, 400);
    let wrong =
        pairs[2].values.iter().position(|p| p.kind == ParameterKind::C80 && p.band_hz == 1000.0).unwrap();
    // A slip of the pen: the sign.
    pairs[2].values[wrong].value -= 6.0;
    let tables: Vec<MeasuredTable<'_>> = pairs.iter().map(Pair::table).collect();
    let fit = fit(&tables);
    let (materials, air) = (&fit.of_responses.fit.materials, Air::default());
    let conditions = Conditions::new(materials, &air);
    let misfits: Vec<TableMisfit> =
        tables.iter().map(|table| TableMisfit::under(*table, &conditions, 0.05).unwrap()).collect();
    let octaves = misfits.iter().enumerate().flat_map(|(i, m)| m.octaves.iter().map(move |o| (i, o)));
    let (pair, octave) = octaves.max_by(|a, b| (a.1.chi_squared).total_cmp(&b.1.chi_squared)).unwrap();
    assert_eq!((pair, octave.band_hz, octave.worst), (2, 1000.0, wrong), "{octave:?}");
    let value = &misfits[2].values[wrong];
    assert!(value.own_deviations < -4.0 && value.jnd() < -3.0, "{value:?}");
    // And no other octave looks as bad.
    let next = misfits.iter().flat_map(|m| &m.octaves).filter(|o| *o != octave);
    let next = next.map(|o| o.chi_squared / o.count as f64).fold(0.0, f64::max);
    println!("wrong {:.1} of {}, next {next:.2}", octave.chi_squared, octave.count);
    assert!(octave.chi_squared / octave.count as f64 > 1.5 * next);
}

#[test]
fn tables_beside_responses_tell_more_than_either() {
    let pairs = pairs(4, 500);
    let ((materials, priors), air) = (guess(), Air::default());
    let problem = FitProblem::new(&materials, &priors, &air);
    let decays: Vec<MeasuredDecay> =
        pairs[..2].iter().map(|p| MeasuredDecay::new(&p.response, octaves()).unwrap()).collect();
    let responses: Vec<MeasuredPair<'_>> = decays
        .iter()
        .zip(&pairs)
        .map(|(measured, pair)| MeasuredPair { measured, paths: &pair.paths })
        .collect();
    let tables: Vec<MeasuredTable<'_>> = pairs[2..].iter().map(Pair::table).collect();
    let measurement = Measurement { time_zero: TimeZero::Emission, levels: Levels::Common };
    let both = fitter().fit_measured((&responses, measurement), &tables, &problem, &()).unwrap();
    let one = fitter().fit_responses(&responses, measurement, &problem, &()).unwrap();
    let error = |fit: &sabine_optimize::MaterialFit| -> f64 {
        fit.absorption_standard_error.iter().flat_map(|e| e.values()).sum()
    };
    let (both_error, one_error, table_error) =
        (error(&both.of_responses.fit), error(&one.fit), error(&fit(&tables).of_responses.fit));
    println!("standard errors: both {both_error:.3}, responses {one_error:.3}, tables {table_error:.3}");
    assert!(both_error < one_error && both_error < table_error);
    assert!(standardised(&both).iter().all(|z| z.abs() < 3.5), "{:?}", standardised(&both));
    assert!(both.of_responses.dispersion.values().iter().all(Option::is_some));
    assert!(both.dispersion.values().iter().all(Option::is_some));
}

#[test]
fn predictions_are_those_of_path_parameters() {
    let pair = pairs(1, 600).remove(0);
    let (truth, air) = (room(), Air::default());
    let materials: Vec<Material> = truth.materials().iter().map(|m| m.material.clone()).collect();
    let conditions = Conditions::new(&materials, &air);
    let misfit = TableMisfit::under(pair.table(), &conditions, 0.05).unwrap();
    let read = PathParameters::read(&pair.paths, &conditions).unwrap();
    for value in &misfit.values {
        let kind = value.measured.kind;
        let column = match kind {
            ParameterKind::Edt => &read.edt_s,
            ParameterKind::T20 => &read.t20_s,
            ParameterKind::T30 => &read.t30_s,
            ParameterKind::C50 => &read.c50_db,
            ParameterKind::C80 => &read.c80_db,
            ParameterKind::D50 => &read.d50,
            _ => &read.centre_time_s,
        };
        let other = column.at_hz(value.measured.band_hz).unwrap().as_ref().unwrap();
        let found = value.predicted.as_ref().unwrap();
        let off = kind.in_jnd(found.value, other.value).abs();
        assert!(off < 0.3, "{kind} at {} Hz: {found:?} {other:?}", value.measured.band_hz);
        // Two estimates of the same Monte-Carlo error: linearised here, jackknife there.
        let ratio = found.standard_error / other.standard_error;
        assert!((0.7..1.4).contains(&ratio), "{kind}: {found:?} {other:?}");
    }
}

/// Paths of a perfectly diffuse field that falls by 60 dB in T, the air included.
fn diffuse(t60_s: f64, duration_s: f64, air_per_m: f64) -> PathSet {
    let speed_m_s = Air::default().speed_of_sound_m_s();
    let mut paths = PathSet::new(1, duration_s * speed_m_s);
    let count = (duration_s / 1e-4) as u32;
    for i in 0..count {
        let time_s = 1e-4 * (f64::from(i) + 0.5);
        paths.push(Contribution {
            length_m: time_s * speed_m_s,
            log_weight: -13.8155 * time_s / t60_s + air_per_m * time_s * speed_m_s,
            chain: PathSet::DIRECT,
            tail: PathSet::DIRECT,
            departure: [0.0, 0.0, 1.0],
            arrival: [0.0, 0.0, 1.0],
            batch: Some((i % 32) as u8),
        });
    }
    paths
}

/// The spread that the paths state is that of many band-limited responses of random phase, and for decay times that of ISO 3382-2, 7.1.
#[test]
fn the_spread_by_interference_is_that_of_random_responses() {
    let (t60_s, rate) = (1.0, 16_000u32);
    let bands = octaves();
    let silent = [Material::uniform(bands, 0.0, 0.0).unwrap()];
    let air = Air::default();
    let conditions = Conditions::new(&silent, &air);
    let mut drawn: Vec<Vec<f64>> = vec![Vec::new(); 14];
    let mut random = rand_pcg::Pcg64::seed_from_u64(11);
    let mut normal = move || -> f64 {
        let (u, v): (f64, f64) = (random.random(), random.random());
        (-2.0 * (1.0 - u).ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
    };
    for _ in 0..300 {
        let mut samples = vec![0f32; 400];
        samples.extend((0..2 * rate).map(|i| {
            let time_s = f64::from(i) / f64::from(rate);
            (normal() * (-6.9078 * time_s / t60_s).exp()) as f32
        }));
        let measured = RoomParameters::measure(&ImpulseResponse::new(samples, rate).unwrap(), bands).unwrap();
        for (k, kind) in ParameterKind::ALL.into_iter().enumerate() {
            for b in 0..2 {
                drawn[2 * k + b].extend(kind.of(&measured).values()[b].as_ref().ok().map(|e| e.value));
            }
        }
    }
    // The noise knows no air, so that the paths make up for it.
    let exponents = air.energy_exponent_per_m(bands);
    let paths: Vec<PathSet> = exponents.values().iter().map(|m| diffuse(t60_s, 1.6, *m)).collect();
    for (k, kind) in ParameterKind::ALL.into_iter().enumerate() {
        for (b, band_hz) in bands.iter_hz().enumerate() {
            let values = &drawn[2 * k + b];
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64;
            let sd = variance.sqrt();
            // An error of the measurement that does not count.
            let list = [MeasuredParameter { band_hz, kind, value: mean, standard_deviation: Some(1e-5) }];
            let table = MeasuredTable { values: &list, paths: &paths[b] };
            let misfit = TableMisfit::under(table, &conditions, 0.0).unwrap();
            let stated = misfit.values[0].expected_sd;
            println!("{kind} at {band_hz} Hz: stated {stated:.4}, of {} draws {sd:.4}", values.len());
            assert!((stated / sd - 1.0).abs() < 0.2, "{kind} at {band_hz} Hz: {stated} {sd}");
            let (lower, upper) = bands.edges_hz(b);
            let iso = match kind {
                // n = 10, which the integrated impulse response stands for.
                ParameterKind::T20 => 0.88 * (1.0f64 + 0.19).sqrt(),
                ParameterKind::T30 => 0.55 * (1.0f64 + 0.152).sqrt(),
                _ => continue,
            } * t60_s
                / ((upper - lower) * t60_s).sqrt();
            println!("  ISO 3382-2: {iso:.4}");
            assert!((stated / iso - 1.0).abs() < 0.3, "{kind}: {stated} {iso}");
        }
    }
}

#[test]
fn what_no_room_has_is_refused() {
    let ((materials, priors), air) = (guess(), Air::default());
    let problem = FitProblem::new(&materials, &priors, &air);
    let mut pair = pairs(1, 700).remove(0);
    let fit = |pair: &Pair| fitter().fit_tables(&[pair.table()], &problem, &());
    pair.values[0].value = -0.3;
    assert!(matches!(fit(&pair), Err(Error::OutOfRange(e)) if e.value == -0.3));
    pair.values[0].value = 0.4;
    pair.values[0].standard_deviation = Some(0.0);
    assert!(matches!(fit(&pair), Err(Error::OutOfRange(e)) if e.field.contains("standard deviation")));
    pair.values.clear();
    assert!(matches!(fit(&pair), Err(Error::NoDecay { .. })));
    assert!(matches!(fitter().fit_tables(&[], &problem, &()), Err(Error::NoPaths { .. })));
}
