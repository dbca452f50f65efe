//! Rooms with one fault each, made from the fixture's.

use super::outcome::Case;
use super::outcome::Expected::{self, Done, Refused};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;

const PLACE: &str = "position_m = [1.6, 1.5, 1.5]";
const TABLE: &str = "absorption = [0.01, 0.01, 0.02, 0.02, 0.02, 0.02, 0.02]";
const SD: &str = "absorption_sd = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]";
const CENTRES: &str = "centres_hz = [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0]";
const RESPONSE: &str = "file = \"ir/talker_microphone.wav\"";

fn fixture(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/room").join(name))
        .unwrap()
}

/// The files of a room beside its responses.
type Files = BTreeMap<&'static str, Vec<u8>>;

fn write(folder: &Path, name: &str, files: &Files) {
    let room = folder.join("rooms").join(name);
    std::fs::create_dir_all(room.join("ir")).unwrap();
    let responses = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/room/ir");
    for file in ["talker_corner.wav", "talker_microphone.wav"] {
        std::fs::copy(responses.join(file), room.join("ir").join(file)).unwrap();
    }
    for (file, bytes) in files {
        std::fs::write(room.join(file), bytes).unwrap();
    }
}

/// The room file with one line changed.
fn edited(from: &str, to: &str) -> Files {
    let text = fixture("room.toml");
    assert!(text.contains(from), "{from} is not in the fixture");
    Files::from([("room.toml", text.replacen(from, to, 1).into()), ("room.obj", fixture("room.obj").into())])
}

/// The room file as it is with another mesh.
fn meshed(mesh: impl Into<Vec<u8>>) -> Files {
    Files::from([("room.toml", fixture("room.toml").into()), ("room.obj", mesh.into())])
}

/// The mesh with each vertex changed.
fn moved(change: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let line = |line: &str| match line.strip_prefix("v ") {
        None => line.to_owned(),
        Some(numbers) => {
            let v: Vec<f64> = numbers.split_whitespace().map(|n| n.parse().unwrap()).collect();
            let [x, y, z] = change([v[0], v[1], v[2]]);
            format!("v {x} {y} {z}")
        }
    };
    fixture("room.obj").lines().map(line).collect::<Vec<_>>().join("\n")
}

/// The mesh without the faces of a material.
fn without(material: &str) -> String {
    let mut current = "";
    let mesh = fixture("room.obj");
    let mut kept = Vec::new();
    for line in mesh.lines() {
        current = line.strip_prefix("usemtl ").unwrap_or(current);
        if !(line.starts_with("f ") && current == material) {
            kept.push(line);
        }
    }
    kept.join("\n")
}

/// A glTF file of one triangle; `change` spoils it.
fn gltf(change: impl Fn(&mut serde_json::Value)) -> Files {
    let mut file = json!({ "asset": { "version": "2.0" },
        "buffers": [{ "uri": "mesh.bin", "byteLength": 36 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "nodes": [{ "mesh": 0 }], "scenes": [{ "nodes": [0] }], "scene": 0 });
    change(&mut file);
    let text = fixture("room.toml").replace("room.obj", "room.gltf");
    Files::from([("room.toml", text.into()), ("room.gltf", file.to_string().into())])
}

/// Each room with what `trace` should make of it.
fn rooms() -> Vec<(&'static str, Files, Expected)> {
    let toml =
        |text: &[u8]| Files::from([("room.toml", text.to_vec()), ("room.obj", fixture("room.obj").into())]);
    let text = fixture("room.toml");
    let mesh = fixture("room.obj");
    let all_tables = |value: &str| {
        let line = |line: &str| {
            if line.starts_with("absorption = ") {
                format!("absorption = [{value}]")
            } else {
                line.to_owned()
            }
        };
        toml(text.lines().map(line).collect::<Vec<_>>().join("\n").as_bytes())
    };
    let flipped = |line: &str| match line.strip_prefix("f ") {
        Some(corners) => format!("f {}", corners.split(' ').rev().collect::<Vec<_>>().join(" ")),
        None => line.to_owned(),
    };
    let script = "x<script>alert(1)</script>";
    let named = Files::from([
        ("room.toml", text.replace("[materials.brick]", &format!("[materials.\"{script}\"]")).into()),
        ("room.obj", mesh.replace("usemtl brick", &format!("usemtl {script}")).into()),
    ]);
    let far = |position: &str| -> String {
        let numbers: Vec<String> =
            position.split(',').map(|n| (n.trim().parse::<f64>().unwrap() + 50_000.0).to_string()).collect();
        numbers.join(", ")
    };
    let far_text = text
        .lines()
        .map(|line| match line.strip_prefix("position_m = [") {
            Some(rest) => format!("position_m = [{}]", far(rest.trim_end_matches(']'))),
            None => line.to_owned(),
        })
        .collect::<Vec<_>>()
        .join("\n");
    let far_room = Files::from([
        ("room.toml", far_text.into()),
        ("room.obj", moved(|[x, y, z]| [x + 50_000.0, y + 50_000.0, z + 50_000.0]).into()),
    ]);
    let scaled = |factor: f64| meshed(moved(move |v| v.map(|c| c * factor)));
    let vertices: String = mesh.lines().filter(|l| l.starts_with("v ")).map(|l| format!("{l}\n")).collect();
    let faces: String = mesh.lines().filter(|l| !l.starts_with("v ")).map(|l| format!("{l}\n")).collect();
    let respond = |name: &'static str, from: &str| {
        let mut files = edited("[air]", "[air]");
        files.insert(name, from.into());
        files
    };
    vec![
        ("good", edited("[air]", "[air]"), Done(&["paths; traced in"])),
        ("bom", toml(&[b"\xef\xbb\xbf", text.as_bytes()].concat()), Done(&["paths; traced in"])),
        (
            "crlf",
            Files::from([
                ("room.toml", text.replace('\n', "\r\n").into()),
                ("room.obj", mesh.replace('\n', "\r\n").into()),
            ]),
            Done(&["paths; traced in"]),
        ),
        (
            "flipped_faces",
            meshed(mesh.lines().map(flipped).collect::<Vec<_>>().join("\n")),
            Done(&["paths; traced in"]),
        ),
        ("faces_twice", meshed(format!("{mesh}\n{faces}")), Done(&["paths; traced in"])),
        ("negative_indices", meshed(format!("{mesh}\nf -1 -2 -3\n")), Done(&["paths; traced in"])),
        ("far_from_the_origin", far_room, Done(&["paths; traced in"])),
        ("script_in_a_name", named, Done(&["paths; traced in"])),
        ("position_of_integers", edited(PLACE, "position_m = [1, 1, 1]"), Done(&["paths; traced in"])),
        ("black", all_tables("1,1,1,1,1,1,1"), Done(&[])),
        (
            "absorption_is_text",
            edited(TABLE, "absorption = \"0.1\""),
            Refused(&["room.toml", "line 17", "absorption"]),
        ),
        (
            "absorption_negative",
            edited(TABLE, "absorption = [-0.01, 0, 0, 0, 0, 0, 0]"),
            Refused(&["materials.brick.absorption", "between 0 and 1"]),
        ),
        (
            "absorption_above_1",
            edited(TABLE, "absorption = [1.5, 0, 0, 0, 0, 0, 0]"),
            Refused(&["materials.brick.absorption", "between 0 and 1"]),
        ),
        (
            "absorption_nan",
            edited(TABLE, "absorption = [nan, 0, 0, 0, 0, 0, 0]"),
            Refused(&["materials.brick.absorption", "NaN"]),
        ),
        (
            "absorption_short",
            edited(TABLE, "absorption = [0.1, 0.1]"),
            Refused(&["materials.brick.absorption", "2 values", "7 bands"]),
        ),
        ("sd_zero", edited(SD, "absorption_sd = [0, 0, 0, 0, 0, 0, 0]"), Refused(&["absorption_sd"])),
        ("sd_negative", edited(SD, "absorption_sd = [-1, 0, 0, 0, 0, 0, 0]"), Refused(&["absorption_sd"])),
        (
            "material_misspelt",
            edited("[materials.brick]", "[materials.brik]"),
            Refused(&["materials.brik", "no face"]),
        ),
        ("id_missing", edited("id = \"talker\"\n", ""), Refused(&["room.toml", "id"])),
        ("id_empty", edited("id = \"talker\"", "id = \"\""), Refused(&["room.toml", "sources[0].id"])),
        (
            "id_twice",
            edited("id = \"corner\"", "id = \"microphone\""),
            Refused(&["receivers[1].id", "microphone"]),
        ),
        ("key_unknown", edited("[air]", "[air]\nfoo = 1"), Refused(&["room.toml", "foo"])),
        (
            "position_of_two",
            edited(PLACE, "position_m = [1.6, 1.5]"),
            Refused(&["sources[0].position_m", "3"]),
        ),
        (
            "position_nan",
            edited(PLACE, "position_m = [nan, 1.5, 1.5]"),
            Refused(&["sources[0].position_m", "NaN"]),
        ),
        ("position_outside", edited(PLACE, "position_m = [100, 1.5, 1.5]"), Refused(&["talker", "outside"])),
        (
            "position_in_a_wall",
            edited(PLACE, "position_m = [0.0, 1.5, 1.5]"),
            Refused(&["talker", "surface"]),
        ),
        (
            "orientation_of_length_3",
            edited(PLACE, &format!("{PLACE}\norientation = [3, 0, 0]")),
            Refused(&["sources[0].orientation", "length"]),
        ),
        (
            "bands_with_a_gap",
            edited(CENTRES, "centres_hz = [125, 250, 500, 2000, 4000, 8000, 16000]"),
            Refused(&["bands.centres_hz"]),
        ),
        ("bands_empty", edited(CENTRES, "centres_hz = []"), Refused(&["bands.centres_hz", "empty"])),
        (
            "bands_that_are_no_octaves",
            edited(CENTRES, "centres_hz = [100, 200, 400, 800, 1600, 3200, 6400]"),
            Refused(&["bands.centres_hz", "octave"]),
        ),
        ("cold", edited("temperature_c = 21.0", "temperature_c = -300.0"), Refused(&["temperature_c"])),
        (
            "humid",
            edited("relative_humidity_percent = 45.0", "relative_humidity_percent = 450.0"),
            Refused(&["relative_humidity_percent"]),
        ),
        ("vacuum", edited("pressure_kpa = 101.325", "pressure_kpa = 0.0"), Refused(&["pressure_kpa"])),
        (
            "time_zero_unknown",
            edited("time_zero = \"emission\"", "time_zero = \"whenever\""),
            Refused(&["room.toml", "time_zero"]),
        ),
        (
            "mesh_elsewhere",
            edited("mesh = \"room.obj\"", "mesh = \"../good/room.obj\""),
            Refused(&["room.mesh", "../good/room.obj"]),
        ),
        (
            "mesh_absolute",
            edited("mesh = \"room.obj\"", "mesh = \"/etc/passwd\""),
            Refused(&["room.mesh", "/etc/passwd"]),
        ),
        ("mesh_a_folder", edited("mesh = \"room.obj\"", "mesh = \"ir\""), Refused(&["ir"])),
        (
            "mesh_missing",
            Files::from([("room.toml", text.clone().into())]),
            Refused(&["room.obj", "No such file"]),
        ),
        (
            "room_file_missing",
            Files::from([("room.obj", mesh.clone().into())]),
            Refused(&["room.toml", "No such file"]),
        ),
        ("room_file_empty", toml(b""), Refused(&["room.toml"])),
        (
            "room_file_binary",
            toml(&(0..1000u32).map(|i| (i * i * 37 % 251) as u8).collect::<Vec<_>>()),
            Refused(&["room.toml"]),
        ),
        ("room_file_deep", toml(format!("a={}", "[".repeat(100_000)).as_bytes()), Refused(&["room.toml"])),
        ("mesh_empty", meshed(""), Refused(&["room.obj"])),
        (
            "mesh_binary",
            meshed((0..2000u32).map(|i| (i * i * 37 % 251) as u8).collect::<Vec<_>>()),
            Refused(&["room.obj", "line"]),
        ),
        ("vertex_nan", meshed(mesh.replacen("v 0 0 0", "v nan 0 0", 1)), Refused(&["room.obj", "NaN"])),
        (
            "vertex_infinite",
            meshed(mesh.replacen("v 0 0 0", "v 1e400 0 0", 1)),
            Refused(&["room.obj", "inf"]),
        ),
        (
            "vertex_1e308",
            meshed(mesh.replacen("v 0 0 0", "v 1e308 0 0", 1)),
            Refused(&["room.obj", "line 2"]),
        ),
        ("index_9999", meshed(format!("{mesh}\nf 1 2 9999\n")), Refused(&["room.obj", "9999"])),
        ("index_0", meshed(format!("{mesh}\nf 0 1 2\n")), Refused(&["room.obj", "`0`"])),
        (
            "index_too_large",
            meshed(format!("{mesh}\nf 99999999999999999999 1 2\n")),
            Refused(&["room.obj", "99999999999999999999"]),
        ),
        ("face_of_two", meshed(format!("{mesh}\nf 1 2\n")), Refused(&["room.obj", "three corners"])),
        (
            "face_of_2000",
            meshed(format!("{mesh}\nf {}\n", "1 2 3 4 ".repeat(500))),
            Refused(&["room.obj", "1024"]),
        ),
        ("one_triangle", meshed(format!("{vertices}usemtl brick\nf 1 2 3\n")), Refused(&[])),
        (
            "ceiling_missing",
            Files::from([("room.toml", text.clone().into()), ("room.obj", without("ceiling").into())]),
            Refused(&["ceiling"]),
        ),
        ("millimetres", scaled(1000.0), Refused(&["units"])),
        ("centimetres", scaled(100.0), Done(&["is the mesh in centimetres?"])),
        ("tenths_of_a_millimetre", scaled(1e-4), Refused(&["units"])),
        ("y_up", meshed(moved(|[x, y, z]| [x, z, -y])), Refused(&["up_axis"])),
        (
            "source_at_the_receiver",
            edited("position_m = [6.2, 2.6, 1.3]", "position_m = [1.6, 1.5, 1.5]"),
            Refused(&["talker", "coincide"]),
        ),
        (
            "gltf_reads_passwd",
            gltf(|f| f["buffers"][0]["uri"] = json!("../../../../../../etc/passwd")),
            Refused(&["buffers[0]", "etc/passwd"]),
        ),
        (
            "gltf_from_the_net",
            gltf(|f| f["buffers"][0]["uri"] = json!("http://example.com/x.bin")),
            Refused(&["buffers[0]", "http://example.com/x.bin"]),
        ),
        (
            "gltf_of_4_gb",
            gltf(|f| {
                f["buffers"][0] = json!({ "uri": "data:application/octet-stream;base64,AAAA", "byteLength": 4_000_000_000u64 });
                f["accessors"][0]["count"] = json!(300_000_000);
            }),
            Refused(&["buffers[0]"]),
        ),
        (
            "gltf_in_a_circle",
            gltf(|f| {
                f["buffers"][0]["uri"] = json!(
                    "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"
                );
                f["nodes"][0] = json!({ "mesh": 0, "children": [0] });
            }),
            Refused(&["nodes"]),
        ),
        (
            "response_missing",
            edited(RESPONSE, "file = \"ir/nothere.wav\""),
            Refused(&["nothere.wav", "No such file"]),
        ),
        (
            "response_elsewhere",
            edited(RESPONSE, "file = \"../../wav/good.wav\""),
            Refused(&["responses", "../../wav/good.wav"]),
        ),
        (
            "response_absolute",
            edited(RESPONSE, "file = \"/etc/passwd\""),
            Refused(&["responses", "/etc/passwd"]),
        ),
        (
            "response_twice",
            toml(format!("{text}\n{}", &text[text.find("[[responses]]").unwrap()..]).as_bytes()),
            Refused(&["responses[2].file", "twice"]),
        ),
        // The header of every response is read with the room; whether it is a response, where it is needed.
        (
            "response_of_text",
            respond("ir/talker_microphone.wav", "this is not audio"),
            Refused(&["talker_microphone.wav", "this is text"]),
        ),
    ]
}

/// Writes all rooms into `rooms/`.
pub fn make(folder: &Path) {
    for (name, files, _) in rooms() {
        write(folder, name, &files);
    }
    for (name, wav) in
        [("response_nan", "nan.wav"), ("response_silent", "zeros.wav"), ("response_of_speech", "speech.wav")]
    {
        let mut files = edited("[air]", "[air]");
        files.insert("ir/talker_microphone.wav", std::fs::read(folder.join("wav").join(wav)).unwrap());
        write(folder, name, &files);
    }
    let piped = folder.join("rooms/room_file_a_pipe");
    std::fs::create_dir_all(&piped).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(piped.join("room.toml")).status().unwrap().success());
    let looped = folder.join("rooms/symbolic_loop");
    std::fs::create_dir_all(&looped).unwrap();
    std::os::unix::fs::symlink("room.toml", looped.join("room.toml")).unwrap();
}

/// What `trace`, `fit`, `match` and `diagnose` make of them.
pub fn cases() -> Vec<Case> {
    let trace = |name: &str, expected| {
        let arguments = format!("trace --room rooms/{name} --rays 300 --duration 0.4 --out OUT");
        Case::new(format!("trace, room {name}"), &arguments, expected)
    };
    let mut cases: Vec<Case> = rooms().into_iter().map(|(name, _, expected)| trace(name, expected)).collect();
    cases.push(trace("room_file_a_pipe", Refused(&["room.toml", "named pipe"])));
    cases.push(trace("symbolic_loop", Refused(&["room.toml", "symbolic links"])));
    for (name, words) in [
        ("response_nan", &["talker_microphone.wav", "not finite"][..]),
        ("response_silent", &["talker_microphone.wav", "silent"]),
        ("response_of_speech", &["talker_microphone.wav"]),
        ("response_of_text", &["talker_microphone.wav"]),
    ] {
        for command in ["fit --responses --rays 300", "diagnose --rays 300"] {
            let arguments = format!("{command} --room rooms/{name} --out OUT");
            cases.push(Case::new(format!("{command}, room {name}"), &arguments, Refused(words)));
        }
    }
    for (name, expected) in [
        ("black", Done(&["note"])),
        ("script_in_a_name", Done(&["report.html"])),
        ("sd_zero", Refused(&["absorption_sd"])),
        ("y_up", Refused(&["up_axis"])),
        ("centimetres", Done(&["is the mesh in centimetres?"])),
    ] {
        let arguments = format!("match --room rooms/{name} --rays 1000 --out OUT");
        cases.push(Case::new(format!("match, room {name}"), &arguments, expected));
    }
    cases
}
