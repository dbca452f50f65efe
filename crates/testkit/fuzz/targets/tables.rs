//! Any bytes as a table of positions, as text of REW and as a geometry file of CATT-Acoustic: something whole, or an error.

#![no_main]

mod scratch;

use libfuzzer_sys::fuzz_target;
use sabine_scene::{ImportOptions, Materials, Measurements, Receiver, Source};

fuzz_target!(|bytes: &[u8]| {
    let options = ImportOptions::default();
    let _ = Measurements::read_table(scratch::file("positions.csv", bytes), &options);
    let source = Source { id: "s1".into(), position_m: [0.0; 3], axis: None };
    let receiver = Receiver { id: "r1".into(), position_m: [1.0; 3], axis: None };
    if let Ok(set) = Measurements::read_single(scratch::file("rew.txt", bytes), source, receiver, &options) {
        assert!(set.responses[0].samples.samples().iter().all(|sample| sample.is_finite()));
    }
    if let Ok(materials) = Materials::read_catt(scratch::file("room.geo", bytes)) {
        let text = materials.to_toml().expect("tables that were read can be written");
        Materials::from_toml(&text).expect("and read again");
    }
});
