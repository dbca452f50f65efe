//! `fit_materials` as a user runs it: what it writes, and what it says of bad input.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use serde_json::Value;
use std::path::PathBuf;
use std::process::{Command, Output};

/// `cargo test` builds the examples beside the tests.
fn program() -> PathBuf {
    let tests = std::env::current_exe().unwrap();
    let folder = tests.ancestors().nth(2).unwrap().join("examples");
    let program = folder.join(format!("fit_materials{}", std::env::consts::EXE_SUFFIX));
    assert!(program.exists(), "{} is missing: run `cargo test --workspace`", program.display());
    program
}

fn run(arguments: &[&str]) -> Output {
    Command::new(program()).args(arguments).output().unwrap()
}

/// The fixture's responses are sampled at 16 kHz: the octave of 8 kHz says nothing, and the others are fitted all the same.
#[test]
fn responses_of_the_fixture_are_fitted_where_they_say_something() {
    let folder = tempfile::tempdir().unwrap();
    let (out, json) = (folder.path().join("out"), folder.path().join("fit.json"));
    let arguments =
        ["--responses", "--rays", "3000", "--out", out.to_str().unwrap(), "--json", json.to_str().unwrap()];
    let output = run(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let result: Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    let (target, reached) = (&result["target_t60_s"], &result["reached_t60_s"]);
    for band in 1..5 {
        let (wanted, found) = (target[band].as_f64().unwrap(), reached[band].as_f64().unwrap());
        assert!((found / wanted - 1.0).abs() < 0.15, "band {band}: {found} s of {wanted} s");
    }
    assert!(target[6].is_null(), "{target}");
    let materials = result["materials"].as_object().unwrap();
    for (name, material) in materials {
        for (absorption, sd) in material["absorption"]
            .as_array()
            .unwrap()
            .iter()
            .zip(material["absorption_sd"].as_array().unwrap())
        {
            let (absorption, sd) = (absorption.as_f64().unwrap(), sd.as_f64().unwrap());
            assert!((0.0..=1.0).contains(&absorption) && sd.is_finite() && sd >= 0.0, "{name}");
        }
    }
    assert!(!result["not_determined"].as_array().unwrap().is_empty());
    for file in ["impulse_response.wav", "report.html", "responses.json"] {
        assert!(out.join(file).exists(), "{file} is missing");
    }
}

#[test]
fn bad_targets_and_names_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for (arguments, named) in [
        (vec!["--t60=0,1,1,1,1,1,1"], "125 Hz"),
        (vec!["--t60=1,-1,1,1,1,1,1"], "250 Hz"),
        (vec!["--t60=1,1,nan,1,1,1,1"], "500 Hz"),
        (vec!["--t60=1,1,1,30,1,1,1"], "1000 Hz"),
        (vec!["--t60=1,1"], "7 bands"),
        (vec!["--responses", "--hold-out", "nobody"], "nobody"),
        (vec!["--t60=1,1,1,1,1,1,1", "--receiver", "nobody"], "nobody"),
    ] {
        let output = run(&[&arguments[..], &["--out", out.to_str().unwrap()]].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(message.contains(named) && !message.contains("panicked"), "{arguments:?}: {message}");
        assert!(!out.exists(), "{arguments:?} left {}", out.display());
    }
}
