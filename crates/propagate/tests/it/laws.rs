//! Laws in what is rendered.

use crate::octave_filter::{measured_t_s, octave};
use sabine_acoustics::*;
use sabine_paths::laws::{BoundLaws, Law, LawParameter, LawSite, LawTarget};
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::*;

const RATE_HZ: u32 = 48_000;

fn bound(target: LawTarget, formula: &str, parameters: &[(&str, f64, &str)]) -> BoundLaws {
    let bands = Bands::SIMULATION;
    let wall = Material::uniform(bands, 0.1, 0.1).unwrap();
    let scene = Scene::shoebox([8.0, 5.5, 3.2], std::array::from_fn(|_| wall.clone())).unwrap();
    let source = Source::omni("S", [2.0, 3.0, 1.5]).unwrap();
    let receiver = Receiver::omni("R", [6.0, 2.0, 1.6]).unwrap();
    let parameter = |&(name, value, unit): &(&str, f64, &str)| {
        (name.to_owned(), LawParameter::new(value, [value - 1.0, value + 1.0], unit))
    };
    let law = Law::new("law", target, None, formula, parameters.iter().map(parameter)).unwrap();
    BoundLaws::new(&[law], &LawSite::new(&scene, &source, &receiver, &Air::default())).unwrap()
}

/// The direct sound from 5 m ahead, and another from the left, 10 m long.
fn two_pulses() -> PathSet {
    let mut paths = PathSet::new(1, 340.0);
    for (length_m, from) in [(5.0, [1.0, 0.0, 0.0]), (10.0, [0.0, 1.0, 0.0])] {
        paths.push(Contribution {
            length_m,
            log_weight: -2.0 * f64::ln(length_m),
            chain: PathSet::DIRECT,
            tail: PathSet::DIRECT,
            departure: from,
            arrival: from,
            batch: None,
        });
    }
    paths
}

fn pressure(paths: &PathSet, laws: Option<&BoundLaws>) -> Vec<f32> {
    let (wall, air) = ([Material::uniform(Bands::SIMULATION, 0.1, 0.1).unwrap()], Air::default());
    let conditions = Conditions::new(&wall, &air);
    let conditions = laws.map_or(conditions, |laws| conditions.with_laws(laws));
    let config = RenderConfig { sample_rate_hz: RATE_HZ, ..Default::default() };
    PressureRenderer::new(config).unwrap().render(paths, &conditions).unwrap().into_samples()
}

#[test]
fn a_delay_moves_pulses_and_nothing_else() {
    let paths = two_pulses();
    // 10 ms are 480 samples: the same fraction of a sample, hence the same pulse.
    let laws = bound(LawTarget::Delay, "t", &[("t", 10.0, "ms")]);
    let (plain, late) = (pressure(&paths, None), pressure(&paths, Some(&laws)));
    for (i, (found, expected)) in late[480..].iter().zip(&plain).enumerate() {
        assert!((found - expected).abs() < 2e-6, "sample {i}: {found} for {expected}");
    }
    // A delay that grows with the length moves the second pulse twice as far; ambisonics hear it from where it came.
    let laws = bound(LawTarget::Delay, "t * length_m", &[("t", 1.0, "ms/m")]);
    let (wall, air) = ([Material::uniform(Bands::SIMULATION, 0.1, 0.1).unwrap()], Air::default());
    let conditions = Conditions::new(&wall, &air).with_laws(&laws);
    let config = RenderConfig { sample_rate_hz: RATE_HZ, ..Default::default() };
    let heard =
        AmbisonicRenderer::new(1, config).unwrap().render(&paths, &conditions, Orientation::default());
    let heard = heard.unwrap();
    // ACN: W, Y (left), Z, X (ahead).
    for (channel, length_m) in [(3, 5.0), (1, 10.0)] {
        let samples = heard.channel(channel);
        let peak = (0..samples.len()).max_by(|a, b| samples[*a].total_cmp(&samples[*b])).unwrap();
        let expected = (length_m / air.speed_of_sound_m_s() + 1e-3 * length_m) * f64::from(RATE_HZ);
        assert!((peak as f64 - expected).abs() <= 0.5, "channel {channel}: {peak} for {expected}");
    }
}

#[test]
fn a_law_of_paths_is_heard_in_its_octave() {
    let paths = two_pulses();
    let laws = bound(
        LawTarget::Path,
        "-a * (length_m / l) * above(frequency_hz, f)",
        &[("a", 6.0, "dB"), ("l", 10.0, "m"), ("f", 1.0, "kHz")],
    );
    let (plain, under) = (pressure(&paths, None), pressure(&paths, Some(&laws)));
    let rate = f64::from(RATE_HZ);
    // Around each pulse: 3 dB less of the first, 6 dB of the second, from 1 kHz on, away from the edge.
    for (length_m, change_db) in [(5.0, -3.0), (10.0, -6.0)] {
        let at = (length_m / Air::default().speed_of_sound_m_s() * rate) as usize;
        for (band, expected_db) in [(1, 0.0), (2, 0.0), (5, change_db), (6, change_db)] {
            let energy = |samples: &[f32]| -> f64 {
                let mut around = vec![0.0f32; 4096];
                around[2048 - 300..2048 + 300].copy_from_slice(&samples[at - 300..at + 300]);
                octave(&around, rate, Bands::SIMULATION, band).iter().map(|v| v * v).sum()
            };
            let found_db = 10.0 * (energy(&under) / energy(&plain)).log10();
            assert!(
                (found_db - expected_db).abs() < 0.3,
                "band {band}, {length_m} m: {found_db} for {expected_db}"
            );
        }
    }
}

#[test]
fn added_energy_is_noise_that_decays_as_the_law_says() {
    let paths = two_pulses();
    // 60 dB/s: a decay time of 1 s.
    let laws =
        bound(LawTarget::Added, "a - b * time_after_direct_s", &[("a", 10.0, "dB"), ("b", 60.0, "dB/s")]);
    let (plain, under) = (pressure(&paths, None), pressure(&paths, Some(&laws)));
    let added: Vec<f32> = under.iter().zip(&plain).map(|(a, b)| a - b).collect();
    let rate = f64::from(RATE_HZ);
    let first = (5.0 / Air::default().speed_of_sound_m_s() * rate) as usize;
    assert!(added[..first].iter().all(|s| s.abs() < 1e-6), "sound before the direct sound");
    for band in 2..7 {
        let filtered = octave(&added, rate, Bands::SIMULATION, band);
        let energy: f64 = filtered.iter().map(|v| v * v).sum();
        let mut impulse = vec![0.0f32; RATE_HZ as usize];
        impulse[RATE_HZ as usize / 2] = 1.0;
        let passed: f64 = octave(&impulse, rate, Bands::SIMULATION, band).iter().map(|v| v * v).sum();
        // 10 per second, falling by 60 dB/s, to the end of the response.
        let slope = 6.0 * std::f64::consts::LN_10;
        let wanted = 10.0 / slope * passed;
        let off_db = 10.0 * (energy / wanted).log10();
        assert!(off_db.abs() < 0.3, "band {band}: {off_db} dB");
        let found_s = measured_t_s(&added, rate, Bands::SIMULATION, band, -25.0);
        assert!((found_s - 1.0).abs() < 0.08, "band {band}: {found_s} s");
    }
}
