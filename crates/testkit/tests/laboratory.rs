//! The laboratory against closed forms and against the other oracles.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod spectrum;

use sabine_acoustics::{
    Air, Error, ImpulseResponse, Levels, MeasuredRoom, OctaveBands, Receiver, Source, TimeZero,
};
use sabine_testkit::{
    End, Fault, Gap, Hidden, LabConfig, Laboratory, PhononConfig, Phonons, ShoeboxImages, Truth,
    assert_all_close, assert_close,
};
use spectrum::{middle_of_octave, widths_hz};

/// One octave, which then reaches from 0 Hz to Nyquist: samples are pulses as they are.
fn one_octave(seed: u64, receivers: usize, sample_rate_hz: u32) -> Laboratory {
    let bands = OctaveBands::new(1000.0, 1000.0).unwrap();
    let config = LabConfig {
        seed,
        receivers,
        sample_rate_hz,
        bands,
        levels: Levels::Absolute,
        ..LabConfig::default()
    };
    Laboratory::new(config).unwrap()
}

/// Of some rooms the one with the fewest images.
fn quick_room(receivers: usize) -> Laboratory {
    let images = |lab: &Laboratory| lab.truth(&[]).unwrap().duration_s.powi(3) / lab.scene().volume_m3();
    let labs = (30..50).map(|seed| one_octave(seed, receivers, 8_000));
    labs.min_by(|a, b| images(a).total_cmp(&images(b))).unwrap()
}

fn seven_octaves(seed: u64, receivers: usize) -> Laboratory {
    let config = LabConfig { seed, receivers, levels: Levels::Absolute, ..LabConfig::default() };
    Laboratory::new(config).unwrap()
}

/// Samples with the response's gain taken off.
fn samples(lab: &Laboratory, effects: &[Hidden]) -> Vec<Vec<f64>> {
    let truth = lab.truth(effects).unwrap();
    let plain = |(r, gain_db): (ImpulseResponse, f64)| {
        let gain = 10f64.powf(-gain_db / 20.0);
        r.samples().iter().map(|&s| f64::from(s) * gain).collect()
    };
    lab.responses(effects).unwrap().into_iter().zip(truth.gains_db).map(plain).collect()
}

fn energy(samples: &[f64]) -> f64 {
    samples.iter().map(|s| s * s).sum()
}

fn true_places(truth: &Truth, receiver: usize) -> (Source, Receiver) {
    let source = Source::omni("s", truth.sources[0].position_m).unwrap();
    (source, Receiver::omni("r", truth.receivers_m[receiver]).unwrap())
}

fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

/// Energies in windows of 50 ms over all receivers, against a plain sum of images; random signs scatter them by 1 / sqrt(B t).
#[test]
fn null_rooms_follow_the_energies_of_images() {
    let lab = seven_octaves(3, 8);
    let truth = lab.truth(&[]).unwrap();
    let (bands, rate) = (lab.config().bands, lab.config().sample_rate_hz);
    let responses = samples(&lab, &[]);
    let (scene, air) = (lab.true_scene(&[]).unwrap(), truth.air().unwrap());
    let window_s = 0.05;
    let windows = 10;
    let oracle = ShoeboxImages::new(window_s * windows as f64).unwrap();
    let expected: Vec<_> = (0..responses.len())
        .map(|r| {
            let (source, receiver) = true_places(&truth, r);
            oracle.energy_response(&scene, &source, &receiver, Some(&air), window_s).unwrap()
        })
        .collect();
    let mut scores = Vec::new();
    for band in 0..bands.len() {
        let (two_hz, four_hz) = widths_hz(bands, band);
        let share = two_hz / (0.5 * f64::from(rate));
        // Values of a band in a time: (integral of g^2)^2 / (integral of g^4).
        let width_hz = two_hz * two_hz / four_hz;
        let filtered: Vec<Vec<f64>> =
            responses.iter().map(|s| middle_of_octave(s, rate, bands, band)).collect();
        // The first window holds the direct sound, which has no random sign.
        for window in 1..windows {
            let from = (window as f64 * window_s * f64::from(rate)) as usize;
            let to = from + (window_s * f64::from(rate)) as usize;
            let found: f64 = filtered.iter().map(|s| energy(&s[from..to])).sum::<f64>() / share;
            let wanted: f64 = expected.iter().map(|e| e.band(band)[window]).sum();
            // What rings over from louder windows, and the noise, matter at the end only.
            let loudest: f64 = expected.iter().map(|e| e.band(band)[1]).sum();
            if wanted < 10f64.powf(-4.0) * loudest {
                continue;
            }
            let spread = 1.0 / (width_hz * window_s * responses.len() as f64).sqrt();
            scores.push((found / wanted - 1.0) / spread);
        }
    }
    let n = scores.len() as f64;
    assert!(n > 40.0, "{n} windows");
    let (mean, square) = (scores.iter().sum::<f64>() / n, energy(&scores) / n);
    assert!(scores.iter().all(|z| z.abs() < 4.5), "{scores:.1?}");
    assert!(mean.abs() < 4.0 / n.sqrt(), "mean {mean} of {n}");
    assert!((0.5..1.7).contains(&square), "mean square {square}");
}

/// Every early image of the true room is where it must be, as large as it must be.
fn check_first_arrivals(lab: &Laboratory, effects: &[Hidden]) {
    let truth = lab.truth(effects).unwrap();
    let (scene, air) = (lab.true_scene(effects).unwrap(), truth.air().unwrap());
    let bands = lab.config().bands;
    let (speed, exponent) = (air.speed_of_sound_m_s(), air.energy_exponent_per_m(bands).values()[0]);
    let mut checked = 0;
    for (index, found) in samples(lab, effects).iter().enumerate() {
        let (source, receiver) = true_places(&truth, index);
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
    check_first_arrivals(&lab, &[Hidden::SoundSpeed { temperature_offset_k: 8.0 }]);
    let offset_m = [0.2, -0.15, 0.1];
    check_first_arrivals(&lab, &[Hidden::PositionError { end: End::Receiver, index: 2, offset_m }]);
    check_first_arrivals(&lab, &[Hidden::PositionError { end: End::Source, index: 0, offset_m }]);
    check_first_arrivals(&lab, &[Hidden::SurfaceAbsorption { material: 1, absorption: vec![0.7] }]);
    // What is declared stays as it is.
    let moved = lab.truth(&[Hidden::PositionError { end: End::Source, index: 0, offset_m }]).unwrap();
    for (k, offset) in offset_m.into_iter().enumerate() {
        let shift = moved.sources[0].position_m[k] - lab.sources()[0].position_m[k];
        assert_close("offset (m)", shift, offset, 1e-12, 0.0);
    }
}

#[test]
fn levels_and_time_zero_are_as_unknown_as_declared() {
    let spread = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    };
    let truth = |time_zero, levels| {
        let config = LabConfig { seed: 22, time_zero, levels, ..LabConfig::default() };
        Laboratory::new(config).unwrap().truth(&[]).unwrap()
    };
    let absolute = truth(TimeZero::Emission, Levels::Absolute);
    assert!(absolute.latencies_s.iter().all(|&l| l == 0.0));
    assert!(absolute.gains_db.iter().all(|g| g.abs() < 1.5) && spread(&absolute.gains_db) > 0.1);
    let common = truth(TimeZero::Common, Levels::Common);
    assert!(spread(&common.latencies_s) == 0.0 && common.latencies_s[0] >= 1e-3);
    let shift_db = common.gains_db[0] - absolute.gains_db[0];
    assert!((0.01..=10.0).contains(&shift_db.abs()));
    for (a, b) in common.gains_db.iter().zip(&absolute.gains_db) {
        assert_close("gain (dB)", a - b, shift_db, 1e-12, 0.0);
    }
    let own = truth(TimeZero::PerResponse, Levels::PerResponse);
    assert!(spread(&own.latencies_s) > 2e-3 && own.latencies_s.iter().all(|l| (1e-3..=0.02).contains(l)));
    assert!(spread(&own.gains_db) > 3.0 && own.gains_db.iter().all(|g| g.abs() < 11.5));
}

#[test]
fn jitter_of_places_is_a_few_millimetres() {
    let lab = one_octave(6, 12, 24_000);
    let truth = lab.truth(&[]).unwrap();
    let offsets: Vec<f64> = lab
        .receivers()
        .iter()
        .zip(&truth.receivers_m)
        .flat_map(|(declared, real)| (0..3).map(|k| real[k] - declared.position_m[k]))
        .collect();
    let sd = (energy(&offsets) / offsets.len() as f64).sqrt();
    assert!((0.003..0.007).contains(&sd), "{sd} m");
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
        assert_all_close(
            "5 ms later",
            &late[r][240..n],
            &plain[r][..n - 240],
            2e-3 * lab_peak(&plain[r]),
            0.0,
        );
    }
}

fn lab_peak(samples: &[f64]) -> f64 {
    samples.iter().fold(0.0, |p, s| p.max(s.abs()))
}

/// What a shift by 5 ms leaves is the noise, twice: -63 dB over the response in the octave and the response where it is worst, so
/// that 50 dB of every decay are clean.
#[test]
fn the_floor_lies_far_below_each_octave() {
    let lab = seven_octaves(7, 2);
    let (bands, rate) = (lab.config().bands, lab.config().sample_rate_hz);
    let (plain, late) = (samples(&lab, &[]), samples(&lab, &[Hidden::TimeZero { latency_s: 0.005 }]));
    let mut worst = f64::NEG_INFINITY;
    for (a, b) in plain.iter().zip(&late) {
        // The first milliseconds ring over from before the first sample.
        let noise: Vec<f64> = (4800..a.len()).map(|i| b[i + 240] - a[i]).collect();
        for band in 0..bands.len() {
            let power = energy(&middle_of_octave(&noise, rate, bands, band)) / noise.len() as f64 / 2.0;
            let level_db = db(power * a.len() as f64 / energy(&middle_of_octave(a, rate, bands, band)));
            // At 125 Hz the first images, a few oscillations apart, may cancel for the most part.
            let limit_db = if band < 2 { -57.0 } else { -61.0 };
            assert!(level_db < limit_db, "band {band}: {level_db} dB");
            worst = worst.max(level_db);
        }
    }
    assert!(worst > -65.0, "{worst} dB");
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

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let lab = Laboratory::new(LabConfig { seed: 17, receivers: 3, ..LabConfig::default() }).unwrap();
    let effects = [
        Hidden::random("scattering", 1.0, &lab, 1).unwrap(),
        Hidden::random("background_noise", 1.0, &lab, 1).unwrap(),
    ];
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| lab.responses(&effects).unwrap())
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn a_room_is_written_and_read_back_and_the_truth_lies_elsewhere() {
    let place = tempfile::tempdir().unwrap();
    let config = LabConfig {
        seed: 18,
        sources: 2,
        receivers: 3,
        time_zero: TimeZero::Common,
        orientation: false,
        ..LabConfig::default()
    };
    let lab = Laboratory::new(config).unwrap();
    let (folder, secret) = (place.path().join("room"), place.path().join("truth.toml"));
    let effects: Vec<Hidden> = Hidden::CATALOGUE
        .iter()
        .filter(|id| **id != "scattering")
        .map(|id| Hidden::random(id, 0.5, &lab, 3).unwrap())
        .collect();
    let room = lab.write(&effects, &folder, Some(&secret)).unwrap();
    assert_eq!(room, MeasuredRoom::read(&folder).unwrap());
    assert_eq!(room.scene().materials(), lab.scene().materials());
    assert_eq!(room.scene().vertices(), lab.scene().vertices());
    let (areas, declared) = (room.scene().material_areas_m2(), lab.scene().material_areas_m2());
    assert_all_close("areas (m2)", &areas, &declared, 1e-9, 0.0);
    assert_eq!((room.sources(), room.receivers()), (lab.sources(), lab.receivers()));
    assert_eq!((room.air(), room.priors()), (lab.air(), lab.priors()));
    assert!(room.sources().iter().all(|s| s.axis.is_none()));
    assert_eq!(room.responses().len(), 6);
    let expected = lab.responses(&effects).unwrap();
    for (i, response) in expected.iter().enumerate() {
        assert_eq!(&room.load_response(i).unwrap(), response);
    }
    let truth = Truth::read(&secret).unwrap();
    assert_eq!(truth, lab.truth(&effects).unwrap());
    assert_eq!(truth.effects, effects);
    assert!((0.001..=0.02).contains(&lab.truth(&[]).unwrap().latencies_s[0]));

    let inside = lab.write(&[], &place.path().join("other"), Some(&place.path().join("other/truth.toml")));
    assert!(matches!(inside, Err(Error::Io { .. })));
    assert!(!place.path().join("other").exists());
    // The folder is taken: no truth without a room.
    let taken = lab.write(&[], &folder, Some(&place.path().join("second.toml")));
    assert!(taken.is_err() && !place.path().join("second.toml").exists());
}

#[test]
fn at_strength_0_nothing_is_hidden() {
    let lab = quick_room(3);
    let plain = lab.responses(&[]).unwrap();
    for id in Hidden::CATALOGUE.into_iter().chain(Hidden::OUTSIDE) {
        let effect = Hidden::random(id, 0.0, &lab, 4).unwrap();
        let outside = Hidden::OUTSIDE.contains(&id);
        assert_eq!(effect.id(), if outside { "outside" } else { id });
        for (a, b) in lab.responses(&[effect]).unwrap().iter().zip(&plain) {
            let off = a.samples().iter().zip(b.samples()).fold(0f32, |most, (a, b)| most.max((a - b).abs()));
            assert!(a.samples().len() == b.samples().len() && off < 1e-6 * b.peak(), "{id}: {off}");
        }
    }
}

/// Each effect alone changes what is recorded, and so does a second one beside it.
#[test]
fn any_two_effects_work_together() {
    let lab = quick_room(2);
    let plain = lab.responses(&[]).unwrap();
    let effects: Vec<Hidden> = Hidden::CATALOGUE
        .into_iter()
        .chain(Hidden::OUTSIDE)
        .map(|id| Hidden::random(id, 1.0, &lab, 5).unwrap())
        .collect();
    for (i, first) in effects.iter().enumerate() {
        let alone = lab.responses(std::slice::from_ref(first)).unwrap();
        assert_ne!(alone, plain, "{} changes nothing", first.name());
        for second in &effects[i + 1..] {
            let both = lab.responses(&[first.clone(), second.clone()]).unwrap();
            assert_ne!(both, alone, "{} changes nothing beside {}", second.name(), first.name());
        }
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let lab = one_octave(21, 2, 8_000);
    let refused = |effect: Hidden| lab.truth(&[effect]).unwrap_err();
    assert!(matches!(
        refused(Hidden::TransducerResponse { gains_db: vec![1.0; 7] }),
        Error::BandCount { expected: 1, found: 7 }
    ));
    assert!(matches!(
        refused(Hidden::SurfaceAbsorption { material: 9, absorption: vec![0.1] }),
        Error::Index { what: "material", index: 9, .. }
    ));
    assert!(matches!(
        refused(Hidden::ChannelFault { fault: Fault::Swap { a: 0, b: 2 } }),
        Error::Index { what: "response", index: 2, count: 2 }
    ));
    assert!(matches!(refused(Hidden::SamplingClock { ppm: f64::NAN }), Error::OutOfRange { .. }));
    assert!(matches!(refused(Hidden::RoomDimensions { scale: [1.0, 2.0, 1.0] }), Error::OutOfRange { .. }));
    assert!(matches!(Hidden::random("ghosts", 1.0, &lab, 1), Err(Error::UnknownId { .. })));
    assert!(matches!(Hidden::random("scattering", -1.0, &lab, 1), Err(Error::OutOfRange { .. })));
    for wrong in [
        LabConfig { sources: 0, ..LabConfig::default() },
        LabConfig { receivers: 33, ..LabConfig::default() },
        LabConfig { sample_rate_hz: 16_000, ..LabConfig::default() },
    ] {
        assert!(matches!(Laboratory::new(wrong), Err(Error::OutOfRange { .. })));
    }
}

/// Rooms are what they are said to be, and no two alike.
#[test]
fn rooms_keep_to_their_bounds() {
    let mut sizes = Vec::new();
    for seed in 100..112 {
        let lab = Laboratory::new(LabConfig { seed, ..LabConfig::default() }).unwrap();
        let truth = lab.truth(&[]).unwrap();
        let [x, y, z] = truth.size_m;
        assert!((3.0..9.0).contains(&x) && (3.0..9.0).contains(&y) && (2.4..4.0).contains(&z));
        assert!((35.0..=200.0).contains(&lab.scene().volume_m3()));
        assert!((3..=5).contains(&lab.scene().materials().len()));
        let places: Vec<[f64; 3]> = lab
            .sources()
            .iter()
            .map(|s| s.position_m)
            .chain(lab.receivers().iter().map(|r| r.position_m))
            .collect();
        for (i, a) in places.iter().enumerate() {
            assert!((0..3).all(|k| a[k] >= 0.6 && truth.size_m[k] - a[k] >= 0.6));
            for b in &places[..i] {
                assert!((0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>() > 0.64);
            }
        }
        for (real, prior) in truth.materials.iter().zip(lab.priors()) {
            let table = prior.absorption.as_ref().unwrap().values();
            assert!(table.iter().all(|a| (0.03..=0.6).contains(a)));
            let off = real.absorption.iter().zip(table).zip(prior.absorption_sd.values());
            assert!(off.map(|((a, b), sd)| (a - b).abs() / sd).all(|z| z < 4.5));
        }
        sizes.push(x);
    }
    sizes.sort_by(f64::total_cmp);
    assert!(sizes.windows(2).all(|w| w[1] > w[0]));
}
