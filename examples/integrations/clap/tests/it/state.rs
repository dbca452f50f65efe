//! What a project keeps.

use crate::host::{Rack, decay, noise, state};
use sabine_acoustics::{SampleFormat, write_wav};
use sabine_clap_plugin::Parameter;
use std::sync::atomic::Ordering;

#[test]
fn a_project_brings_room_and_gains_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a hall, ü.wav");
    write_wav(&path, &decay(4000, 1), 48_000, SampleFormat::Float32).unwrap();
    let mut rack = Rack::with_room(&path, -3.25, -30.0);
    assert!(rack.asked.rescans.load(Ordering::Relaxed) > 0, "hosts show the new values");
    let saved = rack.save();
    assert_eq!(saved, state(&path, -3.25, -30.0));
    let mut again = Rack::new();
    assert!(again.load(saved.as_bytes()));
    assert_eq!(again.save(), saved);
    assert_eq!((again.value(Parameter::Wet), again.value(Parameter::Dry)), (-3.25, -30.0));
    let input = noise(6000, 2, 0.5);
    let heard = [&mut rack, &mut again].map(|rack| {
        let mut player = rack.start(48e3, 333, 2);
        let heard = player.render(&[&input, &input], &[], &[333]);
        rack.stop(player);
        heard
    });
    assert!(heard[0] == heard[1]);
}

#[test]
fn a_new_instance_has_the_built_in_hall_and_no_path() {
    let mut rack = Rack::new();
    let saved = rack.save();
    assert_eq!(saved, "Sabine room 1\nwet_db 0\ndry_db 0\n");
    assert!(rack.load(saved.as_bytes()));
    assert_eq!(rack.save(), saved);
    assert!(rack.load(b"Sabine room 1\nwet_db 0\ndry_db 0\nroom\n"), "and none at all");
    assert_eq!(rack.value(Parameter::Room), 1.0);
    assert_eq!(rack.save(), "Sabine room 1\nwet_db 0\ndry_db 0\nroom\n");
}

#[test]
fn a_room_folder_is_traced() {
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../fixtures/room");
    let path = std::fs::canonicalize(fixture).unwrap();
    let mut rack = Rack::with_room(&path, 0.0, Parameter::LEAST_DB);
    let mut player = rack.start(48e3, 4096, 2);
    let mut impulse = vec![0.0; 48_000];
    impulse[0] = 1.0;
    let heard = player.render(&[&impulse, &impulse], &[], &[4096]);
    // The direct sound takes 13.77 ms (examples/trace_room.rs); 64 samples are the plug-in's.
    let first = heard[0].iter().position(|s| s.abs() > 1e-3).unwrap();
    assert!((first as f64 - (0.01377 * 48e3 + 64.0)).abs() < 24.0, "{first}");
    let energy = |from: usize| heard[1][from..from + 4800].iter().map(|s| f64::from(s * s)).sum::<f64>();
    assert!(energy(4800) > 10.0 * energy(43_200) && energy(43_200) > 0.0, "it decays");
    rack.stop(player);
}
