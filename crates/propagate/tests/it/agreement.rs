//! The path tracer against the reference tracer, and against itself on other numbers of threads.

use crate::shoebox::*;
use sabine_acoustics::*;
use sabine_paths::Conditions;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::{Scene, Triangle};
use std::ops::Range;

/// A box whose surfaces scatter differently, and differently in each octave: from not at all to all.
fn banded_scene() -> Scene {
    let bands = Bands::octaves(250.0, 2000.0).unwrap();
    let material = |a: f64, s: [f64; 4]| {
        Material::new(PerBand::uniform(bands, a), PerBand::new(bands, s.to_vec()).unwrap()).unwrap()
    };
    Scene::shoebox(
        [6.0, 4.5, 3.0],
        [
            material(0.10, [0.05, 0.10, 0.20, 0.40]),
            material(0.30, [0.10, 0.10, 0.10, 0.10]),
            material(0.10, [0.00, 0.20, 0.40, 0.60]),
            material(0.20, [0.30, 0.50, 0.70, 0.90]),
            material(0.15, [0.00, 0.00, 0.00, 0.00]),
            material(0.25, [0.20, 0.40, 0.60, 1.00]),
        ],
    )
    .unwrap()
}

/// The same box with one octave only.
fn only(scene: &Scene, band: usize) -> Scene {
    let hz = scene.materials()[0].material.bands().nominal_hz(band);
    let one = Bands::octaves(hz, hz).unwrap();
    scene
        .with_materials(scene.materials().iter().map(|named| named.material.resampled(one)).collect())
        .unwrap()
}

/// The same box, each octave of which scatters as this one of it does.
fn rearranged(scene: &Scene, octaves: [usize; 4]) -> Scene {
    let materials = scene.materials().iter().map(|named| {
        let scattering = named.material.scattering();
        let values = octaves.iter().map(|&octave| scattering.values()[octave]).collect();
        let scattering = PerBand::new(scattering.bands(), values).unwrap();
        Material::new(named.material.absorption().clone(), scattering).unwrap()
    });
    scene.with_materials(materials.collect()).unwrap()
}

/// One trace serves four octaves of very different scattering; the reference traces each of them by itself.
#[test]
fn the_tracer_agrees_with_the_reference_in_every_octave() {
    agrees_with_the_reference(&banded_scene(), 0..4);
}

/// Three octaves of four scatter as one another, so that three rays of four are drawn for them.
#[test]
fn it_agrees_where_most_rays_are_drawn_for_one_scattering() {
    agrees_with_the_reference(&rearranged(&banded_scene(), [0, 3, 0, 0]), 0..2);
}

fn agrees_with_the_reference(scene: &Scene, bands: Range<usize>) {
    let config = TracerConfig { rays: 40_000, duration_s: 0.25, seed: 3, ..Default::default() };
    let air = Air::default();
    let (from, to) = (source([1.5, 1.0, 1.2]), receiver([4.5, 3.0, 1.7]));
    let traced = PathTracer::new(config.clone()).unwrap().trace(scene, &from, &to, &air, &()).unwrap();
    let speed_m_s = air.speed_of_sound_m_s();
    for band in bands {
        let alone = only(scene, band);
        let config = TracerConfig { rays: 25_000, seed: 40 + band as u64, ..config.clone() };
        let reference = ReferenceTracer::new(config).unwrap().trace(&alone, &from, &to, &air, &()).unwrap();
        let a = batch_energies(&traced, &materials_of(scene), band, speed_m_s, 1e-3);
        let b = batch_energies(&reference, &materials_of(&alone), 0, speed_m_s, 1e-3);
        // The sphere smears arrivals by its radius: windows much wider than 1.5 ms.
        for range in [0..30, 30..60, 60..100, 100..160, 160..250] {
            let sum = |parts: &[Vec<f64>]| {
                let exact: f64 = parts[32][range.clone()].iter().sum();
                jackknife(&parts[..32], |e| exact + e[range.clone()].iter().sum::<f64>())
            };
            let (a, b) = (sum(&a), sum(&b));
            let spread = a.standard_error.hypot(b.standard_error);
            assert!((a.value - b.value).abs() < 4.0 * spread, "band {band} {range:?}: {a:?} {b:?}");
            assert!(spread < 0.06 * a.value, "band {band} {range:?}: {a:?} {b:?}");
        }
    }
}

/// Two rooms and a doorway of 0.9 m2 in the wall between them.
fn coupled_rooms(bands: Bands, scattering: &[f64]) -> Scene {
    let wall = |a: f64| {
        let scattering = PerBand::new(bands, scattering.to_vec()).unwrap();
        Material::new(PerBand::uniform(bands, a), scattering).unwrap()
    };
    let shell = Scene::shoebox([8.0, 4.0, 3.0], std::array::from_fn(|_| wall(0.2))).unwrap();
    let (mut vertices, mut triangles) = (shell.vertices().to_vec(), shell.triangles().to_vec());
    let mut partition = |y: [f64; 2], z: [f64; 2]| {
        let first = vertices.len() as u32;
        vertices.extend([[4.5, y[0], z[0]], [4.5, y[1], z[0]], [4.5, y[1], z[1]], [4.5, y[0], z[1]]]);
        for corners in [[0, 1, 2], [0, 2, 3]] {
            triangles.push(Triangle { vertices: corners.map(|c| c + first), material: 0 });
        }
    };
    partition([0.0, 3.0], [0.0, 3.0]);
    partition([3.0, 3.5], [1.8, 3.0]);
    partition([3.5, 4.0], [0.0, 3.0]);
    Scene::new(vertices, triangles, shell.materials().to_vec()).unwrap()
}

/// Rays from both ends, joined by lines and meetings, find the energy that rays from the source alone find, in each octave,
/// early and late, and where only a doorway leads from room to room; and they find it more precisely.
#[test]
fn both_ends_agree_with_one_and_are_more_precise() {
    let bands = Bands::octaves(500.0, 1000.0).unwrap();
    let scene = coupled_rooms(bands, &[0.1, 0.4]);
    let air = Air::default();
    let read = |bidirectional: bool, seed: u64| {
        let rays = 40_000;
        let config = TracerConfig { rays, duration_s: 0.3, seed, bidirectional, ..Default::default() };
        let (from, to) = (source([1.5, 1.0, 1.2]), receiver([6.8, 1.2, 1.7]));
        let paths = PathTracer::new(config).unwrap().trace(&scene, &from, &to, &air, &()).unwrap();
        [0, 1].map(|band| batch_energies(&paths, &materials_of(&scene), band, air.speed_of_sound_m_s(), 1e-3))
    };
    let (one, both) = (read(false, 1), read(true, 2));
    let mut gain = Vec::new();
    for band in 0..2 {
        for range in [0..30, 30..60, 60..100, 100..160, 160..300] {
            let sum = |parts: &[Vec<f64>]| {
                let exact: f64 = parts[32][range.clone()].iter().sum();
                jackknife(&parts[..32], |e| exact + e[range.clone()].iter().sum::<f64>())
            };
            let (a, b) = (sum(&one[band]), sum(&both[band]));
            let spread = a.standard_error.hypot(b.standard_error);
            eprintln!(
                "band {band} {range:?} ms: {:.3e} {:.3e} +- {:.1e} {:.1e}",
                a.value, b.value, a.standard_error, b.standard_error
            );
            assert!((a.value - b.value).abs() < 4.0 * spread, "band {band} {range:?}: {a:?} {b:?}");
            gain.push((a.standard_error / b.standard_error).powi(2));
        }
    }
    // The same number of rays; each variance is known to a quarter only, so their geometric mean is asked.
    let mean_gain = (gain.iter().map(|g| g.ln()).sum::<f64>() / gain.len() as f64).exp();
    eprintln!("variance of one end over that of both: {mean_gain:.2} ({gain:.1?})");
    assert!(mean_gain > 2.0, "{gain:?}");
}

/// What rays find beyond the image sources makes up for what image sources leave out.
#[test]
fn the_image_order_changes_nothing_in_the_mean() {
    let scene = banded_scene();
    let air = Air::default();
    let read = |image_order: usize| {
        let config = TracerConfig {
            rays: 40_000,
            duration_s: 0.2,
            seed: image_order as u64,
            image_order,
            ..Default::default()
        };
        let paths = PathTracer::new(config)
            .unwrap()
            .trace(&scene, &source([1.5, 1.0, 1.2]), &receiver([4.5, 3.0, 1.7]), &air, &())
            .unwrap();
        batch_energies(&paths, &materials_of(&scene), 0, air.speed_of_sound_m_s(), 1e-3)
    };
    let orders = [0, 1, 2, 4].map(read);
    for range in [0..200, 25..60] {
        let sums = orders.each_ref().map(|parts| {
            let exact: f64 = parts[32][range.clone()].iter().sum();
            jackknife(&parts[..32], |e| exact + e[range.clone()].iter().sum::<f64>())
        });
        for pair in sums.windows(2) {
            let spread = pair[0].standard_error.hypot(pair[1].standard_error);
            assert!((pair[0].value - pair[1].value).abs() < 4.0 * spread, "{range:?}: {pair:?}");
            assert!(spread < 0.05 * pair[0].value);
        }
    }
}

#[test]
fn the_seed_decides_and_the_number_of_threads_does_not() {
    let scene = banded_scene();
    let air = Air::default();
    let traced = |threads: usize, seed: u64| {
        let config = TracerConfig { rays: 3_000, duration_s: 0.2, seed, ..Default::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let paths = PathTracer::new(config)
                .unwrap()
                .trace(&scene, &source([1.5, 1.0, 1.2]), &receiver([4.5, 3.0, 1.7]), &air, &())
                .unwrap();
            let renderer =
                PressureRenderer::new(RenderConfig { sample_rate_hz: 16_000, seed, ..Default::default() })
                    .unwrap();
            let response = renderer.render(&paths, &Conditions::new(&materials_of(&scene), &air)).unwrap();
            (paths, response)
        })
    };
    let one = traced(1, 5);
    assert!(one == traced(2, 5) && one == traced(8, 5));
    assert!(one.0 != traced(2, 6).0);
}

#[test]
fn an_observer_hears_of_every_ray_and_can_stop_the_trace() {
    use std::sync::atomic::{AtomicU64, Ordering};
    let scene = banded_scene();
    let config = TracerConfig { rays: 5_000, duration_s: 0.1, ..Default::default() };
    let tracer = PathTracer::new(config).unwrap();
    let (from, to) = (source([1.5, 1.0, 1.2]), receiver([4.5, 3.0, 1.7]));
    let (most, whole) = (AtomicU64::new(0), AtomicU64::new(0));
    let listen = |_: &str, done: u64, total: u64| {
        most.fetch_max(done, Ordering::Relaxed);
        whole.fetch_max(total, Ordering::Relaxed);
        std::ops::ControlFlow::Continue(())
    };
    tracer.trace(&scene, &from, &to, &Air::default(), &listen).unwrap();
    let whole = whole.into_inner();
    assert_eq!(most.into_inner(), whole);
    // Rounded up to equal shares of 32 batches, two ends and four sets of scattering coefficients.
    assert!((5_000..5_000 + 32 * 2 * 4).contains(&whole), "{whole}");
    let stop = |_: &str, done: u64, _: u64| match done {
        1000.. => std::ops::ControlFlow::Break(()),
        _ => std::ops::ControlFlow::Continue(()),
    };
    let error = tracer.trace(&scene, &from, &to, &Air::default(), &stop).unwrap_err();
    assert!(matches!(error, sabine_acoustics::Error::Cancelled { stage } if stage == "tracing"));
}
