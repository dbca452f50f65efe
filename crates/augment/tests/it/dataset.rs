//! Data sets: the same bytes whoever makes them and however often they are interrupted, and no leak.

use crate::material::{response, speech};
use sabine_acoustics::{Observer, Signal};
use sabine_augment::{
    DatasetBuilder, DatasetConfig, DatasetSources, Error, Manifest, NoiseCorpus, Partition, PartitionConfig,
    ResponseCorpus, ResponseFilter, SpeechCorpus, Worker,
};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

fn voices(count: u64) -> SpeechCorpus {
    let mut corpus = SpeechCorpus::default();
    for i in 0..count {
        assert_eq!(corpus.add(format!("s{i}"), speech(6.0, 100.0 + 17.0 * i as f64, i), 4.0), None);
    }
    corpus
}

fn rooms(count: u64) -> ResponseCorpus {
    let mut corpus = ResponseCorpus::default();
    for i in 0..count {
        for position in 0..2 {
            let measured = response(0.3 + 0.1 * i as f64, 0.8, 65.0, 16_000, 10 * i + position);
            corpus
                .add(format!("r{i}"), format!("r{i}/{position}.wav"), measured, &ResponseFilter::default())
                .unwrap();
        }
    }
    corpus
}

fn noise() -> NoiseCorpus {
    let mut corpus = NoiseCorpus::default();
    for i in 0..3 {
        corpus.add(format!("n{i}"), speech(2.0, 50.0 + f64::from(i), 99));
    }
    corpus
}

fn config() -> DatasetConfig {
    DatasetConfig {
        seed: 5,
        clips: [21, 9, 9],
        shard_clips: 7,
        clips_per_response: 3,
        ..DatasetConfig::default()
    }
}

fn sources(speakers: u64, measured: ResponseCorpus) -> DatasetSources {
    DatasetSources {
        speech: voices(speakers),
        responses: measured,
        traced: ResponseCorpus::default(),
        noise: noise(),
    }
}

fn builder() -> DatasetBuilder {
    DatasetBuilder::new(config(), sources(5, rooms(4))).unwrap()
}

/// Name and content of every file.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(path).unwrap()))
        .collect()
}

/// Names of the files that differ.
fn differences(a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    a.keys().chain(b.keys()).filter(|name| a.get(*name) != b.get(*name)).cloned().collect()
}

fn built(threads: usize, folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| builder().build(folder, Worker::default(), false, &())).unwrap();
    files(folder)
}

#[test]
fn threads_workers_and_interruptions_change_no_byte() {
    let folder = tempfile::tempdir().unwrap();
    let whole = built(1, folder.path());
    assert_eq!(whole.keys().filter(|name| name.ends_with(".safetensors")).count(), 7);

    let threads = tempfile::tempdir().unwrap();
    assert_eq!(differences(&whole, &built(3, threads.path())), [""; 0], "three threads");

    // Three workers, the last one first; only the last to finish can write the manifest.
    let workers = tempfile::tempdir().unwrap();
    for index in [3, 1, 2] {
        let made = builder().build(workers.path(), Worker { index, of: 3 }, false, &()).unwrap();
        assert_eq!(made.manifest.is_some(), index == 2);
    }
    assert_eq!(differences(&whole, &files(workers.path())), [""; 0], "three workers");

    // Stopped in the middle of a shard, over and over, until it is done.
    let stopped = tempfile::tempdir().unwrap();
    let mut stops = 0;
    loop {
        // A little later every time.
        let calls = std::sync::atomic::AtomicU64::new(0);
        let limit = 4 + 3 * stops;
        let stop = |_: &str, _: u64, _: u64| {
            let call = calls.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            if call > limit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let observer: &dyn Observer = &stop;
        match builder().build(stopped.path(), Worker::default(), true, observer) {
            Ok(_) => break,
            Err(Error::Acoustics(sabine_acoustics::Error::Cancelled { .. })) => stops += 1,
            Err(error) => panic!("{error}"),
        }
        assert!(stops < 30, "no progress");
        assert!(files(stopped.path()).keys().all(|name| !name.contains("tmp")), "a fragment was left");
    }
    assert!(stops >= 2, "{stops} stops");
    assert_eq!(differences(&whole, &files(stopped.path())), [""; 0], "interruptions");
}

#[test]
fn a_damaged_shard_is_found_and_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let whole = built(2, folder.path());
    let damaged = folder.path().join("train-00001.safetensors");
    let mut bytes = std::fs::read(&damaged).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&damaged, bytes).unwrap();
    std::fs::remove_file(folder.path().join("test-00000.safetensors")).unwrap();
    let mended = builder().build(folder.path(), Worker::default(), true, &()).unwrap();
    assert_eq!((mended.made, mended.kept, mended.mended), (1, 5, 1));
    assert_eq!(differences(&whole, &files(folder.path())), [""; 0]);
}

#[test]
fn the_shards_hold_what_the_manifest_says() {
    let folder = tempfile::tempdir().unwrap();
    built(2, folder.path());
    let manifest = Manifest::read(folder.path()).unwrap();
    assert_eq!(manifest.format, "sabine-dataset-1");
    assert_eq!((manifest.mels, manifest.frames, manifest.sample_rate_hz), (32, 499, 16_000));
    assert_eq!(manifest.eq_bands_hz, [62.5, 125.0, 250.0, 500.0, 2000.0, 4000.0]);
    let mut rooms_of: BTreeMap<Partition, Vec<i64>> = BTreeMap::new();
    let mut speakers_of: BTreeMap<Partition, Vec<i64>> = BTreeMap::new();
    for shard in &manifest.shards {
        let bytes = std::fs::read(folder.path().join(&shard.file)).unwrap();
        let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        let n = shard.clips;
        for (name, shape) in [
            ("features", vec![n, 32, 499]),
            ("t60_s", vec![n, 7]),
            ("eq_db", vec![n, 6]),
            ("snr_db", vec![n]),
            ("drr_db", vec![n]),
            ("room", vec![n]),
            ("speaker", vec![n]),
        ] {
            assert_eq!(tensors.tensor(name).unwrap().shape(), shape, "{name} of {}", shard.file);
        }
        let integers = |name: &str| -> Vec<i64> {
            let data = tensors.tensor(name).unwrap().data().to_vec();
            data.chunks_exact(8).map(|b| i64::from_le_bytes(b.try_into().unwrap())).collect()
        };
        rooms_of.entry(shard.partition).or_default().extend(integers("room"));
        speakers_of.entry(shard.partition).or_default().extend(integers("speaker"));
        let t60 = tensors.tensor("t60_s").unwrap().data().to_vec();
        let readable =
            t60.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).filter(|t| t.is_finite());
        assert!(readable.clone().count() > 5 * n, "{}: too few readings", shard.file);
        assert!(readable.into_iter().all(|t| t > 0.03 && t < 10.0));
    }
    // No room and no speaker in two partitions, and every index has a name that says where it belongs.
    for (of, names, dealt) in [
        (&rooms_of, &manifest.rooms, &manifest.room_partitions),
        (&speakers_of, &manifest.speakers, &manifest.speaker_partitions),
    ] {
        let mut seen: BTreeMap<i64, Partition> = BTreeMap::new();
        for (&partition, indices) in of {
            for &index in indices {
                assert_eq!(*seen.entry(index).or_insert(partition), partition, "leak of {index}");
                let name = &names[index as usize];
                let own = dealt.get(name).copied();
                assert!(
                    own.map_or(name.contains(partition.name()), |p| p == partition),
                    "{name} in {partition}"
                );
            }
        }
    }
    let clips: u64 = manifest.statistics.values().map(|s| s.snr_db.count).sum();
    assert_eq!(clips, 39);
}

#[test]
fn what_leaks_or_cannot_be_partitioned_is_refused() {
    let refused = DatasetBuilder::new(config(), sources(1, rooms(4))).err().unwrap();
    assert!(matches!(refused, Error::TooFew { what: "speakers", .. }), "{refused}");
    let refused = DatasetBuilder::new(config(), sources(5, rooms(2))).err().unwrap();
    assert!(matches!(refused, Error::TooFew { what: "rooms", .. }), "{refused}");

    let leak = PartitionConfig {
        validation: vec!["r1".into()],
        test: vec!["r1".into()],
        ..PartitionConfig::default()
    };
    let config_with_leak = DatasetConfig { rooms: leak, ..config() };
    let refused = DatasetBuilder::new(config_with_leak, sources(5, rooms(4))).err().unwrap();
    assert!(matches!(refused, Error::Leak { what: "room", .. }), "{refused}");

    // The same response under another name.
    let mut copied = rooms(3);
    let copy = copied.responses()[0].response.clone();
    copied.add("another", "copy.wav", copy, &ResponseFilter::default()).unwrap();
    let apart = PartitionConfig {
        validation: vec!["another".into()],
        test: vec!["r1".into()],
        ..PartitionConfig::default()
    };
    let refused =
        DatasetBuilder::new(DatasetConfig { rooms: apart, ..config() }, sources(5, copied)).err().unwrap();
    assert!(matches!(refused, Error::Leak { .. }), "{refused}");
}

#[test]
fn another_set_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    built(2, folder.path());
    let again = builder().build(folder.path(), Worker::default(), false, &());
    assert!(matches!(again, Err(Error::NotEmpty { .. })), "{again:?}");
    let other = DatasetBuilder::new(DatasetConfig { seed: 6, ..config() }, sources(5, rooms(4))).unwrap();
    let resumed = other.build(folder.path(), Worker::default(), true, &());
    assert!(matches!(resumed, Err(Error::OtherPlan { .. })), "{resumed:?}");
    let worker = builder().build(folder.path(), Worker { index: 4, of: 3 }, true, &());
    assert!(matches!(worker, Err(Error::Setting { .. })), "{worker:?}");
}

#[test]
fn unusable_sound_is_left_out_with_its_reason() {
    let mut corpus = SpeechCorpus::default();
    assert!(
        corpus.add("quiet", Signal::new(vec![0.0; 80_000], 16_000).unwrap(), 4.0).unwrap().contains("silent")
    );
    assert!(corpus.add("brief", speech(2.0, 100.0, 1), 4.0).unwrap().contains("2.00 s"));
    let empty = tempfile::tempdir().unwrap();
    assert!(matches!(SpeechCorpus::read(empty.path(), 16_000, 4.0, &()), Err(Error::TooFew { .. })));
    let filter = ResponseFilter::default();
    assert!(matches!(
        ResponseCorpus::read(empty.path(), 16_000, &filter, &[], &()),
        Err(Error::TooFew { .. })
    ));
    assert!(matches!(NoiseCorpus::read(&empty.path().join("nowhere"), 16_000, &()), Err(Error::Io { .. })));
    std::fs::write(empty.path().join("a.wav"), b"not a sound").unwrap();
    assert!(SpeechCorpus::read(empty.path(), 16_000, 4.0, &()).is_err());
}
