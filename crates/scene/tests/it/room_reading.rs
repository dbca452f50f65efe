//! What a room file may state and name: units, axes, the material library, files; and what is said of it.

use sabine_acoustics::{SampleFormat, library_material, material_library, write_wav};
use sabine_scene::{Error, LengthUnit, MaterialPrior, MeasuredRoom, ReadOptions, RoomNote, UpAxis};
use std::path::Path;
use tempfile::TempDir;

const TOML: &str = r#"
[room]
mesh = "room.obj"
[measurement]
time_zero = "per_response"
levels = "common"
[bands]
centres_hz = [500, 1000]
[materials.floor]
absorption = [0.1, 0.2]
[materials.wall]
absorption = [0.1, 0.2]
[[sources]]
id = "s1"
position_m = [1.0, 1.0, 1.6]
[[receivers]]
id = "r1"
position_m = [7.0, 5.0, 1.0]
[[responses]]
source = "s1"
receiver = "r1"
file = "a.wav"
"#;

/// A box whose corners come from those of 8 x 6 x 3 m.
fn obj(corner: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let corners = [[0., 0.], [8., 0.], [8., 6.], [0., 6.]];
    let at = |z: f64| corners.map(|[x, y]| corner([x, y, z]));
    let line = |[x, y, z]: [f64; 3]| format!("v {x} {y} {z}\n");
    let vertices: String = at(0.0).into_iter().chain(at(3.0)).map(line).collect();
    vertices + "usemtl floor\nf 1 2 3 4\nusemtl wall\nf 8 7 6 5\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n"
}

fn decay() -> Vec<f32> {
    (0..24_000)
        .map(|i| if i < 100 { 0.0 } else { (-(i as f32) * 1e-3).exp() * (i as f32 * 1.7).sin() })
        .collect()
}

fn folder(toml: &str, obj: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("room.toml"), toml).unwrap();
    std::fs::write(folder.path().join("room.obj"), obj).unwrap();
    write_wav(folder.path().join("a.wav"), &decay(), 48_000, SampleFormat::Float32).unwrap();
    folder
}

fn as_it_is(p: [f64; 3]) -> [f64; 3] {
    p
}

fn read(toml: &str, obj: &str) -> Result<MeasuredRoom, Error> {
    MeasuredRoom::read(folder(toml, obj).path())
}

fn in_room(line: &str) -> String {
    TOML.replacen("mesh = \"room.obj\"", &format!("mesh = \"room.obj\"\n{line}"), 1)
}

#[test]
fn units_and_axes_are_as_the_file_states() {
    let plain = read(TOML, &obj(as_it_is)).unwrap();
    assert_eq!(plain.size_line(), "room: 8 x 6 x 3 m (along x, y, z), volume 144 m3, surface 180 m2");
    assert_eq!(plain.notes(), []);
    for unit in LengthUnit::ALL {
        let scaled = obj(|p| p.map(|c| c / unit.metres()));
        let room = read(&in_room(&format!("units = \"{}\"", unit.symbol())), &scaled).unwrap();
        for (found, expected) in
            room.scene().vertices().iter().flatten().zip(plain.scene().vertices().iter().flatten())
        {
            assert!((found - expected).abs() < 1e-12, "{unit:?}");
        }
    }
    // y up, as modelling programs write it: their y is our z, their z our -y.
    let room = read(&in_room("up_axis = \"y\""), &obj(|[x, y, z]| [x, z, -y])).unwrap();
    assert_eq!(room.scene().vertices(), plain.scene().vertices());
    for (line, words) in [("units = \"yd\"", "room.units: "), ("up_axis = \"x\"", "room.up_axis: ")] {
        let message = read(&in_room(line), &obj(as_it_is)).unwrap_err().to_string();
        assert!(message.contains("room.toml: line 4: ") && message.contains(words), "{message}");
    }
}

#[test]
fn a_mesh_in_other_units_is_asked_about() {
    for unit in [LengthUnit::Centimetre, LengthUnit::Millimetre, LengthUnit::Inch] {
        let room = read(TOML, &obj(|p| p.map(|c| c / unit.metres()))).unwrap();
        let notes = room.notes();
        let found = |note: &&RoomNote| matches!(note, RoomNote::UnusualSize { unit: Some(found), .. } if *found == unit);
        let note = notes.iter().find(found).unwrap_or_else(|| panic!("{unit:?}: {notes:?}")).to_string();
        assert!(note.contains(&format!("units = \"{}\"", unit.symbol())), "{note}");
    }
    let long = read(TOML, &obj(|p| p.map(|c| 100.0 * c))).unwrap().notes();
    assert_eq!(
        long[0].to_string(),
        "800 m long: is the mesh in centimetres? Then add units = \"cm\" to [room]"
    );
    let small =
        read(&TOML.replace("[1.0, 1.0, 1.6]", "[0.1, 0.1, 0.1]"), &obj(|p| p.map(|c| 0.1 * c))).unwrap();
    assert!(matches!(small.notes()[0], RoomNote::UnusualSize { unit: None, .. }), "{:?}", small.notes());
}

#[test]
fn a_mesh_that_lies_on_its_side_is_recognised() {
    let y_up = |[x, y, z]: [f64; 3]| [x, z, -y];
    // A source outside, and inside once the mesh is turned: an error that offers the turn.
    let message = read(TOML, &obj(y_up)).unwrap_err().to_string();
    assert!(message.contains("room.toml: sources[0].position_m: [1.0, 1.0, 1.6] m is outside"), "{message}");
    assert!(message.contains("add up_axis = \"y\" to [room]"), "{message}");
    // The other way about: said to be y up, but z up.
    let message = read(&in_room("up_axis = \"y\""), &obj(as_it_is)).unwrap_err().to_string();
    assert!(message.contains("add up_axis = \"z\" to [room]"), "{message}");
    // Outside either way: for the tracer to say.
    read(&TOML.replace("[7.0, 5.0, 1.0]", "[70.0, 5.0, 1.0]"), &obj(y_up)).unwrap();
    // No place says anything: the face called floor is a wall.
    let bare = &TOML[..TOML.find("[[sources]]").unwrap()];
    let notes = read(bare, &obj(y_up)).unwrap().notes();
    assert!(matches!(notes[..], [RoomNote::LiesOnItsSide { up_axis: UpAxis::Y }]), "{notes:?}");
    // Without telling names, a hall higher than wide whose turned height would be that of a room.
    let unnamed = |text: &str| text.replace("floor", "m0").replace("wall", "m1");
    let notes = read(&unnamed(bare), &unnamed(&obj(y_up))).unwrap().notes();
    assert!(matches!(notes[..], [RoomNote::LiesOnItsSide { .. }]), "{notes:?}");
    for upright in [read(bare, &obj(as_it_is)), read(&unnamed(bare), &unnamed(&obj(as_it_is)))] {
        assert_eq!(upright.unwrap().notes(), []);
    }
}

/// A refusal that names room.toml, the field and the file.
fn refused(room: &Path, field: &str, file: &str) {
    let error = MeasuredRoom::read(room).unwrap_err();
    let Error::InFile { path, field: found, source } = &error else { panic!("{field}: {error:?}") };
    assert_eq!((path, found.as_str()), (&room.join("room.toml"), field));
    assert!(matches!(&**source, Error::OutsideFolder { .. }), "{error}");
    assert!(error.to_string().contains(file), "{error}");
}

#[test]
fn files_outside_the_folder_are_read_only_if_asked() {
    let other = folder(TOML, &obj(as_it_is));
    let name = |file: &str| other.path().join(file).display().to_string();
    for (key, field) in [("room.obj", "room.mesh"), ("a.wav", "responses[0].file")] {
        let absolute = folder(&TOML.replace(key, &name(key)), &obj(as_it_is));
        refused(absolute.path(), field, &name(key));
        let up = format!("../{}/{key}", other.path().file_name().unwrap().display());
        let dotted = folder(&TOML.replace(key, &up), &obj(as_it_is));
        refused(dotted.path(), field, &up);
        for room in [&absolute, &dotted] {
            let options = ReadOptions { allow_outside: true };
            let read = MeasuredRoom::read_with(room.path(), &options).unwrap();
            assert_eq!(read.load_response(0).unwrap().samples(), decay());
        }
        // What is not there must not be told from what is.
        let missing = folder(&TOML.replace(key, &format!("../no/{key}")), &obj(as_it_is));
        refused(missing.path(), field, key);
        #[cfg(unix)]
        {
            let linked = folder(TOML, &obj(as_it_is));
            std::fs::remove_file(linked.path().join(key)).unwrap();
            std::os::unix::fs::symlink(name(key), linked.path().join(key)).unwrap();
            refused(linked.path(), field, key);
        }
    }
    // The same file by another way, and a folder that is itself a link.
    let inside = folder(&TOML.replace("room.obj", "./room.obj"), &obj(as_it_is));
    MeasuredRoom::read(inside.path()).unwrap();
    #[cfg(unix)]
    {
        let alias = inside.path().with_extension("alias");
        std::os::unix::fs::symlink(inside.path(), &alias).unwrap();
        MeasuredRoom::read(&alias).unwrap();
        std::fs::remove_file(alias).unwrap();
    }
}

#[test]
fn materials_may_come_from_the_library() {
    let carpet = library_material("carpet_thin").unwrap();
    let with = |lines: &str| {
        TOML.replacen("[materials.floor]\nabsorption = [0.1, 0.2]", &format!("[materials.floor]\n{lines}"), 1)
    };
    let room =
        read(&with("library = \"carpet_thin\"\nabsorption_sd = [0.03, 0.04]"), &obj(as_it_is)).unwrap();
    let floor = &room.scene().materials()[0].material;
    assert_eq!(floor, &carpet.material(room.bands()).unwrap());
    assert_eq!(room.priors()[0].absorption.as_ref().unwrap().values(), [0.08, 0.2]);
    assert_eq!(room.priors()[0].absorption_sd.values(), [0.03, 0.04]);
    assert_eq!(room.notes(), []);
    let scattered =
        read(&with("library = \"carpet_thin\"\nscattering = [0.3, 0.4]"), &obj(as_it_is)).unwrap();
    assert_eq!(scattered.scene().materials()[0].material.scattering().values(), [0.3, 0.4]);
    assert_eq!(scattered.priors()[0].absorption_sd.values(), [MaterialPrior::TABLE_SD; 2]);

    let both = read(&with("library = \"carpet_thin\"\nabsorption = [0.1, 0.2]"), &obj(as_it_is)).unwrap_err();
    assert!(
        both.to_string().contains("room.toml: materials.floor.library: `library` and `absorption`"),
        "{both}"
    );
    let slip = read(&with("library = \"carpt_thin\""), &obj(as_it_is)).unwrap_err().to_string();
    assert!(
        slip.contains("room.toml: materials.floor.library: ") && slip.contains("names are carpet_thin,"),
        "{slip}"
    );

    // A material of the mesh that has no table, but the name of an entry.
    let toml = TOML.replacen("[materials.floor]\nabsorption = [0.1, 0.2]\n", "", 1);
    let named = read(&toml, &obj(as_it_is).replace("floor", "carpet_thin")).unwrap();
    assert_eq!(&named.scene().materials()[0].material, floor);
    assert_eq!(named.notes(), [RoomNote::LibraryTable { material: "carpet_thin".into() }]);
    assert!(matches!(read(&toml, &obj(as_it_is)), Err(Error::MaterialWithoutTable { .. })));
}

#[test]
fn guesses_are_named_with_their_share() {
    let toml = TOML.replacen("[materials.floor]\nabsorption = [0.1, 0.2]", "[materials.floor]", 1);
    let room = read(&toml, &obj(as_it_is)).unwrap();
    let notes = room.notes();
    let [RoomNote::GuessedAbsorption { material, area_m2, share: (low, high) }] = &notes[..] else {
        panic!("{notes:?}")
    };
    assert_eq!((material.as_str(), *area_m2), ("floor", 48.0));
    // 48 m2 of 0.2 beside 132 m2 of 0.1 and 0.2.
    assert!((low - 48.0 / 180.0).abs() < 1e-12 && (high - 9.6 / 22.8).abs() < 1e-12, "{low} {high}");
    assert_eq!(
        notes[0].to_string(),
        "floor: no absorption is stated; 0.2 ± 0.25 is a guess (48 m2, 27 to 42 % of the equivalent absorption area)"
    );
}

#[test]
fn rooms_far_away_and_rooms_without_absorption_are_mentioned() {
    let far = obj(|p| p.map(|c| c + 50_000.0));
    let toml = TOML
        .replace("[1.0, 1.0, 1.6]", "[50001, 50001, 50001.6]")
        .replace("[7.0, 5.0, 1.0]", "[50007, 50005, 50001]");
    let room = read(&toml, &far).unwrap();
    assert!((room.scene().volume_m3() - 144.0).abs() < 1e-6);
    assert!(matches!(room.notes()[..], [RoomNote::FarFromOrigin { distance_m }] if distance_m > 86_000.0));
    let hard = read(&TOML.replace("[0.1, 0.2]", "[0, 0.2]"), &obj(as_it_is)).unwrap();
    assert_eq!(hard.notes(), [RoomNote::NothingAbsorbs { bands_hz: vec![500.0] }]);
}

#[test]
fn slips_of_the_toml_have_a_line_and_a_key() {
    for (old, new, words) in [
        (
            "absorption = [0.1, 0.2]",
            "absorption = \"0.1\"",
            "line 10: materials.floor.absorption: invalid type",
        ),
        ("levels = \"common\"", "levels = \"loud\"", "line 6: measurement.levels: unknown variant"),
        ("id = \"r1\"\n", "", "line 16: receivers[0]: missing field `id`"),
        ("[bands]", "[bands]\ncolour = 1", "line 8: bands.colour: unknown field"),
        ("id = \"s1\"", "id = \"\"", "sources[0].id: the identifier is empty"),
        ("[500, 1000]", "[]", "bands.centres_hz: the list of centres is empty"),
    ] {
        assert!(TOML.contains(old));
        let message = read(&TOML.replacen(old, new, 1), &obj(as_it_is)).unwrap_err().to_string();
        assert!(message.contains(&format!("room.toml: {words}")), "{new:?} gave {message}");
        assert!(!message.contains('\n'), "{message:?}");
    }
}

#[test]
fn numbers_in_messages_are_short() {
    let message = read(TOML, &obj(as_it_is).replacen("v 8", "v 1e308", 1)).unwrap_err().to_string();
    assert!(message.contains("vertex coordinate (m) is 100e306; it must be"), "{message}");
}

#[test]
fn what_is_no_response_is_refused_with_file_and_field() {
    let folder = folder(TOML, &obj(as_it_is));
    let noise: Vec<f32> =
        (0..48_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / 8_388_608.0 - 1.0).collect();
    for (samples, words) in [(vec![0.0; 4800], "silent"), (noise, "no direct sound")] {
        write_wav(folder.path().join("a.wav"), &samples, 48_000, SampleFormat::Float32).unwrap();
        let error = MeasuredRoom::read(folder.path()).unwrap().load_response(0).unwrap_err().to_string();
        let start = format!("{}: responses[0].file: {words}", folder.path().join("a.wav").display());
        assert!(error.starts_with(&start), "{error}");
    }
}

/// No response of a real or independently simulated room is taken for silence or speech.
#[test]
fn measured_responses_of_many_rooms_pass() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let kinds = ["rooms", "rooms_more", "rooms_foreign"].map(|kind| data.join(kind));
    let folders = kinds.iter().filter_map(|kind| std::fs::read_dir(kind).ok()).flatten();
    let (mut rooms, mut responses) = (0, 0);
    for folder in folders.map(|entry| entry.unwrap().path()).filter(|path| path.join("room.toml").exists()) {
        let room = MeasuredRoom::read(&folder).unwrap();
        println!("{}: {} {:?}", folder.display(), room.size_line(), room.notes());
        // Every seventh of the many of a large room.
        for index in (0..room.responses().len()).step_by(if room.responses().len() > 50 { 7 } else { 1 }) {
            room.load_response(index).unwrap_or_else(|error| panic!("{error}"));
            responses += 1;
        }
        rooms += 1;
    }
    match rooms {
        0 => println!("skipped: {} is not there", data.display()),
        _ => println!("{responses} responses of {rooms} rooms"),
    }
}

/// A response in a room's folder may have any format that is read elsewhere: here a stream (RF64) of doubles.
#[test]
fn responses_may_be_streams_of_doubles() {
    let folder = TempDir::new().unwrap();
    let put = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    put(
        "room.toml",
        b"room = { mesh = \"room.obj\" }\nbands = { centres_hz = [500, 1000] }\nmaterials.wall = {}\n\
          sources = [{ id = \"s\", position_m = [1, 1, 1] }]\nreceivers = [{ id = \"r\", position_m = [1.2, 1, 1] }]\n\
          measurement = { time_zero = \"per_response\", levels = \"per_response\" }\nresponses = [{ source = \"s\", receiver = \"r\", file = \"ir.wav\" }]\n",
    );
    put("room.obj", b"v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nusemtl wall\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
    // One channel of 48 kHz; neither the file nor its samples know their length. A direct sound, and nothing after it.
    let mut stream = b"RF64\xff\xff\xff\xffWAVEfmt \x10\0\0\0\x03\0\x01\0".to_vec();
    stream.extend([48_000_u32, 8 * 48_000].map(u32::to_le_bytes).concat());
    stream.extend(b"\x08\0\x40\0data\xff\xff\xff\xff");
    stream.extend((0..480).flat_map(|i| f64::from(u8::from(i == 5)).to_le_bytes()));
    put("ir.wav", &stream);
    let room = MeasuredRoom::read(folder.path()).unwrap();
    assert_eq!(room.load_response(0).unwrap().samples().len(), 480);
    put("ir.wav", b"\x89PNG\r\n\x1a\n");
    let error = MeasuredRoom::read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("ir.wav: this is PNG"), "{error}");
}

/// The prior of an unknown surface is that of a surface drawn from the library.
#[test]
fn the_prior_of_the_unknown_is_the_library_as_a_whole() {
    let all: Vec<f64> = material_library().iter().flat_map(|surface| surface.absorption).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let variance = all.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / all.len() as f64;
    println!("mean {mean:.3}, standard deviation {:.3}", variance.sqrt());
    assert!((mean - MaterialPrior::UNKNOWN_ABSORPTION).abs() < 0.05, "{mean}");
    assert!((variance.sqrt() - MaterialPrior::UNKNOWN_ABSORPTION_SD).abs() < 0.05, "{}", variance.sqrt());
}
