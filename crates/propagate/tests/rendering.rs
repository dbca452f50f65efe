//! The rendered response, measured: octave filters in the time domain, which share no code with the renderer.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_acoustics::*;
use sabine_propagate::*;

/// Second-order section.
struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

/// Butterworth low pass or high pass of eighth order, by bilinear transform with prewarping.
fn butterworth(edge_hz: f64, rate_hz: f64, high_pass: bool) -> Vec<Section> {
    let k = (std::f64::consts::PI * edge_hz / rate_hz).tan();
    (0..4)
        .map(|i| {
            let damping = 2.0 * (std::f64::consts::PI * (2 * i + 1) as f64 / 16.0).cos();
            let norm = 1.0 / (1.0 + damping * k + k * k);
            let a = [2.0 * (k * k - 1.0) * norm, (1.0 - damping * k + k * k) * norm];
            let b = if high_pass {
                [norm, -2.0 * norm, norm]
            } else {
                [k * k * norm, 2.0 * k * k * norm, k * k * norm]
            };
            Section { b, a }
        })
        .collect()
}

/// Octave-filtered samples; run backwards in time, so that the filter's own decay does not lengthen the room's.
fn octave(samples: &[f32], rate_hz: f64, bands: OctaveBands, band: usize) -> Vec<f64> {
    let (low, high) = bands.edges_hz(band);
    let mut sections = butterworth(low, rate_hz, true);
    if high < 0.45 * rate_hz {
        sections.extend(butterworth(high, rate_hz, false));
    }
    let mut signal: Vec<f64> = samples.iter().rev().map(|&s| f64::from(s)).collect();
    signal.resize(samples.len() + (8.0 * rate_hz / low) as usize, 0.0);
    for section in sections {
        let (mut z1, mut z2) = (0.0, 0.0);
        for x in &mut signal {
            let y = section.b[0] * *x + z1;
            z1 = section.b[1] * *x - section.a[0] * y + z2;
            z2 = section.b[2] * *x - section.a[1] * y;
            *x = y;
        }
    }
    signal.truncate(samples.len());
    signal.reverse();
    signal
}

fn measured_t_s(response: &ImpulseResponse, bands: OctaveBands, band: usize, end_db: f64) -> f64 {
    let rate = f64::from(response.sample_rate_hz());
    let energy: Vec<f64> = octave(response.samples(), rate, bands, band).iter().map(|v| v * v).collect();
    EnergyDecayCurve::from_energy(&energy, 1.0 / rate).decay_time_s(-5.0, end_db).unwrap()
}

fn room(absorption: [f64; 8], scattering: [f64; 8]) -> (Scene, Vec<Material>) {
    let bands = OctaveBands::SIMULATION;
    let m = Material::new(
        PerBand::new(bands, absorption.to_vec()).unwrap(),
        PerBand::new(bands, scattering.to_vec()).unwrap(),
    )
    .unwrap();
    let scene = Scene::shoebox([8.0, 5.5, 3.2], std::array::from_fn(|_| m.clone())).unwrap();
    let materials = scene.materials().iter().map(|m| m.material.clone()).collect();
    (scene, materials)
}

#[test]
fn probe() {
    let absorption = [0.10, 0.11, 0.13, 0.16, 0.18, 0.20, 0.22, 0.25];
    let scattering = [0.1, 0.12, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6];
    let (scene, materials) = room(absorption, scattering);
    let air = Air::default();
    let tracer =
        PathTracer::new(TracerConfig { rays: 20_000, duration_s: 1.5, ..Default::default() }).unwrap();
    let start = std::time::Instant::now();
    let paths = tracer
        .trace(
            &scene,
            &Source::omni("S", [2.0, 3.0, 1.5]).unwrap(),
            &Receiver::omni("R", [6.0, 2.0, 1.6]).unwrap(),
            &air,
            &(),
        )
        .unwrap();
    eprintln!("traced {} paths {:?}", paths.len(), start.elapsed());
    let energy = paths.energy_response(&materials, &air, 1e-3).unwrap();
    for statistics in [Statistics::Gaussian, Statistics::DecayMatched] {
        for seed in 0..4 {
            let renderer =
                PressureRenderer::new(RenderConfig { seed, statistics, ..Default::default() }).unwrap();
            let start = std::time::Instant::now();
            let response = renderer.render(&paths, &materials, &air).unwrap();
            let took = start.elapsed();
            let errors: Vec<String> = (0..8)
                .map(|b| {
                    let wanted = energy.decay_curve(b).decay_time_s(-5.0, -35.0).unwrap();
                    let w20 = energy.decay_curve(b).decay_time_s(-5.0, -25.0).unwrap();
                    format!(
                        "{:.2}:{:+.1}/{:+.1}%",
                        wanted,
                        100.0 * (measured_t_s(&response, energy.bands(), b, -35.0) / wanted - 1.0),
                        100.0 * (measured_t_s(&response, energy.bands(), b, -25.0) / w20 - 1.0)
                    )
                })
                .collect();
            eprintln!("{statistics:?} {seed} {took:?} {errors:?}");
        }
    }
}
