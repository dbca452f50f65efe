//! Levels against librosa's, stored beside the script that made them.

use sabine_features::FeatureExtractor;
use sabine_features::{LogMel, LogMelConfig, NaiveLogMel};

/// As in `golden/make_golden.py`.
const CASES: [&str; 6] = ["noise", "tones", "click", "sweep", "voice", "decay"];
const LENGTH: usize = 4096;

fn read(name: &str) -> Vec<f32> {
    let path = format!("{}/tests/golden/{name}", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
}

#[test]
fn levels_are_librosas_within_a_ten_thousandth_of_a_decibel() {
    let (inputs, levels) = (read("inputs.f32"), read("levels.f32"));
    assert_eq!(inputs.len(), CASES.len() * LENGTH);
    let config = LogMelConfig::default();
    let extractors: [(&str, Box<dyn FeatureExtractor>); 2] = [
        ("fast", Box::new(LogMel::new(config.clone()).unwrap())),
        ("naive", Box::new(NaiveLogMel::new(config).unwrap())),
    ];
    let mut failures = Vec::new();
    for (kind, extractor) in &extractors {
        for ((case, input), expected) in
            CASES.iter().zip(inputs.chunks(LENGTH)).zip(levels.chunks(levels.len() / CASES.len()))
        {
            let found = extractor.extract(input);
            assert_eq!(found.len(), expected.len());
            let worst = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            println!("{kind}, {case}: {worst:.2e} dB");
            if worst.is_nan() || worst > 1e-4 {
                failures.push(format!("{kind}, {case}: {worst} dB"));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:?}");
}
