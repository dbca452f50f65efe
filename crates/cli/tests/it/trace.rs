//! `sabine trace` as a user runs it: what it writes, that threads change nothing, and what it says of bad input.

use crate::sabine;
use sabine::acoustics::{Bands, Channel, ImpulseResponse, RoomParameters, read_audio};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

fn run(arguments: &[&str]) -> Output {
    sabine("trace").args(arguments).output().unwrap()
}

fn traced(out: &Path, more: &[&str]) -> Value {
    let output =
        run(&[&["--rays", "4000", "--rate", "16000", "--out", out.to_str().unwrap()], more].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&std::fs::read_to_string(out.join("parameters.json")).unwrap()).unwrap()
}

fn numbers(result: &Value, key: &str) -> Vec<f64> {
    result[key]
        .as_array()
        .unwrap_or_else(|| panic!("{key} is missing"))
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

#[test]
fn the_response_measures_what_the_paths_say() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let result = traced(&out, &[]);
    let t30_s = numbers(&result, "t30_s");
    assert_eq!(numbers(&result, "bands_hz"), [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0]);
    for key in ["edt_s", "t20_s", "c50_db", "c80_db", "d50", "centre_time_s", "drr_db"] {
        assert_eq!(numbers(&result, key).len(), 7);
    }
    for (sd, t30) in numbers(&result, "t30_sd_s").iter().zip(&t30_s) {
        assert!(*sd > 0.0 && *sd < 0.2 * t30, "{sd} of {t30}");
    }
    assert!(
        result["contributions"].as_u64().unwrap() > 1000
            && result["seconds"]["trace"].as_f64().unwrap() > 0.0
    );
    assert!(std::fs::read_to_string(out.join("plan.svg")).unwrap().contains("<polyline"));

    // Measured by ISO 3382 on the sound itself, by code that knows nothing of paths.
    let response =
        ImpulseResponse::from(read_audio(out.join("impulse_response.wav"), Channel::Mono).unwrap());
    let bands = Bands::octaves(250.0, 4000.0).unwrap();
    let room = RoomParameters::measure(&response, bands).unwrap();
    for (measured, expected) in room.t30_s.values().iter().zip(&t30_s[1..6]) {
        let measured = measured.as_ref().unwrap().value;
        assert!((measured / expected - 1.0).abs() < 0.06, "{measured} s, {expected} s by the paths");
    }
    let ambisonics = out.join("ambisonics.wav");
    assert!(
        read_audio(&ambisonics, Channel::Index(3)).is_ok()
            && read_audio(&ambisonics, Channel::Index(4)).is_err()
    );
}

#[test]
fn threads_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str, threads: &str| {
        let out = folder.path().join(name);
        traced(&out, &["--threads", threads, "--seed", "5", "--duration", "0.5"]);
        ["impulse_response.wav", "ambisonics.wav", "plan.svg"]
            .map(|file| std::fs::read(out.join(file)).unwrap())
    };
    assert!(bytes("one", "1") == bytes("three", "3"));
}

/// Energy per hertz between two frequencies, by a plain Fourier sum.
fn energy(response: &ImpulseResponse, low_hz: f64, high_hz: f64) -> f64 {
    let count = 60;
    (0..count)
        .map(|i| {
            let hz = low_hz + (high_hz - low_hz) * (f64::from(i) + 0.5) / f64::from(count);
            let turn = std::f64::consts::TAU * hz / f64::from(response.sample_rate_hz());
            let sum = response.samples().iter().enumerate().fold((0.0, 0.0), |(re, im), (i, &s)| {
                let (sine, cosine) = (turn * i as f64).sin_cos();
                (re + f64::from(s) * cosine, im + f64::from(s) * sine)
            });
            (sum.0 * sum.0 + sum.1 * sum.1) / f64::from(count)
        })
        .sum()
}

#[test]
fn waves_take_the_low_end_and_leave_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let heard = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let result = traced(&out, &[&["--duration", "0.5"], more].concat());
        let audio = read_audio(out.join("impulse_response.wav"), Channel::Mono).unwrap();
        (result, ImpulseResponse::from(audio))
    };
    let (plain, rays) = heard("rays", &[]);
    let (result, joined) = heard("waves", &["--wave-below", "100"]);
    assert!(plain["waves"].is_null());
    let waves = &result["waves"];
    let number = |key: &str| waves[key].as_f64().unwrap();
    assert!(number("below_hz") == 100.0 && number("voxels") > 10_000.0 && number("seconds") > 0.0);
    assert!(number("level_difference_db").abs() < 6.0 && number("gain_db").abs() < 6.1, "{waves}");
    assert_eq!(joined.samples().len(), rays.samples().len());
    // A diagnosis that named standing waves says so in its model.
    let model = folder.path().join("extended_model.toml");
    std::fs::write(&model, "version = 2\ncentres_hz = [125.0]\n[[causes]]\nid = \"room_modes\"\nchanges = [{ wave_below_hz = 100.0 }]\n")
        .unwrap();
    let (extended, told) = heard("model", &["--model", model.to_str().unwrap()]);
    assert_eq!((&extended["waves"]["below_hz"], told), (&waves["below_hz"], joined.clone()));
    // Above the octave about 100 Hz nothing changes.
    let off: f64 = (0..40)
        .map(|i| 200.0 + 25.0 * f64::from(i))
        .map(|hz| (energy(&joined, hz, hz + 1.0) / energy(&rays, hz, hz + 1.0)).log10().abs() * 10.0)
        .fold(0.0, f64::max);
    assert!(off < 0.2, "{off} dB");
    // Below it there are other peaks: between two modes far less than the mean that rays know.
    let level_db = 10.0 * (energy(&joined, 30.0, 70.0) / energy(&rays, 30.0, 70.0)).log10();
    assert!(level_db.abs() > 0.5 && level_db.abs() < 20.0, "{level_db} dB");
}

#[test]
fn bad_input_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let empty = folder.path().join("no_room");
    for (arguments, named) in [
        (vec!["--source", "nobody"], "nobody"),
        (vec!["--rays", "0"], "rays"),
        (vec!["--order", "99"], "image_order"),
        (vec!["--ambisonics", "7"], "ambisonic order"),
        (vec!["--rate", "10"], "sample_rate_hz"),
        (vec!["--duration", "-1"], "duration_s"),
        (vec!["--wave-below", "-1"], "crossover_hz"),
        (vec!["--wave-below", "3000", "--rate", "16000"], "would fit"),
        (vec!["--wave-below", "100", "--pattern", "cardioid"], "--pattern"),
        (vec!["--room", empty.to_str().unwrap()], "room.toml"),
    ] {
        let output = run(&[&arguments[..], &["--out", out.to_str().unwrap()]].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_ne!(output.status.code(), Some(0), "{arguments:?}");
        assert!(message.contains(named) && !message.contains("panicked"), "{arguments:?}: {message}");
        assert!(!out.exists(), "{arguments:?} left {}", out.display());
    }
}
