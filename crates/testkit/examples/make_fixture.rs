//! Makes the fixtures: a room whose tables are wrong, a recording from the room as it really is, and the truth about it.
//!
//! `cargo run --release -p sabine-testkit --example make_fixture -- fixtures`, after the dry speech has been made; see
//! `fixtures/make.sh`.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use realfft::num_complex::Complex;
use sabine_acoustics::RealTransforms;
use sabine_acoustics::{
    Air, Bands, Channel, ImpulseResponse, Material, PerBand, SampleFormat, library_material, read_audio,
    write_atomically, write_wav,
};
use sabine_scene::{
    Levels, MaterialPrior, Measurement, NamedMaterial, NewResponse, NewRoom, PositionSd, Receiver, Scene,
    Source, TimeZero, Triangle,
};
use sabine_testkit::{PhononConfig, Phonons};
use serde_json::json;
use std::error::Error;
use std::path::Path;

/// Bands of the room's tables, as most rooms have them.
const TABLES: Bands = Bands::T60;
/// Bands of the truth.
const TRUTH: Bands = Bands::SIMULATION;
/// Longer than the longest reverberation time.
const DURATION_S: f64 = 1.25;
/// Level of the noise below the speech, in dB.
const SNR_DB: f64 = 30.0;
/// What microphone and recorder do to the sound, in dB at 62.5 Hz to 8 kHz.
const CHAIN_DB: [f64; 8] = [-3.0, -1.0, 0.5, 1.0, 0.0, -1.5, -2.5, -4.0];

/// A surface as the model states it (a library entry that looked about right) and as it is.
struct Surface {
    name: &'static str,
    stated: &'static str,
    absorption: [f64; 8],
    scattering: [f64; 8],
}

#[rustfmt::skip]
const SURFACES: [Surface; 8] = [
    Surface { name: "carpet",  stated: "carpet_thin",         absorption: [0.03, 0.05, 0.10, 0.22, 0.32, 0.42, 0.50, 0.55], scattering: [0.10, 0.10, 0.15, 0.20, 0.25, 0.30, 0.40, 0.50] },
    Surface { name: "parquet", stated: "parquet_on_concrete", absorption: [0.08, 0.08, 0.07, 0.07, 0.07, 0.06, 0.06, 0.06], scattering: [0.10, 0.15, 0.20, 0.25, 0.30, 0.30, 0.30, 0.30] },
    Surface { name: "ceiling", stated: "plaster_on_lath",     absorption: [0.28, 0.26, 0.20, 0.15, 0.12, 0.11, 0.10, 0.10], scattering: [0.05, 0.05, 0.10, 0.10, 0.15, 0.20, 0.25, 0.30] },
    Surface { name: "window",  stated: "double_glazing",      absorption: [0.25, 0.28, 0.20, 0.14, 0.10, 0.07, 0.05, 0.05], scattering: [0.10, 0.10, 0.15, 0.20, 0.25, 0.30, 0.30, 0.35] },
    Surface { name: "plaster", stated: "rendered_brick",      absorption: [0.10, 0.10, 0.07, 0.05, 0.05, 0.05, 0.05, 0.05], scattering: [0.10, 0.15, 0.20, 0.20, 0.25, 0.25, 0.30, 0.30] },
    Surface { name: "curtain", stated: "curtain_light",       absorption: [0.06, 0.12, 0.25, 0.48, 0.62, 0.65, 0.62, 0.60], scattering: [0.10, 0.10, 0.20, 0.30, 0.40, 0.50, 0.60, 0.60] },
    Surface { name: "panels",  stated: "wooden_door",         absorption: [0.25, 0.25, 0.18, 0.12, 0.09, 0.09, 0.08, 0.08], scattering: [0.10, 0.15, 0.25, 0.35, 0.45, 0.50, 0.55, 0.60] },
    Surface { name: "brick",   stated: "brick_painted",       absorption: [0.04, 0.05, 0.06, 0.08, 0.09, 0.11, 0.12, 0.12], scattering: [0.05, 0.10, 0.15, 0.20, 0.30, 0.35, 0.40, 0.45] },
];

/// A polygon of vertices, with the index of its surface.
type Face = (usize, Vec<u32>);

/// An L of 45 m2 under a ceiling that rises from 2.6 to 3.96 m.
fn shape() -> (Vec<[f64; 3]>, Vec<Face>) {
    let plan =
        [[0.0, 0.0], [4.6, 0.0], [8.0, 0.0], [8.0, 4.2], [4.6, 4.2], [4.6, 6.8], [0.0, 6.8], [0.0, 4.2]];
    let height = |y: f64| 2.6 + 0.2 * y;
    let mut vertices: Vec<[f64; 3]> = plan.iter().map(|p| [p[0], p[1], 0.0]).collect();
    vertices.extend(plan.iter().map(|p| [p[0], p[1], height(p[1])]));
    // Floor: the carpet lies before the window. Faces look inward.
    let mut faces = vec![(0, vec![0, 1, 4, 7]), (1, vec![1, 2, 3, 4]), (1, vec![7, 4, 5, 6])];
    let above = |polygon: &[u32]| polygon.iter().rev().map(|v| v + 8).collect::<Vec<u32>>();
    let ceiling: Vec<Face> = faces.iter().map(|(_, polygon)| (2, above(polygon))).collect();
    faces.extend(ceiling);
    // Walls in the order of the plan: window, plaster, curtain, panels, panels, brick, plaster, plaster.
    for (i, surface) in [3, 4, 5, 6, 6, 7, 4, 4].into_iter().enumerate() {
        let (a, b) = (i as u32, (i as u32 + 1) % 8);
        faces.push((surface, vec![a, a + 8, b + 8, b]));
    }
    (vertices, faces)
}

fn scene(
    material: impl Fn(&Surface) -> Result<Material, sabine_acoustics::Error>,
) -> Result<Scene, Box<dyn Error>> {
    let (vertices, faces) = shape();
    let mut triangles = Vec::new();
    for (surface, polygon) in faces {
        let material = surface as u32;
        triangles.push(Triangle { vertices: [polygon[0], polygon[1], polygon[2]], material });
        triangles.push(Triangle { vertices: [polygon[0], polygon[2], polygon[3]], material });
    }
    let mut materials = Vec::new();
    for surface in &SURFACES {
        materials.push(NamedMaterial { name: surface.name.to_owned(), material: material(surface)? });
    }
    Ok(Scene::new(vertices, triangles, materials)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: make_fixture FIXTURES_FOLDER")?;
    let folder = Path::new(&folder);
    let air = Air::new(21.0, 45.0, 101.325)?;
    let truth = scene(|s| {
        let column = |values: [f64; 8]| PerBand::new(TRUTH, values.to_vec());
        Material::new(column(s.absorption)?, column(s.scattering)?)
    })?;
    let stated = scene(|s| library_material(s.stated)?.material(TABLES))?;
    let talker = Source::omni("talker", [1.6, 1.5, 1.5])?;
    let screen = Source::omni("screen", [2.3, 5.9, 1.2])?;
    let microphone = Receiver::omni("microphone", [6.2, 2.6, 1.3])?;
    let corner = Receiver::omni("corner", [1.2, 3.9, 1.6])?;

    let dry = read_audio(folder.join("speech/dry_talker.wav"), Channel::Mono)?;
    let rate = dry.sample_rate_hz();
    eprintln!("room of {:.1} m3; particles in 8 bands", truth.volume_m3());
    let config = PhononConfig { particles: 32_000, detector_radius_m: 0.3, duration_s: DURATION_S, seed: 20 };
    let phonons = Phonons::new(&truth, config)?;
    let at_microphone = phonons.impulse_response(&talker, &microphone, &air, rate)?;
    let at_corner = phonons.impulse_response(&talker, &corner, &air, rate)?;

    let (t60_s, t60_sd_s) = reverberation(&truth, &talker, &microphone, &air)?;
    let response: Vec<f64> = at_microphone.samples().iter().map(|&s| f64::from(s)).collect();
    let heard = chain(&response, rate);
    let response_eq_db = octave_levels_db(&response, rate);
    let eq_db = octave_levels_db(&heard, rate);

    let dry_samples: Vec<f64> = dry.samples().iter().map(|&s| f64::from(s)).collect();
    let mut recording = convolve(&dry_samples, &heard);
    recording.truncate(dry_samples.len() + rate as usize / 2);
    add_noise(&mut recording, SNR_DB);
    let peak = recording.iter().fold(0.0f64, |p, s| p.max(s.abs()));
    let recording: Vec<f32> = recording.iter().map(|s| (0.7 * s / peak) as f32).collect();
    write_wav(folder.join("speech/recording.wav"), &recording, rate, SampleFormat::Int16)?;

    let measured = |receiver: &Receiver, samples: ImpulseResponse| NewResponse {
        source: talker.id.clone(),
        receiver: receiver.id.clone(),
        name: format!("{}_{}", talker.id, receiver.id),
        air: None,
        session: None,
        recorded_at: None,
        samples,
    };
    let priors = stated.materials().iter().map(|m| MaterialPrior {
        absorption: Some(m.material.absorption().clone()),
        absorption_sd: PerBand::uniform(TABLES, MaterialPrior::TABLE_SD),
    });
    let room = NewRoom {
        priors: priors.collect(),
        scene: stated,
        air: Some(air),
        measurement: Measurement { time_zero: TimeZero::Emission, levels: Levels::Absolute },
        position_sd: PositionSd::default(),
        responses: vec![measured(&microphone, at_microphone), measured(&corner, at_corner)],
        sources: vec![talker, screen],
        receivers: vec![microphone, corner],
    };
    room.write(folder.join("room"))?;

    let materials: serde_json::Map<_, _> = SURFACES
        .iter()
        .map(|s| (s.name.to_owned(), json!({ "absorption": s.absorption, "scattering": s.scattering })))
        .collect();
    let round = |values: &[f64]| values.iter().map(|v| (v * 1e4).round() / 1e4).collect::<Vec<f64>>();
    let truth = json!({
        "about": "the truth behind room/ and speech/recording.wav; made by make.sh",
        "source": "talker", "receiver": "microphone",
        "bands_hz": TRUTH.iter_hz().collect::<Vec<f64>>(),
        "t60_s": round(&t60_s), "t60_sd_s": round(&t60_sd_s),
        "t60_from": "line through the decay curve of the particles' energy from -5 to -35 dB",
        "eq_db": round(&eq_db), "eq_of_the_response_db": round(&response_eq_db), "recording_chain_db": CHAIN_DB,
        "eq_from": "mean power density in each octave relative to 1 kHz, chain included; 8 kHz ends at Nyquist",
        "snr_db": SNR_DB,
        "materials": materials,
    });
    write_atomically(&folder.join("truth.json"), |file| {
        serde_json::to_writer_pretty(file, &truth).map_err(Into::into)
    })?;
    for (band, hz) in TRUTH.iter_hz().enumerate() {
        eprintln!("{hz:>7} Hz: T60 {:.3} +- {:.3} s, EQ {:+.1} dB", t60_s[band], t60_sd_s[band], eq_db[band]);
    }
    Ok(())
}

/// Mean of T30 over eight independent runs, and its standard error.
fn reverberation(
    scene: &Scene,
    source: &Source,
    receiver: &Receiver,
    air: &Air,
) -> Result<(Vec<f64>, Vec<f64>), Box<dyn Error>> {
    const RUNS: u64 = 8;
    let mut runs = Vec::new();
    for seed in 0..RUNS {
        let config = PhononConfig {
            particles: 16_000,
            detector_radius_m: 0.5,
            duration_s: DURATION_S,
            seed: 100 + seed,
        };
        let energy = Phonons::new(scene, config)?.energy(source, receiver, Some(air), 5e-3)?;
        if energy.lost > 0 {
            return Err("the room is not closed".into());
        }
        let decay = |band: usize| energy.response.decay_curve(band).decay_time_s(-5.0, -35.0);
        runs.push((0..TRUTH.len()).map(decay).collect::<Result<Vec<f64>, _>>()?);
    }
    let n = RUNS as f64;
    let mean = |band: usize| runs.iter().map(|r| r[band]).sum::<f64>() / n;
    let error = |band: usize| {
        let squares: f64 = runs.iter().map(|r| (r[band] - mean(band)).powi(2)).sum();
        (squares / (n - 1.0) / n).sqrt()
    };
    Ok(((0..TRUTH.len()).map(mean).collect(), (0..TRUTH.len()).map(error).collect()))
}

fn spectrum(samples: &[f64], size: usize) -> Vec<Complex<f64>> {
    let forward = RealTransforms::<f64>::new(size).forward;
    let mut input = samples.to_vec();
    input.resize(size, 0.0);
    let mut output = forward.make_output_vec();
    forward.process(&mut input, &mut output).expect("the plan made the buffers");
    output
}

fn samples_of(mut spectrum: Vec<Complex<f64>>, size: usize) -> Vec<f64> {
    let inverse = RealTransforms::<f64>::new(size).inverse;
    let end = spectrum.len() - 1;
    (spectrum[0].im, spectrum[end].im) = (0.0, 0.0);
    let mut output = inverse.make_output_vec();
    inverse.process(&mut spectrum, &mut output).expect("the plan made the buffers");
    output.iter_mut().for_each(|s| *s /= size as f64);
    output
}

/// The recording chain: zero phase, its gain a straight line between octave centres on a logarithmic axis.
fn chain(samples: &[f64], rate: u32) -> Vec<f64> {
    let size = (2 * samples.len()).next_power_of_two();
    let mut bins = spectrum(samples, size);
    for (i, bin) in bins.iter_mut().enumerate() {
        let hz = (i as f64 * f64::from(rate) / size as f64).max(1.0);
        let place = (hz / TRUTH.exact_hz(0)).log2().clamp(0.0, 7.0);
        let (low, share) = (place.floor().min(6.0) as usize, place - place.floor().min(6.0));
        *bin *= 10f64.powf((CHAIN_DB[low] * (1.0 - share) + CHAIN_DB[low + 1] * share) / 20.0);
    }
    let mut output = samples_of(bins, size);
    output.truncate(samples.len());
    output
}

fn octave_levels_db(samples: &[f64], rate: u32) -> Vec<f64> {
    let size = (2 * samples.len()).next_power_of_two();
    let bins = spectrum(samples, size);
    let level = |band: usize| {
        let (low, high) = TRUTH.edges_hz(band);
        let index = |hz: f64| ((hz * size as f64 / f64::from(rate)) as usize).min(bins.len() - 1);
        let octave = &bins[index(low)..index(high)];
        10.0 * (octave.iter().map(|b| b.norm_sqr()).sum::<f64>() / octave.len() as f64).log10()
    };
    let reference = TRUTH.index_of(1000.0).map_or(0.0, level);
    (0..TRUTH.len()).map(|band| level(band) - reference).collect()
}

fn convolve(a: &[f64], b: &[f64]) -> Vec<f64> {
    let size = (a.len() + b.len()).next_power_of_two();
    let (left, right) = (spectrum(a, size), spectrum(b, size));
    let mut output = samples_of(left.iter().zip(&right).map(|(l, r)| l * r).collect(), size);
    output.truncate(a.len() + b.len() - 1);
    output
}

/// Pink noise, the same power in every octave, so far below the recording's mean power.
fn add_noise(samples: &mut [f64], snr_db: f64) {
    let mut random = Pcg64Mcg::seed_from_u64(30);
    let size = samples.len().next_power_of_two();
    let mut bins = vec![Complex::new(0.0, 0.0); size / 2 + 1];
    for (i, bin) in bins.iter_mut().enumerate().skip(1) {
        *bin = Complex::from_polar((i as f64).sqrt().recip(), std::f64::consts::TAU * random.random::<f64>());
    }
    let noise = samples_of(bins, size);
    let power = |x: &[f64]| x.iter().map(|s| s * s).sum::<f64>() / x.len() as f64;
    let gain = (power(samples) / power(&noise[..samples.len()]) / 10f64.powf(snr_db / 10.0)).sqrt();
    samples.iter_mut().zip(noise).for_each(|(s, n)| *s += gain * n);
}
