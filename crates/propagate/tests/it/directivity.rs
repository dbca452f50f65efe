//! Directional sources and receivers: closed forms that hold without tracing again.

use sabine_acoustics::*;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::*;
use std::f64::consts::PI;

fn box_scene(wall: &Material) -> Scene {
    Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(|_| wall.clone())).unwrap()
}

fn trace(scene: &Scene, from: [f64; 3], to: [f64; 3], config: TracerConfig) -> PathSet {
    let (source, receiver) = (Source::omni("S", from).unwrap(), Receiver::omni("R", to).unwrap());
    PathTracer::new(config).unwrap().trace(scene, &source, &receiver, &Air::default(), &()).unwrap()
}

/// In a lossless room with Lambert walls energy fills the volume evenly: 4 pi c / V per second for an omnidirectional source,
/// and 1 / Q of it for a directional one that is as loud on its axis, less what the air takes.
#[test]
fn the_reverberation_of_a_directional_source_falls_by_its_factor() {
    let bands = Bands::octaves(125.0, 250.0).unwrap();
    let wall = Material::uniform(bands, 0.0, 1.0).unwrap();
    let config = TracerConfig { rays: 4_000, duration_s: 0.5, ..Default::default() };
    let paths = trace(&box_scene(&wall), [1.0, 1.2, 0.9], [3.6, 2.9, 1.7], config);
    let (walls, air) = (vec![wall; 6], Air::default());
    let speed_m_s = air.speed_of_sound_m_s();
    for (share, factor) in [(1.0, 1.0), (0.5, 3.0), (0.25, 4.0), (0.0, 3.0)] {
        let pattern = Directivity::first_order(share).unwrap();
        let facing = Orientation::towards([0.3, -1.0, 0.2]).unwrap();
        for conditions in [
            Conditions::new(&walls, &air).with_source(&pattern, facing),
            Conditions::new(&walls, &air).with_receiver(&pattern, facing),
        ] {
            let response = paths.energy_response(&conditions, 0.05).unwrap();
            // From 0.1 s on: ten mean free paths.
            let (mut found, mut expected, mut variance) = (0.0, 0.0, 0.0);
            for bin in 2..10 {
                let time_s = 0.05 * (bin as f64 + 0.5);
                let left = (-air.energy_exponent_per_m(bands).values()[0] * speed_m_s * time_s).exp();
                expected += 0.05 * 4.0 * PI * speed_m_s / 60.0 / factor * left;
                found += response.band(0)[bin];
                variance += response.band_standard_error(0)[bin].powi(2);
            }
            // Bins share rays: their errors may add up instead of their variances, hence the factor sqrt 8 at most.
            let error = (8.0 * variance).sqrt();
            assert!(error < 0.06 * expected, "share {share}: {error} of {expected}");
            assert!((found - expected).abs() < 3.0 * error, "share {share}: {found} +- {error}, {expected}");
        }
    }
}

fn direct_energy(paths: &PathSet, conditions: &Conditions) -> f64 {
    f64::from(paths.energies(conditions).unwrap()[0][0])
}

#[test]
fn a_cardioid_sends_ahead_and_nothing_back() {
    let bands = Bands::octaves(125.0, 250.0).unwrap();
    let wall = Material::uniform(bands, 0.3, 0.2).unwrap();
    let config = TracerConfig { rays: 1, image_order: 0, ..Default::default() };
    let paths = trace(&box_scene(&wall), [1.0, 2.0, 1.5], [4.0, 2.0, 1.5], config);
    let (walls, air) = (vec![wall; 6], Air::default());
    let cardioid = Directivity::first_order(Directivity::CARDIOID).unwrap();
    let turned = |degrees: f64| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        Orientation::towards([cosine, sine, 0.0]).unwrap()
    };
    let base = Conditions::new(&walls, &air);
    let omni = direct_energy(&paths, &base);
    for (degrees, gain) in [(0.0, 1.0), (60.0, 0.5625), (90.0, 0.25), (180.0, 0.0)] {
        let sent = direct_energy(&paths, &base.with_source(&cardioid, turned(degrees)));
        assert!((sent / omni - gain).abs() < 1e-3, "sent at {degrees} degrees: {}", sent / omni);
        // The receiver sees the source in the opposite direction.
        let heard = direct_energy(&paths, &base.with_receiver(&cardioid, turned(180.0 - degrees)));
        assert!((heard / omni - gain).abs() < 1e-3, "heard at {degrees} degrees: {}", heard / omni);
    }
    let shown = direct_energy(&paths, &base.with_source(&Directivity::omni(), turned(10.0)));
    assert_eq!(shown, omni);
}

/// Turning a source in a room is turning the room, the receiver and the source the other way about it.
#[test]
fn a_turned_scene_is_a_turned_source() {
    let bands = Bands::octaves(125.0, 250.0).unwrap();
    let walls: Vec<Material> =
        (0..6).map(|i| Material::uniform(bands, 0.1 + 0.1 * f64::from(i), 0.1).unwrap()).collect();
    let room = Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(|i| walls[i].clone())).unwrap();
    let turn = Orientation::new([0.4, 0.8, -0.3], [0.1, 0.2, 1.0]).unwrap();
    let vertices = room.vertices().iter().map(|&v| turn.to_room(v)).collect();
    let turned = Scene::new(vertices, room.triangles().to_vec(), room.materials().to_vec()).unwrap();
    let config = TracerConfig { rays: 1, image_order: 2, duration_s: 0.1, ..Default::default() };
    let (from, to) = ([1.0, 1.2, 0.9], [3.6, 2.9, 1.7]);
    let straight = trace(&room, from, to, config.clone());
    let skewed = trace(&turned, turn.to_room(from), turn.to_room(to), config);
    let levels: Vec<f64> = (0..16 * 9).map(|i| -f64::from(i * 7919 % 17)).collect();
    let pattern = Directivity::table(16, 9, &PerBand::uniform(bands, levels)).unwrap();
    let facing = Orientation::new([0.2, -1.0, 0.4], [0.0, 0.0, 1.0]).unwrap();
    let with_room = Orientation::new(turn.to_room(facing.forward()), turn.to_room(facing.up())).unwrap();
    let air = Air::default();
    let energies = |paths: &PathSet, facing| {
        let conditions =
            Conditions::new(&walls, &air).with_source(&pattern, facing).with_receiver(&pattern, facing);
        let all = paths.energies(&conditions).unwrap();
        let mut exact: Vec<(f32, f32)> = (0..paths.len())
            .filter(|&i| paths.is_exact(i))
            .map(|i| (paths.lengths_m()[i], all[0][i]))
            .collect();
        exact.sort_by(|a, b| a.0.total_cmp(&b.0));
        exact
    };
    let (a, b) = (energies(&straight, facing), energies(&skewed, with_room));
    assert_eq!((a.len(), b.len()), (25, 25)); // 1 + 6 + 18 images of a box
    for ((length_a, energy_a), (length_b, energy_b)) in a.into_iter().zip(b) {
        assert!((length_a - length_b).abs() < 1e-4);
        // Directions are stored to 0.005 degrees; the table falls by up to 17 dB in 20 degrees.
        assert!((energy_a / energy_b - 1.0).abs() < 2e-3, "{length_a} m: {energy_a} {energy_b}");
    }
}

#[test]
fn directivities_on_other_bands_are_refused() {
    let bands = Bands::octaves(125.0, 250.0).unwrap();
    let wall = Material::uniform(bands, 0.3, 0.2).unwrap();
    let config = TracerConfig { rays: 1, image_order: 0, ..Default::default() };
    let paths = trace(&box_scene(&wall), [1.0, 2.0, 1.5], [4.0, 2.0, 1.5], config);
    let (walls, air) = (vec![wall; 6], Air::default());
    let other = Directivity::first_order_per_band(&PerBand::uniform(Bands::T60, 0.7)).unwrap();
    let conditions = Conditions::new(&walls, &air).with_source(&other, Orientation::default());
    assert!(matches!(paths.energies(&conditions), Err(sabine_acoustics::Error::BandMismatch { .. })));
    let fitting = other.resampled(bands);
    let conditions = Conditions::new(&walls, &air).with_source(&fitting, Orientation::default());
    assert!(paths.energies(&conditions).is_ok());
}
