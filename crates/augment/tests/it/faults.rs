//! Data sets when something goes wrong: what is there is whole, and the work goes on from it.

use crate::material::{response, speech};
use crate::process;
use crate::process::snapshot;
use sabine_augment::{
    Built, DatasetBuilder, DatasetConfig, DatasetSources, Error, NoiseCorpus, ResponseCorpus, ResponseFilter,
    SpeechCorpus, Worker,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

fn build(folder: &Path, clips: usize, resume: bool) -> Result<Built, Error> {
    let mut sources = DatasetSources {
        speech: SpeechCorpus::default(),
        responses: ResponseCorpus::default(),
        traced: ResponseCorpus::default(),
        noise: NoiseCorpus::default(),
    };
    for i in 0..4 {
        assert_eq!(sources.speech.add(format!("s{i}"), speech(6.0, 100.0 + 17.0 * i as f64, i), 4.0), None);
        let measured = response(0.3 + 0.1 * i as f64, 0.8, 65.0, 16_000, 10 * i);
        let (room, file) = (format!("r{i}"), format!("r{i}.wav"));
        sources.responses.add(room, file, measured, &ResponseFilter::default()).unwrap();
        sources.noise.add(format!("n{i}"), speech(2.0, 50.0 + i as f64, 99));
    }
    let config = DatasetConfig { seed: 3, clips: [clips, 2, 2], shard_clips: 2, ..DatasetConfig::default() };
    DatasetBuilder::new(config, sources)?.build(folder, Worker::default(), resume, &())
}

/// More than a disk of 256 KiB holds: 32 kB each.
const CLIPS: usize = 60;

#[test]
#[ignore = "run by the other tests in a process of its own"]
fn child_fails() {
    let Some(folder) = process::folder() else { return };
    let set = folder.join("set");
    let before = snapshot(&folder);
    let error = build(&set, CLIPS, true).err().unwrap();
    assert!(error.to_string().contains(set.to_str().unwrap()), "{error}");
    let after = snapshot(&folder);
    if before.contains_key(&set) {
        assert!(before == after, "{:?} instead of {:?}", after.keys(), before.keys());
    }
    // Shards that went onto the disk while it had room are whole: each can be taken up again.
    for (path, bytes) in after.iter().filter(|(path, _)| path.extension().is_some_and(|e| e == "safetensors"))
    {
        safetensors::SafeTensors::deserialize(bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    }
    assert!(after.keys().all(|path| path.extension().is_none_or(|e| e != "tmp")), "{:?}", after.keys());
    assert!(!after.contains_key(&set.join("manifest.json")));
    process::done();
}

#[test]
fn a_full_disk_holds_whole_shards_only() {
    let folder = tempfile::tempdir().unwrap();
    process::on_full_disk("faults::child_fails", folder.path());
}

#[test]
fn a_folder_that_cannot_be_written_to_stays_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    build(&set, CLIPS, false).unwrap();
    for entry in std::fs::read_dir(&set).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.starts_with("train-00007") || name == "manifest.json" {
            std::fs::remove_file(path).unwrap();
        }
    }
    process::in_read_only_folder("faults::child_fails", folder.path());
}

#[test]
#[ignore = "run by the other test in a process of its own"]
fn child_builds() {
    let Some(folder) = process::folder() else { return };
    build(&folder.join("set"), CLIPS, false).unwrap();
    // The others are to kill it before this.
    std::thread::sleep(Duration::from_secs(60));
}

#[test]
fn a_set_whose_maker_was_killed_goes_on_from_whole_shards() {
    let whole = tempfile::tempdir().unwrap();
    build(whole.path(), CLIPS, false).unwrap();
    let whole: BTreeMap<PathBuf, Vec<u8>> = names(whole.path());
    for round in 0..4 {
        let folder = tempfile::tempdir().unwrap();
        let set = folder.path().join("set");
        let begun = || set.join("train-00001.json").exists();
        process::killed("faults::child_builds", folder.path(), Duration::from_millis(37 * round), begun);
        for (name, bytes) in names(&set) {
            // What it was at keeps a temporary name.
            assert!(
                whole.get(&name) == Some(&bytes) || is_temporary(&name),
                "{} is not whole",
                name.display()
            );
        }
        let built = build(&set, CLIPS, true).unwrap();
        assert!(built.kept >= 1 && built.mended <= 1, "{built:?}");
        let found = names(&set).into_iter().filter(|(name, _)| !is_temporary(name));
        assert!(found.collect::<BTreeMap<_, _>>() == whole, "round {round}");
    }
}

fn names(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let relative = |(path, bytes): (PathBuf, Vec<u8>)| (path.strip_prefix(folder).unwrap().to_owned(), bytes);
    snapshot(folder).into_iter().map(relative).collect()
}

fn is_temporary(name: &Path) -> bool {
    name.extension().is_some_and(|e| e == "tmp") && name.to_string_lossy().starts_with('.')
}
