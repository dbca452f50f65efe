//! The example own_effect as a user runs it, and the page that quotes it.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use std::path::{Path, PathBuf};
use std::process::Command;

/// `cargo test` builds the examples beside the tests.
fn program() -> PathBuf {
    let tests = std::env::current_exe().unwrap();
    let folder = tests.ancestors().nth(2).unwrap().join("examples");
    let program = folder.join(format!("own_effect{}", std::env::consts::EXE_SUFFIX));
    assert!(program.exists(), "{} is missing: run `cargo test --workspace`", program.display());
    program
}

fn run(arguments: &[&str]) -> (bool, String, String) {
    let output = Command::new(program()).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.success(), text(output.stdout), text(output.stderr))
}

/// The number after a name, and the ends of its interval.
fn found(printed: &str, name: &str) -> [f64; 3] {
    let line = printed.lines().find(|line| line.trim_start().starts_with(name));
    let line = line.unwrap_or_else(|| panic!("no {name}: {printed}"));
    let numbers = line.split(|c: char| !c.is_ascii_digit() && c != '.' && c != '-');
    let mut numbers: Vec<f64> = numbers.filter_map(|word| word.parse().ok()).collect();
    // The level of the interval stands between.
    numbers.retain(|n| *n != 90.0);
    numbers.try_into().unwrap()
}

#[test]
fn the_hidden_drift_is_named_with_its_depth_period_and_phase() {
    let (done, printed, errors) = run(&[]);
    assert!(done, "{errors}");
    let mut lines = printed.lines();
    assert_eq!(lines.next(), Some("explained"), "{printed}");
    assert!(lines.next().unwrap().starts_with("gain_drift ("), "{printed}");
    // Hidden: 3 dB, 0.2 s, 1 rad.
    let [sine, cosine, period] = ["sine", "cosine", "period"].map(|name| found(&printed, name));
    for ([value, low, high], truth) in [(sine, 3.0 * 1f64.cos()), (cosine, 3.0 * 1f64.sin()), (period, 0.2)] {
        assert!(low < value && value < high, "{printed}");
        // Three standard deviations: a 90 % interval reaches 1.645 to either side.
        assert!((value - truth).abs() < 3.0 / 1.645 * 0.5 * (high - low), "{truth}: {printed}");
    }
    assert!((period[0] / 0.2 - 1.0).abs() < 0.03, "{printed}");
}

#[test]
fn without_it_the_drift_is_not_named() {
    let (done, printed, errors) = run(&["--without"]);
    assert!(done, "{errors}");
    assert!(!printed.contains("gain_drift"), "{printed}");
    assert!(printed.starts_with("unexplained"), "{printed}");
}

#[test]
fn a_folder_that_is_no_room_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (done, _, errors) = run(&["--room", folder.path().to_str().unwrap()]);
    assert!(!done && errors.contains("room.toml"), "{errors}");
}

#[test]
fn the_page_quotes_the_example() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = std::fs::read_to_string(root.join("own_effect.rs")).unwrap();
    let page = std::fs::read_to_string(root.join("../docs/how-to/own-effect.md")).unwrap();
    let start = source.find("/// Gain in dB").unwrap();
    let end = source.find("/// Diagnose a room").unwrap();
    assert!(page.contains(source[start..end].trim_end()), "the page shows another effect than the example");
    assert!(source.lines().count() < 110);
}
