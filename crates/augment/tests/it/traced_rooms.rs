//! Polyhedral rooms through a propagator that the caller brings.

use crate::material::{response, speech};
use sabine_acoustics::{Air, Bands, ImpulseResponse, Observer};
use sabine_augment::{
    DatasetBuilder, DatasetConfig, DatasetSources, Error, Manifest, Partition, PolyhedralRoomConfig,
    ResponseCorpus, ResponseFilter, RoomCache, SpeechCorpus, TracedRooms, Worker,
};
use sabine_paths::{Contribution, PathSet, Propagator};
use sabine_scene::{DiffuseRoom, Receiver, Scene, Source};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Finds the direct sound, and counts how often it was asked.
#[derive(Default)]
struct DirectOnly {
    asked: AtomicUsize,
}

impl Propagator for DirectOnly {
    fn trace(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        _: &Air,
        _: &dyn Observer,
    ) -> Result<PathSet, sabine_acoustics::Error> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        let way: [f64; 3] = std::array::from_fn(|i| receiver.position_m[i] - source.position_m[i]);
        let length_m = way.iter().map(|w| w * w).sum::<f64>().sqrt();
        let mut paths = PathSet::new(scene.materials().len(), 100.0);
        paths.push(Contribution {
            length_m,
            log_weight: -2.0 * length_m.ln(),
            chain: PathSet::DIRECT,
            tail: PathSet::DIRECT,
            departure: way.map(|w| w / length_m),
            arrival: way.map(|w| w / length_m),
            batch: None,
        });
        Ok(paths)
    }
}

/// Noise that decays as Eyring expects of the room.
fn render(
    paths: &PathSet,
    scene: &Scene,
    air: &Air,
    seed: u64,
) -> Result<ImpulseResponse, sabine_acoustics::Error> {
    assert!(!paths.is_empty());
    let rooms = DiffuseRoom::of_scene(scene, air, Bands::SIMULATION)?;
    let t60_s = rooms.at_hz(1000.0).unwrap().eyring_t60_s();
    Ok(response(t60_s, 1.5, 80.0, 16_000, seed))
}

fn corpus(tracer: &DirectOnly, count: usize, cache: Option<&RoomCache>) -> Result<ResponseCorpus, Error> {
    let rooms = TracedRooms::new(PolyhedralRoomConfig::default(), tracer, &render)?;
    rooms.corpus(count, 3, &ResponseFilter::default(), cache, &())
}

fn samples(corpus: &ResponseCorpus) -> Vec<(String, Vec<f32>)> {
    corpus.responses().iter().map(|r| (r.room.clone(), r.response.samples().to_vec())).collect()
}

#[test]
fn each_room_is_its_own_and_threads_change_nothing() {
    let tracer = DirectOnly::default();
    let made = corpus(&tracer, 12, None).unwrap();
    assert_eq!(made.rooms().len(), 12);
    assert!(made.responses().iter().all(|r| (r.response.peak() - 1.0).abs() < 1e-6));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = one.install(|| corpus(&tracer, 12, None)).unwrap();
    assert_eq!(samples(&made), samples(&again));
    // More rooms begin with the same ones.
    assert_eq!(samples(&corpus(&tracer, 14, None).unwrap())[..12], samples(&made));
}

#[test]
fn the_cache_spares_the_tracer_and_a_damaged_response_is_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let cache = |tracer: &str| RoomCache { folder: folder.path().join("rooms"), tracer: tracer.to_owned() };
    let tracer = DirectOnly::default();
    let first = corpus(&tracer, 6, Some(&cache("a"))).unwrap();
    let traced = tracer.asked.load(Ordering::Relaxed);
    assert_eq!(samples(&corpus(&tracer, 6, Some(&cache("a"))).unwrap()), samples(&first));
    assert_eq!(tracer.asked.load(Ordering::Relaxed), traced, "all came out of the cache");

    let file = std::fs::read_dir(folder.path().join("rooms")).unwrap().next().unwrap().unwrap().path();
    let mut bytes = std::fs::read(&file).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    assert_eq!(samples(&corpus(&tracer, 6, Some(&cache("a"))).unwrap()), samples(&first));
    assert_eq!(tracer.asked.load(Ordering::Relaxed), traced + 1, "one was made again");

    // Another tracer has other responses.
    corpus(&tracer, 6, Some(&cache("b"))).unwrap();
    assert_eq!(tracer.asked.load(Ordering::Relaxed), 2 * traced + 1);
}

#[test]
fn what_cannot_be_traced_is_said() {
    struct Refuses;
    impl Propagator for Refuses {
        fn trace(
            &self,
            _: &Scene,
            _: &Source,
            _: &Receiver,
            _: &Air,
            _: &dyn Observer,
        ) -> Result<PathSet, sabine_acoustics::Error> {
            Err(sabine_acoustics::Error::Empty { what: "room" })
        }
    }
    let rooms = TracedRooms::new(PolyhedralRoomConfig::default(), &Refuses, &render).unwrap();
    let refused = rooms.corpus(1, 1, &ResponseFilter::default(), None, &());
    assert!(matches!(refused, Err(Error::Acoustics(sabine_acoustics::Error::Empty { .. }))), "{refused:?}");
    // A cache that cannot be written is named.
    let tracer = DirectOnly::default();
    let cache = RoomCache { folder: Path::new("/dev/null/rooms").to_owned(), tracer: String::new() };
    match corpus(&tracer, 1, Some(&cache)) {
        Err(Error::Io { path, .. }) => assert!(path.starts_with("/dev/null")),
        other => panic!("{other:?}"),
    }
}

#[test]
fn traced_rooms_enter_sets_each_in_one_partition() {
    let build = |folder: &Path, workers: usize| {
        let mut voices = SpeechCorpus::default();
        for i in 0..5 {
            voices.add(format!("s{i}"), speech(6.0, 100.0 + 17.0 * i as f64, i), 4.0);
        }
        let tracer = DirectOnly::default();
        let sources = DatasetSources {
            speech: voices,
            traced: corpus(&tracer, 10, None).unwrap(),
            ..DatasetSources::default()
        };
        let config = DatasetConfig {
            clips: [24, 8, 8],
            shard_clips: 8,
            clips_per_response: 2,
            measured_fraction: [0.0; 3],
            traced_fraction: [1.0; 3],
            ..DatasetConfig::default()
        };
        let builder = DatasetBuilder::new(config, sources).unwrap();
        for index in 1..=workers {
            builder.build(folder, Worker { index, of: workers }, true, &()).unwrap();
        }
    };
    let (whole, shared) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    build(whole.path(), 1);
    build(shared.path(), 2);
    let manifest = Manifest::read(whole.path()).unwrap();
    assert_eq!(manifest, Manifest::read(shared.path()).unwrap());
    let mut heard = std::collections::BTreeSet::new();
    for shard in &manifest.shards {
        let bytes = std::fs::read(whole.path().join(&shard.file)).unwrap();
        assert_eq!(bytes, std::fs::read(shared.path().join(&shard.file)).unwrap());
        let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        for index in tensors.tensor("room").unwrap().data().chunks_exact(8) {
            let name = &manifest.rooms[i64::from_le_bytes(index.try_into().unwrap()) as usize];
            assert!(name.starts_with("traced/"), "{name}");
            assert_eq!(manifest.room_partitions[name], shard.partition, "{name} leaks");
            heard.insert((name.clone(), shard.partition));
        }
    }
    assert!(heard.iter().any(|(_, p)| *p == Partition::Test) && heard.len() >= 6, "{heard:?}");
}
