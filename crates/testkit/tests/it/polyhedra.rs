//! Rooms that are no box, against the plain particles of [`Phonons`], which share with them neither images nor filling with noise.

use sabine_acoustics::EnergyResponse;
use sabine_scene::Source;
use sabine_testkit::{
    PhononConfig, Phonons, Planted, PolyhedralConfig, PolyhedralRoom, Polyhedron, at_night,
};

const RATE_HZ: f64 = 16_000.0;
const WINDOW_S: f64 = 0.04;

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

#[test]
fn they_decay_as_particles_do() {
    for shape in Polyhedron::ALL.into_iter().take(if at_night() { 4 } else { 1 }) {
        let room = PolyhedralConfig { particles: 307_200, ..config(shape, Planted::Nothing) };
        let room = PolyhedralRoom::new(room).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let measured = room.write(&folder.path().join("room")).unwrap();
        let bands = room.scene().materials()[0].material.bands();
        let scene = room.scene().with_materials(room.true_materials().unwrap()).unwrap();
        let config = PhononConfig { particles: 25_600, detector_radius_m: 0.4, duration_s: 0.35, seed: 2 };
        let particles = Phonons::new(&scene, config).unwrap();
        let source: &Source = &measured.sources()[0];
        let air = measured.air();
        let counted: Vec<EnergyResponse> = measured
            .receivers()
            .iter()
            .map(|r| particles.energy(source, r, Some(&air), WINDOW_S).unwrap().response)
            .collect();
        let energies = room.energies();
        let each = (WINDOW_S / PolyhedralRoom::BIN_S).round() as usize;
        for band in 0..bands.len() {
            for window in 0..8 {
                let own = energies.iter().flat_map(|r| &r[band][window * each..(window + 1) * each]);
                let (own, other): (f64, f64) =
                    (own.sum(), counted.iter().map(|r| r.band(band)[window]).sum::<f64>());
                let variance: f64 =
                    counted.iter().map(|r| r.band_standard_error(band)[window].powi(2)).sum::<f64>();
                // Twelve times as many particles fly in the room: a twelfth of the variance. With an eighth of these phonons, late energy that
                // rare ones carry was missed, and its standard error with it. What comes within the 2 ms that a sphere takes may fall into
                // the next window.
                let allowed = 4.5 * (variance * (1.0 + 1.0 / 12.0)).sqrt() + 0.03 * other;
                assert!(
                    (own - other).abs() < allowed,
                    "{shape:?}, {band}, {window}: {own} {other} {allowed}"
                );
            }
        }
    }
}

#[test]
fn responses_hold_the_energies() {
    let room = PolyhedralRoom::new(PolyhedralConfig {
        particles: 100_000,
        ..config(Polyhedron::Wedge, Planted::Nothing)
    })
    .unwrap();
    let bands = room.scene().materials()[0].material.bands();
    let energies = room.energies();
    let (mut own, mut heard) = ([0.0; 2], [0.0; 2]);
    for (response, energies) in room.responses().unwrap().iter().zip(&energies) {
        let direct_s = energies[0].iter().position(|e| *e > 0.0).unwrap() as f64 * PolyhedralRoom::BIN_S;
        for (half, after_s) in [0.06, 0.13].into_iter().enumerate() {
            let (from_s, to_s) = (direct_s + after_s, direct_s + after_s + 0.07);
            let bins = |s: f64| (s / PolyhedralRoom::BIN_S).round() as usize;
            // A pulse of energy one in each octave alone is as wide as its octave.
            let of_band = |band: usize| -> f64 {
                bands.exact_hz(band) * energies[band][bins(from_s)..bins(to_s)].iter().sum::<f64>()
            };
            own[half] += (0..bands.len()).map(of_band).sum::<f64>();
            let samples = |s: f64| (s * RATE_HZ) as usize;
            let part = &response.samples()[samples(from_s)..samples(to_s)];
            heard[half] += part.iter().map(|s| f64::from(*s).powi(2)).sum::<f64>();
        }
    }
    // Noise of 5 kHz over 70 ms in each of four responses: 0.1 dB for each half, and as much for the images among it.
    let fall_db = |e: [f64; 2]| 10.0 * (e[1] / e[0]).log10();
    assert!((fall_db(own) - fall_db(heard)).abs() < 0.8, "{own:?} {heard:?}");
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
