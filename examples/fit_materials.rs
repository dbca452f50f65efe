//! Seven reverberation times and a model: which absorption makes the model ring as long, and which of it is known at all?
//!
//! ```text
//! cargo run --example fit_materials
//! ```
//!
//! It prints
//! ```text
//! octave (Hz)   T60 wanted (s)   before (s)   after (s)
//!         125             0.80         1.90        0.80
//! ...
//!        1000             0.76         1.17        0.76
//! ...
//!        8000             0.49         0.57        0.49
//! absorption at 1 kHz      table        fitted
//!   carpet                  0.20     0.24 ± 0.10
//!   parquet                 0.06     0.10 ± 0.10
//! ...
//! not determined: carpet, parquet, ceiling, window, plaster, curtain, panels and brick cannot be told apart at 125 Hz to 8 kHz
//! ...
//! ```
//!
//! In full: `sabine fit --room DIR --t60 0.8,0.86,0.82,0.76,0.7,0.63,0.49 --out DIR`. What is minimised: `docs/explanation/objective.md`.

use sabine::acoustics::{Bands, Estimate, Material, PerBand, Reading};
use sabine::optimize::{AbsorptionPrior, FitConfig, FitProblem, MaterialFitter};
use sabine::paths::{Conditions, PathParameters, Propagator};
use sabine::propagate::{PathTracer, TracerConfig};
use sabine::scene::MeasuredRoom;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let room = MeasuredRoom::read(fixtures.join("room"))?;
    let (source, receiver) = (room.source("talker")?, room.receiver("microphone")?);
    let bands = Bands::T60;

    // What somebody measured, at 125 Hz to 8 kHz, known to 3 %.
    let measured_s = PerBand::new(bands, vec![0.80, 0.86, 0.82, 0.76, 0.70, 0.63, 0.49])?;
    let target_s = measured_s.map(|&t60_s| Estimate::new(t60_s, 0.03 * t60_s));

    // The tables of the room file, and how far each is trusted.
    let names: Vec<&str> = room.scene().materials().iter().map(|m| m.name.as_str()).collect();
    let tables: Vec<Material> =
        room.scene().materials().iter().map(|m| m.material.resampled(bands)).collect();
    let priors = AbsorptionPrior::of_room(&room, bands);

    let scene = room.scene().with_materials(tables.clone())?;
    let config = TracerConfig { rays: 10_000, duration_s: 2.5, ..TracerConfig::default() };
    let paths = PathTracer::new(config)?.trace(&scene, source, receiver, &room.air(), &())?;
    let before = PathParameters::read(&paths, &Conditions::new(&tables, &room.air()))?;
    let fit = MaterialFitter::new(FitConfig::default())?.fit_t60(
        &[&paths],
        &FitProblem::new(&tables, &priors, &room.air()),
        &target_s,
        &(),
    )?;

    println!("octave (Hz)   T60 wanted (s)   before (s)   after (s)");
    for (b, (hz, wanted)) in measured_s.iter().enumerate() {
        let [before, after] = [&before.t30_s, &fit.predicted_t60_s].map(|t60| seconds(&t60.values()[b]));
        println!("{hz:>11}{wanted:>17.2}{before:>13}{after:>12}");
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
    for missed in &fit.unreachable {
        println!("not reached: {missed}");
    }
    for warning in &fit.warnings {
        println!("warning: {}", warning.describe(&names));
    }
    Ok(())
}

fn seconds(reading: &Reading) -> String {
    reading.as_ref().map_or_else(|_| "-".to_owned(), |t60| format!("{:.2}", t60.value))
}
