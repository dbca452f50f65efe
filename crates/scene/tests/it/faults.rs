//! What is written when something goes wrong: nothing is lost and nothing is half there.

use crate::process::{self, snapshot};
use sabine_acoustics::{
    Bands, Channel, Error, ImpulseResponse, Material, PerBand, SampleFormat, read_audio, write_atomically,
    write_wav, write_wav_channels,
};
use sabine_scene::{
    Levels, MaterialPrior, MeasuredRoom, Measurement, NamedMaterial, NewResponse, NewRoom, PositionSd,
    Receiver, Scene, Source, TimeZero, Triangle,
};
use std::io::Write;
use std::path::Path;
use std::time::Duration;

/// More than the full disk holds.
const MANY: usize = 500_000;

fn room(samples: usize) -> NewRoom {
    let place = |id: &str, x: f64| (id.to_owned(), [x, 1.0, 1.0]);
    let material = Material::uniform(Bands::T60, 0.2, 0.1).unwrap();
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
    let vertices = vec![[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 9.0]];
    let triangles = faces.map(|vertices| Triangle { vertices, material: 0 }).into();
    let scene =
        Scene::new(vertices, triangles, vec![NamedMaterial { name: "cloth".into(), material }]).unwrap();
    let (source, receiver) = (place("s", 1.0), place("r", 2.0));
    let response = |name: &str| NewResponse {
        source: "s".into(),
        receiver: "r".into(),
        name: name.into(),
        air: None,
        session: None,
        recorded_at: None,
        samples: ImpulseResponse::new((0..samples).map(|i| (-1e-3 * i as f32).exp()).collect(), 48_000)
            .unwrap(),
    };
    NewRoom {
        priors: vec![MaterialPrior { absorption: None, absorption_sd: PerBand::uniform(Bands::T60, 0.2) }],
        scene,
        air: None,
        measurement: Measurement { time_zero: TimeZero::Emission, levels: Levels::Absolute },
        position_sd: PositionSd::default(),
        sources: vec![Source { id: source.0, position_m: source.1, axis: None }],
        receivers: vec![Receiver { id: receiver.0, position_m: receiver.1, axis: None }],
        responses: vec![response("one"), response("two")],
    }
}

/// What is there before.
fn prepare(folder: &Path) {
    write_atomically(&folder.join("result.json"), |file| file.write_all(b"old")).unwrap();
    write_wav(folder.join("sound.wav"), &[0.25; 100], 8000, SampleFormat::Float32).unwrap();
    room(1000).write(folder.join("room")).unwrap();
}

/// Every writer fails, names what it could not write, and leaves everything as it was.
fn all_fail(folder: &Path) {
    let before = snapshot(folder);
    assert_eq!(before.len(), 8, "{:?}", before.keys());
    let samples = vec![0.5; MANY];
    let fails = |name: &str, result: Result<(), Error>| {
        let Err(error @ Error::Io { .. }) = &result else { panic!("{name}: {result:?}") };
        assert!(error.to_string().contains(name), "{name} is not in: {error}");
        let after = snapshot(folder);
        assert!(before == after, "{name}: {:?} instead of {:?}", after.keys(), before.keys());
    };
    let path = |name: &str| folder.join(name);
    fails("result.json", write_atomically(&path("result.json"), |file| file.write_all(&[b'x'; MANY])));
    fails("new.json", write_atomically(&path("new.json"), |file| file.write_all(&[b'x'; MANY])));
    fails("sound.wav", write_wav(path("sound.wav"), &samples, 48_000, SampleFormat::Int16));
    let channels = [&samples[..], &samples[..]];
    fails("two.wav", write_wav_channels(path("two.wav"), &channels, 48_000, SampleFormat::Float32));
    let cellar = room(MANY).write(path("cellar")).map(|_| ());
    fails(
        "cellar",
        cellar.map_err(|error| match error {
            sabine_scene::Error::Acoustics(error) => error,
            other => panic!("{other}"),
        }),
    );
}

#[test]
#[ignore = "run by the other tests in a process of its own"]
fn child_fails() {
    let Some(folder) = process::folder() else { return };
    if !folder.join("room").exists() {
        prepare(&folder);
    }
    all_fail(&folder);
    process::done();
}

#[test]
fn a_folder_that_cannot_be_written_to_stays_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    process::in_read_only_folder("faults::child_fails", folder.path());
}

#[test]
fn a_full_disk_stays_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    process::on_full_disk("faults::child_fails", folder.path());
}

/// Content of the file that is written over and over; its length and every byte tell which it is.
fn version(number: usize) -> Vec<u8> {
    vec![b'a' + (number % 2) as u8; 1_000_000 + number % 2]
}

#[test]
#[ignore = "run by the other tests in a process of its own"]
fn child_writes_for_ever() {
    let Some(folder) = process::folder() else { return };
    let loud = [vec![0.25; 200_000], vec![0.5; 200_001]];
    for number in 0.. {
        write_atomically(&folder.join("result.json"), |file| file.write_all(&version(number))).unwrap();
        write_wav(folder.join("sound.wav"), &loud[number % 2], 48_000, SampleFormat::Int16).unwrap();
        room(100_000).write(folder.join(format!("room{number}"))).unwrap();
    }
}

#[test]
fn whoever_is_killed_leaves_whole_files() {
    for round in 0..8 {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let begun = || path("room0").exists();
        process::killed(
            "faults::child_writes_for_ever",
            folder.path(),
            Duration::from_millis(17 * round),
            begun,
        );
        let found = std::fs::read(path("result.json")).unwrap();
        assert!((0..2).any(|number| found == version(number)), "round {round}: {} bytes", found.len());
        let sound = read_audio(path("sound.wav"), Channel::Mono).unwrap();
        let count = if sound.samples()[0] < 0.4 { 200_000 } else { 200_001 };
        assert_eq!(sound.samples().len(), count, "round {round}");
        assert!(sound.samples().iter().all(|s| *s == sound.samples()[0]));
        let mut rooms = 0;
        for entry in std::fs::read_dir(folder.path()).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            // What a killed process was at keeps its temporary name; nothing reads that.
            if name.starts_with("room") {
                let room = MeasuredRoom::read(path(&name)).unwrap();
                assert!((0..2).all(|i| room.load_response(i).unwrap().samples().len() == 100_000), "{name}");
                rooms += 1;
            } else if !["result.json", "sound.wav"].contains(&name.as_str()) {
                assert!(name.starts_with('.') && name.ends_with(".tmp"), "{name}");
            }
        }
        assert!(rooms > 0);
        // A later writer is not in the way of what was left.
        room(500).write(path("after")).unwrap();
    }
}

/// Two that write one room at once: one wins, whole; the other is told.
#[test]
fn two_writers_of_one_room_do_not_mix() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room");
    let lengths = [40_000, 40_001, 40_002, 40_003];
    let results: Vec<bool> = std::thread::scope(|scope| {
        let write = |samples| {
            scope.spawn({
                let path = &path;
                move || room(samples).write(path).is_ok()
            })
        };
        lengths.map(write).into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert_eq!(results.iter().filter(|ok| **ok).count(), 1, "{results:?}");
    let winner = lengths[results.iter().position(|ok| *ok).unwrap()];
    let found = MeasuredRoom::read(&path).unwrap();
    assert!((0..2).all(|i| found.load_response(i).unwrap().samples().len() == winner));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
