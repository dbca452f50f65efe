//! Folders of results when something goes wrong: nothing is lost and nothing is half there.

use crate::process::{self, snapshot};
use sabine_cli::output::{OutputError, OutputFolder};
use std::path::Path;
use std::time::Duration;

const NAMES: [&str; 3] = ["matched.wav", "match.json", "report.html"];

fn write(folder: &Path, fill: u8, length: usize) -> Result<(), OutputError> {
    let mut out = OutputFolder::create(folder)?;
    for name in NAMES {
        out.write(name, &vec![fill; length])?;
    }
    out.finish()
}

#[test]
#[ignore = "run by the other tests in a process of its own"]
fn child_fails() {
    let Some(folder) = process::folder() else { return };
    let results = folder.join("results");
    if !results.exists() {
        write(&results, b'o', 1000).unwrap();
    }
    let before = snapshot(&folder);
    let old = write(&results, b'x', 200_000).unwrap_err();
    assert!(old.path.starts_with(&results), "{old}");
    let new = write(&folder.join("others"), b'x', 200_000).unwrap_err();
    assert!(new.path.starts_with(folder.join("others")), "{new}");
    let after = snapshot(&folder);
    assert!(before == after, "{:?} instead of {:?}", after.keys(), before.keys());
    process::done();
}

#[test]
fn a_folder_that_cannot_be_written_to_stays_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let results = folder.path().join("results");
    write(&results, b'o', 1000).unwrap();
    // Neither the results nor a place beside them.
    process::in_read_only_folder("faults::child_fails", folder.path());
}

#[test]
fn a_full_disk_stays_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    process::on_full_disk("faults::child_fails", folder.path());
}

#[test]
#[ignore = "run by the other test in a process of its own"]
fn child_writes_for_ever() {
    let Some(folder) = process::folder() else { return };
    for number in 0u8.. {
        write(&folder.join("results"), b'a' + number % 26, 300_000).unwrap();
    }
}

#[test]
fn whoever_is_killed_leaves_whole_files() {
    for round in 0..8 {
        let folder = tempfile::tempdir().unwrap();
        let results = folder.path().join("results");
        let begun = || results.join("report.html").exists();
        process::killed(
            "faults::child_writes_for_ever",
            folder.path(),
            Duration::from_millis(11 * round),
            begun,
        );
        for name in NAMES {
            let found = std::fs::read(results.join(name)).unwrap();
            assert!(found.len() == 300_000 && found.iter().all(|b| *b == found[0]), "round {round}: {name}");
        }
        // A later run is not in the way of what was left.
        write(&results, b'z', 10).unwrap();
        assert_eq!(std::fs::read(results.join(NAMES[2])).unwrap(), [b'z'; 10]);
    }
}
