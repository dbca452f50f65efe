//! The wave solution against a real room below its Schroeder frequency: BRAS CR2 (Aspoeck et al. 2020), where its files are present.

use sabine_acoustics::{Channel, ImpulseResponse, read_audio};
use sabine_paths::{Conditions, Propagator};
use sabine_propagate::wave::{WaveConfig, WaveSolver};
use sabine_propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine_scene::MeasuredRoom;
use std::path::Path;

/// 2000 sqrt(1.8 s / 146 m3) is 222 Hz.
const RANGE_HZ: (f64, f64) = (40.0, 230.0);
const DURATION_S: f64 = 1.5;

/// Levels in dB of bands so many to the octave, two to each width, by the discrete Fourier transform every half hertz.
fn levels_db(response: &ImpulseResponse, per_octave: f64) -> Vec<f64> {
    let rate = f64::from(response.sample_rate_hz());
    let count = response.samples().len().min((DURATION_S * rate) as usize);
    let line = |hz: f64| {
        let step = std::f64::consts::TAU * hz / rate;
        let sum = response.samples()[..count].iter().enumerate().fold((0.0, 0.0), |(re, im), (i, &s)| {
            let (sine, cosine) = (step * i as f64).sin_cos();
            (re + f64::from(s) * cosine, im + f64::from(s) * sine)
        });
        sum.0 * sum.0 + sum.1 * sum.1
    };
    let first = RANGE_HZ.0 / 1.1;
    let lines: Vec<(f64, f64)> = (0..)
        .map(|i| first + 0.5 * f64::from(i))
        .take_while(|hz| *hz < RANGE_HZ.1 * 1.1)
        .map(|hz| (hz, line(hz)))
        .collect();
    let bands = ((RANGE_HZ.1 / RANGE_HZ.0).log2() * 2.0 * per_octave) as usize;
    let half = (0.5 / per_octave).exp2();
    (0..=bands)
        .map(|b| {
            let centre = RANGE_HZ.0 * (b as f64 / (2.0 * per_octave)).exp2();
            let own = lines.iter().filter(|(hz, _)| (centre / half..centre * half).contains(hz));
            let (sum, n) = own.fold((0.0, 0.0), |(sum, n), (_, e)| (sum + e, n + 1.0));
            10.0 * (sum / n).log10()
        })
        .collect()
}

/// Root mean square of the difference once the mean has been taken off: the response's level means nothing.
fn off_db(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let mean = a.iter().zip(b).map(|(a, b)| a - b).sum::<f64>() / n;
    (a.iter().zip(b).map(|(a, b)| (a - b - mean).powi(2)).sum::<f64>() / n).sqrt()
}

#[test]
fn waves_come_nearer_to_a_measured_spectrum_than_paths() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms/bras_cr2"));
    if !folder.is_dir() {
        eprintln!("skipped: {} is absent", folder.display());
        return;
    }
    let room = MeasuredRoom::read(folder).unwrap();
    let measured =
        ImpulseResponse::from(read_audio(folder.join("ir/LS1_MP1.wav"), Channel::Index(0)).unwrap());
    let (source, receiver) = (room.source("LS1").unwrap(), room.receiver("MP1").unwrap());
    let air = room.air();
    let config = WaveConfig {
        limit_hz: 1.1 * RANGE_HZ.1,
        points_per_wavelength: 12.0,
        duration_s: DURATION_S,
        sample_rate_hz: 2000,
        ..WaveConfig::default()
    };
    let heard = std::slice::from_ref(receiver);
    let solver = WaveSolver::new(config).unwrap();
    let waves = solver.respond(room.scene(), source, heard, &air, &()).unwrap()[0].response().unwrap();
    let materials: Vec<_> = room.scene().materials().iter().map(|m| m.material.clone()).collect();
    // Several seeds: what paths say of single peaks is chance.
    let paths: Vec<ImpulseResponse> = (1..=4)
        .map(|seed| {
            let config = TracerConfig { rays: 4000, duration_s: DURATION_S, seed, ..TracerConfig::default() };
            let paths =
                PathTracer::new(config).unwrap().trace(room.scene(), source, receiver, &air, &()).unwrap();
            let render = RenderConfig { seed, ..RenderConfig::default() };
            PressureRenderer::new(render).unwrap().render(&paths, &Conditions::new(&materials, &air)).unwrap()
        })
        .collect();
    let off = |per_octave: f64| {
        let wanted = levels_db(&measured, per_octave);
        let flat = vec![0.0; wanted.len()];
        let of_waves = off_db(&levels_db(&waves, per_octave), &wanted);
        let squares = paths.iter().map(|p| off_db(&levels_db(p, per_octave), &wanted).powi(2));
        let of_paths = (squares.sum::<f64>() / paths.len() as f64).sqrt();
        println!(
            "1/{per_octave} octave: waves {of_waves:.2} dB, paths {of_paths:.2} dB, a flat line {:.2} dB rms from the measured spectrum",
            off_db(&flat, &wanted)
        );
        (of_waves, of_paths)
    };
    for per_octave in [24.0, 12.0, 3.0] {
        let (of_waves, of_paths) = off(per_octave);
        assert!(of_waves < of_paths, "1/{per_octave} octave: {of_waves} and {of_paths} dB");
    }
}
