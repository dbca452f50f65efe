//! Checkpoints when something goes wrong: there is always a whole one, and training goes on from it.

use crate::process::{self, snapshot};
use crate::support;
use sabine_estimator::{Block, Dataset, Error, NetworkConfig, Summary, TrainConfig, Trained, Trainer};
use std::io::Write;
use std::path::Path;
use std::time::Duration;

const CHECKPOINT: &str = "checkpoint.safetensors";

/// A training of twelve short epochs.
fn train(data: &Path, out: Option<&Path>, resume: bool) -> Result<Trained, Error> {
    let block = |channels, kernel, pool| Block { channels, kernel, pool };
    let config = TrainConfig {
        network: NetworkConfig {
            blocks: vec![block(4, [1, 2], [1, 4]), block(8, [1, 2], [2, 4])],
            summary: Summary::TimeMean,
            hidden: Some(8),
            ..NetworkConfig::small()
        },
        epochs: 12,
        batch: 16,
        ..TrainConfig::default()
    };
    Trainer::new(config, &Dataset::open(data)?, out)?.train(resume, &())
}

fn bytes(trained: Result<Trained, Error>) -> Vec<u8> {
    trained.unwrap().model.to_safetensors(false).unwrap()
}

/// Data and an interrupted training: a checkpoint after some epochs.
fn interrupted(folder: &Path) {
    std::fs::create_dir(folder.join("data")).unwrap();
    support::usual(&folder.join("data"));
    let out = folder.join("out");
    std::fs::create_dir(&out).unwrap();
    let begun = || out.join(CHECKPOINT).exists();
    process::killed("faults::child_trains", folder, Duration::ZERO, begun);
}

#[test]
#[ignore = "run by the other tests in a process of its own"]
fn child_trains() {
    let Some(folder) = process::folder() else { return };
    train(&folder.join("data"), Some(&folder.join("out")), false).unwrap();
    // The others are to kill it before this.
    std::thread::sleep(Duration::from_secs(60));
}

#[test]
fn a_training_that_was_killed_goes_on_from_a_whole_checkpoint() {
    let whole = tempfile::tempdir().unwrap();
    support::usual(whole.path());
    let whole = bytes(train(whole.path(), None, false));
    for round in 0..4 {
        let folder = tempfile::tempdir().unwrap();
        let (data, out) = (folder.path().join("data"), folder.path().join("out"));
        std::fs::create_dir(&data).unwrap();
        std::fs::create_dir(&out).unwrap();
        support::usual(&data);
        let begun = || out.join(CHECKPOINT).exists();
        process::killed("faults::child_trains", folder.path(), Duration::from_millis(41 * round), begun);
        assert!(bytes(train(&data, Some(&out), true)) == whole, "round {round}");
    }
}

#[test]
#[ignore = "run by the other tests in a process of its own"]
fn child_fails() {
    let Some(folder) = process::folder() else { return };
    let out = folder.join("out");
    let before = snapshot(&out);
    let error = train(&folder.join("data"), Some(&out), true).err().unwrap();
    assert!(error.to_string().contains(CHECKPOINT), "{error}");
    assert!(snapshot(&out) == before, "{:?}", snapshot(&out).keys());
    process::done();
}

#[test]
fn a_folder_that_cannot_be_written_to_keeps_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    interrupted(folder.path());
    process::in_read_only_folder("faults::child_fails", folder.path());
    // It is as good as before.
    let (data, out) = (folder.path().join("data"), folder.path().join("out"));
    assert!(bytes(train(&data, Some(&out), true)) == bytes(train(&data, None, false)));
}

#[test]
#[ignore = "run by the other tests in a process of its own"]
fn child_fills_the_disk() {
    let Some(disk) = process::folder() else { return };
    let data = tempfile::tempdir().unwrap();
    support::usual(data.path());
    let mut filler = std::fs::File::create(disk.join("filler")).unwrap();
    let error = loop {
        if let Err(error) = filler.write_all(&[0; 1024]) {
            break error;
        }
    };
    if error.kind() == std::io::ErrorKind::StorageFull {
        let error = train(data.path(), Some(&disk), false).err().unwrap();
        assert!(error.to_string().contains(CHECKPOINT), "{error}");
        assert_eq!(snapshot(&disk).len(), 1, "{:?}", snapshot(&disk).keys());
    } else {
        println!("skipped: a limit on the size of files ({error}) leaves room for a small checkpoint");
    }
    process::done();
}

#[test]
fn a_full_disk_has_no_half_a_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    process::on_full_disk("faults::child_fills_the_disk", folder.path());
}
