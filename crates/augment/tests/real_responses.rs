//! The augmentations on every usable measured response. Skipped where `../shared/data` is not there.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod material;

use material::{quantile, shared_data};
use sabine_acoustics::{Augment, ImpulseResponse};
use sabine_augment::{
    EqStatistics, Labels, MeasuredResponse, ResponseCorpus, ResponseFilter, T60Augment, T60Config,
};
use std::collections::BTreeMap;

fn corpus() -> Option<ResponseCorpus> {
    let data = shared_data()?;
    let by_file = ["python_acoustics".to_owned(), "decayfitnet".to_owned()];
    // The hand clap is no response.
    let filter =
        ResponseFilter { excluded_rooms: vec!["spatialaudio".to_owned()], ..ResponseFilter::default() };
    let mut corpus = ResponseCorpus::read(&data.join("rir"), 16_000, &filter, &by_file, &()).unwrap();
    corpus.extend(ResponseCorpus::read(&data.join("rooms"), 16_000, &filter, &by_file, &()).unwrap());
    for left_out in corpus.left_out() {
        eprintln!("left out: {}: {}", left_out.path, left_out.reason);
    }
    Some(corpus)
}

/// At most four responses of each room: the rooms count, not the microphones.
fn few_of_each(corpus: &ResponseCorpus) -> Vec<&MeasuredResponse> {
    let mut chosen = Vec::new();
    for room in corpus.rooms() {
        let own: Vec<_> = corpus.responses().iter().filter(|r| r.room == room).collect();
        chosen.extend(own.iter().step_by(own.len().div_ceil(4)).copied());
    }
    chosen
}

fn times(response: &ImpulseResponse) -> Vec<Option<f64>> {
    let labels = Labels::measure(response).unwrap();
    labels.t60_s().values().iter().map(|r| r.as_ref().ok().map(|e| e.value)).collect()
}

#[test]
fn reverberation_times_of_measured_responses_meet_their_targets() {
    let Some(corpus) = corpus() else { return };
    let augment = T60Augment::new(T60Config::default()).unwrap();
    let (mut errors, mut refused, mut asked) = (Vec::new(), 0, 0);
    let mut by_octave: [Vec<f64>; 7] = Default::default();
    for (i, measured) in few_of_each(&corpus).into_iter().enumerate() {
        let before = times(&measured.response);
        for (j, target_s) in [0.1, 0.2, 0.4, 0.7, 1.1, 1.5].into_iter().enumerate() {
            asked += 1;
            let Ok(full_band_s) = augment.full_band_s(&measured.response) else {
                refused += 1;
                continue;
            };
            let Ok(changed) = augment.to_s(&measured.response, target_s, (10 * i + j) as u64) else {
                refused += 1;
                continue;
            };
            for (octave, (before, after)) in before.iter().zip(times(&changed)).enumerate() {
                if let (Some(before), Some(after)) = (before, after) {
                    let error = after / (before * target_s / full_band_s) - 1.0;
                    errors.push(error.abs());
                    by_octave[octave].push(error.abs());
                    if error.abs() > 0.2 {
                        eprintln!(
                            "{} {target_s} s, octave {octave}: {:+.0} % ({before:.2} -> {after:.2} s)",
                            measured.path,
                            100.0 * error
                        );
                    }
                }
            }
        }
    }
    let (median, high) = (quantile(&mut errors, 0.5), quantile(&mut errors, 0.95));
    eprintln!(
        "{} responses asked, {refused} refused; {} readings: median error {:.2} %, 95th percentile {:.2} %",
        asked,
        errors.len(),
        100.0 * median,
        100.0 * high
    );
    for (octave, errors) in by_octave.iter_mut().enumerate() {
        eprintln!(
            "{} Hz: {} readings, median {:.2} %, 95th percentile {:.2} %",
            125 << octave,
            errors.len(),
            100.0 * quantile(errors, 0.5),
            100.0 * quantile(errors, 0.95)
        );
    }
    assert!(median < 0.03, "median {median}");
    assert!(refused * 10 < asked, "{refused} of {asked} refused");
}

#[test]
fn the_shipped_statistics_are_those_of_the_responses() {
    let Some(corpus) = corpus() else { return };
    let rooms = corpus.rooms();
    let labels: Vec<Vec<Labels>> = rooms
        .iter()
        .map(|room| corpus.responses().iter().filter(|r| &r.room == room).map(|r| r.labels.clone()).collect())
        .collect();
    let fitted = EqStatistics::fit(labels.iter().map(Vec::as_slice)).unwrap();
    eprintln!("{} rooms, {} responses", rooms.len(), fitted.responses());
    eprintln!("mean {:.2?}", fitted.mean_db().values());
    eprintln!("sd   {:.2?}", fitted.standard_deviation_db().values());
    let shipped = EqStatistics::measured();
    for i in 0..7 {
        assert!((fitted.mean_db().values()[i] - shipped.mean_db().values()[i]).abs() < 0.05);
        assert!(
            (fitted.standard_deviation_db().values()[i] - shipped.standard_deviation_db().values()[i]).abs()
                < 0.05
        );
    }
    assert_eq!(fitted.responses(), shipped.responses());
}

#[test]
fn most_changes_of_measured_responses_are_granted_and_keep_the_direct_sound_in_front() {
    let Some(corpus) = corpus() else { return };
    let chain = sabine_augment::Chain::for_training(16_000).unwrap();
    let t60 = T60Augment::new(T60Config::default()).unwrap();
    let (mut granted, mut asked) = (0, 0);
    for room in corpus.rooms() {
        let measured = few_of_each(&corpus).into_iter().find(|r| r.room == room).unwrap();
        let mut reasons = BTreeMap::new();
        for seed in 0..30 {
            asked += 1;
            let outcome = match chain.augment(&measured.response, seed) {
                Ok(_) => "granted".to_owned(),
                Err(error) => error.to_string().chars().filter(|c| !c.is_ascii_digit()).collect(),
            };
            granted += u32::from(outcome == "granted");
            *reasons.entry(outcome).or_insert(0) += 1;
            if let Ok(changed) = t60.augment(&measured.response, seed) {
                // No late growth: what comes 0.1 s after the largest sample of the recording stays below it.
                let peak = measured
                    .response
                    .samples()
                    .iter()
                    .position(|s| s.abs() == measured.response.peak())
                    .unwrap();
                let late = changed.samples()[peak + 1600..].iter().fold(0.0_f32, |p, s| p.max(s.abs()));
                assert!(
                    late < measured.response.peak(),
                    "{} seed {seed}: the tail grows to {late}",
                    measured.path
                );
            }
        }
        eprintln!("{room}: {reasons:?}");
    }
    eprintln!("{granted} of {asked} granted");
    assert!(granted * 10 > asked * 7, "{granted} of {asked}");
}
