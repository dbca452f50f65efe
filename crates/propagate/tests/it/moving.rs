//! Moving listeners and sources: what is exact stays exact, what is averaged converges.

use sabine_acoustics::*;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::*;

const SIZE_M: [f64; 3] = [8.0, 5.0, 3.0];

fn room() -> (Scene, Vec<Material>) {
    let wall = Material::uniform(Bands::octaves(500.0, 1000.0).unwrap(), 0.2, 0.3).unwrap();
    (Scene::shoebox(SIZE_M, std::array::from_fn(|_| wall.clone())).unwrap(), vec![wall; 6])
}

fn tracer(rays: usize, most_frames: usize, seed: u64) -> MovingTracer {
    let tracer = TracerConfig { rays, seed, duration_s: 0.6, image_order: 2, ..Default::default() };
    MovingTracer::new(room().0, Air::default(), MovingConfig { tracer, most_frames, ..Default::default() })
        .unwrap()
}

fn source() -> Source {
    Source::omni("S", [1.5, 2.0, 1.4]).unwrap()
}

fn receiver(position_m: [f64; 3]) -> Receiver {
    Receiver::omni("R", position_m).unwrap()
}

fn long_trace(position_m: [f64; 3]) -> PathSet {
    let config =
        TracerConfig { rays: 40_000, seed: 99, duration_s: 0.6, image_order: 2, ..Default::default() };
    PathTracer::new(config)
        .unwrap()
        .trace(&room().0, &source(), &receiver(position_m), &Air::default(), &())
        .unwrap()
}

#[test]
fn a_listener_who_stands_still_hears_the_long_trace() {
    let place = [5.5, 3.5, 1.7];
    let (walls, air) = (room().1, Air::default());
    let conditions = Conditions::new(&walls, &air);
    let mut moving = tracer(250, 40, 1);
    let mut errors = Vec::new();
    let mut last = None;
    for _ in 0..40 {
        let frame = moving.update(&source(), &receiver(place)).unwrap();
        let response = frame.paths.energy_response(&conditions, 0.1).unwrap();
        errors.push(response.band_standard_error(0)[1] / response.band(0)[1]);
        last = Some((frame.effective_rays, response, frame.paths));
    }
    let (effective_rays, response, paths) = last.unwrap();
    assert!((effective_rays - 10_000.0).abs() < 1e-6);
    // 40 frames have a 6.3th of the error of one; each of the two errors is itself known to 13 %.
    let fall = errors[0] / errors[39] / 40f64.sqrt();
    assert!((0.6..1.6).contains(&fall), "{fall}");
    let long = long_trace(place);
    let wanted = long.energy_response(&conditions, 0.1).unwrap();
    for band in 0..2 {
        for bin in 0..4 {
            let off = response.band(band)[bin] - wanted.band(band)[bin];
            let error = response.band_standard_error(band)[bin].hypot(wanted.band_standard_error(band)[bin]);
            assert!(off.abs() < 4.0 * error, "band {band}, bin {bin}: {off} +- {error}");
        }
    }
    let t20 = |paths: &PathSet| {
        PathParameters::read(paths, &conditions).unwrap().t20_s.values()[0].clone().unwrap()
    };
    let (found, wanted) = (t20(&paths), t20(&long));
    let error = found.standard_error.hypot(wanted.standard_error);
    assert!((found.value - wanted.value).abs() < 4.0 * error, "{found:?} {wanted:?}");
    assert!(error < 0.03 * wanted.value);
}

#[test]
fn a_walking_listener_has_the_exact_direct_sound_and_the_right_level() {
    let (walls, air) = (room().1, Air::default());
    let conditions = Conditions::new(&walls, &air);
    let mut moving = tracer(500, 16, 7);
    let speed_m_s = air.speed_of_sound_m_s();
    for step in 0..30u32 {
        // 1.4 m/s at ten frames a second, away from the source.
        let place = [2.5 + 0.14 * f64::from(step), 2.5 + 0.03 * f64::from(step), 1.7];
        let frame = moving.update(&source(), &receiver(place)).unwrap();
        let distance_m =
            source().position_m.iter().zip(place).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        let first_m = frame.paths.lengths_m().iter().copied().fold(f32::INFINITY, f32::min);
        let late_s = (f64::from(first_m) - distance_m).abs() / speed_m_s;
        assert!(late_s < 1e-8, "step {step}: the direct sound is off by {late_s} s");
        if step % 10 != 9 {
            continue;
        }
        // About seven frames count. The level of the reverberation is that of a long trace.
        assert!((3_000.0..3_800.0).contains(&frame.effective_rays), "{}", frame.effective_rays);
        let found = frame.paths.energy_response(&conditions, 0.1).unwrap();
        let wanted = long_trace(place).energy_response(&conditions, 0.1).unwrap();
        for bin in 0..3 {
            let off = found.band(0)[bin] - wanted.band(0)[bin];
            let error = found.band_standard_error(0)[bin].hypot(wanted.band_standard_error(0)[bin]);
            assert!(error < 0.15 * wanted.band(0)[bin]);
            assert!(off.abs() < 4.0 * error, "step {step}, bin {bin}: {off} +- {error}");
        }
    }
}

#[test]
fn the_same_walk_gives_the_same_paths_on_any_number_of_threads() {
    let walk = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let mut moving = tracer(300, 8, 3);
            let frame = |x_m| moving.update(&source(), &receiver([x_m, 3.0, 1.5])).unwrap();
            [4.0, 4.1, 4.3].map(frame)
        })
    };
    assert!(walk(1) == walk(4));
}

#[test]
fn a_step_into_the_wall_is_refused_and_forgotten() {
    let mut moving = tracer(100, 8, 3);
    moving.update(&source(), &receiver([4.0, 3.0, 1.5])).unwrap();
    assert!(moving.update(&source(), &receiver([8.0, 3.0, 1.5])).is_err());
    let frame = moving.update(&source(), &receiver([4.1, 3.0, 1.5])).unwrap();
    assert!(frame.effective_rays > 190.0);
    moving.clear();
    assert_eq!(moving.update(&source(), &receiver([2.0, 3.0, 1.5])).unwrap().effective_rays, 100.0);
    for config in [
        MovingConfig { memory_m: 0.0, ..Default::default() },
        MovingConfig { most_frames: 0, ..Default::default() },
        MovingConfig { memory_m: f64::NAN, ..Default::default() },
    ] {
        let refused = MovingTracer::new(room().0, Air::default(), config);
        assert!(matches!(refused, Err(sabine_propagate::Error::OutOfRange(_))));
    }
}

/// The box with 40 small bodies on its floor: 200 more planes, too many to try all pairs.
fn crowded() -> Scene {
    let (scene, _) = room();
    let (mut vertices, mut triangles) = (scene.vertices().to_vec(), scene.triangles().to_vec());
    for i in 0..40u32 {
        let (x, y) = (0.6 + 0.85 * f64::from(i % 9), 0.3 + 0.9 * f64::from(i / 9));
        let (size, height) = (0.2 + 0.004 * f64::from(i), 0.3 + 0.013 * f64::from(i));
        // Turned a little, each by another angle, so that no two planes coincide.
        let (sine, cosine) = (0.1 + 0.031 * f64::from(i)).sin_cos();
        let first = vertices.len() as u32;
        for z in [0.02, height] {
            for (u, v) in [(0.0, 0.0), (size, 0.0), (size, size), (0.0, size)] {
                vertices.push([x + cosine * u - sine * v, y + sine * u + cosine * v, z]);
            }
        }
        for face in [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7], [3, 2, 1, 0]] {
            let [a, b, c, d] = face.map(|corner: u32| first + corner);
            triangles.push(Triangle { vertices: [a, b, c], material: 0 });
            triangles.push(Triangle { vertices: [a, c, d], material: 0 });
        }
    }
    Scene::new(vertices, triangles, scene.materials().to_vec()).unwrap()
}

fn exact_lengths_m(paths: &PathSet) -> Vec<f32> {
    let exact = (0..paths.len()).filter(|&i| paths.is_exact(i));
    let mut lengths: Vec<f32> = exact.map(|i| paths.lengths_m()[i]).collect();
    lengths.sort_by(f32::total_cmp);
    lengths
}

#[test]
fn early_reflections_once_found_are_kept_as_long_as_they_are_there() {
    let config = TracerConfig { rays: 32, duration_s: 0.1, image_order: 3, ..Default::default() };
    let mut moving = MovingTracer::new(
        crowded(),
        Air::default(),
        MovingConfig { tracer: config.clone(), ..Default::default() },
    )
    .unwrap();
    let place = |step: u32| [5.0 + 0.002 * f64::from(step), 4.2, 1.7];
    let mut counts = Vec::new();
    let mut last = Vec::new();
    for step in 0..25 {
        last = exact_lengths_m(&moving.update(&source(), &receiver(place(step))).unwrap().paths);
        counts.push(last.len());
    }
    // What there is, by 100,000 rays; and what each frame's own rays find.
    let trace = |rays: usize, seed: u64| {
        let config = TracerConfig { rays, seed, ..config.clone() };
        let tracer = PathTracer::new(config).unwrap();
        exact_lengths_m(
            &tracer.trace(&crowded(), &source(), &receiver(place(24)), &Air::default(), &()).unwrap(),
        )
    };
    let (all, own) = (trace(100_000, 5), trace(32, 24));
    println!("{counts:?}, own {}, all {}", own.len(), all.len());
    assert!(own.len() < last.len() && last.len() <= all.len(), "{} {} {}", own.len(), last.len(), all.len());
    // All that is remembered is there.
    for length_m in last {
        let nearest = all.iter().map(|other| (other - length_m).abs()).fold(f32::INFINITY, f32::min);
        assert!(nearest < 1e-4, "{length_m} m");
    }
}
