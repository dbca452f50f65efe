//! Rooms of the laboratory: the null room against image sources, and how rooms are declared, written and refused.

use crate::rooms::{db, energy, one_octave, quick_room, samples, seven_octaves, true_places};
use crate::spectrum::{middle_of_octave, widths_hz};
use sabine_acoustics::{Air, Bands, Error};
use sabine_scene::{Levels, MeasuredRoom, TimeZero};
use sabine_testkit::{
    Fault, Hidden, LabConfig, Laboratory, ShoeboxImages, Truth, assert_all_close, assert_close, at_night,
};

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
        receivers: 2,
        time_zero: TimeZero::Common,
        orientation: false,
        bands: Bands::octaves(500.0, 2000.0).unwrap(),
        sample_rate_hz: 16_000,
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
    assert_eq!(room.responses().len(), 4);
    let expected = lab.responses(&effects).unwrap();
    for (i, response) in expected.iter().enumerate() {
        assert_eq!(&room.load_response(i).unwrap(), response);
    }
    let truth = Truth::read(&secret).unwrap();
    assert_eq!(truth, lab.truth(&effects).unwrap());
    assert_eq!(truth.effects, effects);
    assert!((0.001..=0.02).contains(&lab.truth(&[]).unwrap().latencies_s[0]));

    let inside = lab.write(&[], &place.path().join("other"), Some(&place.path().join("other/truth.toml")));
    assert!(matches!(inside, Err(sabine_scene::Error::Acoustics(Error::Io { .. }))));
    assert!(!place.path().join("other").exists());
    // The folder is taken: no truth without a room.
    let taken = lab.write(&[], &folder, Some(&place.path().join("second.toml")));
    assert!(taken.is_err() && !place.path().join("second.toml").exists());
}

#[test]
fn sessions_have_air_of_their_own_and_turned_sources_keep_their_places() {
    let place = tempfile::tempdir().unwrap();
    let config = LabConfig { seed: 19, receivers: 4, sessions: 2, turned: true, ..LabConfig::default() };
    let lab = Laboratory::new(config).unwrap();
    let room = lab.write(&[], &place.path().join("room"), None).unwrap();
    let [first, again] = room.sources() else { panic!("{:?}", room.sources()) };
    assert_eq!(first.position_m, again.position_m);
    let (a, b) = (first.axis.unwrap(), again.axis.unwrap());
    assert!((a[0] * b[0] + a[1] * b[1]).abs() < 1e-9 && a[2] == b[2]);
    let truth = lab.truth(&[]).unwrap();
    for (i, response) in room.responses().iter().enumerate() {
        let session = i % 2;
        assert_eq!(response.session.as_deref(), Some(["session 1", "session 2"][session]));
        let warmer_k = response.air.temperature_c() - lab.air().temperature_c();
        assert!((warmer_k - 6.0 * session as f64).abs() < 1e-9, "{warmer_k} K");
        let percent = |air: &Air| air.relative_humidity_percent();
        let off_percent = (percent(&response.air) - percent(&lab.air())).abs();
        assert!((off_percent - 30.0 * session as f64).abs() < 1e-9, "{off_percent} %");
        // The direct sound comes with the speed of sound of its session, 331.3 m/s and 0.606 m/s more for each degree.
        let (from, to) = (truth.sources[i / 4].position_m, truth.receivers_m[i % 4]);
        let length_m = (0..3).map(|k| (from[k] - to[k]).powi(2)).sum::<f64>().sqrt();
        let expected_s = length_m / (331.3 + 0.606 * response.air.temperature_c());
        let samples = room.load_response(i).unwrap();
        let most = samples.samples().iter().fold(0f32, |m, s| m.max(s.abs()));
        let onset = samples.samples().iter().position(|s| s.abs() > 0.3 * most).unwrap();
        let onset_s = onset as f64 / 48e3;
        assert!((onset_s - expected_s).abs() < 1e-4, "{i}: {onset_s} {expected_s}");
    }
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

/// Each effect alone changes what is recorded, and so does a second one beside it: in the gate the two that follow it.
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
        for second in effects[i + 1..].iter().take(if at_night() { effects.len() } else { 2 }) {
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
    assert!(matches!(refused(Hidden::SamplingClock { ppm: f64::NAN }), Error::OutOfRange(_)));
    assert!(matches!(refused(Hidden::RoomDimensions { scale: [1.0, 2.0, 1.0] }), Error::OutOfRange(_)));
    assert!(matches!(Hidden::random("ghosts", 1.0, &lab, 1), Err(Error::UnknownId { .. })));
    assert!(matches!(Hidden::random("scattering", -1.0, &lab, 1), Err(Error::OutOfRange(_))));
    for wrong in [
        LabConfig { sources: 0, ..LabConfig::default() },
        LabConfig { receivers: 41, ..LabConfig::default() },
        LabConfig { sessions: 5, ..LabConfig::default() },
        LabConfig { sample_rate_hz: 16_000, ..LabConfig::default() },
    ] {
        assert!(matches!(Laboratory::new(wrong), Err(Error::OutOfRange(_))));
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
