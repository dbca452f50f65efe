//! From recordings to the prior, the likelihood and the detectors of the weights.

use crate::error::Error;
use crate::record::{DEFECTS, PLAIN, Record};
use crate::rooms::Use;
use sabine::estimator::{Combination, Detectors, Evidence, HeardPlace, Model, Sound};
use std::collections::BTreeMap;

/// Longest middle reverberation time that the combination is fitted to, in seconds: the network was trained to 2.5 s and says little
/// of longer ones.
const LONGEST_FITTED_S: f64 = 2.5;
/// Shorter rooms must not count as beyond the range of the training, longer ones should, in seconds.
const RANGE_S: [f64; 2] = [2.3, 2.5];

/// What each sound is among the recordings, and the share of plain speech that may pass for it.
const SOUNDS: [(Sound, &[&str], f64); 6] = [
    (Sound::Noise, &["noise alone"], 0.003),
    (Sound::Music, &["music"], 0.005),
    (Sound::Telephone, &["telephone"], 0.003),
    (Sound::BandLimited, &["11.025 kHz"], 0.003),
    (Sound::SeveralTalkers, &["two talkers", "three talkers"], 0.015),
    (Sound::Dry, &["no room"], 0.005),
];
/// The same of rooms beyond the range.
const LONG_FALSE_ALARMS: f64 = 0.015;

/// The model with combination and detectors learned.
///
/// # Errors
/// What [`Combination::fit`] refuses.
pub fn learn(mut model: Model, records: &[Record]) -> Result<Model, Error> {
    debug_assert!(SOUNDS.iter().all(|(_, names, _)| names.iter().all(|name| DEFECTS.contains(name))));
    let windows = &model.calibration.window_correlation;
    model.combination = Some(Combination::fit(&model.labels, windows, &places(records))?);
    model.detectors = Some(detectors(records));
    Ok(model)
}

/// Places of rooms whose decay the network was trained for.
fn places(records: &[Record]) -> Vec<HeardPlace> {
    let mut places: BTreeMap<(&str, usize), HeardPlace> = BTreeMap::new();
    for record in records.iter().filter(|r| r.condition == PLAIN) {
        let in_range = record.middle_t60_s < LONGEST_FITTED_S;
        if !in_range && record.used == Use::Simulated {
            continue;
        }
        let place = places.entry((&record.room, record.response)).or_insert_with(|| HeardPlace {
            room: record.room.clone(),
            measured: record.used != Use::Simulated,
            is_judged: record.used != Use::Prior && in_range,
            labels: record.labels,
            recordings: Vec::new(),
        });
        place.recordings.push(record.estimate.evidence.clone());
    }
    places.into_values().collect()
}

fn detectors(records: &[Record]) -> Detectors {
    let of = |wanted: &dyn Fn(&Record) -> bool| -> Vec<&Evidence> {
        records.iter().filter(|r| wanted(r)).map(|r| &r.estimate.evidence).collect()
    };
    let plain = of(&|r| r.condition == PLAIN);
    let mut detectors = Detectors::of_inputs(plain.iter().copied());
    for (sound, conditions, false_alarms) in SOUNDS {
        let with = of(&|r| conditions.contains(&r.condition));
        detectors = detectors.learned(sound, &with, &plain, false_alarms);
    }
    let short = of(&|r| r.condition == PLAIN && r.middle_t60_s < RANGE_S[0]);
    let long = of(&|r| r.condition == PLAIN && r.middle_t60_s > RANGE_S[1]);
    detectors.learned(Sound::LongDecay, &long, &short, LONG_FALSE_ALARMS)
}
