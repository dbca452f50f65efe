//! The sheet in the form of ISO 3382-2.

use crate::sabine;
use sabine::acoustics::{SampleFormat, write_wav};
use std::path::Path;
use std::process::Output;
use tempfile::TempDir;

/// A decay of T = 0.5 s from 0.1 s on: noise of a linear congruential generator.
fn decay(seed: u32) -> Vec<f32> {
    let mut state = seed;
    let mut sample = |i: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (state >> 8) as f32 / 8_388_608.0 - 1.0;
        let since_s = (i as f32 - 3200.0) / 32_000.0;
        if i == 3200 {
            1.0
        } else {
            0.1 * noise * (10f32.powf(-3.0 * since_s.max(0.0) / 0.5)) * if i > 3200 { 1.0 } else { 0.0 }
        }
    };
    (0..40_000).map(&mut sample).collect()
}

fn measure(folder: &Path, arguments: &[&str]) -> Output {
    let files = ["seat <1>.wav", "seat_2.wav"];
    for (seed, name) in files.iter().enumerate() {
        write_wav(folder.join(name), &decay(seed as u32 + 1), 32_000, SampleFormat::Float32).unwrap();
    }
    sabine("measure").args(files).args(arguments).current_dir(folder).output().unwrap()
}

#[test]
fn the_sheet_holds_the_means_and_what_it_was_told() {
    let folder = TempDir::new().unwrap();
    let arguments =
        ["--from", "125", "--to", "4000", "--sheet", "s.html", "--json", "s.json", "--room-name", "Room <7>"];
    let more = ["--volume", "182", "--remark", "Measured by: A & B"];
    let output = measure(folder.path(), &[&arguments[..], &more].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = std::fs::read_to_string(folder.path().join("s.html")).unwrap();
    for words in [
        "Room &lt;7&gt;",
        "182 m³",
        "A &amp; B",
        "seat &lt;1&gt;.wav",
        "Mean over 2 positions",
        "<svg",
        "size:A4",
    ] {
        assert!(page.contains(words), "{words}");
    }
    // The mean of the positions' own times, as the other output has them.
    let text = std::fs::read_to_string(folder.path().join("s.json")).unwrap();
    let results: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap();
    let mean = results.iter().map(|r| r["t20_s"][3].as_f64().unwrap()).sum::<f64>() / 2.0;
    assert!((mean - 0.5).abs() < 0.05, "{mean}");
    assert!(page.contains(&format!("<tr><td>1000</td><td>{mean:.2}</td>")), "{mean}");
}

#[test]
fn what_no_sheet_can_show_is_refused() {
    for (arguments, words) in [
        (&["--volume", "0"][..], "--volume is 0"),
        (&["--volume", "nan"], "--volume is NaN"),
        (&["--remark", "A. Weiss"], "write NAME: TEXT"),
        (&["--remark", ": x"], "write NAME: TEXT"),
    ] {
        let folder = TempDir::new().unwrap();
        let output = measure(folder.path(), &[&["--sheet", "s.html"][..], arguments].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && text.contains(words), "{arguments:?}: {text}");
        assert!(!folder.path().join("s.html").exists());
    }
}
