//! `sabine replace` as a user runs it: what it predicts and writes, and what it says of bad input.

use crate::sabine;
use sabine::acoustics::{Channel, read_audio};
use serde_json::Value;
use std::process::Output;

fn run(arguments: &[&str]) -> Output {
    sabine("replace").args(arguments).output().unwrap()
}

#[test]
fn plaster_on_the_ceiling_shortens_the_decay_and_makes_it_clearer() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = run(&["--rays", "4000", "--duration-s", "2", "--out", out.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let change: Value = serde_json::from_slice(&std::fs::read(out.join("change.json")).unwrap()).unwrap();
    let row = |name: &str| {
        let rows = change["rows"].as_array().unwrap();
        rows.iter().find(|r| r["quantity"] == name).unwrap().clone()
    };
    // 500 Hz to 2 kHz, where the plaster absorbs what the ceiling before it did not; T60 at 4 and 8 kHz, where air ends the late decay that
    // few rays carry.
    for (name, sign, bands) in [("T60 s", -1.0, 5..7), ("C50 dB", 1.0, 2..5), ("D50", 1.0, 2..5)] {
        for band in bands {
            let row = row(name);
            let of = |key: &str| row[key][band].as_f64().unwrap();
            assert!((of("after") - of("before") - of("difference")).abs() < 1e-9, "{name}");
            assert!(sign * of("difference") > 3.0 * of("difference_se"), "{name}, band {band}: {row}");
        }
    }
    let energy = |file: &str| {
        let sound = read_audio(out.join(file), Channel::Mono).unwrap();
        let late = sound.samples().len() / 8;
        sound.samples()[late..].iter().map(|x| f64::from(*x).powi(2)).sum::<f64>()
    };
    assert!(energy("after.wav") < 0.7 * energy("before.wav"));
    // The voices keep the difference of their levels: plaster makes the room quieter, late and in all.
    assert!(energy("voice_after.wav") < energy("voice_before.wav"));
    let peak = |file: &str| read_audio(out.join(file), Channel::Mono).unwrap().peak();
    assert!(peak("voice_before.wav").max(peak("voice_after.wav")) > 0.9);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(page.matches("data:audio/wav").count(), 3);
    assert_eq!(page.matches("<svg class=\"chart\"").count(), 3);
}

#[test]
fn bad_input_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for (arguments, named) in [
        (vec!["--material", "cheese"], "cheese"),
        (vec!["--with", "cheese"], "cheese"),
        (vec!["--absorption=0.1,0.1"], "7 bands"),
        (vec!["--absorption=0.1,0.1,0.1,0.1,0.1,0.1,1.5"], "absorption"),
        (vec!["--receiver", "nobody"], "nobody"),
        (vec!["--rays", "0"], "rays"),
    ] {
        let output = run(&[&arguments[..], &["--out", out.to_str().unwrap()]].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(message.contains(named) && !message.contains("panicked"), "{arguments:?}: {message}");
        assert!(!out.exists(), "{arguments:?} left {}", out.display());
    }
}
