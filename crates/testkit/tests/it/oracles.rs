//! The oracles against closed forms, against published figures and against each other.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Air, Bands, EnergyResponse, Material, PerBand};
use sabine_paths::{Conditions, PathSet, Propagator, RayScene};
use sabine_scene::{NamedMaterial, Receiver, Scene, Source, Triangle};
use sabine_testkit::{
    BruteForceRays, PhononConfig, Phonons, ShoeboxImages, assert_all_close, assert_close,
    assert_within_standard_errors,
};

const SIZE_M: [f64; 3] = [10.0, 7.0, 3.0];

fn one_band() -> Bands {
    Bands::octaves(1000.0, 1000.0).unwrap()
}

fn shoebox(absorption: f64, scattering: f64) -> Scene {
    let m = Material::uniform(one_band(), absorption, scattering).unwrap();
    Scene::shoebox(SIZE_M, std::array::from_fn(|_| m.clone())).unwrap()
}

fn places() -> (Source, Receiver) {
    (Source::omni("s", [2.0, 3.0, 1.5]).unwrap(), Receiver::omni("r", [7.0, 4.0, 1.6]).unwrap())
}

fn t_s(response: &EnergyResponse, end_db: f64) -> f64 {
    response.decay_curve(0).decay_time_s(-5.0, end_db).unwrap()
}

/// design/facts.md: T30 2.118 s and T20 1.938 s without air.
#[test]
fn images_give_the_published_decay() {
    let (source, receiver) = places();
    let scene = shoebox(0.1, 0.0);
    let response =
        ShoeboxImages::new(3.0).unwrap().energy_response(&scene, &source, &receiver, None, 5e-3).unwrap();
    assert_close("T30 (s)", t_s(&response, -35.0), 2.118, 0.0, 0.005);
    assert_close("T20 (s)", t_s(&response, -25.0), 1.938, 0.0, 0.005);
}

/// Six different walls: the direct sound and the six first reflections, each by hand.
#[test]
fn the_first_images_are_where_the_mirror_puts_them() {
    let absorption = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
    let scene =
        Scene::shoebox(SIZE_M, absorption.map(|a| Material::uniform(one_band(), a, 0.0).unwrap())).unwrap();
    // Off the middle, so that no two of them are equally long.
    let (source, receiver) = (places().0, Receiver::omni("r", [7.0, 4.3, 1.7]).unwrap());
    let oracle = ShoeboxImages::new(0.06).unwrap();
    let images = oracle.images(&scene, &source, &receiver, &Air::default()).unwrap();
    assert_close("direct (m)", images[0].length_m, (25.0f64 + 1.69 + 0.04).sqrt(), 1e-12, 0.0);
    let (s, r) = (source.position_m, receiver.position_m);
    let paths = oracle.trace(&scene, &source, &receiver, &Air::default(), &()).unwrap();
    let energies = paths
        .energies(&Conditions::new(
            &scene.materials().iter().map(|m| m.material.clone()).collect::<Vec<_>>(),
            &Air::default(),
        ))
        .unwrap();
    for (face, absorbed) in absorption.into_iter().enumerate() {
        let axis = face / 2;
        let mut mirrored = s;
        mirrored[axis] = if face % 2 == 0 { -s[axis] } else { 2.0 * SIZE_M[axis] - s[axis] };
        let way: [f64; 3] = std::array::from_fn(|k| mirrored[k] - r[k]);
        let length = way.iter().map(|c| c * c).sum::<f64>().sqrt();
        let image = images.iter().find(|i| i.hits.iter().sum::<u32>() == 1 && i.hits[face] == 1).unwrap();
        assert_close("length (m)", image.length_m, length, 1e-12, 0.0);
        let arrival = way.map(|c| c / length);
        let mut departure = arrival.map(|c| -c);
        departure[axis] = arrival[axis];
        assert_all_close("arrival", &image.arrival, &arrival, 1e-12, 0.0);
        assert_all_close("departure", &image.departure, &departure, 1e-12, 0.0);
        let i = (0..paths.len()).find(|&i| (f64::from(paths.lengths_m()[i]) - length).abs() < 1e-5).unwrap();
        let air = (-Air::default().energy_exponent_per_m(one_band()).values()[0] * length).exp();
        let expected = (1.0 - absorbed) * air / (length * length);
        assert_close("energy", f64::from(energies[0][i]), expected, 0.0, 1e-5);
    }
}

/// Through paths, with the vocabulary's air and materials, or straight: the same energy.
#[test]
fn paths_carry_what_the_images_carry() {
    let bands = Bands::T60;
    let material = |i: usize| {
        let a = PerBand::from_fn(bands, |b| 0.05 + 0.1 * i as f64 + 0.02 * b as f64);
        Material::new(a, PerBand::uniform(bands, 0.1)).unwrap()
    };
    let scene = Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(material)).unwrap();
    let (source, receiver) =
        (Source::omni("s", [1.0, 1.5, 1.2]).unwrap(), Receiver::omni("r", [3.9, 2.7, 1.6]).unwrap());
    let air = Air::new(15.0, 30.0, 99.0).unwrap();
    let oracle = ShoeboxImages::new(0.3).unwrap();
    let straight = oracle.energy_response(&scene, &source, &receiver, Some(&air), 0.01).unwrap();
    let paths = oracle.trace(&scene, &source, &receiver, &air, &()).unwrap();
    let materials: Vec<Material> = scene.materials().iter().map(|m| m.material.clone()).collect();
    let via = paths.energy_response(&Conditions::new(&materials, &air), 0.01).unwrap();
    for band in 0..bands.len() {
        assert_all_close("energy", via.band(band), &straight.band(band)[..via.bins()], 1e-9, 1e-4);
    }
    assert!((0..paths.len()).all(|i| paths.is_exact(i)));
    assert!(paths.lengths_m().iter().all(|&l| f64::from(l) <= paths.max_length_m()));
    assert!(paths.chain_count() < paths.len() + 2, "chains are shared");
    assert_eq!(paths.chains().iter().filter(|&&c| c == PathSet::DIRECT).count(), 1);
}

#[test]
fn source_and_receiver_may_change_places() {
    let scene = shoebox(0.2, 0.0);
    let (source, receiver) = places();
    let swapped =
        (Source::omni("s", receiver.position_m).unwrap(), Receiver::omni("r", source.position_m).unwrap());
    let oracle = ShoeboxImages::new(0.5).unwrap();
    let there = oracle.energy_response(&scene, &source, &receiver, None, 0.02).unwrap();
    let back = oracle.energy_response(&scene, &swapped.0, &swapped.1, None, 0.02).unwrap();
    assert_all_close("energy", there.band(0), back.band(0), 1e-9, 1e-9);
}

/// The pressure response holds the direct pulse at its instant; at 0 Hz every image adds the amplitude of the lowest band, and
/// between the bands nothing is lost.
#[test]
fn pressure_adds_up_the_images() {
    let bands = Bands::SIMULATION;
    let a = PerBand::from_fn(bands, |b| 0.5 - 0.05 * b as f64);
    let m = Material::new(a, PerBand::uniform(bands, 0.0)).unwrap();
    let scene = Scene::shoebox(SIZE_M, std::array::from_fn(|_| m.clone())).unwrap();
    let (source, receiver) = places();
    let air = Air::default();
    let oracle = ShoeboxImages::new(0.4).unwrap();
    let pressure = oracle.impulse_response(&scene, &source, &receiver, &air, 48_000).unwrap();
    let exponent = air.energy_exponent_per_m(bands).values()[0];
    let images = oracle.images(&scene, &source, &receiver, &air).unwrap();
    let amplitude = |image: &sabine_testkit::Image| {
        let hits = f64::from(image.hits.iter().sum::<u32>());
        (0.5f64.powf(hits) * (-exponent * image.length_m).exp()).sqrt() / image.length_m
    };
    let expected: f64 = images.iter().map(amplitude).sum();
    let found: f64 = pressure.samples().iter().map(|&s| f64::from(s)).sum();
    assert_close("gain at 0 Hz", found, expected, 0.0, 2e-3);
    // Black walls leave the direct pulse alone.
    let black = Material::uniform(bands, 1.0, 0.0).unwrap();
    let scene = Scene::shoebox(SIZE_M, std::array::from_fn(|_| black.clone())).unwrap();
    let direct = oracle.impulse_response(&scene, &source, &receiver, &air, 48_000).unwrap();
    let at = images[0].length_m / air.speed_of_sound_m_s() * 48e3;
    // As far to the right as to the left: the filters ring on both sides.
    let sum = |power: i32| -> f64 {
        let near = direct.samples()[..1427].iter().enumerate();
        near.map(|(i, &s)| (i as f64 - at).powi(power) * f64::from(s)).sum()
    };
    assert_close("area of the direct pulse", sum(0), 1.0 / images[0].length_m, 0.0, 1e-3);
    assert_close("centre of the direct pulse (samples)", sum(1) / sum(0), 0.0, 0.05, 0.0);
}

/// An L with a slanted roof, one material.
fn odd_room() -> Scene {
    let plan = [[0.0, 0.0], [8.0, 0.0], [8.0, 4.0], [4.0, 4.0], [4.0, 7.0], [0.0, 7.0]];
    let roof = |p: [f64; 2]| 3.0 + 0.25 * p[0];
    let mut vertices: Vec<[f64; 3]> = plan.iter().map(|p| [p[0], p[1], 0.0]).collect();
    vertices.extend(plan.iter().map(|&p| [p[0], p[1], roof(p)]));
    let mut faces: Vec<[u32; 3]> = [[0, 3, 1], [1, 3, 2], [0, 4, 3], [0, 5, 4]].to_vec();
    faces.extend([[0, 1, 3], [1, 2, 3], [0, 3, 4], [0, 4, 5]].map(|f: [u32; 3]| f.map(|i| i + 6)));
    for i in 0..6u32 {
        let j = (i + 1) % 6;
        faces.extend([[i, j, j + 6], [i, j + 6, i + 6]]);
    }
    let triangles = faces.into_iter().map(|vertices| Triangle { vertices, material: 0 }).collect();
    let material = Material::uniform(one_band(), 0.0, 0.5).unwrap();
    Scene::new(vertices, triangles, vec![NamedMaterial { name: "all".into(), material }]).unwrap()
}

/// Rays into a box meet the wall that arithmetic says, and rays aimed at edges and corners meet something.
#[test]
fn brute_force_rays_find_walls_and_leak_nowhere() {
    let rays = BruteForceRays::new(&shoebox(0.1, 0.0));
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let mut unit = || loop {
        let v: [f64; 3] = std::array::from_fn(|_| 2.0 * random.random::<f64>() - 1.0);
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        if length > 0.1 && length < 1.0 {
            return v.map(|c| c / length);
        }
    };
    let origin = [2.0, 3.0, 1.5];
    for _ in 0..20_000 {
        let d = unit();
        let expected = (0..3)
            .map(|k| if d[k] > 0.0 { (SIZE_M[k] - origin[k]) / d[k] } else { -origin[k] / d[k] })
            .fold(f64::INFINITY, f64::min);
        let hit = rays.closest_hit(origin, d, 100.0).unwrap();
        assert_close("distance (m)", hit.distance, expected, 1e-9, 1e-9);
        assert!(rays.closest_hit(origin, d, expected * 0.999).is_none());
    }
    let room = odd_room();
    let rays = BruteForceRays::new(&room);
    let origin = [1.3, 2.1, 1.7];
    for i in 0..room.triangles().len() {
        let [a, b, _] = room.corners_m(i);
        for step in 0..=1000 {
            let f = f64::from(step) / 1000.0;
            let way: [f64; 3] = std::array::from_fn(|k| a[k] + f * (b[k] - a[k]) - origin[k]);
            let length = way.iter().map(|c| c * c).sum::<f64>().sqrt();
            assert!(rays.closest_hit(origin, way.map(|c| c / length), 100.0).is_some(), "triangle {i}, {f}");
        }
    }
}

/// Without losses energy stays: the late field holds 4 pi c dt / V in every bin, whatever the room's shape.
#[test]
fn a_lossless_room_keeps_its_energy() {
    let room = odd_room();
    let volume = room.volume_m3();
    let config = PhononConfig { particles: 9600, detector_radius_m: 0.6, duration_s: 0.6, seed: 3 };
    let (source, receiver) =
        (Source::omni("s", [1.3, 1.1, 1.7]).unwrap(), Receiver::omni("r", [2.9, 5.2, 1.4]).unwrap());
    let found = Phonons::new(&room, config).unwrap().energy(&source, &receiver, None, 0.3).unwrap();
    assert_eq!(found.lost, 0);
    let expected = 4.0 * std::f64::consts::PI * 343.2 * 0.3 / volume;
    let (energy, error) = (found.response.band(0)[1], found.response.band_standard_error(0)[1]);
    assert!(error / energy < 0.02, "the test would show nothing: {energy} +- {error}");
    assert_within_standard_errors("late energy", energy, error, expected, 4.0);
}

/// Kosten: the mean free path of a diffuse field is 4V/S.
#[test]
fn the_mean_free_path_is_4v_over_s() {
    let scene = shoebox(0.0, 1.0);
    let (source, receiver) = places();
    let config = PhononConfig { particles: 3200, duration_s: 2.0, ..Default::default() };
    let found = Phonons::new(&scene, config).unwrap().energy(&source, &receiver, None, 0.1).unwrap();
    assert_close("mean free path (m)", found.mean_free_path_m, 4.0 * 210.0 / 242.0, 0.0, 0.005);
}

/// design/facts.md: T30 at scattering 0.3 and 1. The room's, so the receiver matters little; 2 % covers both and the noise.
#[test]
fn phonons_give_the_published_decay() {
    let (source, receiver) = places();
    for (scattering, t30_s) in [(0.3, 1.373), (1.0, 1.360)] {
        let config = PhononConfig { particles: 12_800, detector_radius_m: 0.8, duration_s: 1.8, seed: 5 };
        let phonons = Phonons::new(&shoebox(0.1, scattering), config).unwrap();
        let found = phonons.energy(&source, &receiver, None, 5e-3).unwrap();
        assert_close("T30 (s)", t_s(&found.response, -35.0), t30_s, 0.0, 0.02);
    }
}

/// Mirrors only: particles find the energy of the images, bin by bin, within their own standard errors.
#[test]
fn phonons_and_images_agree() {
    let scene = shoebox(0.3, 0.0);
    let (source, receiver) = places();
    let air = Air::default();
    let config = PhononConfig { particles: 64_000, detector_radius_m: 0.2, duration_s: 0.5, seed: 11 };
    let particles =
        Phonons::new(&scene, config).unwrap().energy(&source, &receiver, Some(&air), 0.05).unwrap();
    let images = ShoeboxImages::new(0.5)
        .unwrap()
        .energy_response(&scene, &source, &receiver, Some(&air), 0.05)
        .unwrap();
    let (found, error) = (particles.response.band(0), particles.response.band_standard_error(0));
    for bin in 0..10 {
        // An image may sit at the edge of a bin and be smeared across it by the sphere: half a percent on top.
        let error = error[bin].hypot(0.005 * images.band(0)[bin]);
        assert_within_standard_errors(&format!("bin {bin}"), found[bin], error, images.band(0)[bin], 4.0);
    }
}

/// The pressure's power is the energy, and the seed alone decides.
#[test]
fn the_pressure_of_phonons_has_their_energy() {
    let bands = Bands::octaves(500.0, 2000.0).unwrap();
    let m = Material::uniform(bands, 0.2, 0.5).unwrap();
    let scene = Scene::shoebox(SIZE_M, std::array::from_fn(|_| m.clone())).unwrap();
    let (source, receiver) = places();
    let air = Air::default();
    let config = PhononConfig { particles: 6400, detector_radius_m: 0.5, duration_s: 0.6, seed: 2 };
    let phonons = Phonons::new(&scene, config).unwrap();
    let pressure = phonons.impulse_response(&source, &receiver, &air, 16_000).unwrap();
    assert_eq!(pressure, phonons.impulse_response(&source, &receiver, &air, 16_000).unwrap());
    let other = Phonons::new(&scene, PhononConfig { seed: 4, ..config }).unwrap();
    assert_ne!(pressure, other.impulse_response(&source, &receiver, &air, 16_000).unwrap());
    let energy = phonons.energy(&source, &receiver, Some(&air), 0.1).unwrap().response;
    for bin in 1..5 {
        let power: f64 = pressure.samples()[bin * 1600..(bin + 1) * 1600]
            .iter()
            .map(|&s| f64::from(s) * f64::from(s))
            .sum();
        // The top band reaches from 1.4 kHz to 8 kHz, and so holds most of the power. 1600 samples of noise: 3.5 % each.
        let mean = (energy.band(0)[bin] * 0.7 + energy.band(1)[bin] * 0.7 + energy.band(2)[bin] * 6.6) / 8.0;
        assert_close(&format!("power in bin {bin}"), power, mean, 0.0, 0.15);
    }
}

#[test]
fn what_is_no_box_is_refused() {
    let (source, receiver) = places();
    let oracle = ShoeboxImages::new(0.1).unwrap();
    assert!(oracle.images(&odd_room(), &source, &receiver, &Air::default()).is_err());
    let outside = Source::omni("s", [-1.0, 1.0, 1.0]).unwrap();
    assert!(oracle.images(&shoebox(0.1, 0.0), &outside, &receiver, &Air::default()).is_err());
    assert!(ShoeboxImages::new(f64::NAN).is_err());
    let bad = PhononConfig { detector_radius_m: 0.0, ..Default::default() };
    assert!(Phonons::new(&odd_room(), bad).is_err());
}
