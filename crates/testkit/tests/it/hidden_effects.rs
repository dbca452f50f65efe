//! Each effect of the laboratory against a closed form or against the other oracles.

use crate::rooms::{db, energy, one_octave, samples, seven_octaves, true_places};
use crate::spectrum::middle_of_octave;
use sabine_acoustics::Air;
use sabine_testkit::{
    End, Fault, Gap, Hidden, Laboratory, PhononConfig, Phonons, ShoeboxImages, assert_all_close, assert_close,
};

/// Every early image of the true room is where it must be, as large as it must be.
fn check_first_arrivals(lab: &Laboratory, effects: &[Hidden]) {
    let truth = lab.truth(effects).unwrap();
    let (scene, air) = (lab.true_scene(effects).unwrap(), truth.air().unwrap());
    let bands = lab.config().bands;
    let (speed, exponent) = (air.speed_of_sound_m_s(), air.energy_exponent_per_m(bands).values()[0]);
    let mut checked = 0;
    for (index, found) in samples(lab, effects).iter().enumerate() {
        let (mut source, mut receiver) = true_places(&truth, index);
        // In the coordinates of the declared room, as the scene is.
        for k in 0..3 {
            source.position_m[k] += truth.origin_m[k];
            receiver.position_m[k] += truth.origin_m[k];
        }
        let images = ShoeboxImages::new(0.03).unwrap().images(&scene, &source, &receiver, &air).unwrap();
        let at = |i: usize| images[i].length_m / speed * f64::from(lab.config().sample_rate_hz);
        for (i, image) in images.iter().enumerate().take(10) {
            // Those that stand alone.
            if (i > 0 && at(i) - at(i - 1) < 40.0) || at(i + 1) - at(i) < 40.0 {
                continue;
            }
            let walls: f64 = images[i]
                .hits
                .iter()
                .zip(truth.faces)
                .map(|(&n, m)| (1.0 - truth.materials[m].absorption[0]).powi(n as i32))
                .product();
            let amplitude = (walls * (-exponent * image.length_m).exp()).sqrt() / image.length_m;
            // Between samples the pulse is what a sinc makes of them.
            let sum: f64 = (-20..=20)
                .map(|k| {
                    let n = at(i).round() as i64 + k;
                    let x = std::f64::consts::PI * (n as f64 - at(i));
                    let sinc = if x.abs() < 1e-9 { 1.0 } else { x.sin() / x };
                    found[n as usize] * sinc
                })
                .sum();
            assert_close("amplitude", sum.abs(), amplitude, 0.0, 0.06);
            if i == 0 {
                assert!(sum > 0.0, "the direct sound is positive");
            }
            checked += 1;
        }
    }
    assert!(checked >= 5, "{checked} arrivals stand alone");
}

#[test]
fn arrivals_are_those_of_the_true_room() {
    let lab = one_octave(5, 6, 48_000);
    check_first_arrivals(&lab, &[]);
    check_first_arrivals(&lab, &[Hidden::RoomDimensions { scale: [1.03, 1.0, 0.98] }]);
    check_first_arrivals(&lab, &[Hidden::SurfaceDisplacement { face: 2, offset_m: 0.41 }]);
    check_first_arrivals(&lab, &[Hidden::SurfaceDisplacement { face: 5, offset_m: -0.2 }]);
    check_first_arrivals(&lab, &[Hidden::SoundSpeed { temperature_offset_k: 8.0 }]);
    let offset_m = [0.2, -0.15, 0.1];
    check_first_arrivals(&lab, &[Hidden::PositionError { end: End::Receiver, index: 2, offset_m }]);
    check_first_arrivals(&lab, &[Hidden::PositionError { end: End::Source, index: 0, offset_m }]);
    check_first_arrivals(&lab, &[Hidden::CoordinateShift { shift_m: offset_m, turn_deg: -4.0 }]);
    check_first_arrivals(&lab, &[Hidden::SurfaceAbsorption { material: 1, absorption: vec![0.7] }]);
    // What is declared stays as it is.
    let moved = lab.truth(&[Hidden::PositionError { end: End::Source, index: 0, offset_m }]).unwrap();
    for (k, offset) in offset_m.into_iter().enumerate() {
        let shift = moved.sources[0].position_m[k] - lab.sources()[0].position_m[k];
        assert_close("offset (m)", shift, offset, 1e-12, 0.0);
    }
}

/// Five faces and all places stay where they are, and the sixth stands where it was put.
#[test]
fn a_displaced_face_leaves_everything_else_in_its_place() {
    let lab = one_octave(5, 6, 48_000);
    let declared = lab.truth(&[]).unwrap();
    let faces = |scene: &sabine_scene::Scene| -> Vec<f64> {
        let along = |k: usize| scene.vertices().iter().map(move |v| v[k]);
        (0..3)
            .flat_map(|k| {
                [along(k).fold(f64::INFINITY, f64::min), along(k).fold(f64::NEG_INFINITY, f64::max)]
            })
            .collect()
    };
    let before = faces(lab.scene());
    for face in 0..6 {
        let hidden = [Hidden::SurfaceDisplacement { face, offset_m: 0.3 }];
        let truth = lab.truth(&hidden).unwrap();
        for (i, (found, stated)) in faces(&lab.true_scene(&hidden).unwrap()).iter().zip(&before).enumerate() {
            let outwards = if i.is_multiple_of(2) { -0.3 } else { 0.3 };
            assert_close("face (m)", *found, stated + if i == face { outwards } else { 0.0 }, 1e-12, 0.0);
        }
        for k in 0..3 {
            let place = |t: &sabine_testkit::Truth| {
                [t.sources[0].position_m[k] + t.origin_m[k], t.receivers_m[2][k] + t.origin_m[k]]
            };
            let (now, then) = (place(&truth), place(&declared));
            assert_close("source (m)", now[0], then[0], 1e-12, 0.0);
            assert_close("receiver (m)", now[1], then[1], 1e-12, 0.0);
        }
    }
    // No place may be behind it.
    let refused: Vec<bool> = (0..6)
        .map(|face: usize| {
            let axis = face / 2;
            let low = face.is_multiple_of(2);
            let before =
                |place: [f64; 3]| if low { place[axis] } else { declared.size_m[axis] - place[axis] };
            let nearest = (declared.receivers_m.iter().map(|place| before(*place)))
                .chain([before(declared.sources[0].position_m)])
                .fold(f64::INFINITY, f64::min);
            let at = |offset_m: f64| lab.truth(&[Hidden::SurfaceDisplacement { face, offset_m }]);
            assert!(at(0.06 - nearest.min(1.0)).is_ok(), "face {face}, nearest {nearest} m");
            nearest < 1.0 && at(0.04 - nearest).is_err()
        })
        .collect();
    assert!(refused.contains(&true), "no place is within a metre of any face");
    assert!(lab.truth(&[Hidden::SurfaceDisplacement { face: 6, offset_m: 0.1 }]).is_err());
}

/// Distances and angles between places, and between axes and places, stay; the centre of all places is shifted.
#[test]
fn places_in_other_coordinates_move_as_one_body() {
    let lab = one_octave(5, 6, 48_000);
    let (shift_m, turn_deg) = ([0.2, -0.15, 0.1], 5.0f64);
    let declared = lab.truth(&[]).unwrap();
    let truth = lab.truth(&[Hidden::CoordinateShift { shift_m, turn_deg }]).unwrap();
    let places = |t: &sabine_testkit::Truth| -> Vec<[f64; 3]> {
        t.sources.iter().map(|s| s.position_m).chain(t.receivers_m.iter().copied()).collect()
    };
    let minus = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| a[k] - b[k]) };
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let (before, after) = (places(&declared), places(&truth));
    let source = |t: &sabine_testkit::Truth| (t.sources[0].position_m, t.sources[0].axis);
    let ((from, axis), (to, turned)) = (source(&declared), source(&truth));
    for (one, other) in before.iter().zip(&after) {
        let ways = (minus(*one, from), minus(*other, to));
        assert_close("distance (m)", dot(ways.1, ways.1).sqrt(), dot(ways.0, ways.0).sqrt(), 1e-12, 0.0);
        assert_close("along the axis (m)", dot(ways.1, turned), dot(ways.0, axis), 1e-12, 0.0);
        // From above, counter-clockwise.
        let across = ways.0[0] * ways.1[1] - ways.0[1] * ways.1[0];
        let level2 = ways.0[0].powi(2) + ways.0[1].powi(2);
        assert_close("turn", across, level2 * turn_deg.to_radians().sin(), 1e-12, 0.0);
    }
    let axes = |t: &sabine_testkit::Truth| [t.microphones[2].axis, t.sources[0].axis];
    let cosine = |[a, b]: [[f64; 3]; 2]| dot(a, b);
    assert_close("axes", cosine(axes(&truth)), cosine(axes(&declared)), 1e-12, 0.0);
    for (k, shift) in shift_m.into_iter().enumerate() {
        let mean = |all: &[[f64; 3]]| all.iter().map(|p| p[k]).sum::<f64>() / all.len() as f64;
        assert_close("centre (m)", mean(&after) - mean(&before), shift, 1e-12, 0.0);
    }
    // What is declared stays as it is.
    assert_eq!(
        lab.sources()[0].position_m,
        Laboratory::new(lab.config().clone()).unwrap().sources()[0].position_m
    );
    for refused in [([2.1, 0.0, 0.0], 0.0), ([0.0; 3], 31.0)] {
        let hidden = Hidden::CoordinateShift { shift_m: refused.0, turn_deg: refused.1 };
        assert!(lab.truth(&[hidden]).is_err());
    }
}

/// 20 000 ppm, so that the direct sound moves by whole samples.
#[test]
fn clock_and_latency_move_the_onset() {
    let lab = one_octave(7, 4, 48_000);
    let truth = lab.truth(&[]).unwrap();
    let onset = |s: &[f64]| (0..s.len()).max_by(|&a, &b| s[a].abs().total_cmp(&s[b].abs())).unwrap();
    let (plain, fast) = (samples(&lab, &[]), samples(&lab, &[Hidden::SamplingClock { ppm: 2e4 }]));
    let late = samples(&lab, &[Hidden::TimeZero { latency_s: 0.005 }]);
    for r in 0..4 {
        let (source, receiver) = true_places(&truth, r);
        let square: f64 = (0..3).map(|k| (source.position_m[k] - receiver.position_m[k]).powi(2)).sum();
        let due = square.sqrt() / truth.air().unwrap().speed_of_sound_m_s() * 48e3;
        let first = |s: &[f64], near: f64| {
            let from = near as usize - 3;
            from + onset(&s[from..from + 8])
        };
        assert!((first(&plain[r], due) as f64 - due).abs() <= 0.51);
        assert!((first(&fast[r], due * 1.02) as f64 - due * 1.02).abs() <= 0.51);
        let n = plain[r].len();
        assert_all_close("5 ms later", &late[r][240..n], &plain[r][..n - 240], 2e-3 * peak(&plain[r]), 0.0);
    }
}

fn peak(samples: &[f64]) -> f64 {
    samples.iter().fold(0.0, |p, s| p.max(s.abs()))
}

#[test]
fn a_transducer_changes_each_octave_by_its_gain() {
    let lab = seven_octaves(8, 1);
    let gains_db = vec![4.0, 2.0, -1.0, -4.0, -5.0, -1.0, 3.0];
    let plain = samples(&lab, &[]);
    let changed = samples(&lab, &[Hidden::TransducerResponse { gains_db: gains_db.clone() }]);
    let (bands, rate) = (lab.config().bands, lab.config().sample_rate_hz);
    for (band, gain_db) in gains_db.into_iter().enumerate() {
        let of = |s: &[f64]| energy(&middle_of_octave(s, rate, bands, band));
        // Crossovers ring for a tenth of a second at low frequencies; what would come before the first sample is cut off.
        let tolerance = if band < 2 { 0.2 } else { 0.03 };
        assert_close("gain (dB)", db(of(&changed[0]) / of(&plain[0])), gain_db, tolerance, 0.0);
    }
}

/// The same images with another air: window by window the level differs by the attenuation over the way.
#[test]
fn dry_air_takes_what_iso_9613_says() {
    let lab = seven_octaves(9, 2);
    let truth = lab.truth(&[]).unwrap();
    let (bands, rate) = (lab.config().bands, lab.config().sample_rate_hz);
    let dry = Air::new(truth.temperature_c, 12.0, truth.pressure_kpa).unwrap();
    let plain = samples(&lab, &[]);
    let changed = samples(&lab, &[Hidden::AirAbsorption { relative_humidity_percent: 12.0 }]);
    for band in 3..bands.len() {
        let per_m = dry.attenuation_db_per_m(bands.exact_hz(band))
            - truth.air().unwrap().attenuation_db_per_m(bands.exact_hz(band));
        for (a, b) in plain.iter().zip(&changed) {
            let (a, b) = (middle_of_octave(a, rate, bands, band), middle_of_octave(b, rate, bands, band));
            for window in 2..12 {
                let (from, to) = (window * 960, (window + 1) * 960);
                // Where in the window the energy lies.
                let centre: f64 =
                    (from..to).map(|i| i as f64 * a[i] * a[i]).sum::<f64>() / energy(&a[from..to]);
                let length_m = centre / f64::from(rate) * truth.air().unwrap().speed_of_sound_m_s();
                let change = db(energy(&b[from..to]) / energy(&a[from..to]));
                assert_close("change (dB)", change, -per_m * length_m, 0.15, 0.03);
            }
        }
    }
}

#[test]
fn the_direct_sound_follows_the_pattern() {
    let lab = one_octave(10, 10, 48_000);
    let truth = lab.truth(&[]).unwrap();
    let q = 0.4;
    let plain = samples(&lab, &[]);
    let changed = samples(&lab, &[Hidden::SourceDirectivity { omni_share: vec![q], axis: None }]);
    let axis = lab.sources()[0].axis.unwrap();
    for (r, place) in truth.receivers_m.iter().enumerate() {
        let way: Vec<f64> = (0..3).map(|k| place[k] - truth.sources[0].position_m[k]).collect();
        let length = energy(&way).sqrt();
        let cosine = (0..3).map(|k| way[k] * axis[k]).sum::<f64>() / length;
        let at = (length / truth.air().unwrap().speed_of_sound_m_s() * 48e3).round() as usize;
        // Radiated power is that of the omnidirectional source: the mean square of the pattern over the sphere is q^2 + (1 - q)^2 / 3.
        let expected = (q + (1.0 - q) * cosine) / (q * q + (1.0 - q) * (1.0 - q) / 3.0).sqrt();
        assert_close("gain", changed[r][at] / plain[r][at], expected, 0.06, 0.06);
    }
}

#[test]
fn the_direct_sound_follows_the_microphone() {
    let lab = one_octave(20, 10, 48_000);
    let q = 0.6;
    let effect = Hidden::ReceiverDirectivity { omni_share: vec![q], axis: None };
    let truth = lab.truth(std::slice::from_ref(&effect)).unwrap();
    let (plain, changed) = (samples(&lab, &[]), samples(&lab, &[effect]));
    for (r, (place, microphone)) in truth.receivers_m.iter().zip(&truth.microphones).enumerate() {
        let way: Vec<f64> = (0..3).map(|k| truth.sources[0].position_m[k] - place[k]).collect();
        let length = energy(&way).sqrt();
        let cosine = (0..3).map(|k| way[k] * microphone.axis[k]).sum::<f64>() / length;
        let at = (length / truth.air().unwrap().speed_of_sound_m_s() * 48e3).round() as usize;
        // Sensitivity in a diffuse field is that of the omnidirectional microphone.
        let expected = (q + (1.0 - q) * cosine) / (q * q + (1.0 - q) * (1.0 - q) / 3.0).sqrt();
        assert_close("gain", changed[r][at] / plain[r][at], expected, 0.06, 0.06);
    }
}

#[test]
fn a_channel_changes_its_own_octaves_and_no_other_channel() {
    let lab = seven_octaves(21, 2);
    let gains_db = vec![3.0, 2.0, -1.0, -3.0, -2.0, 1.0, 3.0];
    let hidden = Hidden::ChannelResponse { gains_db: vec![vec![0.0; 7], gains_db.clone()] };
    let (plain, changed) = (samples(&lab, &[]), samples(&lab, &[hidden]));
    assert_eq!(plain[0], changed[0]);
    let (bands, rate) = (lab.config().bands, lab.config().sample_rate_hz);
    for (band, gain_db) in gains_db.into_iter().enumerate() {
        let of = |s: &[f64]| energy(&middle_of_octave(s, rate, bands, band));
        let tolerance = if band < 2 { 0.2 } else { 0.03 };
        assert_close("gain (dB)", db(of(&changed[1]) / of(&plain[1])), gain_db, tolerance, 0.0);
    }
}

/// The particles of another program, with their statistical spread.
#[test]
fn scattering_rooms_hold_the_energies_of_particles() {
    let lab = one_octave(11, 6, 8_000);
    let effect = Hidden::Scattering { scattering: vec![0.4] };
    let (truth, scene) = (
        lab.truth(std::slice::from_ref(&effect)).unwrap(),
        lab.true_scene(std::slice::from_ref(&effect)).unwrap(),
    );
    let found = samples(&lab, &[effect]);
    let window_s = 0.04;
    let windows = 6;
    let config = PhononConfig { particles: 16_000, duration_s: 0.24, ..PhononConfig::default() };
    let particles = Phonons::new(&scene, config).unwrap();
    let (mut wanted, mut variance) = (vec![0.0; windows], vec![0.0; windows]);
    for r in 0..found.len() {
        let (source, receiver) = true_places(&truth, r);
        let one = particles.energy(&source, &receiver, Some(&truth.air().unwrap()), window_s).unwrap();
        for w in 0..windows {
            wanted[w] += one.response.band(0)[w];
            variance[w] += one.response.band_standard_error(0)[w].powi(2);
        }
    }
    for w in 1..windows {
        let (from, to) = ((w as f64 * window_s * 8e3) as usize, ((w + 1) as f64 * window_s * 8e3) as usize);
        let sum: f64 = found.iter().map(|s| energy(&s[from..to])).sum();
        // Signs and noise over 4 kHz, and the two sets of particles.
        let chance = 1.0 / (4e3 * window_s * found.len() as f64);
        let spread = (chance + 2.0 * variance[w] / wanted[w].powi(2)).sqrt();
        let off = (sum / wanted[w] - 1.0) / spread;
        assert!(off.abs() < 4.0, "window {w}: {sum} for {} is {off:.1} standard errors off", wanted[w]);
        assert!(spread < 0.12, "window {w}: {spread} tells little");
    }
}

#[test]
fn background_noise_has_the_level_asked_for() {
    let lab = seven_octaves(12, 3);
    let levels_db = vec![-25.0, -28.0, -31.0, -30.0, -29.0, -27.0, -24.0];
    let plain = samples(&lab, &[]);
    let noisy = samples(&lab, &[Hidden::BackgroundNoise { levels_db: levels_db.clone() }]);
    let (bands, rate) = (lab.config().bands, lab.config().sample_rate_hz);
    for (band, level_db) in levels_db.into_iter().enumerate() {
        let mut strongest: Vec<f64> = plain
            .iter()
            .map(|s| {
                let s = middle_of_octave(s, rate, bands, band);
                s.windows(960).step_by(24).map(energy).fold(0.0, f64::max) / 960.0
            })
            .collect();
        strongest.sort_by(f64::total_cmp);
        let mut power = 0.0;
        for (a, b) in plain.iter().zip(&noisy) {
            let noise: Vec<f64> = a.iter().zip(b).map(|(a, b)| b - a).collect();
            power += energy(&middle_of_octave(&noise, rate, bands, band)) / noise.len() as f64 / 3.0;
        }
        // In low octaves 20 ms hold few oscillations: their strongest 20 ms depend on the filter.
        let tolerance = if band < 2 { 3.5 } else { 1.5 };
        assert_close("level (dB)", db(power / strongest[1]), level_db, tolerance, 0.0);
    }
}

#[test]
fn a_coupled_volume_decays_as_it_should() {
    let lab = one_octave(13, 4, 8_000);
    let truth = lab.truth(&[]).unwrap();
    let aperture_m = [0.0, 0.5 * truth.size_m[1], 1.2];
    let effect = Hidden::CoupledVolume {
        level_db: -20.0,
        decay_s: vec![2.0],
        aperture_m,
        critical_distance_m: 1.5,
        rise_s: 0.007,
    };
    let (plain, coupled) = (samples(&lab, &[]), samples(&lab, &[effect]));
    let diffuse = 4.0 * std::f64::consts::PI * truth.air().unwrap().speed_of_sound_m_s()
        / truth.size_m.iter().product::<f64>();
    let mut ratios = vec![0.0; 10];
    for r in 0..4 {
        let distance_m =
            |from: [f64; 3]| (0..3).map(|k| (truth.receivers_m[r][k] - from[k]).powi(2)).sum::<f64>().sqrt();
        let direct_s = distance_m(truth.sources[0].position_m) / truth.air().unwrap().speed_of_sound_m_s();
        let near = 1.0 + (1.5 / distance_m(aperture_m)).powi(2);
        let tail: Vec<f64> = plain[r].iter().zip(&coupled[r]).map(|(a, b)| b - a).collect();
        for (w, ratio) in ratios.iter_mut().enumerate() {
            let from = ((direct_s + 0.05 * (w + 1) as f64) * 8e3) as usize;
            let mean_s = (from + 200) as f64 / 8e3 - direct_s;
            let expected = diffuse * near * 1e-2 * 10f64.powf(-6.0 * mean_s / 2.0) * 0.05;
            *ratio += energy(&tail[from..from + 400]) / expected / 4.0;
        }
    }
    // 400 independent samples in each of four windows: 3.5 % of spread.
    assert_all_close("energy of the tail", &ratios, &[1.0; 10], 0.14, 0.0);
    assert_close("mean", ratios.iter().sum::<f64>() / 10.0, 1.0, 0.045, 0.0);
    assert!(coupled[0].len() > plain[0].len(), "the response is long enough for the tail");
}

#[test]
fn a_truncated_response_is_silent_after_its_end() {
    let lab = one_octave(14, 1, 24_000);
    let (plain, cut) =
        (samples(&lab, &[]), samples(&lab, &[Hidden::Truncation { end_s: 0.2, fade_s: 0.02 }]));
    assert_eq!(cut[0].len(), plain[0].len());
    assert!(cut[0][4800..].iter().all(|&s| s == 0.0));
    assert_eq!(cut[0][..4320], plain[0][..4320]);
    assert_close("half way", energy(&cut[0][4440..4680]) / energy(&plain[0][4440..4680]), 0.27, 0.08, 0.0);
}

#[test]
fn faults_of_channels_are_exact() {
    let lab = one_octave(15, 4, 24_000);
    let plain = lab.responses(&[]).unwrap();
    let with = |fault| lab.responses(&[Hidden::ChannelFault { fault }]).unwrap();
    let swapped = with(Fault::Swap { a: 1, b: 3 });
    assert_eq!([&swapped[0], &swapped[1], &swapped[3]], [&plain[0], &plain[3], &plain[1]]);
    let turned = with(Fault::Polarity { response: 2 });
    assert!(turned[2].samples().iter().zip(plain[2].samples()).all(|(a, b)| *a == -b));
    assert_eq!(turned[1], plain[1]);
    let loud = with(Fault::Gain { response: 0, gain_db: 10.0 });
    let ratio = f64::from(loud[0].peak() / plain[0].peak());
    assert_close("gain", ratio, 10f64.sqrt(), 0.0, 1e-6);
    assert_eq!(loud[1], plain[1]);
}

#[test]
fn what_no_catalogue_holds_does_what_it_says() {
    let lab = one_octave(16, 2, 24_000);
    let plain = lab.responses(&[]).unwrap();
    let drift = Hidden::GainDrift { depth_db: 4.0, period_s: 0.2, phase_rad: 0.0 };
    let drifted = lab.responses(&[drift]).unwrap();
    let ratio = |i: usize| f64::from(drifted[0].samples()[i] / plain[0].samples()[i]);
    assert_close("after a quarter of the period", 20.0 * ratio(1200).log10(), 4.0, 1e-3, 0.0);
    assert_close("after three quarters", 20.0 * ratio(3600).log10(), -4.0, 1e-3, 0.0);

    let gap = Gap { response: 1, start_s: 0.1, length_s: 0.03 };
    let gapped = lab.responses(&[Hidden::Dropouts { gaps: vec![gap] }]).unwrap();
    assert_eq!(gapped[0], plain[0]);
    assert!(gapped[1].samples()[2424..3096].iter().all(|&s| s == 0.0));
    assert_eq!(gapped[1].samples()[..2400], plain[1].samples()[..2400]);
    assert_eq!(gapped[1].samples()[3121..], plain[1].samples()[3121..]);

    let chirp =
        Hidden::ForeignChirp { start_s: 0.1, length_s: 0.1, from_hz: 700.0, to_hz: 2800.0, level_db: 6.0 };
    let sung = lab.responses(&[chirp]).unwrap();
    let added: Vec<f64> =
        sung[0].samples().iter().zip(plain[0].samples()).map(|(a, b)| f64::from(a - b)).collect();
    assert!(added[..2400].iter().chain(&added[4800..]).all(|s| *s == 0.0));
    // Two octaves of a decay that is white up to 12 kHz hold 2.1 / 12 of its energy.
    let there: f64 =
        plain[0].samples()[2400..4800].iter().map(|s| f64::from(s * s)).sum::<f64>() * 2.1 / 12.0;
    assert_close("level (dB)", db(energy(&added) / there), 6.0, 1.5, 0.0);
    // It rises: more zero crossings in its second half.
    let crossings = |s: &[f64]| s.windows(2).filter(|w| w[0] * w[1] < 0.0).count();
    assert!(crossings(&added[3600..4800]) as f64 > 1.6 * crossings(&added[2400..3600]) as f64);
}
