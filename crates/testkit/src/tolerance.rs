//! Tolerances that say what they allow.

use std::path::Path;

/// Fails unless `|found - expected| <= absolute + relative |expected|`.
///
/// # Panics
/// If the two are farther apart, or either is NaN.
#[track_caller]
pub fn assert_close(what: &str, found: f64, expected: f64, absolute: f64, relative: f64) {
    if let Some(text) = complaint(found, expected, absolute, relative) {
        panic!("{what}: {text}");
    }
}

/// As [`assert_close`] for every pair, and tells of all that fail.
///
/// # Panics
/// If the lengths differ or any pair is too far apart.
#[track_caller]
pub fn assert_all_close(what: &str, found: &[f64], expected: &[f64], absolute: f64, relative: f64) {
    assert_eq!(found.len(), expected.len(), "{what}: numbers of values");
    let failures: Vec<String> = found
        .iter()
        .zip(expected)
        .enumerate()
        .filter_map(|(i, (&f, &e))| complaint(f, e, absolute, relative).map(|text| format!("[{i}] {text}")))
        .collect();
    assert!(
        failures.is_empty(),
        "{what}: {} of {} fail\n{}",
        failures.len(),
        found.len(),
        failures.join("\n")
    );
}

fn complaint(found: f64, expected: f64, absolute: f64, relative: f64) -> Option<String> {
    let allowed = absolute + relative * expected.abs();
    // Written so that NaN fails.
    let fine = (found - expected).abs() <= allowed;
    (!fine).then(|| format!("{found} is not {expected} +- {allowed}"))
}

/// Fails unless a random result lies within `k` standard errors of what is expected. With k = 4 a sound test fails once in 16,000
/// seeds.
///
/// # Panics
/// If it lies farther off, or anything is NaN.
#[track_caller]
pub fn assert_within_standard_errors(what: &str, found: f64, standard_error: f64, expected: f64, k: f64) {
    let off = (found - expected) / standard_error;
    assert!(
        off.abs() <= k,
        "{what}: {found} +- {standard_error} is {off:.1} standard errors from {expected}"
    );
}

/// Reads a table of numbers, separated by commas or blanks, `#` starting a comment. A missing or empty file fails the test.
///
/// # Panics
/// If the file cannot be read, holds no number or something that is none.
#[track_caller]
pub fn read_golden(path: impl AsRef<Path>) -> Vec<Vec<f64>> {
    let path = path.as_ref();
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let number =
        |word: &str| word.parse().unwrap_or_else(|_| panic!("{}: `{word}` is no number", path.display()));
    let row = |line: &str| -> Vec<f64> {
        let line = line.split('#').next().unwrap_or_default();
        line.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty()).map(number).collect()
    };
    let rows: Vec<Vec<f64>> = text.lines().map(row).filter(|row| !row.is_empty()).collect();
    assert!(!rows.is_empty(), "{} holds no numbers", path.display());
    rows
}
