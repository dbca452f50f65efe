//! What would acoustic plaster on the ceiling do? Reverberation and clarity before and after, and a voice in both rooms.
//!
//! ```text
//! cargo run --example replace_material
//! ```
//!
//! Both are read from the same paths: chance moves them together, and the difference has an error of its own. It writes
//! `out/replace_material/before.wav` and `after.wav`, and prints
//! ```text
//!                                  250 Hz            1 kHz            4 kHz
//! T60 before (s)            2.229 ± 0.019    1.173 ± 0.021    0.776 ± 0.010
//! T60 after (s)             1.367 ± 0.057    0.881 ± 0.101    0.585 ± 0.061
//!   difference (s)         -0.863 ± 0.048   -0.293 ± 0.107   -0.191 ± 0.057
//! C50 before (dB)          -4.405 ± 0.133   -0.649 ± 0.149    1.708 ± 0.138
//! C50 after (dB)           -0.958 ± 0.142    4.427 ± 0.238    6.522 ± 0.241
//!   difference (dB)         3.447 ± 0.067    5.076 ± 0.161    4.814 ± 0.174
//! listen to before.wav and after.wav in out/replace_material
//! ```
//!
//! In full: `sabine replace --room DIR --material ceiling --with acoustic_plaster --out DIR`; all surfaces: `sabine materials`.

use sabine::acoustics::{
    Bands, Channel, Material, PerBand, Reading, SampleFormat, library_material, read_audio, write_wav,
};
use sabine::eqfilter::convolve;
use sabine::optimize::PredictedChange;
use sabine::paths::{Conditions, Propagator};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::MeasuredRoom;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let room = MeasuredRoom::read(fixtures.join("room"))?;
    let (source, receiver) = (room.source("talker")?, room.receiver("microphone")?);
    let bands = Bands::T60;
    let named = room.scene().materials();
    let ceiling = named.iter().position(|m| m.name == "ceiling").ok_or("the room has no ceiling")?;
    let before: Vec<Material> = named.iter().map(|m| m.material.resampled(bands)).collect();
    let mut after = before.clone();
    let plaster = library_material("acoustic_plaster")?.material(bands)?;
    after[ceiling] = before[ceiling].with_absorption(plaster.absorption().clone())?;

    let config = TracerConfig { rays: 10_000, duration_s: 2.0, ..TracerConfig::default() };
    let paths = PathTracer::new(config)?.trace(room.scene(), source, receiver, &room.air(), &())?;
    let change = PredictedChange::new(&paths, &before, &after, &room.air())?;
    let row = |quantity: &str, per_band: &PerBand<Reading>| {
        let cells = [250.0, 1000.0, 4000.0].map(|hz| match per_band.at_hz(hz) {
            Some(Ok(e)) => format!("{:>17}", format!("{:.3} ± {:.3}", e.value, e.standard_error)),
            _ => format!("{:>17}", "-"),
        });
        println!("{quantity:<22}{}", cells.concat());
    };
    println!("{:<22}{:>17}{:>17}{:>17}", "", "250 Hz", "1 kHz", "4 kHz");
    row("T60 before (s)", &change.before.t60_s);
    row("T60 after (s)", &change.after.t60_s);
    row("  difference (s)", &change.difference.t60_s);
    row("C50 before (dB)", &change.before.c50_db);
    row("C50 after (dB)", &change.after.c50_db);
    row("  difference (dB)", &change.difference.c50_db);

    // One scale for both voices: the quieter room is to be quieter.
    let voice = read_audio(fixtures.join("speech/dry_guest.wav"), Channel::Mono)?;
    let rate_hz = voice.sample_rate_hz();
    let config = RenderConfig { sample_rate_hz: rate_hz, ..RenderConfig::default() };
    let renderer = PressureRenderer::new(config)?;
    let heard = |materials: &[Material]| -> Result<Vec<f32>, Box<dyn Error>> {
        Ok(convolve(
            voice.samples(),
            renderer.render(&paths, &Conditions::new(materials, &room.air()))?.samples(),
        ))
    };
    let voices = [("before.wav", heard(&before)?), ("after.wav", heard(&after)?)];
    let peak = voices.iter().flat_map(|(_, s)| s).fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
    let out = Path::new("out/replace_material");
    std::fs::create_dir_all(out)?;
    for (name, samples) in &voices {
        let scaled: Vec<f32> = samples.iter().map(|s| 0.9 * s / peak).collect();
        write_wav(out.join(name), &scaled, rate_hz, SampleFormat::Int16)?;
    }
    println!("listen to before.wav and after.wav in {}", out.display());
    Ok(())
}
