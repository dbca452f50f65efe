//! Measurements of other programs into a room, and out of it.

use crate::sabine;
use base64::Engine as _;
use sabine::scene::{Levels, Materials, MeasuredRoom, TimeZero};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::Output;
use tempfile::TempDir;

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scene/tests/sofa");

fn run(folder: &Path, job: &str, arguments: &[&str]) -> Output {
    sabine(job).args(arguments).current_dir(folder).output().unwrap()
}

fn printed(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// What is said; nothing but the files of before may be left.
fn refused(folder: &Path, output: &Output, files: usize) -> String {
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), files, "something is left behind");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn golden(name: &str) -> String {
    format!("{GOLDEN}/{name}")
}

#[test]
fn sofa_goes_in_and_out() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let text = printed(&run(folder, "import", &[&golden("pairs.sofa"), "--out", "hall"]));
    assert!(text.contains("2 sources, 3 receivers, 4 responses"), "{text}");
    assert!(text.contains("--time-zero") && text.contains("next: sabine fit --room hall"), "{text}");
    let room = MeasuredRoom::read(folder.join("hall")).unwrap();
    assert!((room.scene().volume_m3() - 90.0).abs() < 1e-9, "the box that the file states");
    assert_eq!(room.measurement().time_zero, TimeZero::Common);
    // One response is longer for its delay.
    let text = refused(folder, &run(folder, "export", &["--room", "hall", "--out", "hall.sofa"]), 1);
    assert!(text.contains("600 to 603 samples") && text.contains("--cut"), "{text}");
    printed(&run(folder, "export", &["--room", "hall", "--cut", "--out", "hall.sofa"]));
    let arguments =
        ["hall.sofa", "--size", "6x5x3", "--time-zero", "emission", "--levels", "absolute", "--out", "again"];
    printed(&run(folder, "import", &arguments));
    let again = MeasuredRoom::read(folder.join("again")).unwrap();
    assert_eq!(
        (again.measurement().time_zero, again.measurement().levels),
        (TimeZero::Emission, Levels::Absolute)
    );
    assert_eq!(again.receivers().len(), 3);
    for index in 0..4 {
        let (before, after) = (room.load_response(index).unwrap(), again.load_response(index).unwrap());
        assert!(before.samples()[..600] == *after.samples(), "response {index}");
    }
    let text = refused(
        folder,
        &run(folder, "export", &["--room", "hall", "--cut", "--grid", "--out", "grid.sofa"]),
        3,
    );
    assert!(text.contains("no response from `s2` to `r2`"), "{text}");
}

#[test]
fn a_mesh_and_its_tables_may_be_given() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let new = ["--size", "5x4x3", "--floor", "carpet_thin", "--out", "drawn"];
    printed(&run(folder, "new-room", &new));
    std::fs::write(
        folder.join("t.toml"),
        "bands.centres_hz = [500, 1000]\nmaterials.walls.absorption = [0.2, 0.3]",
    )
    .unwrap();
    let arguments = [
        &*golden("grid.sofa"),
        "--mesh",
        "drawn/room.obj",
        "--materials",
        "t.toml",
        "--position-sd",
        "0.03",
        "--out",
        "hall",
    ];
    printed(&run(folder, "import", &arguments));
    let room = MeasuredRoom::read(folder.join("hall")).unwrap();
    assert_eq!(room.responses().len(), 6);
    assert_eq!(room.position_sd().all_m, Some(0.03));
    let walls = room.materials().get("walls").unwrap().clone();
    assert_eq!(walls.absorption.unwrap().values(), [0.2, 0.3]);
}

#[test]
fn what_cannot_be_a_room_is_refused_and_leaves_nothing() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("notes.pdf"), "x").unwrap();
    let import = |file: &str, more: &[&str]| {
        let mut arguments = vec![file, "--out", "hall"];
        arguments.extend(more);
        refused(folder, &run(folder, "import", &arguments), 1)
    };
    for (file, more, words) in [
        (golden("pairs.sofa"), &["--size", "3.5x5x3"][..], "source \"s2\" at [4.25, 1.0, 1.5] m is outside"),
        (golden("pairs.sofa"), &["--size", "6x3.5x3"], "receiver \"r1\""),
        (golden("pairs.sofa"), &["--size", "6x5"], "as 5x4x2.6"),
        (
            golden("pairs.sofa"),
            &["--time-zero", "emission", "--size", "600x5x3", "--humidity", "-3"],
            "RoomTemperature",
        ),
        (golden("grid.sofa"), &["--size", "0x5x3"], "--size 0x5x3"),
        (golden("head.sofa"), &["--size", "6x5x3"], "SimpleFreeFieldHRIR 1.0` where SingleRoomSRIR"),
        ("notes.pdf".into(), &["--size", "6x5x3"], "needs --source X,Y,Z"),
        (golden("grid.sofa"), &["--size", "6x5x3", "--source", "1,1,1"], "leave out --source"),
        ("notes.pdf".into(), &["--size", "6x5x3", "--source", "1,1,1", "--receiver", "4,4,1"], "notes.pdf"),
        (
            "notes.pdf".into(),
            &["--size", "6x5x3", "--source", "1,1", "--receiver", "4,4,1"],
            "--source 1,1: write",
        ),
        ("none.sofa".into(), &["--size", "6x5x3"], "No such file"),
    ] {
        let text = import(&file, more);
        assert!(text.contains(words), "{file} {more:?}: {text}");
    }
}

#[test]
fn rew_text_and_tables_go_in() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let sample = |i: usize| {
        i.checked_sub(60)
            .map_or(0.0, |k| 0.5f32.powi((k / 200) as i32) * if k % 3 == 0 { 0.75 } else { -0.25 })
    };
    let samples: Vec<f32> = (0..6000).map(sample).collect();
    let lines: String = samples.iter().map(|x| format!("{x}\n").replace('.', ",")).collect();
    let head = "* Impulse Response data saved by REW V5.31.3\n* IR is not normalised\n6000 // Response length\n6,25E-5 // Sample interval (seconds)\n0,0 // Start time (seconds)\n* Data start\n";
    std::fs::write(folder.join("seat.txt"), format!("{head}{lines}")).unwrap();
    let places = ["--source", "stage=1,2,1.5", "--receiver", "seat=3.5,2,1.2"];
    let single = [&["seat.txt", "--size", "6x5x3", "--out", "single"][..], &places].concat();
    printed(&run(folder, "import", &single));
    let room = MeasuredRoom::read(folder.join("single")).unwrap();
    assert_eq!((room.sources()[0].id.as_str(), room.receivers()[0].position_m), ("stage", [3.5, 2.0, 1.2]));
    assert!(room.load_response(0).unwrap().samples() == samples);
    // The response of that room, named by a table with decimal commas: out and in again to the bit.
    let table = "file;source_x_m;source_y_m;source_z_m;receiver_x_m;receiver_y_m;receiver_z_m\nsingle/ir/stage_seat.wav;1;2;1,5;3,5;2;1,2\n";
    std::fs::write(folder.join("t.csv"), table).unwrap();
    let text = printed(&run(
        folder,
        "import",
        &["t.csv", "--size", "6x5x3", "--levels", "absolute", "--out", "again"],
    ));
    assert!(text.contains("1 sources, 1 receivers, 1 responses"), "{text}");
    let again = MeasuredRoom::read(folder.join("again")).unwrap();
    assert!(again.load_response(0).unwrap().samples() == samples);
    assert_eq!(
        again.receivers(),
        [sabine::scene::Receiver { id: "r1".into(), position_m: [3.5, 2.0, 1.2], axis: None }]
    );
    std::fs::write(folder.join("t.csv"), table.replace("3,5", "13,5")).unwrap();
    let text = refused(folder, &run(folder, "import", &["t.csv", "--size", "6x5x3", "--out", "other"]), 4);
    assert!(text.contains("receiver \"r1\" at [13.5, 2.0, 1.2] m is outside"), "{text}");
}

#[test]
fn a_measurement_comes_from_rew_while_it_runs() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let samples: Vec<f32> =
        (0..6000).map(|i| if i < 60 { 0.0 } else { 0.75 * 0.5f32.powi((i - 60) / 200) }).collect();
    let bytes: Vec<u8> = samples.iter().flat_map(|sample| (100.0 * sample).to_be_bytes()).collect();
    let data = base64::engine::general_purpose::STANDARD.encode(bytes);
    let body = format!(r#"{{"unit": "percent", "startTime": 0.0, "sampleRate": 16000, "data": "{data}"}}"#);
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/measurements/1", listener.local_addr().unwrap());
    let server = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut head = BufReader::new(stream.try_clone().unwrap()).lines();
        while head.next().is_some_and(|line| !line.unwrap().is_empty()) {}
        let length = body.len();
        write!(stream, "HTTP/1.1 200 OK\r\nContent-Length: {length}\r\n\r\n{body}").unwrap();
    });
    let places = ["--source", "stage=1,2,1.5", "--receiver", "seat=3.5,2,1.2"];
    printed(&run(folder, "import", &[&[&address, "--size", "6x5x3", "--out", "room"][..], &places].concat()));
    server.join().unwrap();
    let room = MeasuredRoom::read(folder.join("room")).unwrap();
    assert!(room.load_response(0).unwrap().samples() == samples);
    let text =
        refused(folder, &run(folder, "import", &[&[&address, "--out", "other"][..], &places].concat()), 1);
    assert!(text.contains("no answer"), "{text}");
}

#[test]
fn tables_of_catt_go_in_and_out() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let geo = ";MASTER.GEO\nABS floor = <1 2 3 4 5 6> L <10 10 10 10 10 10>\nABS walls = <10 20 30 40 50 60>\nCORNERS\n1 0 0 0\n";
    std::fs::write(folder.join("master.geo"), geo).unwrap();
    let text = printed(&run(folder, "materials", &["--from", "master.geo", "--out", "m.toml"]));
    assert!(text.contains("2 materials"), "{text}");
    printed(&run(folder, "materials", &["--from", "m.toml", "--out", "again.geo"]));
    printed(&run(folder, "materials", &["--from", "again.geo", "--out", "again.toml"]));
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    assert_eq!(read("m.toml"), read("again.toml"));
    // They are tables of a box.
    printed(&run(folder, "import", &[&golden("pairs.sofa"), "--materials", "m.toml", "--out", "hall"]));
    let room = MeasuredRoom::read(folder.join("hall")).unwrap();
    assert_eq!(
        room.materials().get("walls").unwrap().absorption.as_ref().unwrap().values(),
        [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    );
    for (arguments, words) in [
        (["--from", "master.geo", "--out", "x.li8"], "x.li8: tables of materials are written to .toml"),
        (["--from", "none.geo", "--out", "x.toml"], "none.geo"),
    ] {
        let text = refused(folder, &run(folder, "materials", &arguments), 5);
        assert!(text.contains(words), "{text}");
    }
    std::fs::write(folder.join("master.geo"), geo.replace("<1 2", "<1 200")).unwrap();
    let text = refused(folder, &run(folder, "materials", &["--from", "master.geo", "--out", "x.toml"]), 5);
    assert!(text.contains("master.geo: line 2: absorption"), "{text}");
}

#[test]
fn a_list_of_odeon_becomes_tables() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let values = "\t0.1\t0.1\t0.2\t0.3\t0.4\t0.5\t0.6\t0.7\n\n";
    std::fs::write(folder.join("List.Li8"), format!("0\tTransparent\n{values}17\tTimber floor\n{values}"))
        .unwrap();
    let text = printed(&run(folder, "materials", &["--from", "List.Li8", "--out", "m.toml"]));
    assert!(text.contains("1 materials"), "{text}");
    let read = Materials::read(folder.join("m.toml")).unwrap();
    let timber = read.get("17 Timber floor").unwrap();
    assert_eq!(timber.absorption.as_ref().unwrap().values(), [0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]);
    std::fs::write(folder.join("List.Li8"), "17\tTimber floor\n\t0,1\n").unwrap();
    let text = refused(folder, &run(folder, "materials", &["--from", "List.Li8", "--out", "x.toml"]), 2);
    assert!(text.contains("List.Li8: line 2: cannot read `0,1`"), "{text}");
}
