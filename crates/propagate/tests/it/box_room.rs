//! The box of known answers: 10 x 7 x 3 m, absorption 0.1, source (2, 3, 1.5), receiver (7, 4, 1.6), no air.

use crate::shoebox::*;
use rand::{Rng, SeedableRng};
use sabine_acoustics::*;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::Scene;
use sabine_testkit::at_night;

const SIZE_M: [f64; 3] = [10.0, 7.0, 3.0];
const SOURCE_M: [f64; 3] = [2.0, 3.0, 1.5];
const RECEIVER_M: [f64; 3] = [7.0, 4.0, 1.6];
const BIN_S: f64 = 1e-3;

fn one_band() -> Bands {
    Bands::octaves(1000.0, 1000.0).unwrap()
}

fn speed_m_s() -> f64 {
    Air::default().speed_of_sound_m_s()
}

fn trace(scene: &Scene, config: TracerConfig, from: [f64; 3], to: [f64; 3]) -> PathSet {
    PathTracer::new(config).unwrap().trace(scene, &source(from), &receiver(to), &Air::default(), &()).unwrap()
}

/// Receivers anywhere in the box, at least half a metre from the walls.
fn anywhere(count: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    (0..count).map(|_| std::array::from_fn(|i| random.random_range(0.5..SIZE_M[i] - 0.5))).collect()
}

/// The oracle of the oracle: the formula gives the figures that are known for this box.
#[test]
fn image_sources_by_formula_give_2_118_s() {
    let all = images(SIZE_M, SOURCE_M, RECEIVER_M, 2.5 * speed_m_s());
    let energy = image_energy(&all, [0.9; 6], speed_m_s(), BIN_S, 2500);
    let t_s = t30_s(&energy, BIN_S);
    assert!((t_s - 2.118).abs() < 0.005, "{t_s}");
}

#[test]
fn without_scattering_t30_and_decay_are_those_of_image_sources() {
    let scene = uniform_box(SIZE_M, one_band(), 0.1, 0.0);
    let config =
        TracerConfig { rays: 40_000, duration_s: 2.3, seed: 1, receiver_radius_m: 1.0, ..Default::default() };
    let paths = trace(&scene, config, SOURCE_M, RECEIVER_M);
    let parts = batch_energies(&paths, &materials_of(&scene), 0, speed_m_s(), BIN_S);
    let t_s = jackknife(&parts[..32], |e| {
        let with_exact: Vec<f64> = e.iter().zip(&parts[32]).map(|(a, b)| a + b).collect();
        t30_s(&with_exact, BIN_S)
    });
    assert!((t_s.value - 2.118).abs() < 4.0 * t_s.standard_error, "{t_s:?}");
    assert!(t_s.standard_error < 0.02 * 2.118, "{t_s:?}");

    // The decay curve to -40 dB: within 0.2 dB, and four standard errors.
    let all = images(SIZE_M, SOURCE_M, RECEIVER_M, 2.5 * speed_m_s());
    let wanted =
        EnergyDecayCurve::from_energy(&image_energy(&all, [0.9; 6], speed_m_s(), BIN_S, 2500), BIN_S);
    let wanted_db: Vec<f64> = wanted.remaining().iter().map(|e| 10.0 * e.log10()).collect();
    for at_s in [0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2] {
        let bin = (at_s / BIN_S) as usize;
        let level = jackknife(&parts[..32], |e| {
            let late: f64 = e[bin..].iter().sum::<f64>() + parts[32][bin..].iter().sum::<f64>();
            10.0 * late.log10()
        });
        let off_db = level.value - wanted_db[bin];
        assert!(wanted_db[bin] - wanted_db[0] > -40.0);
        assert!(
            off_db.abs() < 4.0 * level.standard_error.max(0.01),
            "{at_s} s: {off_db} +- {}",
            level.standard_error
        );
        assert!(off_db.abs() < 0.2, "{at_s} s: {off_db} dB");
    }
}

#[test]
fn with_scattering_t30_is_that_of_the_whole_room() {
    let all = [(0.1, 1.493), (0.5, 1.359), (0.3, 1.373), (1.0, 1.360)];
    for (scattering, expected_s) in all.into_iter().take(if at_night() { 4 } else { 2 }) {
        let scene = uniform_box(SIZE_M, one_band(), 0.1, scattering);
        // Receivers anywhere stand for the room; each is an independent part.
        let parts: Vec<Vec<f64>> = anywhere(16, 7)
            .into_iter()
            .enumerate()
            .map(|(i, at)| {
                let config =
                    TracerConfig { rays: 2_500, duration_s: 1.6, seed: 100 + i as u64, ..Default::default() };
                let paths = trace(&scene, config, SOURCE_M, at);
                total(&batch_energies(&paths, &materials_of(&scene), 0, speed_m_s(), BIN_S))
            })
            .collect();
        // Near the source the direct sound says nothing of the decay: begin when it has passed everywhere.
        let t_s = jackknife(&parts, |e| t30_s(&e[30..], BIN_S));
        eprintln!("scattering {scattering}: T30 {:.4} +- {:.4} s", t_s.value, t_s.standard_error);
        assert!((t_s.value - expected_s).abs() < 4.0 * t_s.standard_error, "{scattering}: {t_s:?}");
        assert!(t_s.standard_error < 0.012 * expected_s, "{scattering}: {t_s:?}");
        // Never below Eyring.
        assert!(t_s.value + 4.0 * t_s.standard_error > 1.327);
    }
}

#[test]
fn exact_paths_are_the_images_of_up_to_third_order() {
    let scene = uniform_box(SIZE_M, one_band(), 0.1, 0.3);
    let config = TracerConfig { rays: 64, duration_s: 0.5, image_order: 3, ..Default::default() };
    let paths = trace(&scene, config, SOURCE_M, RECEIVER_M);
    let counts = paths.hit_counts();
    let mut found: Vec<(f64, [u32; 6])> = (0..paths.len())
        .filter(|&i| paths.is_exact(i))
        .map(|i| {
            let chain = paths.chains()[i] as usize * 6;
            (f64::from(paths.lengths_m()[i]), std::array::from_fn(|m| u32::from(counts[chain + m])))
        })
        .collect();
    let mut wanted: Vec<(f64, [u32; 6])> = images(SIZE_M, SOURCE_M, RECEIVER_M, 100.0)
        .into_iter()
        .filter(|image| image.order() <= 3)
        .map(|image| (image.distance_m, image.hits))
        .collect();
    assert_eq!(wanted.len(), 63); // the octahedral numbers: 1 + 6 + 18 + 38
    let order = |a: &(f64, [u32; 6]), b: &(f64, [u32; 6])| a.1.cmp(&b.1).then(a.0.total_cmp(&b.0));
    found.sort_by(order);
    wanted.sort_by(order);
    assert_eq!(found.len(), wanted.len());
    for (f, w) in found.iter().zip(&wanted) {
        assert_eq!(f.1, w.1);
        assert!((f.0 - w.0).abs() < 1e-5 * w.0, "{f:?} {w:?}");
    }
    // Weights are 1 / d2.
    for i in (0..paths.len()).filter(|&i| paths.is_exact(i)) {
        let expected = -2.0 * paths.lengths_m()[i].ln();
        assert!((paths.log_weights()[i] - expected).abs() < 1e-5);
    }
}

/// Paths through an edge belong to two sequences of planes and are one path all the same.
#[test]
fn symmetric_positions_count_no_path_twice() {
    let scene = uniform_box([4.0, 4.0, 4.0], one_band(), 0.1, 0.0);
    let config = TracerConfig { rays: 64, duration_s: 0.5, image_order: 3, ..Default::default() };
    let (from, to) = ([1.0, 2.0, 2.0], [3.0, 2.0, 2.0]);
    let paths = trace(&scene, config, from, to);
    let exact = (0..paths.len()).filter(|&i| paths.is_exact(i)).count();
    assert_eq!(exact, 63);
}

#[test]
fn six_materials_in_eight_octaves_decay_as_image_sources_do() {
    let bands = Bands::SIMULATION;
    let absorption: [[f64; 8]; 6] = [
        [0.02, 0.02, 0.03, 0.03, 0.04, 0.05, 0.05, 0.05],
        [0.30, 0.25, 0.20, 0.15, 0.10, 0.08, 0.07, 0.06],
        [0.10, 0.10, 0.10, 0.10, 0.10, 0.10, 0.10, 0.10],
        [0.05, 0.10, 0.20, 0.30, 0.40, 0.50, 0.50, 0.50],
        [0.02, 0.05, 0.10, 0.20, 0.30, 0.40, 0.50, 0.60],
        [0.60, 0.60, 0.70, 0.80, 0.80, 0.80, 0.70, 0.70],
    ];
    let walls = absorption.map(|a| {
        Material::new(PerBand::new(bands, a.to_vec()).unwrap(), PerBand::uniform(bands, 0.0)).unwrap()
    });
    let scene = Scene::shoebox(SIZE_M, walls).unwrap();
    let paths = trace(
        &scene,
        TracerConfig { rays: 60_000, duration_s: 1.0, seed: 4, receiver_radius_m: 1.0, ..Default::default() },
        SOURCE_M,
        RECEIVER_M,
    );
    let all = images(SIZE_M, SOURCE_M, RECEIVER_M, 1.0 * speed_m_s());
    for band in 0..8 {
        let parts = batch_energies(&paths, &materials_of(&scene), band, speed_m_s(), BIN_S);
        let reflectance = absorption.map(|a| 1.0 - a[band]);
        let wanted =
            EnergyDecayCurve::from_energy(&image_energy(&all, reflectance, speed_m_s(), BIN_S, 1000), BIN_S);
        let start = wanted.remaining()[0];
        for at_s in [0.03, 0.1, 0.2, 0.3, 0.5, 0.7] {
            let bin = (at_s / BIN_S) as usize;
            let expected_db = 10.0 * (wanted.remaining()[bin] / start).log10();
            if expected_db < -40.0 {
                break;
            }
            let level = jackknife(&parts[..32], |e| {
                let late: f64 = e[bin..].iter().sum::<f64>() + parts[32][bin..].iter().sum::<f64>();
                10.0 * (late / start).log10()
            });
            let off_db = level.value - expected_db;
            assert!(
                off_db.abs() < 4.5 * level.standard_error.max(0.01),
                "{} Hz, {at_s} s: {off_db} +- {} dB",
                bands.nominal_hz(band),
                level.standard_error
            );
            // Later the energy of this uneven room rests on a few grazing paths, and 60,000 rays say less of it.
            assert!(at_s > 0.1 || level.standard_error < 0.3, "{at_s} s: {level:?}");
            assert!(level.standard_error < 1.5, "{at_s} s: {level:?}");
        }
    }
}

/// In a closed room without losses the energy stays: 4 pi c / V per second at any place, in the mean.
#[test]
fn a_lossless_room_keeps_its_energy() {
    for scattering in [0.0, 0.3, 1.0] {
        let scene = uniform_box(SIZE_M, one_band(), 0.0, scattering);
        let parts: Vec<Vec<f64>> = anywhere(12, 21)
            .into_iter()
            .enumerate()
            .map(|(i, at)| {
                let config =
                    TracerConfig { rays: 1_000, duration_s: 1.0, seed: i as u64, ..Default::default() };
                let paths = trace(&scene, config, SOURCE_M, at);
                total(&batch_energies(&paths, &materials_of(&scene), 0, speed_m_s(), BIN_S))
            })
            .collect();
        let expected = 4.0 * std::f64::consts::PI * speed_m_s() / 210.0 * 0.4;
        for range in [200..600, 590..990] {
            let found = jackknife(&parts, |e| e[range.clone()].iter().sum::<f64>() / 12.0);
            assert!(
                (found.value - expected).abs() < 4.0 * found.standard_error,
                "{scattering}: {found:?}, not {expected}"
            );
            assert!(found.standard_error < 0.04 * expected, "{scattering}: {found:?}");
        }
    }
}

/// Sound takes the same ways back.
#[test]
fn source_and_receiver_may_be_exchanged() {
    let bands = Bands::octaves(500.0, 1000.0).unwrap();
    let wall = |a: f64, s: f64| Material::uniform(bands, a, s).unwrap();
    let scene = Scene::shoebox(
        SIZE_M,
        [wall(0.1, 0.2), wall(0.5, 0.7), wall(0.05, 0.1), wall(0.2, 0.3), wall(0.6, 0.5), wall(0.1, 0.05)],
    )
    .unwrap();
    let config = |seed| TracerConfig {
        rays: 20_000,
        duration_s: 0.4,
        seed,
        receiver_radius_m: 1.0,
        ..Default::default()
    };
    let there = trace(&scene, config(1), SOURCE_M, RECEIVER_M);
    let back = trace(&scene, config(2), RECEIVER_M, SOURCE_M);
    let energy = |paths: &PathSet, range: std::ops::Range<usize>| {
        let parts = batch_energies(paths, &materials_of(&scene), 0, speed_m_s(), BIN_S);
        jackknife(&parts[..32], |e| e[range.clone()].iter().sum())
    };
    for range in [0..40, 40..80, 80..160, 160..400] {
        let (a, b) = (energy(&there, range.clone()), energy(&back, range.clone()));
        let spread = a.standard_error.hypot(b.standard_error);
        assert!((a.value - b.value).abs() < 4.0 * spread, "{range:?}: {a:?} {b:?}");
        assert!(spread < 0.08 * a.value, "{range:?}: {a:?} {b:?}");
    }
}

/// Against image sources in air that absorbs.
#[test]
fn traces_last_until_t30_can_be_read_or_as_long_as_they_may() {
    let air = Air::default();
    let at_most = |scene: &Scene, duration_s: f64| {
        let materials = materials_of(scene);
        let conditions = Conditions::new(&materials, &air);
        let config = TracerConfig { rays: 10_000, duration_s, ..TracerConfig::default() };
        let tracer = PathTracer::new(config).unwrap();
        let (from, to) = (source(SOURCE_M), receiver(RECEIVER_M));
        let (paths, parameters) = tracer.trace_until_t30(scene, &from, &to, &conditions, &()).unwrap();
        (paths.max_length_m() / speed_m_s(), parameters.t30_s.values()[0].clone())
    };
    let scene = uniform_box(SIZE_M, one_band(), 0.1, 0.0);
    let per_m = air.energy_exponent_per_m(one_band()).values()[0];
    let all = images(SIZE_M, SOURCE_M, RECEIVER_M, 2.5 * speed_m_s());
    let mut energy = image_energy(&all, [0.9; 6], speed_m_s(), BIN_S, 2500);
    for (bin, e) in energy.iter_mut().enumerate() {
        *e *= (-per_m * (bin as f64 + 0.5) * BIN_S * speed_m_s()).exp();
    }
    let wanted_s = t30_s(&energy, BIN_S);
    let (traced_s, t30) = at_most(&scene, 20.0);
    let t30 = t30.unwrap();
    assert!(traced_s < 20.0 && (t30.value - wanted_s).abs() < 4.0 * t30.standard_error, "{traced_s} {t30:?}");
    let (traced_s, t30) = at_most(&scene, 0.5);
    assert!((traced_s - 0.5).abs() < 1e-9, "{traced_s}");
    assert!(matches!(t30, Err(NoReading::DynamicRange { .. })), "{t30:?}");

    // Between floor and ceiling of felt, sound that runs along them stays: Eyring's formula expects 0.2 s.
    let felt = |face: usize| Material::uniform(one_band(), if face < 4 { 0.02 } else { 0.9 }, 0.0).unwrap();
    let (traced_s, t30) = at_most(&Scene::shoebox(SIZE_M, std::array::from_fn(felt)).unwrap(), 20.0);
    assert!(traced_s > 0.5 && t30.is_ok(), "{traced_s} {t30:?}");
}
