//! Traced once, heard under other conditions: drier air, an open curtain, a talker who looks away. Nothing is traced again.
//!
//! ```text
//! cargo run --example other_air
//! ```
//!
//! It prints
//! ```text
//!                            T30 1 kHz (s)     T30 8 kHz (s)    DRR 1 kHz (dB)
//! as stated                  1.173 ± 0.021     0.566 ± 0.005   -13.860 ± 0.073
//! air of 15 % humidity       1.146 ± 0.021     0.405 ± 0.003   -13.759 ± 0.074
//! curtain drawn back         2.008 ± 0.009     0.752 ± 0.003   -17.283 ± 0.052
//! talker looks away          1.176 ± 0.023     0.565 ± 0.005   -18.628 ± 0.079
//! ```
//!
//! A change of materials in full: `sabine replace --room DIR --material curtain --with rendered_brick`. Why this is possible:
//! `docs/explanation/tracing.md`.

use sabine::acoustics::{Air, Bands, Directivity, Material, Orientation, Reading, library_material};
use sabine::paths::{Conditions, PathParameters, Propagator};
use sabine::propagate::{PathTracer, TracerConfig};
use sabine::scene::MeasuredRoom;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let room = MeasuredRoom::read(fixtures.join("room"))?;
    let (source, receiver) = (room.source("talker")?, room.receiver("microphone")?);
    let start = Instant::now();
    let config = TracerConfig { rays: 10_000, duration_s: 2.0, ..TracerConfig::default() };
    let paths = PathTracer::new(config)?.trace(room.scene(), source, receiver, &room.air(), &())?;
    eprintln!("{} paths traced in {:.2} s", paths.len(), start.elapsed().as_secs_f64());

    // A path is a length, a weight and the materials that it met: absorption and air come in here, not before.
    let bands = Bands::T60;
    let named = room.scene().materials();
    let stated: Vec<Material> = named.iter().map(|m| m.material.resampled(bands)).collect();
    let air = room.air();
    let dry = Air::new(air.temperature_c(), 15.0, air.pressure_kpa())?;
    let curtain = named.iter().position(|m| m.name == "curtain").ok_or("the room has no curtain")?;
    let mut bare = stated.clone();
    // Absorption only: which way a path was scattered was drawn when it was traced.
    let brick = library_material("rendered_brick")?.material(bands)?;
    bare[curtain] = stated[curtain].with_absorption(brick.absorption().clone())?;
    let voice = Directivity::first_order(Directivity::SUBCARDIOID)?;
    let away = Orientation::towards([0, 1, 2].map(|k| source.position_m[k] - receiver.position_m[k]))?;

    let start = Instant::now();
    let as_stated = Conditions::new(&stated, &air);
    let variants = [
        ("as stated", as_stated),
        ("air of 15 % humidity", as_stated.with_attenuation(&dry)),
        ("curtain drawn back", Conditions::new(&bare, &air)),
        ("talker looks away", as_stated.with_source(&voice, away)),
    ];
    println!("{:<22}{:>18}{:>18}{:>18}", "", "T30 1 kHz (s)", "T30 8 kHz (s)", "DRR 1 kHz (dB)");
    for (name, conditions) in &variants {
        let heard = PathParameters::read(&paths, conditions)?;
        let cells = [heard.t30_s.at_hz(1000.0), heard.t30_s.at_hz(8000.0), heard.drr_db.at_hz(1000.0)];
        println!("{name:<22}{}", cells.map(cell).concat());
    }
    eprintln!("weighed {} times in {:.2} s", variants.len(), start.elapsed().as_secs_f64());
    Ok(())
}

fn cell(reading: Option<&Reading>) -> String {
    match reading {
        Some(Ok(e)) => format!("{:>18}", format!("{:.3} ± {:.3}", e.value, e.standard_error)),
        _ => format!("{:>18}", "-"),
    }
}
