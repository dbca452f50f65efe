//! Synthetic truth: the pressure of all image sources of a box (testkit), fitted on the paths of a ray tracer. Neither shares
//! code with the other.

use crate::mirrors::{self, Hearing, RECEIVERS, SOURCES};
use sabine_acoustics::{Air, Bands, Estimate, ImpulseResponse, Material, PerBand};
use sabine_optimize::{
    AbsorptionPrior, DecayMisfit, Error, FitConfig, FitProblem, MaterialFitter, MeasuredDecay, MeasuredPair,
    ResponseFit, UndeterminedKind,
};
use sabine_paths::{PathSet, Propagator};
use sabine_propagate::{PathTracer, TracerConfig};
use sabine_scene::{Levels, Measurement, NamedMaterial, Receiver, Scene, Source, TimeZero};
use sabine_testkit::ShoeboxImages;

const DURATION_S: f64 = 0.7;
const RATE_HZ: u32 = 16_000;
const RAYS: usize = 8_000;
fn octaves() -> Bands {
    Bands::octaves(1000.0, 2000.0).unwrap()
}

fn room(faces: [usize; 6], absorption: &[[f64; 2]]) -> Scene {
    let absorption: Vec<Vec<f64>> = absorption.iter().map(|a| a.to_vec()).collect();
    mirrors::room(octaves(), faces, &absorption)
}

/// Walls, floor and ceiling. The walls, which carry the late decay, are alike in both octaves: else what the filter lets pass of a
/// neighbour that rings longer is what is heard late.
const THREE: [[f64; 2]; 3] = [[0.12, 0.12], [0.3, 0.35], [0.25, 0.2]];

#[derive(Clone)]
struct Measured {
    decay: MeasuredDecay,
    paths: PathSet,
}

fn tracer(rays: usize, seed: u64) -> PathTracer {
    PathTracer::new(TracerConfig { rays, duration_s: DURATION_S, seed, ..TracerConfig::default() }).unwrap()
}

/// The response of the true room by image sources, scaled and delayed, and the paths of a tracer, which do not depend on
/// absorption.
fn measure(
    truth: &Scene,
    source: [f64; 3],
    receiver: [f64; 3],
    seed: u64,
    gain: f32,
    delay: usize,
) -> Measured {
    measure_crooked(truth, source, receiver, seed, gain, delay, 0.0)
}

#[allow(clippy::too_many_arguments)]
fn measure_crooked(
    truth: &Scene,
    source: [f64; 3],
    receiver: [f64; 3],
    seed: u64,
    gain: f32,
    delay: usize,
    arrival_error_s: f64,
) -> Measured {
    let (source, receiver) = (Source::omni("s", source).unwrap(), Receiver::omni("r", receiver).unwrap());
    let air = Air::default();
    let mut samples = vec![0.0; delay];
    samples.extend(
        Hearing { octaves: octaves(), rate_hz: RATE_HZ, duration_s: DURATION_S }
            .pressure_of_a_crooked_room(truth, &source, &receiver, seed, arrival_error_s)
            .iter()
            .map(|s| gain * s),
    );
    let response = ImpulseResponse::new(samples, RATE_HZ).unwrap();
    let paths = tracer(RAYS, seed).trace(truth, &source, &receiver, &air, &()).unwrap();
    Measured { decay: MeasuredDecay::new(&response, octaves()).unwrap(), paths }
}

fn fit(
    truth: &Scene,
    measured: &[Measured],
    levels: Levels,
    time_zero: TimeZero,
    prior: (f64, f64),
) -> ResponseFit {
    fit_trusting(truth, measured, levels, time_zero, prior, 0.0)
}

fn fit_trusting(
    truth: &Scene,
    measured: &[Measured],
    levels: Levels,
    time_zero: TimeZero,
    prior: (f64, f64),
    arrival_error_s: f64,
) -> ResponseFit {
    let guess = vec![Material::uniform(octaves(), prior.0, 0.0).unwrap(); truth.materials().len()];
    let priors = vec![AbsorptionPrior::uniform(octaves(), prior.0, prior.1); guess.len()];
    let pairs: Vec<MeasuredPair<'_>> =
        measured.iter().map(|m| MeasuredPair { measured: &m.decay, paths: &m.paths }).collect();
    let measurement = Measurement { time_zero, levels };
    // These walls are mirrors where they are said to be, and source and receiver hear all directions alike.
    let config = FitConfig { reflection_error: 0.05, arrival_error_s, ..FitConfig::default() };
    MaterialFitter::new(config)
        .unwrap()
        .fit_responses(&pairs, measurement, &FitProblem::new(&guess, &priors, &Air::default()), &())
        .unwrap()
}

fn errors(truth: &Scene, fit: &ResponseFit) -> Vec<Vec<(f64, f64)>> {
    let of = |(k, named): (usize, &NamedMaterial)| {
        let found = fit.fit.materials[k].absorption().values();
        let error = fit.fit.absorption_standard_error[k].values();
        let truth = named.material.absorption().values();
        (0..2).map(|b| (found[b] - truth[b], error[b])).collect()
    };
    truth.materials().iter().enumerate().map(of).collect()
}

#[test]
fn one_material_from_the_reverberation_time_of_another_tracer() {
    let truth = room([0; 6], &[[0.2, 0.3]]);
    let (source, receiver) =
        (Source::omni("s", SOURCES[0]).unwrap(), Receiver::omni("r", RECEIVERS[0]).unwrap());
    let air = Air::default();
    let energy =
        ShoeboxImages::new(DURATION_S).unwrap().energy_response(&truth, &source, &receiver, Some(&air), 1e-3);
    let energy = energy.unwrap();
    let t30 = |b| Estimate::exact(energy.decay_curve(b).decay_time_s(-5.0, -35.0).unwrap());
    let target = PerBand::from_fn(octaves(), t30);
    let paths = tracer(100_000, 3).trace(&truth, &source, &receiver, &air, &()).unwrap();
    let guess = Material::uniform(octaves(), 0.1, 0.0).unwrap();
    let prior = AbsorptionPrior::uniform(octaves(), 0.1, 0.3);
    let fit = MaterialFitter::new(FitConfig::default())
        .unwrap()
        .fit_t60(&[&paths], &FitProblem::new(&[guess], &[prior], &air), &target, &())
        .unwrap();
    let found = fit.materials[0].absorption().values();
    let error = ((found[0] - 0.2).abs() + (found[1] - 0.3).abs()) / 2.0;
    println!("one material: mean absolute error {error:.5}");
    assert!(error < 0.0013, "{found:?}");
}

#[test]
fn three_materials_from_two_receivers_are_covered_by_their_intervals() {
    // Walls, floor, ceiling: x0, x1, y0, y1, floor, ceiling.
    let truth = room([0, 0, 0, 0, 1, 2], &THREE);
    let measured: Vec<Measured> =
        (0..2).map(|i| measure(&truth, SOURCES[0], RECEIVERS[i], i as u64, 1.0, 0)).collect();
    let fit = fit(&truth, &measured, Levels::Common, TimeZero::Emission, (0.2, 0.15));
    let errors = errors(&truth, &fit);
    println!("three materials: {errors:.3?}, dispersion {:?}", fit.dispersion.values());
    for (error, standard_error) in errors.iter().flatten() {
        assert!(error.abs() < 3.0 * standard_error, "{errors:?}");
    }
    // Every material whose interval is no narrower than half its prior's is named.
    for (k, errors) in fit.fit.absorption_standard_error.iter().enumerate() {
        for (band_hz, error) in errors.iter().filter(|(_, e)| **e > 0.55 * 0.15) {
            let named = |u: &sabine_optimize::Undetermined| {
                u.kind != UndeterminedKind::NeverHit
                    && u.materials.contains(&k)
                    && u.bands_hz.contains(&band_hz)
            };
            assert!(fit.fit.not_determined.iter().any(named), "{k} at {band_hz} Hz: {error}");
        }
    }
}

#[test]
fn calibrated_levels_and_a_common_latency() {
    let truth = room([0, 0, 0, 0, 1, 2], &THREE);
    let measured: Vec<Measured> =
        (0..2).map(|i| measure(&truth, SOURCES[0], RECEIVERS[i], i as u64, 1.0, 300)).collect();
    let fit = fit(&truth, &measured, Levels::Absolute, TimeZero::Common, (0.2, 0.15));
    for gain in &fit.gain_db {
        assert!(gain.values().iter().all(|g| *g == Some(0.0)), "{gain:?}");
    }
    for (error, standard_error) in errors(&truth, &fit).iter().flatten() {
        assert!(error.abs() < 3.0 * standard_error, "{:?}", errors(&truth, &fit));
    }
    // Twice the level, said to be calibrated, is read as less absorption: the walls that carry the decay cannot do it.
    let loud: Vec<Measured> =
        (0..2).map(|i| measure(&truth, SOURCES[0], RECEIVERS[i], i as u64, 2.0, 300)).collect();
    let wrong = self::fit(&truth, &loud, Levels::Absolute, TimeZero::Common, (0.2, 0.15));
    for (loud, true_level) in wrong.dispersion.values().iter().zip(fit.dispersion.values()) {
        assert!(loud.unwrap() > 1.2 * true_level.unwrap(), "{loud:?} {true_level:?}");
    }
}

#[test]
fn arrivals_that_are_off_are_allowed_for() {
    // A mesh that is off by some decimetres: arrivals by a millisecond.
    const ERROR_S: f64 = 1e-3;
    let truth = room([0, 0, 0, 0, 1, 2], &THREE);
    let standardised = |allowed_s: f64| -> f64 {
        let (mut square, mut count) = (0.0, 0.0);
        for trial in 0..4u64 {
            let pair = |i: usize| {
                let seed = 2 * trial + i as u64;
                measure_crooked(&truth, SOURCES[0], RECEIVERS[i], seed, 1.0, 0, ERROR_S)
            };
            let measured: Vec<Measured> = (0..2).map(pair).collect();
            let prior = (0.2, 0.15);
            let fit = fit_trusting(&truth, &measured, Levels::Common, TimeZero::Emission, prior, allowed_s);
            for (error, standard_error) in errors(&truth, &fit).iter().flatten() {
                square += (error / standard_error).powi(2);
                count += 1.0;
            }
        }
        square / count
    };
    let (allowed_for, trusted) = (standardised(ERROR_S), standardised(0.0));
    println!("standardised errors squared: {allowed_for:.2} allowed for, {trusted:.2} trusted");
    // 24 squares, partly correlated: their mean scatters by about 0.4.
    assert!(allowed_for < 2.0, "{allowed_for}");
    assert!(trusted > 1.5 * allowed_for, "{trusted} {allowed_for}");
}

#[test]
fn gains_latencies_and_held_out_places() {
    let truth = room([0, 0, 0, 0, 1, 2], &THREE);
    let gains = [0.1, 2.0, 30.0];
    let measured: Vec<Measured> = (0..3)
        .map(|i| measure(&truth, SOURCES[1], RECEIVERS[i], 20 + i as u64, gains[i], 400 * (i + 1)))
        .collect();
    let held_out = &measured[2];
    let fit = fit(&truth, &measured[..2], Levels::PerResponse, TimeZero::PerResponse, (0.45, 0.2));
    for (gain, expected) in fit.gain_db.iter().zip(gains) {
        for found in gain.values() {
            let wanted = 20.0 * f64::from(expected).log10();
            // Floor and ceiling are hardly known here, and with them the level of the paths.
            assert!((found.unwrap() - wanted).abs() < 3.0, "{found:?} dB for {wanted}");
        }
    }
    let pair = MeasuredPair { measured: &held_out.decay, paths: &held_out.paths };
    let misfit = |materials: &[Material]| {
        let m = DecayMisfit::new(pair, TimeZero::PerResponse, materials, &Air::default()).unwrap();
        m.rmse_db.values().iter().map(|r| r.clone().unwrap()).sum::<f64>() / 2.0
    };
    let guess = vec![Material::uniform(octaves(), 0.45, 0.0).unwrap(); 3];
    let (before, after) = (misfit(&guess), misfit(&fit.fit.materials));
    println!("held out: decay curve {before:.2} dB before, {after:.2} dB after");
    // A time constant of 36 ms in an octave of 707 Hz holds 25 independent values: 0.9 dB of chance in the response alone, more
    // where its decay ends.
    assert!(after < 2.0 && before > 3.0 * after, "{before} {after}");
}

#[test]
fn responses_that_say_nothing_are_refused() {
    let silent = ImpulseResponse::new(vec![0.0; 4000], 8000).unwrap();
    assert!(matches!(MeasuredDecay::new(&silent, octaves()), Err(Error::NoOnset { .. })));
    // A click: an onset, but no decay in any band.
    let truth = room([0; 6], &[[0.2, 0.3]]);
    let mut click = vec![0.0; 4000];
    click[500] = 1.0;
    let click = MeasuredDecay::new(&ImpulseResponse::new(click, 8000).unwrap(), octaves()).unwrap();
    let paths = measure(&truth, SOURCES[0], RECEIVERS[0], 1, 1.0, 0).paths;
    let guess = [Material::uniform(octaves(), 0.1, 0.0).unwrap()];
    let priors = [AbsorptionPrior::uniform(octaves(), 0.1, 0.1)];
    let measurement = Measurement { time_zero: TimeZero::Emission, levels: Levels::Absolute };
    let fitter = MaterialFitter::new(FitConfig::default()).unwrap();
    let pair = MeasuredPair { measured: &click, paths: &paths };
    let error = fitter
        .fit_responses(&[pair], measurement, &FitProblem::new(&guess, &priors, &Air::default()), &())
        .unwrap_err();
    assert!(matches!(error, Error::NoDecay { responses: 1, bands: 2 }), "{error}");
    assert!(matches!(
        fitter.fit_responses(&[], measurement, &FitProblem::new(&guess, &priors, &Air::default()), &()),
        Err(Error::NoPaths { .. })
    ));
}
