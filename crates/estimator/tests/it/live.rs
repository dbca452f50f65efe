//! Batches, streams and long recordings give what one recording at a time gives.

use crate::bursts::bursts;
use sabine_acoustics::Signal;
use sabine_estimator::{
    DetailedEstimate, Error, Estimator, LABEL_COUNT, LiveEstimator, Recording, RecordingEvaluation, Warning,
};

fn part(signal: &Signal, samples: usize) -> Signal {
    Signal::new(signal.samples()[..samples].to_vec(), signal.sample_rate_hz()).unwrap()
}

#[test]
fn a_batch_says_of_each_recording_what_is_said_of_it_alone() {
    let estimator = Estimator::pretrained().unwrap();
    let recordings = [
        bursts(4.0, 0.3, 16_000, 1),
        bursts(11.0, 0.8, 48_000, 2),
        bursts(0.5, 0.3, 16_000, 3),
        bursts(1.7, 1.5, 16_000, 4),
    ];
    let batch = estimator.estimate_batch(&recordings);
    assert_eq!(batch.len(), 4);
    for (recording, found) in recordings.iter().zip(&batch) {
        match (estimator.estimate_detailed(recording), found) {
            (Ok(alone), Ok(found)) => assert_eq!(alone, *found),
            (Err(alone), Err(found)) => assert_eq!(alone.to_string(), found.to_string()),
            (alone, found) => panic!("{alone:?} {found:?}"),
        }
    }
    assert!(matches!(batch[2], Err(Error::TooShort { .. })));
    assert!(estimator.estimate_batch(&[]).is_empty());
}

fn listen(live: &mut LiveEstimator, samples: &[f32], portion: usize) -> Vec<DetailedEstimate> {
    let mut estimates = Vec::new();
    for portion in samples.chunks(portion) {
        live.push(portion, |estimate| estimates.push(estimate.unwrap())).unwrap();
    }
    estimates
}

#[test]
fn a_stream_ends_with_the_estimate_of_the_recording_in_portions_of_any_size() {
    let estimator = Estimator::pretrained().unwrap();
    // A quiet beginning, a clipped middle: nothing that a window says may depend on what comes later.
    let mut samples = bursts(11.3, 0.6, 16_000, 5).into_samples();
    samples[..40_000].iter_mut().for_each(|s| *s *= 0.01);
    samples[90_000..].iter_mut().for_each(|s| *s = s.clamp(-0.2, 0.2));
    let recording = Signal::new(samples, 16_000).unwrap();
    let whole = estimator.estimate_detailed(&recording).unwrap();
    let mut first: Option<Vec<DetailedEstimate>> = None;
    for portion in [1_000_000, 16_000, 441, 97] {
        let mut live = LiveEstimator::new(&estimator);
        let estimates = listen(&mut live, recording.samples(), portion);
        // Full windows end at 4.0, 5.992, 7.984 and 9.976 s of 11.3.
        assert_eq!(estimates.len(), 4);
        for (k, estimate) in estimates.iter().enumerate() {
            let so_far = part(&recording, 64_000 + k * 249 * 128);
            assert_eq!(*estimate, estimator.estimate_detailed(&so_far).unwrap(), "window {k}");
        }
        assert_eq!(live.estimate().unwrap(), whole, "portions of {portion}");
        assert_eq!(*first.get_or_insert(estimates.clone()), estimates);
    }
    assert_eq!(whole.windows.len(), 5);
}

#[test]
fn a_short_stream_and_a_silent_one_are_judged_like_recordings() {
    let estimator = Estimator::pretrained().unwrap();
    let mut live = LiveEstimator::new(&estimator);
    assert!((live.first_latency_s() - 4.0).abs() < 1e-9 && (live.hop_s() - 1.992).abs() < 1e-9);
    let short = bursts(2.5, 0.5, 16_000, 6);
    assert!(listen(&mut live, &short.samples()[..8_000], 100).is_empty());
    assert!(matches!(live.estimate(), Err(Error::TooShort { .. })));
    assert!(listen(&mut live, &short.samples()[8_000..], 100).is_empty());
    let estimate = live.estimate().unwrap();
    assert_eq!(estimate, estimator.estimate_detailed(&short).unwrap());
    assert!(estimate.warnings.iter().any(|w| matches!(w, Warning::Short { .. })));
    // Asking changes nothing.
    assert_eq!(live.estimate().unwrap(), estimate);

    live.reset();
    assert_eq!(live.duration_s(), 0.0);
    let mut silent = 0;
    live.push(&[0.0; 70_000], |estimate| {
        silent += usize::from(matches!(estimate, Err(Error::Silent { .. })))
    })
    .unwrap();
    assert_eq!(silent, 1);
    let bad = live.push(&[0.0, f32::NAN], |_| {});
    assert!(matches!(bad, Err(Error::NotFinite { index: 70_001 })), "{bad:?}");
    assert!((live.duration_s() - 70_000.0 / 16_000.0).abs() < 1e-12);
}

#[test]
fn only_the_newest_windows_of_a_stream_count() {
    let estimator = Estimator::pretrained().unwrap();
    let mut live = LiveEstimator::with_windows(&estimator, 2);
    let (before, after) = (bursts(10.0, 0.25, 16_000, 7), bursts(10.0, 1.2, 16_000, 8));
    let first = listen(&mut live, before.samples(), 1000).pop().unwrap();
    let then = listen(&mut live, after.samples(), 1000).pop().unwrap();
    assert_eq!((first.windows.len(), then.windows.len()), (2, 2));
    let at_1_khz = |e: &DetailedEstimate| e.targets.t60_s().at_hz(1000.0).unwrap().value;
    assert!(at_1_khz(&then) > 1.5 * at_1_khz(&first), "{} {}", at_1_khz(&first), at_1_khz(&then));
}

#[test]
fn long_recordings_are_judged_by_room_and_calibrated() {
    let estimator = Estimator::pretrained().unwrap();
    let mut recordings: Vec<Recording> = (0..6)
        .map(|i| {
            let t60_s = 0.3 + 0.15 * i as f64;
            let mut labels = [0.0; LABEL_COUNT];
            labels[..7].fill(t60_s);
            labels[0] = f64::NAN;
            Recording { room: format!("room {i}"), speech: bursts(9.0, t60_s, 16_000, i), labels }
        })
        .collect();
    let evaluation = RecordingEvaluation::new(&estimator, &recordings, 4.0).unwrap();
    // Two excerpts each, one window in each.
    let errors = evaluation.label(3).unwrap();
    assert_eq!(errors.clips, 12);
    assert_eq!(evaluation.windows(), 1.0);
    let by_hand = |k: usize, i: usize| {
        let samples = recordings[i].speech.samples()[k * 64_000..(k + 1) * 64_000].to_vec();
        let found = estimator.estimate_detailed(&Signal::new(samples, 16_000).unwrap()).unwrap();
        (found.targets.t60_s().at_hz(1000.0).unwrap().value - recordings[i].labels[3]).abs()
    };
    let mean = (0..6).map(|i| 0.5 * (by_hand(0, i) + by_hand(1, i))).sum::<f64>() / 6.0;
    assert!((errors.model.value - mean).abs() < 1e-9);
    assert!(evaluation.label(0).is_none());
    // A label that nobody knows cannot be calibrated.
    assert!(matches!(estimator.calibrated(&recordings, &[8.0]), Err(Error::Dataset { .. })));
    recordings.iter_mut().for_each(|r| r.labels[0] = r.labels[1]);
    let model = estimator.calibrated(&recordings, &[8.0]).unwrap();
    // Wherever something less than full correlation was found, the intervals hold 90 % and more.
    let calibrated = Estimator::new(model.clone()).unwrap();
    let evaluation = RecordingEvaluation::new(&calibrated, &recordings, 8.0).unwrap();
    assert!(matches!(RecordingEvaluation::new(&calibrated, &recordings, 10.0), Err(Error::Dataset { .. })));
    assert!(matches!(RecordingEvaluation::new(&calibrated, &recordings, 0.5), Err(Error::TooShort { .. })));
    for label in 0..LABEL_COUNT {
        let correlation = model.calibration.window_correlation[label];
        let coverage = evaluation.label(label).unwrap().coverage_90;
        assert!((0.0..=1.0).contains(&correlation));
        assert!(coverage >= 0.9 || correlation == 1.0, "label {label}: {coverage} with {correlation}");
    }
}
