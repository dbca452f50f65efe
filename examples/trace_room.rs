//! A room folder in, sound out: the response at a microphone, mono and with directions, and what it measures.
//!
//! ```text
//! cargo run --example trace_room [-- ROOM_FOLDER]
//! ```
//!
//! It takes the first source and the first receiver, writes `out/trace_room/impulse_response.wav` and `ambisonics.wav`, and prints
//! ```text
//! 145.7 m3, 187.3 m2; from talker to microphone
//! octave (Hz)         T30 (s)       C50 (dB)
//!         125   1.895 ± 0.040    -3.2 ± 0.1
//! ...
//!        1000   1.168 ± 0.023    -0.7 ± 0.1
//! ...
//!        8000   0.571 ± 0.007    +3.8 ± 0.1
//! direct sound after 13.77 ms from -167 degrees (0: +x, 90: +y)
//! wrote impulse_response.wav and ambisonics.wav (ACN, SN3D) in out/trace_room
//! ```
//!
//! In full: `sabine trace --room DIR --out DIR`. The folder: `docs/measured-room.md`; all options: `docs/how-to/trace-a-room.md`.

use sabine::acoustics::{Material, Orientation, SampleFormat, Signal, write_wav};
use sabine::paths::{Conditions, PathParameters, Propagator};
use sabine::propagate::{AmbisonicRenderer, PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::MeasuredRoom;
use std::error::Error;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let folder = std::env::args_os().nth(1).map(PathBuf::from);
    let room = MeasuredRoom::read(folder.unwrap_or_else(|| fixtures.join("room")))?;
    let source = room.sources().first().ok_or("the room has no source")?;
    let receiver = room.receivers().first().ok_or("the room has no receiver")?;
    println!(
        "{:.1} m3, {:.1} m2; from {} to {}",
        room.scene().volume_m3(),
        room.scene().surface_m2(),
        source.id,
        receiver.id
    );

    let config = TracerConfig { rays: 10_000, duration_s: 2.5, ..TracerConfig::default() };
    let air = room.air();
    let paths = PathTracer::new(config)?.trace(room.scene(), source, receiver, &air, &())?;
    let materials: Vec<Material> = room.scene().materials().iter().map(|m| m.material.clone()).collect();
    let conditions = Conditions::new(&materials, &air);

    let heard = PathParameters::read(&paths, &conditions)?;
    println!("octave (Hz)         T30 (s)       C50 (dB)");
    for ((hz, t30), c50) in heard.t30_s.iter().zip(heard.c50_db.values()) {
        match (t30, c50) {
            (Ok(t30), Ok(c50)) => println!(
                "{hz:>11}   {:.3} ± {:.3}   {:>+5.1} ± {:.1}",
                t30.value, t30.standard_error, c50.value, c50.standard_error
            ),
            (Err(reason), _) | (_, Err(reason)) => println!("{hz:>11}   {reason}"),
        }
    }

    // The listener of the ambisonic response looks along +x; turning the head later needs no new response.
    let config = RenderConfig::default();
    let mono = PressureRenderer::new(config.clone())?.render(&paths, &conditions)?;
    let directional =
        AmbisonicRenderer::new(1, config)?.render(&paths, &conditions, Orientation::default())?;

    // The direct sound, from its pressure (W) and velocities (X, Y): when it comes, and from where.
    let direct = mono.samples().iter().position(|s| s.abs() == mono.peak()).unwrap_or(0);
    let [w, y, x] = [0, 1, 3].map(|acn| directional.channel(acn)[direct]);
    println!(
        "direct sound after {:.2} ms from {:.0} degrees (0: +x, 90: +y)",
        1e3 * direct as f64 / f64::from(mono.sample_rate_hz()),
        (y * w).atan2(x * w).to_degrees()
    );

    let out = Path::new("out/trace_room");
    std::fs::create_dir_all(out)?;
    let mono = Signal::from(mono);
    write_wav(
        out.join("impulse_response.wav"),
        mono.samples(),
        mono.sample_rate_hz(),
        SampleFormat::Float32,
    )?;
    directional.write_wav(out.join("ambisonics.wav"), SampleFormat::Float32)?;
    println!("wrote impulse_response.wav and ambisonics.wav (ACN, SN3D) in {}", out.display());
    Ok(())
}
