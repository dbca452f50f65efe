//! Any bytes as a SOFA file: responses that are whole, or an error.

#![no_main]

mod scratch;

use libfuzzer_sys::fuzz_target;
use sabine_scene::{ImportOptions, Measurements};

fuzz_target!(|bytes: &[u8]| {
    let path = scratch::file("room.sofa", bytes);
    if let Ok(set) = Measurements::read_sofa(&path, &ImportOptions::default()) {
        for response in &set.responses {
            assert!(response.samples.samples().iter().all(|sample| sample.is_finite()));
            assert!(set.sources.iter().any(|source| source.id == response.source));
            assert!(set.receivers.iter().any(|receiver| receiver.id == response.receiver));
        }
    }
});
