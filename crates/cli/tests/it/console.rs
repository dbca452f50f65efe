//! Output that nobody reads, and output that cannot be written.

use crate::sabine;
use std::process::{Command, Stdio};

#[test]
fn a_reader_that_leaves_is_no_error() {
    // The reader is gone before anything is printed.
    for job in
        [&["completions", "bash"][..], &["--help"], &["eq", "--gains-db", "-3,0", "--sample-rate", "48000"]]
    {
        let folder = tempfile::tempdir().unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_sabine"))
            .args(job)
            .current_dir(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && message.is_empty(), "{job:?}: {message}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_an_error_and_no_panic() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = sabine("completions").arg("bash").stdout(full).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("standard output") && !message.contains("panicked"), "{message}");
}

#[test]
fn negative_gains_are_values() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("fir.wav");
    let output = sabine("eq")
        .args(["--gains-db", "-3,0,-1,2,0,1,-6", "--sample-rate", "48000", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(out.exists());
}

#[test]
fn manual_pages_cover_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let output = sabine("man").arg("--out").arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for job in sabine_cli::command().get_subcommands() {
        let page =
            std::fs::read_to_string(folder.path().join(format!("sabine-{}.1", job.get_name()))).unwrap();
        assert!(page.contains(".TH") && page.contains("sabine"), "{}", job.get_name());
    }
}

/// A file of two channels: the left one rings longer.
fn stereo(folder: &std::path::Path) -> std::path::PathBuf {
    use sabine::acoustics::{SampleFormat, write_wav_channels};
    let decay = |t60_s: f32| -> Vec<f32> {
        let noise = (0..24_000u32).map(|i| ((i.wrapping_mul(2_654_435_761) >> 8) as f32 / 8_388_608.0) - 1.0);
        noise.enumerate().map(|(i, n)| 0.3 * n * (-6.9 * i as f32 / 48_000.0 / t60_s).exp()).collect()
    };
    let path = folder.join("stereo.wav");
    write_wav_channels(&path, &[&decay(0.4), &decay(0.2)], 48_000, SampleFormat::Float32).unwrap();
    path
}

#[test]
fn a_file_of_two_channels_names_the_option_that_chooses() {
    let folder = tempfile::tempdir().unwrap();
    let file = stereo(folder.path());
    let refused = sabine("measure").arg(&file).output().unwrap();
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{message}");
    for part in ["stereo.wav", "2 channels", "--channel 0", "--channel mean"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    for choice in ["0", "1", "mean"] {
        let output = sabine("measure").arg(&file).args(["--channel", choice]).output().unwrap();
        assert!(output.status.success(), "{choice}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let odd = sabine("measure").arg(&file).args(["--channel", "left"]).output().unwrap();
    assert_eq!(odd.status.code(), Some(2));
}

#[test]
fn too_few_speakers_are_found_before_rooms_are_traced() {
    let folder = tempfile::tempdir().unwrap();
    let fixtures = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    for speaker in ["one", "two"] {
        // The speaker is the name up to the first hyphen.
        let own = folder.path().join("speech").join(format!("{speaker}-1.wav"));
        std::fs::create_dir_all(own.parent().unwrap()).unwrap();
        std::fs::copy(fixtures.join("speech/dry_talker.wav"), own).unwrap();
    }
    let out = folder.path().join("out");
    // So many rooms would take an hour.
    let output = sabine("augment")
        .arg("--speech")
        .arg(folder.path().join("speech"))
        .arg("--rir")
        .arg(fixtures.join("room/ir"))
        .args(["--rooms", "20000", "--count", "10", "--measured", "0", "0", "0", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("at least 3 speakers needed, 2 found"), "{message}");
    assert!(!out.join("rooms").exists());
}
