//! The parameter "Room" chooses from the folder of rooms. That folder is named in the environment: a process of its own.

use crate::host::{Rack, change, state};
use clack_extensions::params::PluginParams;
use sabine_acoustics::{SampleFormat, write_wav};
use sabine_clap_plugin::Parameter;
use std::path::Path;
use std::process::Command;

/// Set in the process whose environment names the folder.
const INNER: &str = "SABINE_CLAP_TEST_FOLDER";

#[test]
fn rooms_of_the_folder_are_chosen_by_number() {
    if let Some(folder) = std::env::var_os(INNER) {
        return choose_rooms(Path::new(&folder));
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, gain) in [("a half.wav", 0.5), ("b quarter.wav", 0.25)] {
        write_wav(folder.path().join(name), &[gain], 48_000, SampleFormat::Float32).unwrap();
    }
    let elsewhere = folder.path().join("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    write_wav(elsewhere.join("double.wav"), &[2.0], 48_000, SampleFormat::Float32).unwrap();
    let inner = Command::new(std::env::current_exe().unwrap())
        .args(["shelf::rooms_of_the_folder_are_chosen_by_number", "--exact"])
        .env("SABINE_ROOMS", folder.path())
        .env(INNER, folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&inner.stdout);
    assert!(inner.status.success() && said.contains("1 passed"), "{said}");
}

/// The level after a second of ones, with this room chosen meanwhile.
fn level(rack: &mut Rack, room: f64) -> f32 {
    let mut player = rack.start(48e3, 480, 2);
    let ones = vec![1.0; 12_000];
    player.render(&[&ones, &ones], &[change(3, Parameter::Room, room)], &[480]);
    rack.call_back();
    let heard = player.render(&[&ones, &ones], &[], &[480]);
    rack.stop(player);
    heard[0][11_999]
}

fn choose_rooms(folder: &Path) {
    let mut rack = Rack::new();
    let plugin = rack.instance.plugin_handle();
    let parameters: PluginParams = plugin.get_extension().unwrap();
    let mut buffer = [0; 64];
    let mut text = |value| {
        let text = parameters.value_to_text(&plugin, Parameter::Room.id(), value, &mut buffer).unwrap();
        String::from_utf8_lossy(text).into_owned()
    };
    let texts = [0.0, 1.0, 2.0, 3.0].map(&mut text);
    assert_eq!(texts, ["0: built-in hall", "1: no room", "2: a half.wav", "3: b quarter.wav"]);
    assert_eq!(text(99.0), "3: b quarter.wav", "the last");

    let double = folder.join("elsewhere/double.wav");
    assert!(rack.load(state(&double, 0.0, Parameter::LEAST_DB).as_bytes()));
    assert_eq!(rack.value(Parameter::Room), 1.0, "the room of the project");
    for (room, wanted) in [(2.0, 0.5), (3.0, 0.25), (1.0, 2.0), (2.0, 0.5)] {
        assert!((level(&mut rack, room) - wanted).abs() < 1e-5, "room {room}");
    }
    assert_eq!(rack.save(), state(&folder.join("a half.wav"), 0.0, Parameter::LEAST_DB));
    let mut again = Rack::with_room(&folder.join("b quarter.wav"), 0.0, Parameter::LEAST_DB);
    assert_eq!(again.value(Parameter::Room), 3.0);
}
