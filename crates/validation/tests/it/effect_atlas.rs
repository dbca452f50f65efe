//! An atlas made by several processes: byte for byte what one process makes, though one of them is killed.

use std::ffi::OsString;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Four small rooms: what is found in them does not matter here.
const ROOMS: [&str; 8] =
    ["--effects", "none,truncation", "--rooms", "2", "--receivers", "4", "--rays", "300"];

fn atlas(out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_effect_atlas"));
    command.args(ROOMS).arg("--out").arg(out).args(more).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn files(folder: &Path) -> Vec<(OsString, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    let mut all: Vec<_> = entries.map(|e| (e.file_name(), std::fs::read(e.path()).unwrap())).collect();
    all.sort();
    all
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// Kills the process once the file is there, in the middle of its next room.
fn kill_after(mut worker: Child, path: &Path) {
    let begun = Instant::now();
    while !path.exists() {
        assert!(begun.elapsed() < Duration::from_secs(500), "{} does not come", path.display());
        assert!(worker.try_wait().unwrap().is_none(), "ended before {} was there", path.display());
        std::thread::sleep(Duration::from_millis(5));
    }
    worker.kill().unwrap();
    worker.wait().unwrap();
}

#[test]
fn two_workers_of_which_one_is_killed_make_the_atlas_of_one_process() {
    let folder = tempfile::tempdir().unwrap();
    let (alone, shared) = (folder.path().join("alone"), folder.path().join("shared"));
    // Another number of threads for each.
    let output = atlas(&alone, &[]).env("RAYON_NUM_THREADS", "2").output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    assert!(
        said(&output).contains("4 rooms made") && said(&output).contains("## Figures"),
        "{}",
        said(&output)
    );

    let first =
        atlas(&shared, &["--worker", "1/2", "--resume"]).env("RAYON_NUM_THREADS", "1").spawn().unwrap();
    kill_after(first, &shared.join("room-00001.json"));
    assert!(!shared.join("room-00003.json").exists(), "it was killed too late to show anything");
    for (worker, wanted) in [("2/2", "2 rooms made, 0 kept"), ("1/2", "1 rooms made, 1 kept")] {
        let output = atlas(&shared, &["--worker", worker, "--resume"]).output().unwrap();
        assert!(output.status.success() && said(&output).contains(wanted), "{}", said(&output));
    }
    assert!(files(&alone) == files(&shared), "not the same bytes");
    assert_eq!(files(&alone).len(), 6, "four rooms, the plan and the record");
    let record = std::fs::read_to_string(alone.join("record.csv")).unwrap();
    assert_eq!(record.lines().count(), 5, "{record}");

    // The record is read as those are that one process keeps.
    let mut again = Command::new(env!("CARGO_BIN_EXE_effect_atlas"));
    let output = again.args(["--rooms", "0", "--record"]).arg(alone.join("record.csv")).output().unwrap();
    assert!(said(&output).contains("| seconds for a diagnosis (median) | - | |"), "{}", said(&output));
}

#[test]
fn arguments_that_do_not_fit_the_folder_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("taken");
    std::fs::create_dir(&taken).unwrap();
    std::fs::write(taken.join("plan.json"), "{}").unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let cases: [(&Path, &[&str], &str); 5] = [
        (&taken, &[], "--resume goes on with it"),
        (&taken, &["--resume"], "plan.json: was begun with other settings"),
        (&taken, &["--worker", "3/2"], "part 3 of 2 does not exist"),
        (&taken, &["--record", "r.csv"], "cannot be used with"),
        (&file, &[], "file: "),
    ];
    for (out, more, wanted) in cases {
        let output = atlas(out, more).output().unwrap();
        assert!(!output.status.success() && said(&output).contains(wanted), "{more:?}: {}", said(&output));
    }
    assert_eq!(std::fs::read_to_string(taken.join("plan.json")).unwrap(), "{}");
    assert_eq!(std::fs::read_dir(&taken).unwrap().count(), 1);
}
