//! The whole application on a device that is on every Linux: ALSA's `null`, which takes all sound at once and plays none.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use std::io::Write;
use std::process::{Command, Output, Stdio};

/// Runs it, with these lines typed at the start.
fn run(arguments: &[&str], typed: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_sabine-cpal"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut keyboard = child.stdin.take().unwrap();
    // It may have ended with an error before it reads.
    let _ = keyboard.write_all(typed.as_bytes());
    drop(keyboard);
    child.wait_with_output().unwrap()
}

#[test]
fn a_recording_is_played_and_what_is_typed_is_obeyed() {
    let corner = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../../fixtures/room/ir/talker_corner.wav");
    let typed = format!("wet 0.25\nwet loud\n{corner}\nnone.wav\n");
    for rate in ["44100", "48000"] {
        let output = run(&["--device", "alsa:null", "--rate", rate, "--seconds", "1"], &typed);
        let (said, errors) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{said}{errors}");
        assert!(said.contains(&format!("{rate} Hz")) && said.contains("0 gaps and 0 faults"), "{said}");
        for line in
            ["wet 0.25\n", "wet loud: `loud` is no gain", &format!("{corner}\n"), "none.wav: none.wav: "]
        {
            assert!(said.contains(line), "{line} is not in {said}");
        }
        let seconds: f64 =
            said.split(" s of sound").next().unwrap().rsplit('\n').next().unwrap().parse().unwrap();
        assert!(seconds > 1.0, "{said}");
    }
}

#[test]
fn a_machine_without_a_microphone_is_an_error_and_no_panic() {
    // The default device is what the machine has: where there is a microphone, it is heard.
    let output = run(&["--device", "alsa:null", "--microphone", "--seconds", "1"], "");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() || errors.contains("error: "), "{errors}");
    assert!(!errors.contains("panicked"), "{errors}");
}

#[test]
fn what_does_not_fit_ends_it_with_an_error() {
    for (arguments, expected) in [
        (&["--device", "none"][..], "there is no output `none`; --list names them"),
        (&["--device", "alsa:null", "--rate", "1"], "error: "),
        (&["--device", "alsa:null", "--wet", "nan"], "wet"),
        (&["--device", "alsa:null", "none.wav"], "none.wav"),
        (&["--rate"], "--rate needs a value"),
    ] {
        let output = run(arguments, "");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {errors}");
        assert!(errors.contains(expected) && !errors.contains("panicked"), "{arguments:?}: {errors}");
    }
}
