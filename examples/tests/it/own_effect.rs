//! The example own_effect as a user runs it, and the page that quotes it.

use crate::{folder, run};

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
fn without_the_effect_nothing_is_explained_with_it_depth_period_and_phase_are_found() {
    let here = tempfile::tempdir().unwrap();
    let (done, printed, errors) = run("own_effect", &[], here.path());
    assert!(done, "{errors}");
    let (without, with) = printed.split_once("with it: ").unwrap();
    assert!(without.starts_with("without the effect: unexplained"), "{printed}");
    assert!(!without.contains("gain_drift"), "{printed}");
    let mut lines = with.lines();
    assert_eq!(lines.next(), Some("explained"), "{printed}");
    assert!(lines.next().unwrap().starts_with("gain_drift ("), "{printed}");
    // Hidden: 3 dB, 0.2 s, 1 rad.
    let [sine, cosine, period] = ["sine", "cosine", "period"].map(|name| found(with, name));
    for ([value, low, high], truth) in [(sine, 3.0 * 1f64.cos()), (cosine, 3.0 * 1f64.sin()), (period, 0.2)] {
        assert!(low < value && value < high, "{printed}");
        // Three standard deviations: a 90 % interval reaches 1.645 to either side.
        assert!((value - truth).abs() < 3.0 / 1.645 * 0.5 * (high - low), "{truth}: {printed}");
    }
    assert!((period[0] / 0.2 - 1.0).abs() < 0.03, "{printed}");
}

#[test]
fn a_folder_that_is_no_room_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let (done, _, errors) = run("own_effect", &[empty.path().to_str().unwrap()], empty.path());
    assert!(!done && errors.contains("room.toml"), "{errors}");
}

#[test]
fn the_page_quotes_the_example() {
    let source = std::fs::read_to_string(folder().join("own_effect.rs")).unwrap();
    let page = std::fs::read_to_string(folder().join("../docs/how-to/own-effect.md")).unwrap();
    let start = source.find("/// Gain in dB").unwrap();
    let end = source.find("fn main()").unwrap();
    assert!(page.contains(source[start..end].trim_end()), "the page shows another effect than the example");
}
