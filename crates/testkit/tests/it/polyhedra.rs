//! Rooms that are no box, against the plain particles of [`Phonons`], which share with them neither images nor filling with noise.

use sabine_acoustics::{Air, Material, PerBand};
use sabine_scene::{Receiver, Source};
use sabine_testkit::{PhononConfig, Phonons, Planted, PolyhedralConfig, PolyhedralRoom, Polyhedron};

const RATE_HZ: f64 = 16_000.0;

fn config(shape: Polyhedron, planted: Planted) -> PolyhedralConfig {
    PolyhedralConfig {
        seed: 11,
        shape,
        planted,
        receivers: 4,
        particles: 40_000,
        ..PolyhedralConfig::default()
    }
}

/// Energies of all octaves together in intervals of 40 ms, mean over receivers.
fn energies(responses: &[Vec<f64>]) -> Vec<f64> {
    let each = (0.04 * RATE_HZ) as usize;
    (0..8)
        .map(|i| {
            let own =
                responses.iter().map(|r| r[i * each..(i + 1) * each].iter().map(|s| s * s).sum::<f64>());
            own.sum::<f64>() / responses.len() as f64
        })
        .collect()
}

#[test]
fn they_decay_as_particles_do() {
    for shape in Polyhedron::ALL {
        let room = PolyhedralRoom::new(config(shape, Planted::Nothing)).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let measured = room.write(&folder.path().join("room")).unwrap();
        let bands = room.scene().materials()[0].material.bands();
        let truth = room
            .scene()
            .materials()
            .iter()
            .zip(room.true_absorption())
            .map(|(m, table)| {
                let absorption = PerBand::new(bands, table.clone()).unwrap();
                Material::new(absorption, m.material.scattering().clone()).unwrap()
            })
            .collect();
        let scene = room.scene().with_materials(truth).unwrap();
        let config = PhononConfig { particles: 3200, detector_radius_m: 0.4, duration_s: 0.35, seed: 2 };
        let particles = Phonons::new(&scene, config).unwrap();
        let source: &Source = &measured.sources()[0];
        let air = measured.air();
        let rendered = |receiver: &Receiver, air: &Air| -> Vec<f64> {
            let response = particles.impulse_response(source, receiver, air, RATE_HZ as u32).unwrap();
            response.samples().iter().map(|s| f64::from(*s)).collect()
        };
        let expected: Vec<Vec<f64>> = measured.receivers().iter().map(|r| rendered(r, &air)).collect();
        let found: Vec<Vec<f64>> = room
            .responses()
            .unwrap()
            .iter()
            .map(|r| r.samples().iter().map(|s| f64::from(*s)).collect())
            .collect();
        for (i, (a, b)) in energies(&found).iter().zip(energies(&expected)).enumerate() {
            // Noise in 40 ms of four responses: 0.3 dB each; particles of either 0.3 dB.
            let off_db = 10.0 * (a / b).log10();
            assert!(off_db.abs() < 1.5, "{shape:?}, {i}: {off_db:.2} dB");
        }
    }
}

#[test]
fn what_is_planted_shows_where_it_should() {
    let samples = |planted: Planted| -> Vec<Vec<f32>> {
        let room = PolyhedralRoom::new(config(Polyhedron::L, planted)).unwrap();
        room.responses().unwrap().into_iter().map(|r| r.samples().to_vec()).collect()
    };
    let plain = samples(Planted::Nothing);
    let onset = |r: &[f32]| {
        let peak = r.iter().fold(0.0f32, |a, b| a.max(b.abs()));
        r.iter().position(|s| s.abs() > 0.5 * peak).unwrap() as f64 / RATE_HZ
    };
    let late = samples(Planted::Latency);
    for (a, b) in plain.iter().zip(&late) {
        let by_s = onset(b) - onset(a);
        assert!((0.0019..0.0051).contains(&by_s), "{by_s}");
    }
    let energy = |r: &[f32]| r.iter().map(|s| f64::from(*s).powi(2)).sum::<f64>();
    let loud = samples(Planted::Gain);
    let louder: Vec<f64> =
        plain.iter().zip(&loud).map(|(a, b)| 10.0 * (energy(b) / energy(a)).log10()).collect();
    assert_eq!(louder.iter().filter(|db| (3.9..6.1).contains(*db)).count(), 1, "{louder:?}");
    assert_eq!(louder.iter().filter(|db| db.abs() < 0.1).count(), 3, "{louder:?}");
    // More absorption leaves less, and a wall or an object changes reflections and not the direct sound.
    let dead = samples(Planted::Surface);
    assert!(plain.iter().zip(&dead).all(|(a, b)| energy(b) < 0.95 * energy(a)));
    for planted in [Planted::Wall, Planted::Object] {
        let other = samples(planted);
        assert!(plain.iter().zip(&other).all(|(a, b)| a != b), "{planted}");
    }
}

#[test]
fn threads_make_no_difference() {
    let room = PolyhedralRoom::new(config(Polyhedron::Furnished, Planted::Nothing)).unwrap();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| room.responses().unwrap())
    };
    let (one, three) = (on(1), on(3));
    assert!(one.iter().zip(&three).all(|(a, b)| a.samples() == b.samples()));
}

#[test]
fn what_cannot_be_is_refused() {
    for bad in [
        PolyhedralConfig { receivers: 0, ..PolyhedralConfig::default() },
        PolyhedralConfig { particles: 10, ..PolyhedralConfig::default() },
        PolyhedralConfig { seed: u64::MAX, ..PolyhedralConfig::default() },
    ] {
        assert!(PolyhedralRoom::new(bad).is_err(), "{bad:?}");
    }
}
