//! The wave solver against standing waves in closed form, with the absorption that a wall is given, and what it says of
//! rooms that it cannot hold.

use sabine_acoustics::{Air, Bands, Error as AcousticsError, ImpulseResponse, Material, PerBand};
use sabine_paths::{Conditions, Propagator};
use sabine_propagate::wave::{Crossover, WaveConfig, WaveError, WaveSolver};
use sabine_propagate::{Error, PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine_scene::{Receiver, Scene, Source};
use sabine_testkit::BoxModes;
use std::f64::consts::TAU;

const SIZE_M: [f64; 3] = [5.03, 4.37, 2.73];

fn wall(absorption: f64) -> Material {
    Material::uniform(Bands::SIMULATION, absorption, 0.0).unwrap()
}

fn speed_m_s() -> f64 {
    Air::default().speed_of_sound_m_s()
}

/// Walls of different hardness: 0.02 to 0.3.
const ABSORPTIONS: [f64; 6] = [0.02, 0.3, 0.1, 0.05, 0.15, 0.08];

fn box_of(size_m: [f64; 3], absorptions: [f64; 6]) -> (Scene, BoxModes) {
    let scene = Scene::shoebox(size_m, absorptions.map(wall)).unwrap();
    let admittances = absorptions.map(BoxModes::admittance);
    (scene, BoxModes::new(size_m, admittances, speed_m_s()))
}

fn source(position_m: [f64; 3]) -> Source {
    Source::omni("s", position_m).unwrap()
}

fn receiver(position_m: [f64; 3]) -> Receiver {
    Receiver::omni("r", position_m).unwrap()
}

fn respond(config: &WaveConfig, scene: &Scene, from: [f64; 3], to: &[[f64; 3]]) -> Vec<ImpulseResponse> {
    let receivers: Vec<Receiver> = to.iter().copied().map(receiver).collect();
    WaveSolver::new(config.clone())
        .unwrap()
        .respond(scene, &source(from), &receivers, &Air::default(), &())
        .unwrap()
        .iter()
        .map(|waves| waves.response().unwrap())
        .collect()
}

/// Fourier transform of some samples, as an integral over seconds, times the sample rate.
fn line(samples: &[f32], rate: f64, hz: f64) -> (f64, f64) {
    let turn = TAU * hz / rate;
    samples.iter().enumerate().fold((0.0, 0.0), |(re, im), (i, &s)| {
        let (sine, cosine) = (turn * i as f64).sin_cos();
        (re + f64::from(s) * cosine, im - f64::from(s) * sine)
    })
}

fn level(samples: &[f32], rate: f64, hz: f64) -> f64 {
    let (re, im) = line(samples, rate, hz);
    re.hypot(im)
}

/// The closed form behind the low cut that the solver states: a Butterworth high pass at a quarter of c / (2 longest side).
fn expected(modes: &BoxModes, size_m: [f64; 3], [from, to]: [[f64; 3]; 2], hz: f64) -> (f64, f64) {
    let longest_m = size_m.into_iter().fold(0.0, f64::max);
    let x = hz / (speed_m_s() / (8.0 * longest_m));
    // -x^2 / (1 - x^2 + j sqrt 2 x)
    let (a, b) = (1.0 - x * x, std::f64::consts::SQRT_2 * x);
    let scale = -x * x / (a * a + b * b);
    let (re, im) = modes.pressure(from, to, hz);
    (scale * (a * re + b * im), scale * (a * im - b * re))
}

/// Level differences from the closed form in dB, at every half hertz between two frequencies.
fn differences_db(
    modes: &BoxModes,
    size_m: [f64; 3],
    response: &ImpulseResponse,
    ends: [[f64; 3]; 2],
    [low_hz, high_hz]: [f64; 2],
) -> Vec<f64> {
    let rate = f64::from(response.sample_rate_hz());
    let count = ((high_hz - low_hz) / 0.5) as usize;
    (0..count)
        .map(|i| {
            let hz = low_hz + 0.5 * i as f64;
            let (re, im) = expected(modes, size_m, ends, hz);
            20.0 * (level(response.samples(), rate, hz) / re.hypot(im)).log10()
        })
        .collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn a_rigid_box_resounds_at_its_frequencies() {
    let size_m = [3.37, 2.81, 2.23];
    let (scene, modes) = box_of(size_m, [0.0; 6]);
    let (limit_hz, rate) = (210.0, 1000u32);
    let config = WaveConfig { limit_hz, duration_s: 6.0, sample_rate_hz: rate, ..Default::default() };
    // From corner to corner: every mode is loud.
    let end: [f64; 3] = size_m.map(|side| side - 0.07);
    let response = respond(&config, &scene, [0.05, 0.06, 0.04], &[end]).swap_remove(0);
    let windowed: Vec<f32> = response
        .samples()
        .iter()
        .enumerate()
        .map(|(i, &s)| {
            let turn = TAU * i as f64 / response.samples().len() as f64;
            s * (0.5 - 0.5 * turn.cos()) as f32
        })
        .collect();
    let expected: Vec<f64> = modes.rigid_modes_hz(200.0).iter().map(|(hz, _)| *hz).collect();
    let mut worst: f64 = 0.0;
    let mut alone = 0;
    for (i, &hz) in expected.iter().enumerate() {
        let near = |other: Option<&f64>| other.is_some_and(|o| (o - hz).abs() < 1.6);
        // Modes that the window cannot part (1.6 Hz at two of its widths) have no peak of their own.
        if near(expected.get(i + 1)) || i > 0 && near(expected.get(i - 1)) {
            continue;
        }
        alone += 1;
        let step_hz = 0.005;
        let reach = (0.6 / step_hz) as i32;
        let (peak, _) = (-reach..=reach)
            .map(|j| hz + step_hz * f64::from(j))
            .map(|at| (at, level(&windowed, f64::from(rate), at)))
            .fold((0.0, 0.0), |best, here| if here.1 > best.1 { here } else { best });
        let off = peak / hz - 1.0;
        worst = worst.max(off.abs());
        assert!(off.abs() < 0.005 && (peak - hz).abs() < 0.59, "{hz} Hz is found at {peak} Hz");
    }
    eprintln!("{alone} of {} modes stand alone; the worst is off by {:.3} %", expected.len(), 100.0 * worst);
    assert!(alone > 15);
}

#[test]
fn modes_decay_as_their_walls_have_it() {
    let absorption = 0.03;
    let (scene, modes) = box_of(SIZE_M, [absorption; 6]);
    let rate = 1000u32;
    let config = WaveConfig { limit_hz: 120.0, duration_s: 3.0, sample_rate_hz: rate, ..Default::default() };
    let end = SIZE_M.map(|side| side - 0.3);
    let response = respond(&config, &scene, [0.2, 0.25, 0.3], &[end]).swap_remove(0);
    let window = rate as usize;
    let mut worst: f64 = 0.0;
    for n in [[1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [2, 0, 0]] {
        let (hz, decay_per_s) = modes.mode(n);
        let at = |begin: usize| {
            let windowed: Vec<f32> = (0..window)
                .map(|i| {
                    let turn = TAU * i as f64 / window as f64;
                    // A squared Hann window: its neighbours are 4 Hz away at least.
                    response.samples()[begin + i] * (0.5 - 0.5 * turn.cos()).powi(2) as f32
                })
                .collect();
            level(&windowed, f64::from(rate), hz)
        };
        let (early, late) = (100, 1500);
        let found = (at(early) / at(late)).ln() / ((late - early) as f64 / f64::from(rate));
        let off = found / decay_per_s - 1.0;
        worst = worst.max(off.abs());
        assert!(off.abs() < 0.02, "mode {n:?}, {hz:.1} Hz: {found:.3} per s instead of {decay_per_s:.3}");
    }
    eprintln!("the worst decay is off by {:.2} %", 100.0 * worst);
}

#[test]
fn spectra_at_new_positions_are_those_of_the_modes() {
    let (scene, modes) = box_of(SIZE_M, ABSORPTIONS);
    let config = WaveConfig { duration_s: 1.0, sample_rate_hz: 1000, ..Default::default() };
    let from = [1.17, 0.93, 1.31];
    let places = [[3.9, 3.3, 1.2], [2.2, 3.1, 1.7], [4.4, 1.1, 0.6], [0.7, 2.9, 2.1]];
    let responses = respond(&config, &scene, from, &places);
    for (to, response) in places.into_iter().zip(&responses) {
        let db = rms(&differences_db(&modes, SIZE_M, response, [from, to], [20.0, 300.0]));
        eprintln!("at {to:?}: {db:.2} dB rms");
        assert!(db < 3.0, "at {to:?}: {db} dB rms");
    }
}

#[test]
fn finer_grids_converge_in_second_order() {
    let size_m = [2.31, 1.93, 1.57];
    let (scene, modes) = box_of(size_m, [0.1, 0.05, 0.2, 0.1, 0.08, 0.12]);
    let (from, to) = ([0.45, 0.61, 0.37], [1.83, 1.22, 1.19]);
    let errors: Vec<f64> = [8.0, 14.0, 24.5]
        .into_iter()
        .map(|points_per_wavelength| {
            let config = WaveConfig {
                points_per_wavelength,
                limit_hz: 250.0,
                sample_rate_hz: 1000,
                ..Default::default()
            };
            let response = respond(&config, &scene, from, &[to]).swap_remove(0);
            let (mut off, mut all) = (0.0, 0.0);
            for i in 0..210 {
                let hz = 40.0 + f64::from(i);
                let ((re, im), (re_true, im_true)) =
                    (line(response.samples(), 1000.0, hz), expected(&modes, size_m, [from, to], hz));
                off += (re - re_true).powi(2) + (im - im_true).powi(2);
                all += re_true * re_true + im_true * im_true;
            }
            f64::sqrt(off / all)
        })
        .collect();
    eprintln!("relative errors of the complex pressure, 8, 14, 24.5 voxels per wave length: {errors:.4?}");
    for pair in errors.windows(2) {
        assert!(pair[0] / pair[1] > 2.2, "{errors:?}");
    }
    assert!(errors[2] < 0.05, "{errors:?}");
}

#[test]
fn each_octave_has_its_absorption() {
    let bands = Bands::octaves(62.5, 250.0).unwrap();
    let values = [0.05, 0.25, 0.1];
    let absorption = PerBand::new(bands, values.to_vec()).unwrap();
    let material = Material::new(absorption, PerBand::uniform(bands, 0.0)).unwrap();
    let size_m = [2.9, 2.4, 2.1];
    let scene = Scene::shoebox(size_m, std::array::from_fn(|_| material.clone())).unwrap();
    let config = WaveConfig { sample_rate_hz: 1000, ..Default::default() };
    let (from, to) = ([0.5, 0.6, 0.4], [2.2, 1.6, 1.7]);
    let response = respond(&config, &scene, from, &[to]).swap_remove(0);
    for (band, value) in values.into_iter().enumerate() {
        let (_, modes) = box_of(size_m, [value; 6]);
        let centre_hz = bands.exact_hz(band);
        let db =
            rms(&differences_db(&modes, size_m, &response, [from, to], [0.97 * centre_hz, 1.03 * centre_hz]));
        assert!(db < 1.0, "{centre_hz:.0} Hz: {db} dB rms");
    }
}

#[test]
fn walls_between_voxel_borders_are_where_the_mesh_has_them() {
    let size_m = [3.1, 2.6, 2.2];
    let (plain, modes) = box_of(size_m, [0.08; 6]);
    // The same box, with a chip of rock outside: voxels now divide more than the box, and its walls fall within them.
    let mut vertices = plain.vertices().to_vec();
    let mut triangles = plain.triangles().to_vec();
    let first = vertices.len() as u32;
    vertices.extend([[3.613, 2.977, 2.431], [3.62, 2.97, 2.43], [3.62, 2.98, 2.43]]);
    triangles.push(sabine_scene::Triangle { vertices: [first, first + 1, first + 2], material: 0 });
    let scene = Scene::new(vertices, triangles, plain.materials().to_vec()).unwrap();
    let config = WaveConfig {
        limit_hz: 250.0,
        points_per_wavelength: 24.0,
        sample_rate_hz: 1000,
        ..Default::default()
    };
    let (from, to) = ([0.5, 0.6, 0.4], [2.4, 1.9, 1.7]);
    let response = respond(&config, &scene, from, &[to]).swap_remove(0);
    let db = rms(&differences_db(&modes, size_m, &response, [from, to], [40.0, 240.0]));
    eprintln!("walls within voxels: {db:.2} dB rms");
    assert!(db < 1.0, "{db}");
}

/// A box with walls 6 m and more from its middle, where a source stands, and two receivers: 1 m away, and farther askew.
const HALL_M: [f64; 3] = [13.0, 12.6, 12.2];
const MIDDLE_M: [f64; 3] = [6.43, 6.31, 6.11];
const NEAR_M: [[f64; 3]; 2] = [[7.43, 6.31, 6.11], [7.63, 7.48, 7.11]];

fn distance_m(to: [f64; 3]) -> f64 {
    (0..3).map(|a| (to[a] - MIDDLE_M[a]).powi(2)).sum::<f64>().sqrt()
}

/// Level of the direct sound in dB re 1 / distance, by a wave train under a Gauss envelope that is over before echoes come.
fn direct_db(samples: &[f64], lead: usize, rate: f64, distance_m: f64, [hz, width_s]: [f64; 2]) -> f64 {
    let probe = |t: f64| (-(t / width_s).powi(2)).exp() * (TAU * hz * t).cos();
    let at = |i: usize| (i as f64 - lead as f64) / rate - distance_m / speed_m_s();
    let found: f64 = samples.iter().enumerate().map(|(i, s)| s * probe(at(i))).sum();
    20.0 * (found * distance_m).log10()
}

#[test]
fn the_direct_sound_is_one_at_one_metre() {
    let (scene, _) = box_of(HALL_M, [0.5; 6]);
    let rate = 8000u32;
    let config = WaveConfig { duration_s: 0.31, sample_rate_hz: rate, limit_hz: 120.0, ..Default::default() };
    let receivers = NEAR_M.map(receiver);
    let solver = WaveSolver::new(config).unwrap();
    let found = solver.respond(&scene, &source(MIDDLE_M), &receivers, &Air::default(), &()).unwrap();
    for (to, waves) in NEAR_M.into_iter().zip(&found) {
        let distance_m = distance_m(to);
        let db = direct_db(waves.samples(), waves.lead(), f64::from(rate), distance_m, [80.0, 8e-3]);
        eprintln!("{distance_m:.2} m: {db:.3} dB");
        assert!(db.abs() < 0.15, "{distance_m} m: {db} dB");
    }
}

#[test]
fn waves_and_paths_join_at_the_same_level() {
    let absorption = 0.5;
    let (scene, _) = box_of(HALL_M, [absorption; 6]);
    let crossover = Crossover::new(85.0).unwrap();
    let rate = 8000u32;
    let duration_s = 0.4;
    let config =
        WaveConfig { limit_hz: crossover.limit_hz(), duration_s, sample_rate_hz: rate, ..Default::default() };
    let air = Air::default();
    let to = receiver(NEAR_M[1]);
    let from = source(MIDDLE_M);
    let solver = WaveSolver::new(config).unwrap();
    let waves = solver.respond(&scene, &from, std::slice::from_ref(&to), &air, &()).unwrap().swap_remove(0);
    let tracer = PathTracer::new(TracerConfig { rays: 2000, duration_s, ..Default::default() }).unwrap();
    let paths = tracer.trace(&scene, &from, &to, &air, &()).unwrap();
    let config = RenderConfig { sample_rate_hz: rate, ..Default::default() };
    let high = PressureRenderer::new(config)
        .unwrap()
        .render(&paths, &Conditions::new(&vec![wall(absorption); 6], &air))
        .unwrap();
    let joined = crossover.join(&waves, &high).unwrap();
    eprintln!("{:.2} dB apart, {:.2} dB at the crossover", joined.level_difference_db, joined.gain_db);
    // The direct sound below, at and above the crossover.
    let samples: Vec<f64> = joined.response.samples().iter().map(|&s| f64::from(s)).collect();
    for train in [[60.0, 10e-3], [85.0, 10e-3], [120.0, 8e-3], [400.0, 4e-3]] {
        let db = direct_db(&samples, 0, f64::from(rate), distance_m(NEAR_M[1]), train);
        eprintln!("{} Hz: {db:.3} dB", train[0]);
        assert!(db.abs() < 0.2, "{} Hz: {db} dB", train[0]);
    }
    // Two ways to the same energy: half of it absorbed, and half of it by Paris' formula.
    assert!(joined.level_difference_db.abs() < 1.0 && joined.gain_db.abs() < 1.0, "{joined:?}");
    let lower = Crossover::new(200.0).unwrap();
    assert!(matches!(lower.join(&waves, &high), Err(Error::OutOfRange(_))));
}

#[test]
fn a_response_joined_to_itself_stays_itself() {
    let (scene, _) = box_of([2.9, 2.4, 2.1], ABSORPTIONS);
    let config = WaveConfig { duration_s: 0.3, sample_rate_hz: 1000, limit_hz: 250.0, ..Default::default() };
    let solver = WaveSolver::new(config).unwrap();
    let (from, to) = (source([0.5, 0.6, 0.4]), receiver([2.4, 2.1, 1.9]));
    let waves = solver.respond(&scene, &from, &[to], &Air::default(), &()).unwrap().swap_remove(0);
    let whole = waves.response().unwrap();
    let joined = Crossover::new(100.0).unwrap().join(&waves, &whole).unwrap();
    // All but the ringing before time zero, which the one has and the other has not.
    let off: f64 =
        whole.samples().iter().zip(joined.response.samples()).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    let all: f64 = whole.samples().iter().map(|&a| f64::from(a).powi(2)).sum();
    assert!((off / all).sqrt() < 0.01, "{}", (off / all).sqrt());
    assert!(joined.gain_db.abs() < 0.05 && joined.level_difference_db.abs() < 0.1, "{joined:?}");
}

#[test]
fn threads_change_nothing() {
    let (scene, _) = box_of([2.9, 2.4, 2.1], ABSORPTIONS);
    let config = WaveConfig { duration_s: 0.3, sample_rate_hz: 1000, ..Default::default() };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| respond(&config, &scene, [0.5, 0.6, 0.4], &[[2.2, 1.6, 1.7]])).swap_remove(0)
    };
    assert!(on(1).samples() == on(3).samples());
}

/// `cargo test --release -p sabine-propagate --test it waves:: -- --ignored --nocapture`: time and memory of a room of 60 m3 up to
/// 300 Hz, each octave with walls of its own.
#[test]
#[ignore = "a measurement, not a test"]
fn time_and_memory_of_sixty_cubic_metres() {
    let bands = Bands::octaves(62.5, 250.0).unwrap();
    let absorption = PerBand::new(bands, vec![0.05, 0.1, 0.15]).unwrap();
    let material = Material::new(absorption, PerBand::uniform(bands, 0.0)).unwrap();
    let scene = Scene::shoebox(SIZE_M, std::array::from_fn(|_| material.clone())).unwrap();
    let from = source([1.17, 0.93, 1.31]);
    let to = receiver([3.9, 3.3, 1.2]);
    let solver = WaveSolver::new(WaveConfig::default()).unwrap();
    let start = std::time::Instant::now();
    let room = solver.prepare(&scene, &from, &Air::default()).unwrap();
    let prepare_s = start.elapsed().as_secs_f64();
    let materials = vec![material; 6];
    let start = std::time::Instant::now();
    solver.solve(&room, &materials, &from, &[to], &Air::default(), &()).unwrap();
    eprintln!(
        "{:.1} m3, {} voxels, at most {:.1} MiB: cut in {prepare_s:.2} s, three octaves of 1 s solved in {:.2} s",
        room.volume_m3(),
        room.voxels(),
        room.bytes() as f64 / f64::from(1 << 20),
        start.elapsed().as_secs_f64()
    );
}

#[test]
fn rooms_that_voxels_cannot_hold_are_refused() {
    let (scene, _) = box_of(SIZE_M, [0.1; 6]);
    let (from, to) = (source([1.0, 1.0, 1.0]), receiver([3.0, 3.0, 2.0]));
    let with = |config: WaveConfig, scene: &Scene| {
        let solver = WaveSolver::new(config).unwrap();
        solver.respond(scene, &from, std::slice::from_ref(&to), &Air::default(), &()).unwrap_err()
    };
    let config = WaveConfig { sample_rate_hz: 16_000, ..Default::default() };

    // Does not fit: what it names as fitting does.
    let large = WaveConfig { limit_hz: 2000.0, memory_bytes: 64 << 20, ..config.clone() };
    let Error::Wave(WaveError::GridTooLarge { fitting_hz, .. }) = with(large.clone(), &scene) else {
        panic!("fits")
    };
    let prepared = |limit_hz: f64| {
        let solver = WaveSolver::new(WaveConfig { limit_hz, ..large.clone() }).unwrap();
        solver.prepare(&scene, &from, &Air::default()).map(|room| room.bytes())
    };
    assert!(prepared(fitting_hz).unwrap() <= 64 << 20 && prepared(1.02 * fitting_hz + 1.0).is_err());

    // Without a ceiling.
    let open = scene.triangles().iter().copied().filter(|t| t.material != 5).collect();
    let open = Scene::new(scene.vertices().to_vec(), open, scene.materials().to_vec()).unwrap();
    let leak = with(config.clone(), &open);
    assert!(
        matches!(&leak, Error::Wave(WaveError::WavesLeak { open_edges: 4, example_m: Some(_), .. })),
        "{leak}"
    );

    let (flat, _) = box_of([5.0, 4.0, 0.2], [0.1; 6]);
    let solver = WaveSolver::new(config.clone()).unwrap();
    let thin = solver.prepare(&flat, &source([1.0, 1.0, 0.1]), &Air::default()).err().unwrap();
    let Error::Wave(WaveError::ThinRoom { needed_hz, .. }) = thin else { panic!("{thin}") };
    let finer = WaveSolver::new(WaveConfig { limit_hz: needed_hz + 1.0, ..config.clone() }).unwrap();
    assert!(finer.prepare(&flat, &source([1.0, 1.0, 0.1]), &Air::default()).is_ok());

    let short = WaveConfig { duration_s: 0.05, ..config.clone() };
    assert!(
        matches!(with(short, &scene), Error::Wave(WaveError::TooShortForModes { needed_s, .. }) if (0.11..0.13).contains(&needed_s))
    );

    // A slit of 2 cm leads to the receiver's half of the room.
    let parted = parted_by_a_slit();
    assert!(matches!(
        with(config.clone(), &parted),
        Error::Wave(WaveError::BetweenVoxels { what: "receiver", .. })
    ));

    let stop = |_: &str, done: u64, _: u64| {
        if done > 500 { std::ops::ControlFlow::Break(()) } else { std::ops::ControlFlow::Continue(()) }
    };
    let stopped = solver.respond(&scene, &from, std::slice::from_ref(&to), &Air::default(), &stop);
    assert!(matches!(stopped, Err(Error::Acoustics(AcousticsError::Cancelled { .. }))));
    for bad in [
        WaveConfig { limit_hz: f64::NAN, ..config.clone() },
        WaveConfig { points_per_wavelength: 2.0, ..config.clone() },
        WaveConfig { limit_hz: 300.0, sample_rate_hz: 1000, points_per_wavelength: 1e9, ..config.clone() },
        WaveConfig { limit_hz: 450.0, sample_rate_hz: 1000, ..config.clone() },
        WaveConfig { memory_bytes: 1, ..config },
    ] {
        assert!(matches!(WaveSolver::new(bad), Err(Error::OutOfRange(_))));
    }
}

/// The box with a wall across, open by a slit of 2 cm beside the wall y = 0.
fn parted_by_a_slit() -> Scene {
    let (scene, _) = box_of(SIZE_M, [0.1; 6]);
    let [_, y, z] = SIZE_M;
    let mut vertices = scene.vertices().to_vec();
    let mut triangles = scene.triangles().to_vec();
    let first = vertices.len() as u32;
    let x = 2.0;
    vertices.extend([[x, 0.02, 0.0], [x, y, 0.0], [x, y, z], [x, 0.02, z]]);
    for corners in [[0, 1, 2], [0, 2, 3]] {
        triangles.push(sabine_scene::Triangle { vertices: corners.map(|c| first + c), material: 0 });
    }
    Scene::new(vertices, triangles, scene.materials().to_vec()).unwrap()
}
