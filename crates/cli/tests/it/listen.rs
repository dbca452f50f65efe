//! The listening test as a user runs it: stimuli that keep what they promise, and an analysis that agrees with other software.

use crate::sabine;
use sabine::acoustics::{Channel, Signal, read_audio, resample};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Output;

fn run(arguments: &[&str]) -> Output {
    sabine("listen").args(arguments).output().unwrap()
}

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}

fn json(path: impl AsRef<Path>) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Equal to nine digits; p values, however small, to six.
fn agrees(what: &str, ours: &Value, theirs: &Value) {
    match (ours, theirs) {
        (Value::Object(_), Value::Object(fields)) => {
            for (name, value) in fields {
                agrees(&format!("{what}.{name}"), &ours[name], value);
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{what}");
            a.iter().zip(b).enumerate().for_each(|(i, (a, b))| agrees(&format!("{what}[{i}]"), a, b));
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            let digits = if what.contains(".p") { 1e-6 } else { 1e-9 };
            assert!((a - b).abs() <= digits * b.abs(), "{what}: {a} instead of {b}");
        }
        _ => assert_eq!(ours, theirs, "{what}"),
    }
}

#[test]
fn the_analysis_agrees_with_scipy_statsmodels_and_pingouin() {
    let folder = tempfile::tempdir().unwrap();
    let expected = json(golden("listening_test.json"));
    for unit in ["assessor", "trial"] {
        let file = folder.path().join(unit);
        let output = run(&[
            "analyse",
            "--ratings",
            golden("listening_test.csv").to_str().unwrap(),
            "--unit",
            unit,
            "--json",
            file.to_str().unwrap(),
        ]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let found = json(&file);
        agrees("ratings", &found["ratings"], &expected["ratings"]);
        agrees(unit, &found, &expected[unit]);
        let excluded: Vec<&Value> =
            found["excluded"].as_array().unwrap().iter().map(|e| &e["assessor"]).collect();
        assert_eq!(excluded, expected["excluded"].as_array().unwrap().iter().collect::<Vec<_>>());
        let printed = String::from_utf8(output.stdout).unwrap();
        let f = expected[unit]["anova"]["f"].as_f64().unwrap();
        for part in ["14 assessors, 2 left out", "BS.1534-3", "t60 - t60_eq: -13.2", &format!("{f:.2}")] {
            assert!(printed.contains(part), "\"{part}\" is not in: {printed}");
        }
    }
}

#[test]
fn ratings_that_cannot_be_used_name_file_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    let good = std::fs::read_to_string(golden("listening_test.csv")).unwrap();
    let refuses = |text: &str, options: &[&str], named: &[&str]| {
        let path = folder.path().join("bad.csv");
        std::fs::write(&path, text).unwrap();
        let json = folder.path().join("out.json");
        let output = run(&[
            &["analyse", "--ratings", path.to_str().unwrap(), "--json", json.to_str().unwrap()],
            options,
        ]
        .concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{named:?}: {message}");
        for part in [&["bad.csv"], named].concat() {
            assert!(message.contains(part), "\"{part}\" is not in: {message}");
        }
        assert!(!json.exists());
    };
    // The comment in line 9 goes on in line 10: lines are those of the file, not of the table.
    let line_12 = "sabine,a00,reader,t60_eq,96,1009,";
    assert_eq!(good.lines().nth(11), Some(line_12));
    refuses(
        &good.replace(line_12, "sabine,a00,reader,t60_eq,101,1009,"),
        &[],
        &["line 12: rating_score", "101"],
    );
    refuses(
        &good.replace(line_12, "sabine,a00,reader,t60_eq,loud,1009,"),
        &[],
        &["line 12: rating_score", "loud"],
    );
    refuses(
        &good.replace(line_12, "sabine,a00,reader,t60_eq,NaN,1009,"),
        &[],
        &["line 12: rating_score", "NaN"],
    );
    refuses(
        &good.replace(line_12, "sabine,a00,reader,t60_eq,,1009,"),
        &[],
        &["line 12: rating_score: empty"],
    );
    refuses(&good.replace(line_12, "sabine,,reader,t60_eq,96,1009,"), &[], &["line 12: assessor: empty"]);
    refuses(&good.replace(line_12, "sabine,a00,reader"), &[], &["line 12"]);
    refuses(
        &good.replace(line_12, "sabine,a00,reader,t60,96,1009,"),
        &[],
        &["line 12", "line 11 already", "t60"],
    );
    refuses(&good.replace(&format!("{line_12}\n"), ""), &[], &["a00 did not rate t60_eq of reader"]);
    refuses(&good.replace("rating_score", "points"), &[], &["line 1", "rating_score"]);
    refuses(&good.replace("session_test_id,assessor", "session_test_id,who"), &[], &["line 1", "--assessor"]);
    refuses(&good, &["--assessor", "name"], &["line 1", "name"]);
    refuses(&good, &["--mid-anchor", "anchor70"], &["rating_stimulus", "anchor70", "mid_anchor"]);
    refuses("", &[], &["line 1"]);
    refuses(good.lines().next().unwrap(), &[], &["no ratings"]);
    // One assessor is left: nothing to compare.
    let one: String = good.lines().take(17).map(|line| format!("{line}\n")).collect();
    refuses(&one, &[], &["subjects: 1 left", "at least 2"]);
    let output = run(&["analyse", "--ratings", folder.path().join("absent.csv").to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("absent.csv"));
}

fn energy(samples: &[f32]) -> f64 {
    samples.iter().map(|&s| f64::from(s).powi(2)).sum()
}

#[test]
fn the_stimuli_are_those_of_the_paper() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = run(&["--out", out.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).unwrap();
    for part in ["T60 reference", "T60 mid_anchor", "item dry_guest: 5 stimuli", "LUFS", "sabine.yaml"] {
        assert!(printed.contains(part), "\"{part}\" is not in: {printed}");
    }
    let conditions = ["reference", "low_anchor", "mid_anchor", "t60", "t60_eq"];
    let mut names: Vec<String> =
        std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let mut expected: Vec<String> = ["dry_guest", "dry_reader"]
        .iter()
        .flat_map(|item| conditions.map(|condition| format!("{item}_{condition}.wav")))
        .chain(["sabine.yaml".to_owned(), "stimuli.json".to_owned()])
        .collect();
    expected.sort();
    assert_eq!(names, expected);

    let summary = json(out.join("stimuli.json"));
    let t60 = |condition: &str| -> Vec<f64> {
        let rows = summary["t60_s"].as_array().unwrap();
        let row = rows.iter().find(|row| row[0] == condition).unwrap();
        row[1].as_array().unwrap().iter().map(|t| t.as_f64().unwrap()).collect()
    };
    // The decay of noise in an octave has a spread of its own: 0.55 / sqrt(B T) of it (ISO 3382-2, formula A.2).
    for (band, t) in t60("mid_anchor").into_iter().enumerate() {
        let bandwidth_hz = 125.0 * 2f64.powi(band as i32) / 2f64.sqrt();
        let tolerance = 3.0 * 0.55 / (bandwidth_hz * 0.5).sqrt();
        assert!((t / 0.5 - 1.0).abs() < tolerance, "octave {band} of the mid-range anchor: {t} s");
    }
    // The reference is the measured room: its truth is known from what made the fixture.
    let truth = json(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/truth.json"));
    let at_1_khz = truth["bands_hz"].as_array().unwrap().iter().position(|hz| hz == 1000.0).unwrap();
    let t60_truth = truth["t60_s"][at_1_khz].as_f64().unwrap();
    assert!((t60("reference")[3] / t60_truth - 1.0).abs() < 0.05, "{:?} and {t60_truth}", t60("reference"));

    for item in ["dry_guest", "dry_reader"] {
        let sounds: Vec<Signal> = conditions
            .iter()
            .map(|c| read_audio(out.join(format!("{item}_{c}.wav")), Channel::Mono).unwrap())
            .collect();
        for sound in &sounds {
            assert_eq!((sound.samples().len(), sound.sample_rate_hz()), (sounds[0].samples().len(), 48_000));
            assert!(sound.duration_s() < 12.0 && sound.peak() < 0.96);
        }
        // The low anchor is the dry speech, a millisecond later and at another level: what is left of it beside that is
        // rounding to 16 bit.
        let dry = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../fixtures/speech/{item}.wav"));
        let dry = resample(&read_audio(dry, Channel::Mono).unwrap(), 48_000).unwrap();
        let low = &sounds[1].samples()[48..][..dry.samples().len()];
        let product: f64 = low.iter().zip(dry.samples()).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
        let gain = (product / energy(dry.samples())) as f32;
        let rest: Vec<f32> = low.iter().zip(dry.samples()).map(|(a, b)| a - gain * b).collect();
        assert!(energy(&rest) < 1e-6 * energy(low), "{item}: the low anchor is not the dry speech");
        assert!(
            energy(&sounds[1].samples()[48 + dry.samples().len()..]) == 0.0,
            "the low anchor reverberates"
        );
        // What was equalised differs from what was not; both differ from the reference.
        for (a, b) in [(3, 4), (0, 3), (0, 4), (0, 2)] {
            let difference: Vec<f32> =
                sounds[a].samples().iter().zip(sounds[b].samples()).map(|(a, b)| a - b).collect();
            assert!(
                energy(&difference) > 0.01 * energy(sounds[a].samples()),
                "{} is {}",
                conditions[a],
                conditions[b]
            );
        }
    }
    let yaml = std::fs::read_to_string(out.join("sabine.yaml")).unwrap();
    for item in ["dry_guest", "dry_reader"] {
        for condition in &conditions[1..] {
            let line = format!("{condition}: \"configs/resources/sabine/{item}_{condition}.wav\"");
            assert!(yaml.lines().any(|l| l.trim() == line), "{line} is not in: {yaml}");
        }
        let reference = format!("reference: \"configs/resources/sabine/{item}_reference.wav\"");
        assert!(yaml.lines().any(|l| l.trim() == reference), "{reference} is not in: {yaml}");
    }
    assert_eq!(yaml.matches("- type: mushra").count(), 2);
}

#[test]
fn a_test_without_a_measured_response_or_with_long_speech_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refuses = |arguments: &[&str], named: &[&str]| {
        let out = folder.path().join("out");
        let output = run(&[arguments, &["--rays", "2000", "--out", out.to_str().unwrap()]].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        for part in named {
            assert!(message.contains(part), "\"{part}\" is not in: {message}");
        }
        assert!(!out.exists(), "{arguments:?} left something");
    };
    refuses(&["--source", "screen"], &["room.toml: responses"]);
    refuses(&["--source", "nobody"], &["room.toml", "nobody"]);
    let long = folder.path().join("long.wav");
    let samples: Vec<f32> = (0..16_000 * 13).map(|i| 0.1 * (i as f32 * 0.1).sin()).collect();
    sabine::acoustics::write_wav(&long, &samples, 16_000, sabine::acoustics::SampleFormat::Int16).unwrap();
    refuses(&["--dry", long.to_str().unwrap()], &["long.wav", "at most 12 s"]);
    let (one, other) = (long.to_str().unwrap(), folder.path().join("sub/long.wav"));
    refuses(&["--dry", one, other.to_str().unwrap()], &["long"]);
}
