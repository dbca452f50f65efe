//! Does the decay become what was asked for, and does nothing else change?

use crate::material::{quantile, response};
use sabine_acoustics::{Bands, FilterBank, ImpulseResponse};
use sabine_augment::Augment;
use sabine_augment::{Error, Labels, T60Augment, T60Config};

/// Reverberation times of the octaves that can be read.
fn times(response: &ImpulseResponse) -> Vec<Option<f64>> {
    let labels = Labels::measure(response).unwrap();
    labels.t60_s().values().iter().map(|r| r.as_ref().ok().map(|e| e.value)).collect()
}

/// Relative errors of every octave of every pair of recording and target.
fn errors(recorded: &[ImpulseResponse], targets_s: &[f64]) -> Vec<f64> {
    let augment = T60Augment::new(T60Config::default()).unwrap();
    let mut errors = Vec::new();
    for (i, response) in recorded.iter().enumerate() {
        let before = times(response);
        let full_band_s = augment.full_band_s(response).unwrap();
        for (j, &target_s) in targets_s.iter().enumerate() {
            let changed = augment.to_s(response, target_s, (10 * i + j) as u64).unwrap();
            for (before, after) in before.iter().zip(times(&changed)) {
                if let (Some(before), Some(after)) = (before, after) {
                    errors.push((after / (before * target_s / full_band_s) - 1.0).abs());
                }
            }
        }
    }
    errors
}

#[test]
fn the_time_measured_afterwards_is_the_time_asked_for() {
    let recorded: Vec<ImpulseResponse> = (0..6)
        .map(|i| response([0.25, 0.5, 0.9][i % 3], 1.5, [50.0, 70.0][i % 2], 16_000, i as u64))
        .collect();
    let mut errors = errors(&recorded, &[0.12, 0.3, 0.6, 1.0, 1.5]);
    let (median, high) = (quantile(&mut errors, 0.5), quantile(&mut errors, 0.95));
    eprintln!(
        "{} readings: median error {:.2} %, 95th percentile {:.2} %",
        errors.len(),
        100.0 * median,
        100.0 * high
    );
    assert!(errors.len() > 150);
    assert!(median < 0.03, "median {median}");
    assert!(high < 0.10, "95th percentile {high}");
}

#[test]
fn the_decay_goes_on_below_the_old_noise_floor() {
    // 0.5 s over a floor that is reached after 0.2 s; asked for the same time, without the floor.
    let recorded = response(0.5, 1.0, 45.0, 16_000, 3);
    let augment = T60Augment::new(T60Config::default()).unwrap();
    let changed = augment.by_factor(&recorded, 1.0, 1).unwrap();
    let bands =
        FilterBank::new(Bands::octaves(500.0, 4000.0).unwrap(), 16_000).unwrap().split(changed.samples());
    for (hz, band) in bands.iter() {
        let level_db = |from_s: f64| {
            let block = &band[(from_s * 16e3) as usize..][..1600];
            10.0 * (block.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>() / 1600.0).log10()
        };
        // 12 dB in 0.1 s. The block holds at least 35 independent pairs: 0.75 dB of scatter each, four standard errors.
        for step in 1..7 {
            let fall_db = level_db(0.1 * f64::from(step)) - level_db(0.1 * f64::from(step + 1));
            assert!((fall_db - 12.0).abs() < 4.3, "{hz} Hz, step {step}: {fall_db} dB");
        }
        // Over 0.6 s the fit's own error shows: at most 10 %.
        let whole_db = level_db(0.1) - level_db(0.7);
        assert!((whole_db - 72.0).abs() < 7.2, "{hz} Hz: {whole_db} dB over 0.6 s");
    }
}

#[test]
fn there_is_no_click_where_recording_and_noise_meet() {
    // The mean over many recordings of the energy in 5 ms follows the exponential.
    let augment = T60Augment::new(T60Config::default()).unwrap();
    let (count, block) = (60, 80);
    let mut energy = vec![0.0; 60];
    for seed in 0..count {
        let changed = augment.to_s(&response(0.3, 0.6, 50.0, 16_000, seed), 0.5, seed).unwrap();
        for (i, sum) in energy.iter_mut().enumerate() {
            let from = 400 + i * block;
            *sum += changed.samples()[from..from + block].iter().map(|&s| f64::from(s).powi(2)).sum::<f64>();
        }
    }
    // 60 x 80 independent values: 0.09 dB of scatter. The line is fitted, the slope is not under test here.
    let level_db: Vec<f64> = energy.iter().map(|e| 10.0 * e.log10()).collect();
    let n = level_db.len() as f64;
    let (mean_x, mean_y) = ((n - 1.0) / 2.0, level_db.iter().sum::<f64>() / n);
    let slope = level_db.iter().enumerate().map(|(i, y)| (i as f64 - mean_x) * (y - mean_y)).sum::<f64>()
        / level_db.iter().enumerate().map(|(i, _)| (i as f64 - mean_x).powi(2)).sum::<f64>();
    for (i, y) in level_db.iter().enumerate() {
        let off_db = y - (mean_y + slope * (i as f64 - mean_x));
        assert!(off_db.abs() < 1.0, "{} ms: {off_db} dB off", 25 + 5 * i);
    }
}

#[test]
fn the_direct_sound_stays_to_the_bit() {
    let recorded = response(0.5, 1.0, 60.0, 48_000, 4);
    let augment = T60Augment::new(T60Config::default()).unwrap();
    for target_s in [0.15, 1.2] {
        let changed = augment.to_s(&recorded, target_s, 9).unwrap();
        // 2.5 ms on either side of sample 100, and all before.
        assert_eq!(changed.samples()[..221], recorded.samples()[..221]);
        assert_ne!(changed.samples()[400..800], recorded.samples()[400..800]);
    }
}

#[test]
fn the_seed_decides() {
    let recorded = response(0.4, 0.8, 50.0, 16_000, 5);
    let augment = T60Augment::new(T60Config::default()).unwrap();
    let make = |seed| augment.augment(&recorded, seed).unwrap();
    assert_eq!(make(1), make(1));
    assert_ne!(make(1), make(2));
}

#[test]
fn what_has_no_decay_is_refused() {
    let augment = T60Augment::new(T60Config::default()).unwrap();
    let mut steady = response(1e6, 1.0, 60.0, 16_000, 6).into_samples();
    steady[100] = 3.0;
    let refused = augment.to_s(&ImpulseResponse::new(steady, 16_000).unwrap(), 0.5, 1);
    assert!(matches!(refused, Err(Error::NoDecay { .. })), "{refused:?}");
    let silent = ImpulseResponse::new(vec![0.0; 16_000], 16_000).unwrap();
    assert!(matches!(augment.to_s(&silent, 0.5, 1), Err(Error::NoDirectSound { .. })));
    assert!(T60Augment::new(T60Config { t60_s: (1.5, 0.1), ..T60Config::default() }).is_err());
}
