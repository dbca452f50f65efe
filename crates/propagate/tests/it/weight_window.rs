//! Rays that are split and play roulette: right for any absorption, and more precise where surfaces absorb unevenly.

use crate::shoebox::*;
use sabine_acoustics::*;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::{MeasuredRoom, Scene};
use sabine_testkit::at_night;
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

fn two_bands() -> Bands {
    Bands::octaves(500.0, 1000.0).unwrap()
}

fn material(absorption: [f64; 2], scattering: [f64; 2]) -> Material {
    let of = |values: [f64; 2]| PerBand::new(two_bands(), values.to_vec()).unwrap();
    Material::new(of(absorption), of(scattering)).unwrap()
}

/// A hard room with a carpet and an absorbing ceiling, which scatters little, more at 1 kHz than at 500 Hz.
fn uneven_box() -> Scene {
    let wall = || material([0.03, 0.04], [0.1, 0.3]);
    let faces =
        [wall(), wall(), wall(), wall(), material([0.25, 0.4], [0.1, 0.3]), material([0.5, 0.7], [0.2, 0.3])];
    Scene::shoebox([7.0, 5.0, 3.2], faces).unwrap()
}

fn traced(scene: &Scene, weight_window: bool, rays: usize, seed: u64) -> PathSet {
    traced_with(scene, TracerConfig { rays, seed, weight_window, ..Default::default() })
}

fn traced_with(scene: &Scene, config: TracerConfig) -> PathSet {
    let config = TracerConfig { duration_s: 0.9, ..config };
    let (from, to) = (source([1.5, 1.0, 1.2]), receiver([5.1, 3.2, 1.7]));
    PathTracer::new(config).unwrap().trace(scene, &from, &to, &Air::default(), &()).unwrap()
}

/// Energy between two times in milliseconds, and its standard error.
fn energy(paths: &PathSet, materials: &[Material], band: usize, range: Range<usize>) -> Estimate {
    let parts = batch_energies(paths, materials, band, Air::default().speed_of_sound_m_s(), 1e-3);
    let exact: f64 = parts[32][range.clone()].iter().sum();
    jackknife(&parts[..32], |e| exact + e[range.clone()].iter().sum::<f64>())
}

const RANGES: [Range<usize>; 6] = [0..30, 30..60, 60..120, 120..240, 240..400, 400..600];

/// The same paths serve the scene's own absorption and quite another: what was split for one is right for the other.
#[test]
fn energies_are_those_of_rays_that_are_left_alone_with_any_absorption() {
    let scene = uneven_box();
    let own = materials_of(&scene);
    let swapped: Vec<Material> = own
        .iter()
        .enumerate()
        .map(|(i, m)| {
            let absorption = if i < 4 { [0.15, 0.12] } else { [0.08, 0.2] };
            m.with_absorption(PerBand::new(two_bands(), absorption.to_vec()).unwrap()).unwrap()
        })
        .collect();
    let rays = if at_night() { 100_000 } else { 50_000 };
    let alone = traced(&scene, false, 2 * rays, 11);
    let windowed = traced(&scene, true, rays, 12);
    for (name, materials) in [("own", &own), ("other", &swapped)] {
        for band in 0..2 {
            for range in RANGES {
                let [a, b] = [&alone, &windowed].map(|paths| energy(paths, materials, band, range.clone()));
                let spread = a.standard_error.hypot(b.standard_error);
                assert!((a.value - b.value).abs() < 4.0 * spread, "{name} {band} {range:?}: {a:?} {b:?}");
                assert!(spread < 0.2 * a.value, "{name} {band} {range:?}: {a:?} {b:?}");
            }
        }
    }
}

#[test]
fn late_energy_is_more_precise_with_as_many_rays() {
    let scene = uneven_box();
    let own = materials_of(&scene);
    let [alone, windowed] = [false, true].map(|window| traced(&scene, window, 40_000, 5));
    // Where the decay is 20 to 50 dB down. A standard error from 32 batches is known to an eighth.
    for range in [240..400, 400..600] {
        for band in 0..2 {
            let [a, b] = [&alone, &windowed].map(|paths| energy(paths, &own, band, range.clone()));
            let gain = (a.standard_error * b.value / (b.standard_error * a.value)).powi(2);
            assert!(gain > 3.0, "{band} {range:?}: {gain:.1} {a:?} {b:?}");
        }
    }
    // They are not paid for with more paths.
    assert!(windowed.len() < 2 * alone.len(), "{} {}", windowed.len(), alone.len());
}

/// Hard walls to either side of it, all else absorbs, and little is scattered.
fn hall_between_hard_walls() -> Scene {
    let [hard, soft] = [0.02, 0.5].map(|absorption| material([absorption; 2], [0.08, 0.12]));
    Scene::shoebox([7.0, 5.0, 3.2], [&hard, &hard, &soft, &soft, &soft, &soft].map(Material::clone)).unwrap()
}

/// The same paths serve the scene's own absorption and quite another, although only its own says where more rays are sent.
#[test]
fn energies_are_those_of_rays_that_nothing_guides() {
    let scene = hall_between_hard_walls();
    let own = materials_of(&scene);
    let other: Vec<Material> = own
        .iter()
        .map(|m| {
            let absorption = m.absorption().values().iter().map(|a| 0.03 + 0.7 * a).collect();
            m.with_absorption(PerBand::new(two_bands(), absorption).unwrap()).unwrap()
        })
        .collect();
    let plain = traced(&scene, true, 200_000, 21);
    let guided = traced_with(
        &scene,
        TracerConfig { rays: 100_000, seed: 22, path_guiding: true, ..Default::default() },
    );
    for (name, materials) in [("own", &own), ("other", &other)] {
        for band in 0..2 {
            for range in RANGES {
                let [a, b] = [&plain, &guided].map(|paths| energy(paths, materials, band, range.clone()));
                let spread = a.standard_error.hypot(b.standard_error);
                assert!((a.value - b.value).abs() < 4.0 * spread, "{name} {band} {range:?}: {a:?} {b:?}");
                assert!(b.standard_error < 0.1 * b.value, "{name} {band} {range:?}: {a:?} {b:?}");
            }
        }
    }
}

/// The scatter of the logarithm of late energy over seeds: within one trace, batches hardly show it where few rays carry all.
#[test]
fn late_energy_between_hard_walls_hangs_on_more_rays() {
    let seeds: u64 = if at_night() { 40 } else { 20 };
    let scene = hall_between_hard_walls();
    let own = materials_of(&scene);
    let scatter = |path_guiding: bool, range: &Range<usize>| {
        let ln = |seed| {
            let config = TracerConfig { rays: 2_000, seed, path_guiding, ..Default::default() };
            energy(&traced_with(&scene, config), &own, 1, range.clone()).value.ln()
        };
        let all: Vec<f64> = (100..100 + seeds).map(ln).collect();
        let mean = all.iter().sum::<f64>() / seeds as f64;
        all.iter().map(|ln| (ln - mean).powi(2)).sum::<f64>() / (seeds - 1) as f64
    };
    // In milliseconds. Variances from 20 seeds are known to a third, from 40 to a fifth.
    let (late, early) = (200..400, 15..60);
    let gain = scatter(false, &late) / scatter(true, &late);
    assert!(gain > 3.0, "{gain}");
    let loss = scatter(true, &early) / scatter(false, &early);
    assert!(loss < 2.5, "{loss}");
    println!("late variance divided by {gain:.1}, early multiplied by {loss:.2}");
}

#[test]
#[ignore = "figures for docs/validation/propagate.md"]
fn precision_in_the_same_time() {
    let with = TracerConfig { rays: 20_000, duration_s: 2.0, seed: 3, ..Default::default() };
    print_precision(&TracerConfig { weight_window: false, ..with.clone() }, &with);
}

#[test]
#[ignore = "figures for docs/validation/propagate.md"]
fn precision_with_guided_directions_in_the_same_time() {
    let without = TracerConfig { rays: 20_000, duration_s: 2.0, seed: 3, ..Default::default() };
    print_precision(&without, &TracerConfig { path_guiding: true, ..without.clone() });
}

/// Prints what a setting does to time and precision: variance times time without it over that with it.
fn print_precision(without: &TracerConfig, with: &TracerConfig) {
    let rooms = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms"));
    let even =
        Scene::shoebox([7.0, 5.0, 3.2], std::array::from_fn(|_| material([0.1; 2], [0.3; 2]))).unwrap();
    let mut scenes = vec![("box, even".to_owned(), even, [[1.5, 1.0, 1.2], [5.1, 3.2, 1.7]])];
    scenes.push(("box, uneven".to_owned(), uneven_box(), [[1.5, 1.0, 1.2], [5.1, 3.2, 1.7]]));
    for name in ["bras_cr2", "bras_cr3", "bras_cr4"] {
        let Ok(room) = MeasuredRoom::read(rooms.join(name)) else { continue };
        let ends = [room.sources()[0].position_m, room.receivers()[0].position_m];
        scenes.push((name.to_owned(), room.scene().clone(), ends));
    }
    println!(
        "| room | ms | level (dB) | time without (s) | with (s) | variance, without over with | in the same time |"
    );
    for (name, scene, [from, to]) in scenes {
        let materials = materials_of(&scene);
        let bands = materials[0].bands();
        let band = bands.iter_hz().position(|hz| hz == 1000.0).unwrap();
        let run = |config: &TracerConfig| {
            let tracer = PathTracer::new(config.clone()).unwrap();
            let prepared = tracer.prepare(&scene).unwrap();
            let trace = || {
                let (from, to) = (source(from), receiver(to));
                tracer.trace_prepared(&prepared, &from, &to, &Air::default(), &()).unwrap()
            };
            let mut seconds: Vec<f64> = (0..5)
                .map(|_| {
                    let started = Instant::now();
                    trace();
                    started.elapsed().as_secs_f64()
                })
                .collect();
            seconds.sort_by(f64::total_cmp);
            (trace(), seconds[2])
        };
        let ((alone, alone_s), (windowed, windowed_s)) = (run(without), run(with));
        let all = energy(&windowed, &materials, band, 0..1990).value;
        for range in [50..100, 200..300, 400..600, 800..1000, 1200..1500] {
            let [a, b] = [&alone, &windowed].map(|paths| energy(paths, &materials, band, range.clone()));
            let level_db = 10.0 * (b.value / all).log10();
            let gain = (a.standard_error * b.value / (b.standard_error * a.value)).powi(2);
            let same_time = gain * alone_s / windowed_s;
            println!(
                "| {name} | {range:?} | {level_db:.0} | {alone_s:.2} | {windowed_s:.2} | {gain:.1} | {same_time:.1} |"
            );
        }
    }
}
