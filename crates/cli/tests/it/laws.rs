//! `sabine trace --laws` as a user runs it.

use crate::sabine;
use sabine::diagnose::{ExtendedModel, read_laws};
use serde_json::Value;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/laws/carpet.toml");

fn traced(out: &Path, more: &[&str]) -> Value {
    let common = ["--rays", "2000", "--rate", "16000", "--duration", "0.6", "--out", out.to_str().unwrap()];
    let output = sabine("trace").args(common).args(more).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&std::fs::read_to_string(out.join("parameters.json")).unwrap()).unwrap()
}

fn energy(out: &Path, file: &str) -> f64 {
    let sound = sabine::acoustics::read_audio(out.join(file), sabine::acoustics::Channel::Index(0)).unwrap();
    sound.samples().iter().map(|&s| f64::from(s).powi(2)).sum()
}

fn file(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn the_page_shows_the_example_and_the_example_changes_the_response() {
    let example = std::fs::read_to_string(EXAMPLE).unwrap();
    let page = include_str!("../../../../docs/how-to/own-law.md");
    assert!(page.contains(&format!("```toml\n{example}```")));
    assert_eq!(example.lines().count(), 6);

    let folder = tempfile::tempdir().unwrap();
    let [stated, under, modelled] = ["stated", "under", "modelled"].map(|name| folder.path().join(name));
    let before = traced(&stated, &[]);
    let after = traced(&under, &["--laws", EXAMPLE]);
    // Below 2 kHz nothing changes, to the last digit; from there on late energy is taken.
    let mut told = 0;
    for key in ["c50_db", "c80_db", "edt_s", "drr_db"] {
        for band in 0..7 {
            let (before, after) = (&before[key][band], &after[key][band]);
            if band < 4 {
                assert_eq!(before, after, "{key} in band {band}");
            } else if let (Some(before), Some(after)) = (before.as_f64(), after.as_f64()) {
                let shorter = if key == "edt_s" { after < before } else { after > before };
                assert!(shorter, "{key}: {before}, {after}");
                told += 1;
            }
        }
    }
    // In so short a trace not every quantity can be read.
    assert!(told >= 3, "{told}");
    for sound in ["impulse_response.wav", "ambisonics.wav"] {
        let ratio = energy(&under, sound) / energy(&stated, sound);
        assert!((0.5..0.99).contains(&ratio), "{sound}: {ratio}");
    }
    // The same laws in an extended model render the same.
    let mut empty = ExtendedModel::default();
    empty.centres_hz = vec![125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0];
    let model = folder.path().join("extended_model.toml");
    read_laws(EXAMPLE).unwrap().into_iter().fold(empty, ExtendedModel::with_law).write(&model).unwrap();
    let by_model = traced(&modelled, &["--model", model.to_str().unwrap()]);
    for key in ["t20_s", "c50_db", "drr_db"] {
        assert_eq!(by_model[key], after[key], "{key}");
    }
}

#[test]
fn what_is_wrong_with_a_law_is_said_with_file_law_and_column() {
    let folder = tempfile::tempdir().unwrap();
    let law = |target: &str, formula: &str| {
        let a = "parameters = { a = { value = 1, low = 0, high = 2, unit = \"dB\" } }";
        format!("[[laws]]\nid = \"mine\"\n{target}\nformula = \"{formula}\"\n{a}\n")
    };
    let path = "target = \"path\"";
    for (text, words) in [
        (law(path, "a * lenght_m"), "law `mine`, column 5 of its formula: `lenght_m` is neither"),
        (law(path, "a * length_m"), "law `mine`, column 3 of its formula: a law of `path` gives dB"),
        (law(path, "a / reflections"), "law `mine`, column 3 of its formula: division by zero on path"),
        (
            law(path, "a * exp(reflections * 1000)"),
            "law `mine`, column 5 of its formula: exp gives no finite number",
        ),
        (
            law(path, &"(".repeat(100_000)),
            "law `mine`, column 2001 of its formula: longer than 2000 characters",
        ),
        (law(path, &"(".repeat(1_200_000)), "length (bytes)"),
        (
            law("target = \"reflection\"\nsurface = \"carpets\"", "a"),
            "the mesh has no material `carpets`; the nearest name is `carpet`",
        ),
        (law(path, "3 * a"), ""),
        (law(path, "a") + &law(path, "a"), "two laws have it"),
        (
            law(path, "a").replace("value = 1", "value = 3"),
            "parameters.a: 3 lies outside its interval from 0 to 2",
        ),
        ("[[laws]]\nid = 3".to_owned(), "invalid type"),
        ("[laws".to_owned(), "TOML"),
    ] {
        let file = file(folder.path(), "own.toml", &text);
        let run = |more: &[&str]| {
            let common = ["--rays", "200", "--rate", "16000", "--duration", "0.2"];
            sabine("trace").args(common).args(more).output().unwrap()
        };
        let output = run(&["--laws", file.to_str().unwrap()]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.success(), words.is_empty(), "{said}");
        if !words.is_empty() {
            assert!(said.contains(words) && said.contains("own.toml"), "{words}: {said}");
        }
    }
}
