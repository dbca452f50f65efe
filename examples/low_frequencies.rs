//! Below 120 Hz a small room is a wave field: standing waves where theory puts them, joined to rays above.
//!
//! ```text
//! cargo run --example low_frequencies
//! ```
//!
//! Loudspeaker and microphone stand in corners, where waves add up in phase and rays only their energies. It writes
//! `out/low_frequencies/impulse_response.wav` and prints
//! ```text
//! 52 m3, solved up to 170 Hz
//! peaks of the level from 30 to 78 Hz, and the standing waves of a rigid box:
//!   34.3 Hz  +31.3 dB   [1, 0, 0]   34.3 Hz
//!   43.0 Hz  +29.0 dB   [0, 1, 0]   42.9 Hz
//!   54.9 Hz  +31.3 dB   [1, 1, 0]   54.9 Hz
//!   66.2 Hz  +23.8 dB   [0, 0, 1]   66.0 Hz
//!   68.4 Hz  +24.8 dB   [2, 0, 0]   68.6 Hz
//!   74.4 Hz  +27.5 dB   [1, 0, 1]   74.4 Hz
//! about 120 Hz the waves are 8.6 dB above the rays
//! wrote out/low_frequencies/impulse_response.wav
//! ```
//!
//! For a room of your own: `sabine trace --room DIR --wave-below 120 --out DIR`. How it is done: `docs/explanation/wave.md`.

use sabine::acoustics::{Air, Bands, ImpulseResponse, Material, SampleFormat, write_wav};
use sabine::paths::{Conditions, Propagator};
use sabine::propagate::wave::{Crossover, WaveConfig, WaveSolver};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::{Receiver, Scene, Source};
use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::path::Path;

const SIZE_M: [f64; 3] = [5.0, 4.0, 2.6];
const DURATION_S: f64 = 1.5;

fn main() -> Result<(), Box<dyn Error>> {
    let wall = Material::uniform(Bands::SIMULATION, 0.06, 0.1)?;
    let walls = vec![wall.clone(); 6];
    let scene = Scene::shoebox(SIZE_M, std::array::from_fn(|_| wall.clone()))?;
    // In corners, where every standing wave is at its loudest.
    let source = Source::omni("loudspeaker", [0.3, 0.3, 0.3])?;
    let receiver = Receiver::omni("microphone", [4.7, 3.7, 2.3])?;
    let air = Air::default();

    let crossover = Crossover::new(120.0)?;
    let config =
        WaveConfig { limit_hz: crossover.limit_hz(), duration_s: DURATION_S, ..WaveConfig::default() };
    let receivers = std::slice::from_ref(&receiver);
    let waves = WaveSolver::new(config)?.respond(&scene, &source, receivers, &air, &())?.swap_remove(0);
    let heard = waves.response()?;

    println!("{:.0} m3, solved up to {:.0} Hz", scene.volume_m3(), waves.limit_hz());
    println!("peaks of the level from 30 to 78 Hz, and the standing waves of a rigid box:");
    let hz = |step: usize| 30.0 + 0.1 * step as f64;
    let level_db: Vec<f64> = (0..=480).map(|step| level_db(&heard, hz(step))).collect();
    for (i, three) in level_db.windows(3).enumerate() {
        if three[1] > three[0] && three[1] >= three[2] {
            let (mode, theory_hz) = nearest_mode(hz(i + 1), air.speed_of_sound_m_s());
            println!("{:>6.1} Hz {:>+6.1} dB   {mode:?} {theory_hz:>6.1} Hz", hz(i + 1), three[1]);
        }
    }

    let config = TracerConfig { rays: 10_000, duration_s: DURATION_S, ..TracerConfig::default() };
    let paths = PathTracer::new(config)?.trace(&scene, &source, &receiver, &air, &())?;
    let rays =
        PressureRenderer::new(RenderConfig::default())?.render(&paths, &Conditions::new(&walls, &air))?;
    let joined = crossover.join(&waves, &rays)?;
    println!("about 120 Hz the waves are {:.1} dB above the rays", joined.level_difference_db);

    let out = Path::new("out/low_frequencies");
    std::fs::create_dir_all(out)?;
    let (response, file) = (joined.response, out.join("impulse_response.wav"));
    write_wav(&file, response.samples(), response.sample_rate_hz(), SampleFormat::Float32)?;
    println!("wrote {}", file.display());
    Ok(())
}

/// Level of one frequency of a response, relative to that of the direct sound at 1 m.
fn level_db(response: &ImpulseResponse, hz: f64) -> f64 {
    let turn = TAU * hz / f64::from(response.sample_rate_hz());
    let count = response.samples().len() as f64;
    let (re, im) = response.samples().iter().enumerate().fold((0.0, 0.0), |(re, im), (i, &s)| {
        let (sin, cos) = (turn * i as f64).sin_cos();
        // Faded out, for what ends abruptly has ripples in its spectrum.
        let s = f64::from(s) * (0.5 * PI * i as f64 / count).cos().powi(2);
        (re + s * cos, im + s * sin)
    });
    20.0 * f64::hypot(re, im).log10()
}

/// The standing wave of a rigid box that is nearest: half waves along each side, and its frequency.
fn nearest_mode(hz: f64, speed_m_s: f64) -> ([u8; 3], f64) {
    let modes = (1..27_u8).map(|n| [n / 9, n / 3 % 3, n % 3]);
    let frequency_hz = |mode: [u8; 3]| {
        let waves = [0, 1, 2].map(|k| (f64::from(mode[k]) / SIZE_M[k]).powi(2));
        0.5 * speed_m_s * waves.iter().sum::<f64>().sqrt()
    };
    let all = modes.map(|mode| (mode, frequency_hz(mode)));
    all.min_by(|a, b| (a.1 - hz).abs().total_cmp(&(b.1 - hz).abs())).unwrap_or(([0; 3], 0.0))
}
