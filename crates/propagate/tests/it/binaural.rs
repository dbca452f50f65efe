//! Two ears in an ambisonic field, against closed forms.

use sabine_propagate::*;

/// Evenly spread directions along a spiral (Saff and Kuijlaars 1997).
fn spiral(count: u32) -> Vec<[f64; 3]> {
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let (sine, cosine) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            [(1.0 - z * z).sqrt() * cosine, (1.0 - z * z).sqrt() * sine, z]
        })
        .collect()
}

fn wave(order: usize, direction: [f64; 3]) -> AmbisonicResponse {
    let channels = ambisonic_gains(order, direction).into_iter().map(|g| vec![0.0, g as f32, 0.0]);
    AmbisonicResponse::new(channels.collect(), 16_000).unwrap()
}

/// Ears of first order, the left one later by two samples: the decoder gives them exactly, whatever the order.
#[test]
fn ears_of_first_order_are_exact() {
    let directions = spiral(20_000);
    let left = directions.iter().map(|d| vec![0.0, 0.0, (1.0 + 0.5 * d[1]) as f32]).collect();
    let right = directions.iter().map(|d| vec![(1.0 - 0.5 * d[1]) as f32, 0.0, 0.0]).collect();
    let head = HeadResponses::new(directions, left, right, 16_000).unwrap();
    for order in 1..=3 {
        for direction in [[0.0, 1.0, 0.0], [0.6, -0.8, 0.0], [0.0, 0.0, -1.0]] {
            let [left, right] = head.binaural(&wave(order, direction)).unwrap();
            assert_eq!(left.samples().len(), 5);
            // The nearest of 20,000 directions is within a degree.
            assert!(
                (f64::from(left.samples()[3]) - 1.0 - 0.5 * direction[1]).abs() < 0.01,
                "{order} {left:?}"
            );
            assert!(
                (f64::from(right.samples()[1]) - 1.0 + 0.5 * direction[1]).abs() < 0.01,
                "{order} {right:?}"
            );
            assert!(left.samples()[1].abs() < 1e-6 && right.samples()[3].abs() < 1e-6);
        }
    }
}

#[test]
fn heads_that_cannot_be_are_refused() {
    let ear = |n: usize| vec![vec![1.0f32, 0.0]; n];
    let ahead = vec![[1.0, 0.0, 0.0]; 2];
    let head = HeadResponses::new(ahead.clone(), ear(2), ear(2), 48_000).unwrap();
    assert!(matches!(
        head.binaural(&wave(1, [1.0, 0.0, 0.0])),
        Err(sabine_propagate::Error::SampleRates { response_hz: 16_000, head_hz: 48_000 })
    ));
    assert!(HeadResponses::new(ahead.clone(), ear(2), ear(1), 48_000).is_err());
    assert!(HeadResponses::new(Vec::new(), Vec::new(), Vec::new(), 48_000).is_err());
    assert!(HeadResponses::new(vec![[0.0; 3]; 2], ear(2), ear(2), 48_000).is_err());
    let uneven = vec![vec![1.0f32], vec![1.0, 2.0]];
    assert!(HeadResponses::new(ahead, uneven.clone(), uneven, 48_000).is_err());
}

#[cfg(feature = "sofa")]
mod sofa {
    use super::*;
    use std::path::Path;

    fn file() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/head/head.sofa")
    }

    #[test]
    fn a_sofa_file_gives_its_directions_responses_and_delays() {
        let head = HeadResponses::read_sofa(file()).unwrap();
        assert_eq!(head.directions().len(), 42);
        for direction in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]] {
            let index = head.nearest(direction);
            let found = head.directions()[index];
            assert!((0..3).all(|i| (found[i] - direction[i]).abs() < 1e-6), "{found:?}");
            let [left, right] = head.pair(index);
            for (ear, at, height) in
                [(left, 3, 1.0 + 0.5 * direction[1]), (right, 7, 1.0 - 0.5 * direction[1])]
            {
                for (i, &sample) in ear.iter().enumerate() {
                    let expected = if i == at { height } else { 0.0 };
                    assert!((f64::from(sample) - expected).abs() < 1e-6, "{direction:?}, {i}: {sample}");
                }
            }
        }
    }

    /// The sum of the taps is the gain at 0 Hz.
    #[test]
    fn another_rate_keeps_the_gain() {
        let head = HeadResponses::read_sofa(file()).unwrap();
        assert_eq!(head.sample_rate_hz(), 48_000);
        let slower = head.resampled(24_000).unwrap();
        assert_eq!(slower.sample_rate_hz(), 24_000);
        let [left, _] = slower.pair(slower.nearest([0.0, 1.0, 0.0]));
        let gain: f32 = left.iter().sum();
        // A pulse three samples from the start loses the ringing that would precede it.
        assert!((gain / 1.5 - 1.0).abs() < 0.1, "{gain}");
    }

    #[test]
    fn files_that_are_broken_or_missing_are_named() {
        let whole = std::fs::read(file()).unwrap();
        let path = std::env::temp_dir().join(format!("sabine-head-{}.sofa", std::process::id()));
        for length in (0..whole.len()).step_by(97) {
            std::fs::write(&path, &whole[..length]).unwrap();
            if let Err(error) = HeadResponses::read_sofa(&path) {
                assert!(error.to_string().starts_with(&path.display().to_string()), "{error}");
            }
        }
        for place in (0..whole.len()).step_by(53) {
            let mut damaged = whole.clone();
            damaged[place] ^= 0xFF;
            std::fs::write(&path, &damaged).unwrap();
            // A flipped sample cannot be noticed; but nothing else than an answer or an error comes out.
            if let Ok(head) = HeadResponses::read_sofa(&path) {
                assert!(!head.directions().is_empty());
            }
        }
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(HeadResponses::read_sofa(&path), Err(sabine_propagate::Error::Sofa { .. })));
    }
}
