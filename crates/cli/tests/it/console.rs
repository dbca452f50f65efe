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
