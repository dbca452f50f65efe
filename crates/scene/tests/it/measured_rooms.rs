//! Rooms from and to disk, good and bad: one case for each fault that the format lists.

use sabine_acoustics::{
    Air, Bands, Error as ValueError, ImpulseResponse, SampleFormat, library_material, write_wav,
};
use sabine_scene::{
    Error, Levels, MaterialPrior, MeasuredRoom, Measurement, NewResponse, NewRoom, PositionSd, Receiver,
    Scene, Source, TimeZero,
};
use std::path::Path;
use tempfile::TempDir;

const TOML: &str = r#"
[room]
mesh = "room.obj"
[air]
temperature_c = 24.0
relative_humidity_percent = 45.0
pressure_kpa = 101.325
[measurement]
time_zero = "emission"
levels = "common"
[bands]
centres_hz = [500, 1000]
[materials.wall]
absorption = [0.1, 0.2]
absorption_sd = [0.05, 0.06]
scattering = [0.3, 0.4]
[materials.floor]
[[sources]]
id = "s1"
position_m = [1.0, 1.0, 1.0]
orientation = [0.0, 1.0, 0.0]
[[receivers]]
id = "r1"
position_m = [2.0, 1.0, 1.0]
[[responses]]
source = "s1"
receiver = "r1"
file = "ir/a.wav"
temperature_c = 18.5
session = "evening"
"#;

/// A box of 4 x 3 x 2 m, each face one polygon.
const OBJ: &str = "v 0 0 0\nv 4 0 0\nv 4 3 0\nv 0 3 0\nv 0 0 2\nv 4 0 2\nv 4 3 2\nv 0 3 2\nusemtl floor\nf 1 2 3 4\n\
                   usemtl wall\nf 8 7 6 5\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n";

fn folder(toml: &str, obj: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::create_dir(folder.path().join("ir")).unwrap();
    std::fs::write(folder.path().join("room.toml"), toml).unwrap();
    std::fs::write(folder.path().join("room.obj"), obj).unwrap();
    let mut samples = vec![0.0; 480];
    samples[140] = 1.0;
    write_wav(folder.path().join("ir/a.wav"), &samples, 48_000, SampleFormat::Float32).unwrap();
    folder
}

#[test]
fn a_good_room_is_read_as_it_stands() {
    let folder = folder(TOML, OBJ);
    let room = MeasuredRoom::read(folder.path()).unwrap();
    assert!((room.scene().volume_m3() - 24.0).abs() < 1e-9);
    assert_eq!(room.scene().triangles().len(), 12);
    let names: Vec<_> = room.scene().materials().iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["floor", "wall"]);
    assert_eq!(room.bands(), Bands::octaves(500.0, 1000.0).unwrap());
    let (floor, wall) = (&room.priors()[0], &room.priors()[1]);
    assert_eq!(floor.absorption, None);
    assert_eq!(floor.absorption_sd.values(), [MaterialPrior::UNKNOWN_ABSORPTION_SD; 2]);
    assert_eq!(room.scene().materials()[0].material.scattering().values(), [0.1, 0.1]);
    assert_eq!(wall.absorption.as_ref().unwrap().values(), [0.1, 0.2]);
    assert_eq!(wall.absorption_sd.values(), [0.05, 0.06]);
    assert_eq!(room.air(), Air::new(24.0, 45.0, 101.325).unwrap());
    assert!(!room.air_assumed());
    assert_eq!(room.measurement(), Measurement { time_zero: TimeZero::Emission, levels: Levels::Common });
    assert_eq!(room.source("s1").unwrap().axis, Some([0.0, 1.0, 0.0]));
    assert_eq!(room.receiver("r1").unwrap().axis, None);
    let entry = &room.responses()[0];
    assert_eq!((entry.source, entry.receiver, entry.session.as_deref()), (0, 0, Some("evening")));
    assert_eq!(entry.air, Air::new(18.5, 45.0, 101.325).unwrap());
    assert_eq!(room.load_response(0).unwrap().samples()[140], 1.0);
    assert!(matches!(room.load_response(1), Err(Error::Acoustics(ValueError::Index { .. }))));
    assert!(room.source("s9").unwrap_err().to_string().contains("`s9`"));
}

#[test]
fn places_are_known_as_well_as_the_file_says_of_all_or_of_one() {
    let silent = folder(TOML, OBJ);
    let room = MeasuredRoom::read(silent.path()).unwrap();
    assert_eq!(room.position_sd(), &PositionSd::default());
    assert_eq!((room.position_sd().source_m("s1"), room.responses()[0].recorded_at), (None, None));
    let toml = TOML
        .replace("levels = \"common\"", "levels = \"common\"\nposition_sd_m = 0.02")
        .replace("id = \"r1\"", "id = \"r1\"\nposition_sd_m = 0.1")
        .replace("session = \"evening\"", "recorded_at = 3");
    let stated = folder(&toml, OBJ);
    let room = MeasuredRoom::read(stated.path()).unwrap();
    assert_eq!(room.position_sd().source_m("s1"), Some(0.02));
    assert_eq!(room.position_sd().receiver_m("r1"), Some(0.1));
    assert_eq!(room.responses()[0].recorded_at, Some(3.0));
}

#[test]
fn air_that_is_not_stated_is_assumed_and_says_so() {
    let toml = TOML.replace(
        "[air]\ntemperature_c = 24.0\nrelative_humidity_percent = 45.0\npressure_kpa = 101.325\n",
        "",
    );
    let folder = folder(&toml, OBJ);
    let room = MeasuredRoom::read(folder.path()).unwrap();
    assert!(room.air_assumed());
    assert_eq!(room.air(), Air::default());
}

/// (what is changed in room.toml, into what, the file at fault, the words that must be there)
type Case = (&'static str, &'static str, &'static str, &'static [&'static str]);

const TOML_FAULTS: [Case; 47] = [
    (
        "levels = \"common\"",
        "levels = \"common\"\nposition_sd_m = 0.00001",
        "room.toml",
        &["measurement.position_sd_m", "10e-6", "between 0.1 mm and 1 m"],
    ),
    (
        "levels = \"common\"",
        "levels = \"common\"\nposition_sd_m = nan",
        "room.toml",
        &["measurement.position_sd_m", "NaN"],
    ),
    ("id = \"s1\"", "id = \"s1\"\nposition_sd_m = 1.5", "room.toml", &["sources[0].position_sd_m", "1.5"]),
    (
        "id = \"r1\"",
        "id = \"r1\"\nposition_sd_m = -0.1",
        "room.toml",
        &["receivers[0].position_sd_m", "-0.1"],
    ),
    ("id = \"r1\"", "id = \"r1\"\nposition_sd_m = \"1 cm\"", "room.toml", &["position_sd_m"]),
    ("session = \"evening\"", "recorded_at = inf", "room.toml", &["responses[0].recorded_at", "inf"]),
    ("[materials.floor]\n", "", "", &["`floor`", "room.obj", "no table"]),
    ("[materials.floor]", "[materials.floor]\n[materials.roof]", "room.toml", &["materials.roof", "no face"]),
    (
        "absorption = [0.1, 0.2]",
        "absorption = [0.1]",
        "room.toml",
        &["materials.wall.absorption:", "1 values for 2 bands"],
    ),
    (
        "absorption_sd = [0.05, 0.06]",
        "absorption_sd = [0.1, 0.1, 0.1]",
        "room.toml",
        &["materials.wall.absorption_sd", "3 values"],
    ),
    ("scattering = [0.3, 0.4]", "scattering = []", "room.toml", &["materials.wall.scattering", "0 values"]),
    (
        "absorption = [0.1, 0.2]",
        "absorption = [0.1, 1.2]",
        "room.toml",
        &["materials.wall.absorption", "1.2", "between 0 and 1"],
    ),
    (
        "absorption = [0.1, 0.2]",
        "absorption = [-0.1, 0.2]",
        "room.toml",
        &["materials.wall.absorption", "-0.1"],
    ),
    (
        "absorption = [0.1, 0.2]",
        "absorption = [nan, 0.2]",
        "room.toml",
        &["materials.wall.absorption", "NaN"],
    ),
    (
        "absorption_sd = [0.05, 0.06]",
        "absorption_sd = [0.0, inf]",
        "room.toml",
        &["materials.wall.absorption_sd"],
    ),
    ("scattering = [0.3, 0.4]", "scattering = [0.3, 4]", "room.toml", &["materials.wall.scattering", "4"]),
    ("scattering = [0.3, 0.4]", "scatering = [0.3, 0.4]", "room.toml", &["scatering", "unknown"]),
    ("mesh = \"room.obj\"", "mesh = \"room.obj\"\nunits = \"feet\"", "room.toml", &["units", "unknown"]),
    ("[bands]", "[colour]\n[bands]", "room.toml", &["colour", "unknown"]),
    ("id = \"s1\"", "id = \"s1\"\ngain = 3", "room.toml", &["gain", "unknown"]),
    ("session = \"evening\"", "pressure_kpa = 99", "room.toml", &["pressure_kpa", "unknown"]),
    ("time_zero = \"emission\"", "time_zero = \"dawn\"", "room.toml", &["dawn"]),
    (
        "time_zero = \"emission\"\nlevels = \"common\"",
        "levels = \"common\"",
        "room.toml",
        &["time_zero", "missing"],
    ),
    ("[measurement]\ntime_zero = \"emission\"\nlevels = \"common\"\n", "", "room.toml", &["measurement"]),
    ("levels = \"common\"", "levels = 3", "room.toml", &["levels"]),
    ("mesh = \"room.obj\"", "mesh = \"other.obj\"", "other.obj", &["No such file"]),
    ("mesh = \"room.obj\"", "mesh = ", "room.toml", &["line 3"]),
    ("mesh = \"room.obj\"", "mesh = \"room.dxf\"", "room.dxf", &["neither .obj nor"]),
    ("mesh = \"room.obj\"", "mesh = \".obj\"", ".obj", &["neither .obj nor"]),
    (
        "centres_hz = [500, 1000]",
        "centres_hz = [500, 2000]",
        "room.toml",
        &["bands.centres_hz", "contiguous"],
    ),
    ("centres_hz = [500, 1000]", "centres_hz = [500, 1100]", "room.toml", &["bands.centres_hz", "1100"]),
    ("centres_hz = [500, 1000]", "centres_hz = []", "room.toml", &["bands.centres_hz"]),
    ("centres_hz = [500, 1000]", "centres_hz = [31.5, 62.5]", "room.toml", &["bands.centres_hz", "31.5"]),
    ("temperature_c = 24.0", "temperature_c = 240.0", "room.toml", &["air", "temperature_c is 240"]),
    ("temperature_c = 24.0\n", "", "room.toml", &["missing", "temperature_c"]),
    ("temperature_c = 18.5", "temperature_c = nan", "room.toml", &["responses[0].temperature_c"]),
    (
        "temperature_c = 18.5",
        "relative_humidity_percent = 101",
        "room.toml",
        &["responses[0].relative_humidity_percent"],
    ),
    (
        "position_m = [1.0, 1.0, 1.0]",
        "position_m = [1.0, 1.0]",
        "room.toml",
        &["sources[0].position_m", "2 values"],
    ),
    (
        "position_m = [2.0, 1.0, 1.0]",
        "position_m = [2.0, nan, 1.0]",
        "room.toml",
        &["receivers[0].position_m", "NaN"],
    ),
    (
        "orientation = [0.0, 1.0, 0.0]",
        "orientation = [0.0, 2.0, 0.0]",
        "room.toml",
        &["sources[0].orientation", "unit vector"],
    ),
    (
        "orientation = [0.0, 1.0, 0.0]",
        "orientation = [0.0, 0.0, 0.0]",
        "room.toml",
        &["sources[0].orientation"],
    ),
    (
        "[[receivers]]",
        "[[sources]]\nid = \"s1\"\nposition_m = [1, 1, 1]\n[[receivers]]",
        "room.toml",
        &["sources[1].id", "`s1`", "twice"],
    ),
    (
        "[[responses]]",
        "[[receivers]]\nid = \"r1\"\nposition_m = [1, 1, 1]\n[[responses]]",
        "room.toml",
        &["receivers[1].id", "`r1`", "twice"],
    ),
    ("source = \"s1\"", "source = \"s7\"", "room.toml", &["responses[0].source", "`s7`"]),
    ("receiver = \"r1\"", "receiver = \"s1\"", "room.toml", &["responses[0].receiver", "`s1`"]),
    (
        "session = \"evening\"",
        "[[responses]]\nsource = \"s1\"\nreceiver = \"r1\"\nfile = \"ir/a.wav\"",
        "room.toml",
        &["responses[1].file", "twice"],
    ),
    ("file = \"ir/a.wav\"", "file = \"ir/b.wav\"", "ir/b.wav", &["No such file"]),
];

fn message(folder: &Path) -> String {
    match MeasuredRoom::read(folder) {
        Ok(_) => "no error".into(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn each_fault_of_the_toml_is_named_with_file_and_field() {
    let mut failures = Vec::new();
    for (old, new, file, words) in TOML_FAULTS {
        assert!(TOML.contains(old), "the case for {new:?} changes nothing");
        let folder = folder(&TOML.replacen(old, new, 1), OBJ);
        let message = message(folder.path());
        let named = file.is_empty() || message.starts_with(&folder.path().join(file).display().to_string());
        if !named || !words.iter().all(|word| message.contains(word)) {
            failures.push(format!("{new:?} gave: {message}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn each_fault_of_the_mesh_is_named_with_its_line() {
    for (old, new, words) in [
        ("v 4 3 0", "v 4 3", "line 3: cannot read ``"),
        ("v 4 0 0", "v 4 nan 0", "line 2: vertex coordinate"),
        ("f 1 2 3 4", "f 1 2 3 44", "line 10: cannot read `44`"),
        ("f 1 2 3 4", "f 1 3 2 4", "line 10: the outline"),
        ("v 4 0 0", "v 4,0 0 0", "line 2: cannot read `4,0`"),
    ] {
        let folder = folder(TOML, &OBJ.replacen(old, new, 1));
        let message = message(folder.path());
        let start = format!("{}: {words}", folder.path().join("room.obj").display());
        assert!(message.starts_with(&start), "{new:?} gave: {message}");
    }
    let unnamed = folder(&TOML.replace("[materials.floor]\n", ""), &OBJ.replace("usemtl floor\n", ""));
    let text = message(unnamed.path());
    let end = "room.obj name no material, and there is no table `default` for them";
    assert!(text.starts_with("1 faces of the mesh") && text.ends_with(end), "{text}");
    let folder = folder(&TOML.replace("[materials.floor]\n", "").replace("[materials.wall]\nabsorption = [0.1, 0.2]\nabsorption_sd = [0.05, 0.06]\nscattering = [0.3, 0.4]\n", ""), "# nothing\n");
    let message = message(folder.path());
    assert!(message.contains("room.obj: mesh: list of vertices is empty"), "{message}");
}

#[test]
fn each_fault_of_a_response_is_named_with_its_file() {
    let folder = folder(TOML, OBJ);
    let wav = folder.path().join("ir/a.wav");
    let named = |words: &str| {
        let message = message(folder.path());
        assert!(message.starts_with(&wav.display().to_string()) && message.contains(words), "{message}");
    };
    // One metre takes 2.9 ms: 139 samples at 48 kHz.
    write_wav(&wav, &[0.1; 138], 48_000, SampleFormat::Int16).unwrap();
    named("the direct sound arrives after 0.0029 s");
    let whole = std::fs::read(&wav).unwrap();
    std::fs::write(&wav, &whole[..100]).unwrap();
    named("truncated");
    std::fs::write(&wav, b"").unwrap();
    named("empty");
    std::fs::write(&wav, b"a text").unwrap();
    named("this is text");
    let stereo = hound::WavSpec {
        channels: 2,
        sample_rate: 48_000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(&wav, stereo).unwrap();
    (0..1000).for_each(|_| writer.write_sample(1i16).unwrap());
    writer.finalize().unwrap();
    named("2 channels");
    let float = hound::WavSpec {
        channels: 1,
        sample_rate: 48_000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(&wav, float).unwrap();
    (0..1000).for_each(|i| writer.write_sample(if i == 7 { f32::NAN } else { 0.0 }).unwrap());
    writer.finalize().unwrap();
    let room = MeasuredRoom::read(folder.path()).unwrap();
    let error = room.load_response(0).unwrap_err().to_string();
    assert!(
        error.starts_with(&wav.display().to_string()) && error.contains("sample 7 is not finite"),
        "{error}"
    );
}

fn new_room() -> NewRoom {
    let bands = Bands::T60;
    let surface = |name: &str| library_material(name).unwrap().material(bands).unwrap();
    let scene = Scene::shoebox(
        [5.0, 4.0, 3.0],
        ["rendered_brick", "plasterboard", "glass_window", "curtain_heavy", "carpet_thin", "ceiling_tiles"]
            .map(surface),
    )
    .unwrap();
    let priors = scene
        .materials()
        .iter()
        .enumerate()
        .map(|(i, m)| MaterialPrior {
            absorption: (i != 3).then(|| m.material.absorption().clone()),
            absorption_sd: m.material.absorption().map(|_| 0.07),
        })
        .collect();
    NewRoom {
        scene,
        priors,
        air: Some(Air::new(21.0, 40.0, 100.0).unwrap()),
        measurement: Measurement { time_zero: TimeZero::PerResponse, levels: Levels::Absolute },
        position_sd: PositionSd {
            all_m: Some(0.03),
            sources_m: [("s".into(), 0.002)].into(),
            receivers_m: [("r".into(), 0.25)].into(),
        },
        sources: vec![Source { id: "s".into(), position_m: [1.0, 1.1, 1.2], axis: Some([0.6, 0.8, 0.0]) }],
        receivers: vec![Receiver::omni("r", [3.0, 2.1, 1.7]).unwrap()],
        responses: vec![NewResponse {
            source: "s".into(),
            receiver: "r".into(),
            name: "s_r".into(),
            air: Some(Air::new(22.5, 41.0, 100.0).unwrap()),
            session: Some("morning".into()),
            recorded_at: Some(-3.5),
            samples: ImpulseResponse::new(vec![0.0, 1.0, -0.25], 44_100).unwrap(),
        }],
    }
}

#[test]
fn a_written_room_comes_back() {
    let parent = TempDir::new().unwrap();
    let path = parent.path().join("room");
    let new = new_room();
    let room = new.write(&path).unwrap();
    assert_eq!(room, MeasuredRoom::read(&path).unwrap());
    assert_eq!(room.scene().vertices(), new.scene.vertices());
    assert_eq!(room.scene().materials()[4], new.scene.materials()[4]);
    assert_eq!(room.priors()[..3], new.priors[..3]);
    assert_eq!(room.priors()[3].absorption, None);
    assert_eq!((room.sources(), room.receivers()), (&new.sources[..], &new.receivers[..]));
    assert_eq!(room.measurement(), new.measurement);
    assert_eq!(room.position_sd(), &new.position_sd);
    assert_eq!(room.responses()[0].recorded_at, Some(-3.5));
    assert_eq!(Some(room.responses()[0].air), new.responses[0].air);
    assert_eq!(room.load_response(0).unwrap(), new.responses[0].samples);
    // A second time there is something in the way.
    assert!(
        matches!(new.write(&path), Err(Error::Acoustics(ValueError::Io { path: named, .. })) if named == path)
    );
    assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 1);
}

#[test]
fn a_room_that_could_not_be_read_back_is_not_written() {
    let parent = TempDir::new().unwrap();
    let mut new = new_room();
    new.responses[0].receiver = "nobody".into();
    let error = new.write(parent.path().join("room")).unwrap_err();
    assert!(error.to_string().contains("`nobody`"), "{error}");
    let refused = |new: &NewRoom, words: &str| {
        let error = new.write(parent.path().join("room")).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    // A deviation of a place that is not there, or no deviation at all.
    let mut unplaced = new_room();
    unplaced.position_sd.sources_m = [("r".into(), 0.1)].into();
    refused(&unplaced, "`r`");
    unplaced.position_sd = PositionSd { all_m: Some(0.0), ..PositionSd::default() };
    refused(&unplaced, "measurement.position_sd_m");
    new.priors.pop();
    assert!(matches!(
        new.write(parent.path().join("room")),
        Err(Error::Acoustics(ValueError::MaterialCount { expected: 6, found: 5 }))
    ));
    assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 0);
}

/// Rooms that people measured: every one is read, and those known to be closed have a sensible volume.
#[test]
fn real_rooms_are_read() {
    let rooms = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms"));
    if !rooms.is_dir() {
        eprintln!("skipped: {} is absent", rooms.display());
        return;
    }
    for (name, triangles, volume_m3, responses) in [
        ("bras_cr1_doorangle1", None, None, 0),
        ("bras_cr1_doorangle3", None, None, 0),
        ("bras_cr2", None, Some((135.0, 155.0)), 1),
        ("bras_cr3", Some(2598), None, 0),
        ("bras_cr4", Some(5160), None, 0),
        ("dechorate_011111", Some(12), Some((75.0, 85.0)), 12),
    ] {
        let room = MeasuredRoom::read(rooms.join(name)).unwrap();
        println!("{name}: {} triangles, {:.1} m3", room.scene().triangles().len(), room.scene().volume_m3());
        if let Some(triangles) = triangles {
            assert_eq!(room.scene().triangles().len() + room.faces_without_area(), triangles, "{name}");
        }
        if let Some((low, high)) = volume_m3 {
            assert!((low..high).contains(&room.scene().volume_m3()), "{name}");
        }
        assert_eq!(room.responses().len(), responses, "{name}");
        for i in 0..responses {
            assert!(room.load_response(i).unwrap().peak() > 0.0);
        }
    }
}
