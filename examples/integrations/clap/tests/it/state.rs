//! What a project keeps.

use crate::host::{Rack, decay, noise, state};
use sabine_acoustics::{SampleFormat, write_wav};
use sabine_clap_plugin::Parameter;
use std::path::Path;
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

/// The response to the left of the room in a folder, as it is heard.
fn heard_in(folder: &Path) -> Vec<f32> {
    let mut rack = Rack::with_room(folder, 0.0, Parameter::LEAST_DB);
    let mut player = rack.start(48e3, 4096, 2);
    let mut impulse = vec![0.0; 48_000];
    impulse[0] = 1.0;
    let [left, _] = player.render(&[&impulse, &impulse], &[], &[4096]);
    rack.stop(player);
    left
}

/// Energy of a tenth of a second, in dB.
fn level_db(heard: &[f32], from_s: f64) -> f64 {
    let from = (from_s * 48e3) as usize;
    10.0 * heard[from..from + 4800].iter().map(|s| f64::from(s * s)).sum::<f64>().log10()
}

#[test]
fn a_room_folder_is_traced() {
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../fixtures/room");
    let heard = heard_in(&std::fs::canonicalize(fixture).unwrap());
    // The direct sound takes 13.77 ms (examples/trace_room.rs); 64 samples are the plug-in's.
    let first = heard.iter().position(|s| s.abs() > 1e-2).unwrap();
    assert!(first.abs_diff(661 + 64) <= 5, "{first}");
    // T30 from 0.6 s at 8 kHz to 1.9 s at 125 Hz.
    let fall_db = level_db(&heard, 0.3) - level_db(&heard, 0.8);
    assert!((0.5 / 1.9 * 60.0..0.5 / 0.55 * 60.0).contains(&fall_db), "{fall_db} dB");
}

#[test]
fn what_a_diagnosis_found_is_in_force_beside_the_room_file() {
    let fixture = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../fixtures/room"));
    let folder = tempfile::tempdir().unwrap();
    let path = std::fs::canonicalize(folder.path()).unwrap();
    std::fs::create_dir(path.join("ir")).unwrap();
    for file in ["room.toml", "room.obj", "ir/talker_microphone.wav", "ir/talker_corner.wav"] {
        std::fs::copy(fixture.join(file), path.join(file)).unwrap();
    }
    let stated = heard_in(&path);
    let dull = "version = 2\ncentres_hz = [125, 250, 500, 1000, 2000, 4000, 8000]\n\n[absorption]\n\
        plaster = [0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6]\nparquet = [0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6]\n";
    std::fs::write(path.join("extended_model.toml"), dull).unwrap();
    let found = heard_in(&path);
    let [stated_db, found_db] = [&stated, &found].map(|heard| level_db(heard, 0.3));
    assert!(found_db < stated_db - 10.0, "{found_db} dB, {stated_db} dB");
    std::fs::write(path.join("extended_model.toml"), "version = 2\nhall = 1\n").unwrap();
    let mut rack = Rack::new();
    assert!(!rack.load(state(&path, 0.0, 0.0).as_bytes()));
    assert!(rack.asked.log()[0].1.contains("extended_model.toml"));
}
