//! Input that holds no answer gets a reason, never a wrong number and never a panic.

use proptest::prelude::*;
use sabine_acoustics::{
    BandParameters, Bands, Estimate, ImpulseResponse, NoReading, Reading, RoomParameters, equalisation,
};

/// Every reading of a response: octaves and full band.
fn readings(response: &ImpulseResponse) -> Vec<(&'static str, f64, Reading)> {
    let bands = Bands::SIMULATION;
    let room = RoomParameters::measure(response, bands).unwrap();
    let full = BandParameters::full_band(response);
    let mut all = Vec::new();
    for (name, band, whole) in [
        ("edt", &room.edt_s, &full.edt_s),
        ("t20", &room.t20_s, &full.t20_s),
        ("t30", &room.t30_s, &full.t30_s),
        ("t60", &room.t60_s, &full.t60_s),
        ("c50", &room.c50_db, &full.c50_db),
        ("c80", &room.c80_db, &full.c80_db),
        ("d50", &room.d50, &full.d50),
        ("ts", &room.centre_time_s, &full.centre_time_s),
        ("drr", &room.drr_db, &full.drr_db),
    ] {
        all.extend(band.iter().map(|(hz, reading)| (name, hz, reading.clone())));
        all.push((name, 0.0, whole.clone()));
    }
    all.extend(
        equalisation(response, bands).unwrap().iter().map(|(hz, reading)| ("eq", hz, reading.clone())),
    );
    all
}

fn is_sound(name: &str, estimate: Estimate) -> bool {
    let positive = !matches!(name, "edt" | "t20" | "t30" | "t60") || estimate.value > 0.0;
    let share = name != "d50" || (0.0..=1.0).contains(&estimate.value);
    estimate.value.is_finite()
        && estimate.standard_error >= 0.0
        && estimate.standard_error.is_finite()
        && positive
        && share
}

fn no_decay_time(what: &str, samples: Vec<f32>) {
    for (name, hz, reading) in readings(&ImpulseResponse::new(samples, 16000).unwrap()) {
        if matches!(name, "edt" | "t20" | "t30" | "t60") {
            assert!(reading.is_err(), "{what}: {name} at {hz} Hz is {reading:?}");
        }
    }
}

#[test]
fn silence_has_no_onset_in_any_reading() {
    for len in [1, 2, 100, 16000] {
        let silent = ImpulseResponse::new(vec![0.0; len], 48000).unwrap();
        for (name, hz, reading) in readings(&silent) {
            assert_eq!(reading, Err(NoReading::NoOnset), "{len} samples: {name} at {hz} Hz");
        }
    }
}

#[test]
fn what_does_not_decay_has_no_decay_time() {
    no_decay_time("one sample", vec![1.0]);
    no_decay_time("three samples", vec![1.0, -0.5, 0.25]);
    no_decay_time("a constant", vec![0.7; 16000]);
    no_decay_time("a tone", (0..16000).map(|i| (0.4 * i as f32).sin()).collect());
    no_decay_time("a tone on a constant", (0..16000).map(|i| 0.5 + 0.1 * (0.4 * i as f32).sin()).collect());
    // Filters ring; that is not a room.
    let mut pulse = vec![0.0; 16000];
    pulse[1000] = 1.0;
    no_decay_time("a pulse", pulse.clone());
    pulse[1001] = -1.0;
    no_decay_time("two pulses", pulse);
    for seed in 0..10 {
        no_decay_time("noise", crate::synthetic::noise(16000, 1.0, seed).into_samples());
    }
    // Sound that grows.
    let mut growing = crate::synthetic::decay(16000, 1.0, &[(0.5, 0.0)], -60.0, 3).into_samples();
    growing.reverse();
    no_decay_time("a reversed decay", growing);
}

/// A pulse on noise 60 dB below has no room in it either.
#[test]
fn a_pulse_on_noise_has_no_decay_time() {
    for seed in 0..10 {
        let mut samples = crate::synthetic::noise(16000, 1.0, 100 + seed).into_samples();
        samples.iter_mut().for_each(|x| *x *= 1e-2);
        samples[2000] = 1.0;
        no_decay_time("a pulse on noise", samples);
    }
}

/// A response that ends while it still sounds is read as far as it goes, and the rest has a reason.
#[test]
fn a_truncated_response_is_read_as_far_as_it_goes() {
    let response = crate::synthetic::decay(16000, 0.3, &[(1.0, 0.0)], -80.0, 5);
    let room = RoomParameters::measure(&response, Bands::EQ).unwrap();
    // 18 dB of decay.
    for (i, (t20, t60)) in room.t20_s.values().iter().zip(room.t60_s.values()).enumerate() {
        assert!(t20.is_err(), "{i}: {t20:?}");
        if let Ok(t60) = t60 {
            assert!((t60.value - 1.0).abs() < 4.5 * t60.standard_error, "{i}: {t60:?}");
        }
    }
    assert!(room.t60_s.at_hz(4000.0).unwrap().is_ok());
    let mut short = vec![0.0; 400];
    short.extend_from_slice(&response.samples()[..960]);
    let short = ImpulseResponse::new(short, 16000).unwrap();
    let room = RoomParameters::measure(&short, Bands::EQ).unwrap();
    assert!(room.c80_db.values().iter().all(|c| matches!(c, Err(NoReading::TooShort { .. }))));
    // 10 ms of what comes after 50 ms are not the late energy.
    assert!(room.c50_db.values().iter().all(Result::is_err));
}

/// A constant offset and digital silence around the response change nothing that matters.
#[test]
fn offset_and_silence_do_not_disturb() {
    let clean = crate::synthetic::decay(16000, 1.5, &[(0.5, 0.0)], -60.0, 9);
    let plain = BandParameters::full_band(&clean).t60_s.unwrap();
    let offset: Vec<f32> = clean.samples().iter().map(|x| x + 0.01).collect();
    let offset = BandParameters::full_band(&ImpulseResponse::new(offset, 16000).unwrap()).t60_s.unwrap();
    assert!((offset.value - plain.value).abs() < 0.1 * plain.standard_error);
    let mut framed = vec![0.0; 3000];
    framed.extend_from_slice(clean.samples());
    framed.extend(vec![0.0; 8000]);
    let framed = ImpulseResponse::new(framed, 16000).unwrap();
    let silent = BandParameters::full_band(&framed).t60_s.unwrap();
    assert!((silent.value - plain.value).abs() < 0.5 * plain.standard_error);
    let (a, b) = (
        RoomParameters::measure(&clean, Bands::EQ).unwrap(),
        RoomParameters::measure(&framed, Bands::EQ).unwrap(),
    );
    for (a, b) in a.t60_s.values().iter().zip(b.t60_s.values()) {
        let (a, b) = (a.clone().unwrap(), b.clone().unwrap());
        assert!((a.value - b.value).abs() < a.standard_error, "{a:?} {b:?}");
    }
}

/// The scale of the samples is of no account.
#[test]
fn loudness_does_not_matter() {
    let response = crate::synthetic::decay(16000, 1.0, &[(0.4, 0.0)], -50.0, 11);
    let one = readings(&response);
    for gain in [1e-12_f32, 1e12] {
        let scaled: Vec<f32> = response.samples().iter().map(|x| x * gain).collect();
        for ((name, hz, a), (_, _, b)) in
            one.iter().zip(readings(&ImpulseResponse::new(scaled, 16000).unwrap()))
        {
            match (a, b) {
                (Ok(a), Ok(b)) => {
                    assert!((a.value - b.value).abs() < 1e-3 * a.value.abs().max(1e-3), "{name} {hz}")
                }
                (Err(_), Err(_)) => {}
                (a, b) => panic!("{name} at {hz} Hz: {a:?} but {b:?} at gain {gain}"),
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Whatever the samples, every number is finite and in its range.
    #[test]
    fn no_input_breaks_the_measures(
        mut samples in proptest::collection::vec(-1.0f32..1.0, 1..4000),
        spikes in proptest::collection::vec((0usize..4000, -1e6f32..1e6), 0..4),
        fall in 0.0f32..0.02,
        rate in prop::sample::select(vec![1000u32, 8000, 16000, 48000, 192000]),
    ) {
        for (i, x) in samples.iter_mut().enumerate() {
            *x *= (-fall * i as f32).exp();
        }
        for (at, height) in spikes {
            let at = at % samples.len();
            samples[at] = height;
        }
        for (name, hz, reading) in readings(&ImpulseResponse::new(samples, rate).unwrap()) {
            if let Ok(estimate) = reading {
                prop_assert!(is_sound(name, estimate), "{} at {} Hz: {:?}", name, hz, estimate);
            }
        }
    }
}
