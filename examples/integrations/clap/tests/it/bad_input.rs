//! What goes wrong is refused or said in the host's log; nothing panics.

use crate::host::{Rack, noise, state};
use clack_extensions::log::LogSeverity;
use sabine_acoustics::{SampleFormat, write_wav, write_wav_channels};
use sabine_clap_plugin::Parameter;
use std::path::Path;
use std::sync::atomic::Ordering;

/// The one thing that was logged; a caught panic would be `PluginMisbehaving`.
fn logged(rack: &Rack, severity: LogSeverity) -> String {
    let log = rack.asked.log();
    assert_eq!(log.len(), 1, "{log:?}");
    assert_eq!(log[0].0, severity, "{log:?}");
    log[0].1.clone()
}

#[test]
fn states_that_are_not_ours_change_nothing() {
    let mut rack = Rack::new();
    let before = rack.save();
    let cut = &b"Sabine room 1\nwet_db -6"[..];
    let long = [&b"Sabine room 1\nwet_db -6\ndry_db 0\nroom /"[..], &vec![b'a'; 1 << 20]].concat();
    for bad in [&b""[..], cut, &[0xff; 300], b"Sabine room 1\nwet_db 1e99\ndry_db 0\n", b"{\"room\": 1}"] {
        assert!(!rack.load(bad));
        assert!(logged(&rack, LogSeverity::Error).contains("state") || bad.starts_with(b"Sabine"));
        assert_eq!(rack.save(), before);
    }
    assert!(!rack.load(&long));
    logged(&rack, LogSeverity::Error);
}

#[test]
fn rooms_that_cannot_be_read_are_named_kept_and_silent() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("text.wav"), "not a sound").unwrap();
    std::fs::write(path("empty.wav"), "").unwrap();
    std::fs::create_dir(path("bare")).unwrap();
    let ten: Vec<f32> = vec![0.1; 11_000];
    write_wav(path("long.wav"), &ten, 1000, SampleFormat::Float32).unwrap();
    write_wav(path("loud.wav"), &[0.0, 1e9], 48_000, SampleFormat::Float32).unwrap();
    write_wav(path("nan.wav"), &[0.0, 0.1], 48_000, SampleFormat::Float32).unwrap();
    let mut bytes = std::fs::read(path("nan.wav")).unwrap();
    let end = bytes.len();
    bytes[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    std::fs::write(path("nan.wav"), bytes).unwrap();
    write_wav_channels(path("three.wav"), &[&[0.1], &[0.2], &[0.3]], 48_000, SampleFormat::Int16).unwrap();
    let names = ["none.wav", "text.wav", "empty.wav", "bare", "long.wav", "loud.wav", "nan.wav", "three.wav"];
    for name in names {
        let mut rack = Rack::new();
        let state = state(&path(name), 0.0, -6.0);
        assert!(!rack.load(state.as_bytes()), "{name}");
        assert!(logged(&rack, LogSeverity::Error).contains(name), "{name}");
        assert_eq!(rack.save(), state, "the project keeps the path");
        let mut player = rack.start(48e3, 100, 2);
        assert!(logged(&rack, LogSeverity::Error).contains(name), "said again when it is to sound");
        let heard = player.render(&[&[1.0; 1000], &[1.0; 1000]], &[], &[100]);
        assert!(heard[1][64..].iter().all(|s| (s - 0.501_187_2).abs() < 1e-6), "the dry sound alone");
        rack.stop(player);
    }
}

#[test]
fn another_room_that_is_missing_silences_the_one_that_plays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.wav");
    write_wav(&path, &[0.5], 48_000, SampleFormat::Float32).unwrap();
    let mut rack = Rack::with_room(&path, 0.0, Parameter::LEAST_DB);
    let mut player = rack.start(48e3, 480, 2);
    let ones = vec![1.0; 9600];
    assert_eq!(player.render(&[&ones, &ones], &[], &[480])[0][9599], 0.5);
    assert!(!rack.load(state(&folder.path().join("none.wav"), 0.0, Parameter::LEAST_DB).as_bytes()));
    assert!(logged(&rack, LogSeverity::Error).contains("none.wav"));
    assert_eq!(player.render(&[&ones, &ones], &[], &[480])[0][9599], 0.0);
    rack.stop(player);
}

#[test]
fn a_path_of_another_system_is_kept_but_not_followed() {
    let foreign = if cfg!(windows) { "/rooms/hall.wav" } else { "C:\\rooms\\hall.wav" };
    let mut rack = Rack::new();
    let state = state(Path::new(foreign), 0.0, -6.0);
    assert!(!rack.load(state.as_bytes()));
    assert!(logged(&rack, LogSeverity::Error).contains("root"));
    assert_eq!(rack.save(), state);
}

#[test]
fn a_file_that_comes_back_is_heard_with_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("late.wav");
    let mut rack = Rack::new();
    assert!(!rack.load(state(&path, 0.0, Parameter::LEAST_DB).as_bytes()));
    write_wav(&path, &[0.5], 48_000, SampleFormat::Float32).unwrap();
    let mut player = rack.start(48e3, 100, 2);
    assert_eq!(player.render(&[&[1.0; 200], &[1.0; 200]], &[], &[100])[0][199], 0.5);
    rack.stop(player);
}

#[test]
fn sample_rates_that_no_room_has_are_refused() {
    let mut rack = Rack::new();
    for rate_hz in [0.0, f64::NAN, -48e3, 999.0, 1e9, f64::INFINITY] {
        assert!(rack.try_start(rate_hz, 64, 2).is_none(), "{rate_hz}");
        assert!(logged(&rack, LogSeverity::Error).contains("sample rate"));
    }
    for rate_hz in [1e3, 1234.567, 47_952.047, 192e3, 768e3] {
        let mut player = rack.start(rate_hz, 64, 2);
        player.render(&[&[0.1; 640], &[0.1; 640]], &[], &[64]);
        rack.stop(player);
    }
    assert_eq!(rack.asked.log(), []);
}

#[test]
fn empty_and_huge_blocks_and_missing_channels_are_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.wav");
    write_wav(&path, &[0.5], 48_000, SampleFormat::Float32).unwrap();
    let mut rack = Rack::with_room(&path, 0.0, Parameter::LEAST_DB);
    let mut player = rack.start(48e3, 1 << 20, 2);
    for _ in 0..3 {
        let [left, right] = player.call(&[&[], &[]], &[], |call| call());
        assert!(left.is_empty() && right.is_empty());
    }
    let input = noise(1 << 20, 1, 1.0);
    let heard = player.render(&[&input, &input], &[], &[1 << 20]);
    assert!(heard[0][64..].iter().zip(&input).all(|(out, given)| (out - 0.5 * given).abs() < 1e-6));
    rack.stop(player);
    // Fewer channels than the plug-in has asked for: the other is silent.
    let mut player = rack.start(48e3, 512, 1);
    let heard = player.render(&[&input[..2048]], &[], &[512]);
    assert!(heard[0][64..].iter().zip(&input).all(|(out, given)| (out - 0.5 * given).abs() < 1e-6));
    assert!(heard[1].iter().all(|s| *s == 0.0));
    rack.stop(player);
    assert_eq!(rack.asked.log(), []);
}

#[test]
fn samples_that_are_no_sound_are_silence_and_said_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.wav");
    write_wav(&path, &vec![0.01; 20_000], 48_000, SampleFormat::Float32).unwrap();
    let mut rack = Rack::with_room(&path, 0.0, 0.0);
    let mut player = rack.start(48e3, 256, 2);
    let bad = [(100, f32::NAN), (2000, f32::INFINITY), (2001, f32::NEG_INFINITY), (5000, f32::MAX)];
    let mut input = noise(8192, 1, 0.5);
    bad.iter().for_each(|(at, _)| input[*at] = 0.0);
    let silent = player.render(&[&input, &input], &[], &[256]);
    player.processor.reset();
    bad.iter().for_each(|(at, bad)| input[*at] = *bad);
    let heard = player.render(&[&input, &input], &[], &[256]);
    assert!(heard == silent && heard.iter().flatten().all(|s| s.is_finite()));
    assert_eq!(rack.asked.callbacks.load(Ordering::Relaxed), 1);
    assert!(rack.call_back());
    assert!(logged(&rack, LogSeverity::HostMisbehaving).contains("not finite"));
    rack.stop(player);
}
