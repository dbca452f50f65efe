//! Standing waves of the laboratory against the images in whose place they stand and against first-order theory.

use crate::rooms::{db, energy, samples, seven_octaves};
use crate::spectrum::middle_of_octave;
use sabine_testkit::{BoxModes, Hidden, Laboratory, Truth, at_night};

/// Width of a window of the decay, in seconds.
const WINDOW_S: f64 = 0.05;

fn modal(lab: &Laboratory) -> (Hidden, f64) {
    let hidden = Hidden::random("room_modes", 1.0, lab, 1).unwrap();
    let Hidden::RoomModes { below_hz } = hidden else { panic!("{hidden:?}") };
    (hidden, below_hz)
}

/// Energy of an octave in windows, over all receivers.
fn decay(lab: &Laboratory, responses: &[Vec<f64>], band: usize) -> Vec<f64> {
    let rate = lab.config().sample_rate_hz;
    let window = (WINDOW_S * f64::from(rate)) as usize;
    let mut sums = vec![0.0; 7];
    for response in responses {
        let filtered = middle_of_octave(response, rate, lab.config().bands, band);
        for (sum, part) in sums.iter_mut().zip(filtered.chunks(window)) {
            *sum += energy(part);
        }
    }
    sums
}

/// Fall of the lowest octave between two windows in dB if each mode rings with its own decay and as loud as the places have it
/// (Kuttruff, Room Acoustics, equation 3.10); between modes nothing is left of the beats over 12 receivers.
fn modal_fall_db(truth: &Truth, from: usize, to: usize) -> f64 {
    let speed_m_s = truth.air().unwrap().speed_of_sound_m_s();
    let beta = truth.faces.map(|m| BoxModes::admittance(truth.materials[m].absorption[0]));
    let walls = BoxModes::new(truth.size_m, beta, speed_m_s);
    let square = |n: [u32; 3], at: [f64; 3]| -> f64 {
        let one = |a: usize| {
            let factor = if n[a] == 0 { 1.0 } else { 2.0 };
            factor * (std::f64::consts::PI * f64::from(n[a]) * at[a] / truth.size_m[a]).cos().powi(2)
        };
        (0..3).map(one).product()
    };
    let modes: Vec<(f64, f64)> = walls
        .rigid_modes_hz(250.0)
        .iter()
        .map(|(_, n)| (*n, walls.mode(*n)))
        .filter(|(_, (hz, _))| (88.0..177.0).contains(hz))
        .map(|(n, (hz, decay_per_s))| {
            let heard: f64 = truth.receivers_m.iter().map(|r| square(n, *r)).sum();
            (2.0 * decay_per_s, heard * square(n, truth.sources[0].position_m) / (hz * hz))
        })
        .collect();
    let energy = |window: usize| -> f64 {
        let start_s = window as f64 * WINDOW_S;
        let one =
            |(rate, w): &(f64, f64)| w * (-rate * start_s).exp() * (1.0 - (-rate * WINDOW_S).exp()) / rate;
        modes.iter().map(one).sum()
    };
    db(energy(from) / energy(to))
}

#[test]
fn standing_waves_are_as_loud_and_last_as_long_as_theory_has_it() {
    let (mut level_off_db, mut fall_off_db) = (Vec::new(), Vec::new());
    for seed in [601, 602, 603].into_iter().take(if at_night() { 3 } else { 2 }) {
        let lab = seven_octaves(seed, 12);
        let (hidden, below_hz) = modal(&lab);
        assert!((280.0..=400.0).contains(&below_hz), "{below_hz} Hz");
        let (waves, images) = (samples(&lab, std::slice::from_ref(&hidden)), samples(&lab, &[]));
        let (low_waves, low_images) = (decay(&lab, &waves, 0), decay(&lab, &images, 0));
        // Away from walls there is less: the energy near them counts as more volume, S lambda / 8 (Waterhouse 1955, JASA 27, 247).
        let truth = lab.truth(&[]).unwrap();
        let [x, y, z] = truth.size_m;
        let surface = 2.0 * (x * y + x * z + y * z);
        let wave_length_m = truth.air().unwrap().speed_of_sound_m_s() / 125.0;
        let expected_db = -db(1.0 + surface * wave_length_m / (8.0 * x * y * z));
        level_off_db.push(db(low_waves.iter().sum::<f64>() / low_images.iter().sum::<f64>()) - expected_db);
        fall_off_db.push(db(low_waves[1] / low_waves[5]) - modal_fall_db(&truth, 1, 5));
        // Where the images have stayed, nothing has changed.
        let above = (0..7).find(|&b| lab.config().bands.edges_hz(b).0 > 1.2 * below_hz).unwrap();
        let (of_waves, of_images) = (decay(&lab, &waves, above), decay(&lab, &images, above));
        for (a, b) in of_waves.iter().zip(&of_images) {
            assert!((db(a / b)).abs() < 0.01, "band {above}: {of_waves:?} {of_images:?}");
        }
    }
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    println!("level {level_off_db:.2?} dB, fall {fall_off_db:.2?} dB");
    assert!(
        mean(&level_off_db).abs() < 0.7 && level_off_db.iter().all(|d| d.abs() < 1.5),
        "{level_off_db:.2?} dB"
    );
    assert!(
        mean(&fall_off_db).abs() < 1.5 && fall_off_db.iter().all(|d| d.abs() < 3.0),
        "{fall_off_db:.2?} dB"
    );
}
