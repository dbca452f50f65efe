//! Measured responses and a model: materials with which the model decays as the room does, held against a response that was not fitted.
//!
//! ```text
//! cargo run --example fit_responses
//! ```
//!
//! It prints
//! ```text
//! at the place held out, T30 (s) and error of the decay curve (dB)
//! octave (Hz)   measured      with the tables            fitted
//!         250     0.84 s      2.06 s  11.6 dB    0.88 s  1.0 dB
//! ...
//!        1000     0.77 s       1.20 s  6.9 dB    0.76 s  0.8 dB
//! ...
//! absorption at 1 kHz      table        fitted
//!   carpet                  0.20     0.30 ± 0.07
//!   parquet                 0.06     0.02 ± 0.07
//! ...
//! not determined: carpet, parquet, ceiling, window, plaster, curtain, panels and brick cannot be told apart at 250 Hz to 4 kHz
//! ```
//!
//! Read what is not determined before you read an absorption. In full: `sabine fit --room DIR --responses --hold-out r3 --out DIR`,
//! then `sabine validate --room DIR`. Step by step: `docs/how-to/calibrate-a-room.md`.

use sabine::acoustics::Bands;
use sabine::optimize::{
    AbsorptionPrior, DecayMisfit, FitConfig, FitProblem, MaterialFitter, MeasuredDecay, MeasuredPair,
};
use sabine::paths::Propagator;
use sabine::propagate::{PathTracer, TracerConfig};
use sabine::scene::MeasuredRoom;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let room = MeasuredRoom::read(fixtures.join("room"))?;
    let bands = Bands::octaves(250.0, 4000.0)?;
    let tables: Vec<_> = room.scene().materials().iter().map(|m| m.material.resampled(bands)).collect();
    let names: Vec<&str> = room.scene().materials().iter().map(|m| m.name.as_str()).collect();
    let priors = AbsorptionPrior::of_room(&room, bands);

    // The decay of each response, and the paths between the same places.
    let scene = room.scene().with_materials(tables.clone())?;
    let config = TracerConfig { rays: 10_000, duration_s: 1.25, ..TracerConfig::default() };
    let tracer = PathTracer::new(config)?;
    let (mut decays, mut paths) = (Vec::new(), Vec::new());
    for (index, entry) in room.responses().iter().enumerate() {
        decays.push(MeasuredDecay::new(&room.load_response(index)?, bands)?);
        let (source, receiver) = (&room.sources()[entry.source], &room.receivers()[entry.receiver]);
        paths.push(tracer.trace(&scene, source, receiver, &entry.air, &())?);
    }

    // All but the last are fitted: the last says whether the fit is worth anything elsewhere.
    let pairs: Vec<_> =
        decays.iter().zip(&paths).map(|(measured, paths)| MeasuredPair { measured, paths }).collect();
    let (held_out, fitted) = pairs.split_last().ok_or("the room has no responses")?;
    let fitter = MaterialFitter::new(FitConfig::default())?;
    let fit = fitter
        .fit_responses(fitted, room.measurement(), &FitProblem::new(&tables, &priors, &room.air()), &())?
        .fit;

    let misfit =
        |materials| DecayMisfit::new(*held_out, room.measurement().time_zero, materials, &room.air());
    let (before, after) = (misfit(&tables)?, misfit(&fit.materials)?);
    println!("at the place held out, T30 (s) and error of the decay curve (dB)");
    println!("octave (Hz)   measured      with the tables            fitted");
    for (b, (hz, measured)) in before.measured_t30_s.iter().enumerate() {
        let side = |m: &DecayMisfit| match (&m.simulated_t30_s.values()[b], &m.rmse_db.values()[b]) {
            (Ok(t30), Ok(rmse)) => format!("{:.2} s  {rmse:.1} dB", t30.value),
            _ => "-".to_owned(),
        };
        let measured = measured.as_ref().map_or(f64::NAN, |t30| t30.value);
        println!("{hz:>11}{measured:>9.2} s{:>21}{:>18}", side(&before), side(&after));
    }
    println!("absorption at 1 kHz      table        fitted");
    for (i, name) in names.iter().enumerate() {
        let [table, fitted] = [&tables, &fit.materials].map(|m| m[i].absorption().at_hz(1000.0).copied());
        let error = fit.absorption_standard_error[i].at_hz(1000.0).copied();
        let [table, fitted, error] = [table, fitted, error].map(|a| a.unwrap_or(f64::NAN));
        println!("  {name:<18}{table:>10.2}     {fitted:.2} ± {error:.2}");
    }
    for open in &fit.not_determined {
        println!("not determined: {}", open.describe(&names));
    }
    for warning in &fit.warnings {
        println!("warning: {}", warning.describe(&names));
    }
    Ok(())
}
