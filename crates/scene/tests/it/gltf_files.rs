//! Meshes in glTF: what the format may say, and what it must not.

use base64::Engine;
use proptest::prelude::*;
use sabine_acoustics::{Bands, Error as ValueError, Material};
use sabine_scene::{Error, MeasuredRoom, Mesh, Scene};
use serde_json::{Value, json};
use std::path::Path;
use tempfile::TempDir;

/// Corners of a box of 4 m along x, 3 m along y and 2 m upwards, in our axes, and its faces turned inward.
fn corners() -> Vec<[f64; 3]> {
    shoebox().vertices().to_vec()
}

fn shoebox() -> Scene {
    let wall = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
    Scene::shoebox([4.0, 3.0, 2.0], std::array::from_fn(|_| wall.clone())).unwrap()
}

/// z up to y up, in bytes.
fn positions(points: &[[f64; 3]]) -> Vec<u8> {
    points.iter().flat_map(|&[x, y, z]| [x, z, -y]).flat_map(|c| (c as f32).to_le_bytes()).collect()
}

/// Floor and ceiling of 16-bit indices, then the walls.
fn indices() -> Vec<u8> {
    let (mut flat, mut upright) = (Vec::new(), Vec::new());
    for t in shoebox().triangles() {
        if t.material >= 4 { &mut flat } else { &mut upright }.extend(t.vertices);
    }
    flat.into_iter().chain(upright).flat_map(|i| (i as u16).to_le_bytes()).collect()
}

fn bytes() -> Vec<u8> {
    [positions(&corners()), indices()].concat()
}

/// A box of two primitives that share their vertices; pictures that are nowhere.
fn document() -> Value {
    json!({
        "asset": { "version": "2.0", "generator": "a test" },
        "extensionsRequired": ["KHR_texture_transform", "KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "images": [{ "uri": "nowhere.png" }],
        "textures": [{ "source": 0 }, { "extensions": { "KHR_texture_basisu": { "source": 9 } } }],
        "materials": [
            { "name": "wall", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } },
            {}
        ],
        "meshes": [{ "primitives": [
            { "attributes": { "POSITION": 0 }, "indices": 1, "material": 1 },
            { "attributes": { "POSITION": 0 }, "indices": 2, "material": 0 }
        ] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, -3], "max": [4, 2, 0] },
            { "bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR" },
            { "bufferView": 1, "byteOffset": 24, "componentType": 5123, "count": 24, "type": "SCALAR" }
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 96 },
            { "buffer": 0, "byteOffset": 96, "byteLength": 72 }
        ],
        "buffers": [{ "byteLength": 168 }]
    })
}

fn data_uri(bytes: &[u8]) -> Value {
    let text = base64::engine::general_purpose::STANDARD.encode(bytes);
    format!("data:application/octet-stream;base64,{text}").into()
}

fn glb(document: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |n: usize| (n as u32).to_le_bytes();
    let length = 12 + 8 + json.len() + 8 + bin.len();
    [b"glTF", &word(2)[..], &word(length), &word(json.len()), b"JSON", &json, &word(bin.len()), b"BIN\0", bin]
        .concat()
}

fn read(name: &str, bytes: &[u8]) -> Result<Mesh, Error> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    Mesh::read(&path)
}

/// Reads a document whose only buffer is `bin`.
fn read_with(mut document: Value, bin: &[u8]) -> Result<Mesh, Error> {
    document["buffers"] = json!([{ "byteLength": bin.len(), "uri": data_uri(bin) }]);
    read("a.gltf", document.to_string().as_bytes())
}

fn scene(mesh: Mesh) -> Scene {
    let material = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
    let materials = mesh.material_names().iter().map(|name| (name.clone(), material.clone())).collect();
    mesh.into_scene(&materials).unwrap()
}

/// Volume with its sign: negative where faces look inward.
fn signed_volume_m3(mesh: &Mesh) -> f64 {
    let six = |t: &sabine_scene::Triangle| {
        let [a, b, c] = t.vertices.map(|v| mesh.vertices_m()[v as usize]);
        (0..3)
            .map(|i| a[i] * (b[(i + 1) % 3] * c[(i + 2) % 3] - b[(i + 2) % 3] * c[(i + 1) % 3]))
            .sum::<f64>()
    };
    mesh.triangles().iter().map(six).sum::<f64>() / 6.0
}

#[test]
fn a_box_is_the_same_in_all_three_containers() {
    let folder = TempDir::new().unwrap();
    let (mut embedded, mut beside) = (document(), document());
    embedded["buffers"][0]["uri"] = data_uri(&bytes());
    beside["buffers"][0]["uri"] = "the%20numbers.bin".into();
    std::fs::write(folder.path().join("the numbers.bin"), bytes()).unwrap();
    for (name, content) in [
        ("embedded.gltf", embedded.to_string().into_bytes()),
        ("beside.GLTF", beside.to_string().into_bytes()),
        ("binary.glb", glb(&document(), &bytes())),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        let mesh = Mesh::read(&path).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(mesh.material_names(), ["material_1", "wall"], "{name}");
        assert_eq!(mesh.vertices_m(), corners(), "{name}"); // once, and turned upright
        let scene = scene(mesh);
        assert_eq!(scene.triangles().len(), 12);
        assert!((scene.volume_m3() - 24.0).abs() < 1e-9);
        for (area, expected) in scene.material_areas_m2().iter().zip([24.0, 28.0]) {
            assert!((area - expected).abs() < 1e-9);
        }
    }
}

#[test]
fn a_measured_room_may_have_a_binary_mesh() {
    let folder = TempDir::new().unwrap();
    let mut unnamed = document();
    unnamed["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
    std::fs::write(folder.path().join("room.glb"), glb(&unnamed, &bytes())).unwrap();
    let room = |tables: &str| {
        let toml =
            format!("room = {{ mesh = 'room.glb' }}\nbands = {{ centres_hz = [500, 1000] }}\n{tables}");
        std::fs::write(folder.path().join("room.toml"), toml).unwrap();
        MeasuredRoom::read(folder.path())
    };
    let read = room("materials.wall = {}\nmaterials.default = { absorption = [0.3, 0.4] }").unwrap();
    assert!((read.scene().volume_m3() - 24.0).abs() < 1e-9);
    assert_eq!(read.scene().materials()[0].name, Mesh::DEFAULT_MATERIAL);
    assert_eq!(read.priors()[0].absorption.as_ref().unwrap().values(), [0.3, 0.4]);
    let bare = room("materials.wall = {}");
    assert!(matches!(bare, Err(Error::FacesWithoutMaterial { faces: 4, .. })), "{bare:?}");
    let message = room("materials.default = {}\nmaterials.roof = {}").unwrap_err().to_string();
    assert!(message.contains("materials.roof") && message.contains("room.glb"), "{message}");
}

#[test]
fn nodes_move_turn_scale_and_mirror_their_meshes() {
    // A quarter turn about our z (their y), twice as long along x, 5 m further along our y; and a mirrored twin.
    let half = 0.5f64.sqrt();
    let mut document = document();
    document["nodes"] = json!([
        { "children": [1, 2], "translation": [0, 0, -5] },
        { "mesh": 0, "rotation": [0, half, 0, half], "scale": [2, 1, 1] },
        { "mesh": 0, "matrix": [-1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  -10, 0, 0, 1] }
    ]);
    let mesh = read_with(document, &bytes()).unwrap();
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-5);
    for (i, &[x, y, z]) in corners().iter().enumerate() {
        assert!(near(mesh.vertices_m()[i], [-y, 2.0 * x + 5.0, z]), "{i}: {:?}", mesh.vertices_m()[i]);
        assert!(near(mesh.vertices_m()[8 + i], [-10.0 - x, y + 5.0, z]), "{i}");
    }
    // Both look inward still.
    let both = signed_volume_m3(&mesh);
    assert!((both + 48.0 + 24.0).abs() < 1e-4, "{both}");
}

/// The same triangle, turned alike, from its smallest corner on.
fn turned(mut corners: [u32; 3]) -> [u32; 3] {
    let least = (0..3).min_by_key(|&i| corners[i]).unwrap();
    corners.rotate_left(least);
    corners
}

/// A pyramid's sides or a band of wall, by every way to say it; the triangles must come out alike.
#[test]
fn lists_strips_and_fans_of_all_indices_are_triangles() {
    let apex = [[0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]];
    let ring = [
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 0.0],
        [1.0, 1.0, 1.0],
    ];
    let fan: &[[u32; 3]] = &[[1, 2, 0], [2, 3, 0], [3, 4, 0]];
    let strip: &[[u32; 3]] = &[[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]];
    // Points, mode, type and list of the indices, what must come out.
    type Case<'a> = (&'a [[f64; 3]], u32, Option<(u32, Vec<u32>)>, &'a [[u32; 3]]);
    let cases: [Case<'_>; 6] = [
        (&apex, 6, None, fan),
        (&apex, 6, Some((5121, vec![0, 1, 2, 3, 4])), fan),
        (&ring, 5, None, strip),
        (&ring, 5, Some((5125, vec![0, 1, 2, 3, 4, 5])), strip),
        (&ring, 5, Some((5123, vec![0, 1, 2, 3, 3, 2, 2, 3, 4])), &[[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
        (&ring, 4, Some((5121, vec![5, 4, 3, 2, 1, 0])), &[[5, 4, 3], [2, 1, 0]]),
    ];
    for (points, mode, indices, expected) in cases {
        let mut bin = positions(points);
        let start = bin.len();
        let mut primitive = json!({ "attributes": { "POSITION": 0 }, "mode": mode });
        let mut accessors =
            vec![json!({ "bufferView": 0, "componentType": 5126, "count": points.len(), "type": "VEC3" })];
        if let Some((kind, list)) = indices {
            primitive["indices"] = 1.into();
            accessors.push(
                json!({ "bufferView": 1, "componentType": kind, "count": list.len(), "type": "SCALAR" }),
            );
            let size = [1, 2, 4][[5121, 5123, 5125].iter().position(|&k| k == kind).unwrap()];
            bin.extend(list.iter().flat_map(|i| i.to_le_bytes().into_iter().take(size)));
        }
        let mut document = document();
        document["meshes"] = json!([{ "primitives": [primitive, { "attributes": {}, "mode": 1 }] }]);
        document["accessors"] = accessors.into();
        document["bufferViews"] = json!([
            { "buffer": 0, "byteLength": start },
            { "buffer": 0, "byteOffset": start, "byteLength": bin.len() - start }
        ]);
        let mesh = read_with(document, &bin).unwrap();
        let found: Vec<_> = mesh.triangles().iter().map(|t| turned(t.vertices)).collect();
        assert_eq!(found, expected.iter().map(|&t| turned(t)).collect::<Vec<_>>(), "mode {mode}");
        assert_eq!(mesh.faces_without_material(), expected.len());
        assert_eq!(mesh.vertices_m(), points);
    }
}

#[test]
fn sparse_and_interleaved_numbers_find_their_places() {
    // Vertices 16 bytes apart, the last two of them zero, and put right by the sparse part.
    let mut moved = corners();
    (moved[6], moved[7]) = ([0.0; 3], [0.0; 3]);
    let mut bin: Vec<u8> = positions(&moved).chunks(12).flat_map(|p| [p, &[7; 4]].concat()).collect();
    bin.extend([6u8, 7, 0, 0]);
    bin.extend(positions(&corners()[6..]));
    bin.extend(indices());
    let mut document = document();
    document["bufferViews"] = json!([
        { "buffer": 0, "byteLength": 124, "byteStride": 16 }, // without the padding after the last
        { "buffer": 0, "byteOffset": 156, "byteLength": 72 },
        { "buffer": 0, "byteOffset": 128, "byteLength": 2 },
        { "buffer": 0, "byteOffset": 132, "byteLength": 24 }
    ]);
    document["accessors"][0]["sparse"] = json!({
        "count": 2,
        "indices": { "bufferView": 2, "componentType": 5121 },
        "values": { "bufferView": 3 }
    });
    assert_eq!(read_with(document.clone(), &bin).unwrap().vertices_m(), corners());
    document["accessors"][0]["sparse"]["count"] = 3.into();
    assert!(read_with(document.clone(), &bin).is_err_and(|e| e.to_string().contains("ends at byte 3 of 2")));
    bin[128] = 8;
    document["accessors"][0]["sparse"]["count"] = 2.into();
    let message = read_with(document, &bin).unwrap_err().to_string();
    assert!(message.contains("sparse element 8 does not exist"), "{message}");
}

#[test]
fn each_fault_of_a_document_is_named_with_its_place() {
    let huge = 100_000_000u64;
    let cases: Vec<(&str, Value, &str)> = vec![
        (
            "/accessors/1/count",
            huge.into(),
            "meshes[0].primitives[0]: 100000000 values; there must be 99999999",
        ),
        ("/accessors/1/count", (huge - 1).into(), "primitives[0]: 33333333 triangles; at most 10000000"),
        ("/accessors/0/count", huge.into(), "primitives[0]: 100000000 vertices; at most 30000000"),
        ("/accessors/1/count", 39.into(), "primitives[0]: ends at byte 78 of 72"),
        ("/accessors/0/count", u64::MAX.into(), "vertices; at most"),
        ("/accessors/0/count", 9.into(), "primitives[0]: ends at byte 108 of 96"),
        ("/accessors/0/count", 0.into(), "vertex 0 does not exist; there are 0"),
        ("/accessors/0/byteOffset", u64::MAX.into(), "ends at byte"),
        ("/bufferViews/0/byteOffset", u64::MAX.into(), "of 0"),
        ("/bufferViews/1/byteLength", 9999.into(), "no error"), // only what is used must be there
        ("/bufferViews/0/byteStride", 8.into(), "`byteStride 8` where only strides of at least an element"),
        ("/bufferViews/0/buffer", 1.into(), "buffer 1 does not exist"),
        ("/buffers/0/byteLength", 172.into(), "buffers[0]: ends at byte 172 of 168"),
        ("/buffers/0/byteLength", u64::MAX.into(), "bytes of buffers; at most"),
        ("/buffers/0/uri", "http://far.away/b.bin".into(), "buffers[0]: cannot read `http://far.away/b.bin`"),
        ("/buffers/0/uri", "/etc/passwd".into(), "buffers[0]: cannot read `/etc/passwd`"),
        ("/buffers/0/uri", "data:;base64,*".into(), "buffers[0]: cannot read `data:;base64,*`"),
        ("/buffers/0/uri", "%ff".into(), "buffers[0]: cannot read `%ff`"),
        ("/buffers/0/uri", "absent.bin".into(), "absent.bin: No such file"),
        ("/buffers/0/uri", ".".into(), "is a directory"),
        ("/accessors/0/bufferView", 7.into(), "bufferView 7 does not exist; there are 2"),
        ("/accessors/0/bufferView", Value::Null, "bufferView of the accessor is empty"),
        ("/accessors/0/componentType", 5122.into(), "`accessors[0]` where only positions"),
        ("/accessors/0/componentType", 1.into(), "`accessors[0]` where only positions"),
        ("/accessors/1/componentType", 5126.into(), "`accessors[1]` where only indices"),
        ("/accessors/1/type", "VEC2".into(), "`accessors[1]` where only indices"),
        (
            "/meshes/0/primitives/1/attributes/POSITION",
            999.into(),
            "primitives[1]: accessor 999 does not exist",
        ),
        ("/meshes/0/primitives/1/attributes", json!({}), "primitives[1]: attributes.POSITION is empty"),
        ("/meshes/0/primitives/1/indices", 999.into(), "accessor 999 does not exist"),
        ("/meshes/0/primitives/1/material", 2.into(), "material 2 does not exist; there are 2"),
        ("/meshes/0/primitives/1/mode", 7.into(), "only the modes 0 to 6"),
        ("/nodes/0/mesh", 3.into(), "nodes[0]: mesh 3 does not exist"),
        ("/nodes/0/children", json!([0]), "nodes[0]: node 0 hangs in the tree of nodes twice"),
        ("/nodes/0/children", json!([5]), "node 5 does not exist"),
        ("/nodes/0/rotation", json!([0, 0, 0, 0]), "nodes[0]: length of the rotation's quaternion is 0"),
        ("/nodes/0/scale", json!([1e30, 1, 1]), "vertex coordinate (m)"),
        ("/nodes/0/translation", json!([0, 2e5, 0]), "vertex coordinate (m) is 20000"),
        ("/scene", 1.into(), "scene: scene 1 does not exist; there are 1"),
        ("/scenes", json!([]), "scene: scene 0 does not exist"),
        ("/scenes/0/nodes", json!([0, 0]), "hangs in the tree of nodes twice"),
        ("/asset/version", "1.0".into(), "asset.version: `1.0` where only glTF 2"),
        ("/extensionsRequired", json!(["KHR_draco_mesh_compression"]), "`KHR_draco_mesh_compression`"),
        ("/asset", json!({}), "missing field"),
    ];
    let mut failures = Vec::new();
    for (pointer, value, words) in cases {
        let mut document = document();
        document["buffers"][0]["uri"] = data_uri(&bytes());
        for optional in ["byteOffset", "byteStride"] {
            document["bufferViews"][0][optional] = if optional == "byteOffset" { 0 } else { 12 }.into();
        }
        document["accessors"][0]["byteOffset"] = 0.into();
        for (key, neutral) in [
            ("children", json!([])),
            ("rotation", json!([0, 0, 0, 1])),
            ("scale", json!([1, 1, 1])),
            ("translation", json!([0, 0, 0])),
        ] {
            document["nodes"][0][key] = neutral;
        }
        document["meshes"][0]["primitives"][1]["mode"] = 4.into();
        *document.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = value.clone();
        let message = match read("a.gltf", document.to_string().as_bytes()) {
            Ok(_) => "no error".into(),
            Err(error) => error.to_string(),
        };
        if !message.contains(words) {
            failures.push(format!("{pointer} = {value} gave: {message}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn numbers_that_are_none_and_broken_containers_are_refused() {
    let mut bin = bytes();
    bin[0..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let message = read_with(document(), &bin).unwrap_err().to_string();
    assert!(message.contains("meshes[0].primitives[0]: vertex coordinate (m) is NaN"), "{message}");
    let whole = glb(&document(), &bytes());
    for length in 0..whole.len() {
        assert!(read("a.glb", &whole[..length]).is_err(), "{length} bytes");
    }
    for promised in 0u32..12 {
        let mut short = whole.clone();
        short[8..12].copy_from_slice(&promised.to_le_bytes());
        assert!(read("a.glb", &short).is_err_and(|e| e.to_string().contains("header")));
    }
    assert!(matches!(read("a.stl", b"solid"), Err(Error::UnknownMeshFormat { .. })));
    assert!(matches!(Mesh::read(Path::new("/nowhere/a.glb")), Err(Error::Acoustics(ValueError::Io { .. }))));
    assert!(matches!(
        Mesh::read(std::env::temp_dir().join("../dev/null.obj")),
        Err(Error::Acoustics(ValueError::Io { .. }))
    ));
}

/// Sixty nodes that each repeat a mesh: the limit holds for what they ask for together.
#[test]
fn a_mesh_repeated_by_many_nodes_is_refused_before_it_is_read() {
    let mut document = document();
    let nodes = 60;
    document["nodes"] = (0..nodes).map(|_| json!({ "mesh": 0 })).collect();
    document["scenes"] = json!([{ "nodes": (0..nodes).collect::<Vec<_>>() }]);
    // 200,000 triangles on one point, in a file of 2 kB.
    document["accessors"] = json!([
        { "componentType": 5126, "count": 1, "type": "VEC3", "bufferView": 0 },
        { "componentType": 5125, "count": 600_000, "type": "SCALAR",
          "sparse": { "count": 1, "indices": { "bufferView": 1, "componentType": 5121 }, "values": { "bufferView": 1 } } }
    ]);
    document["meshes"] = json!([{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }]);
    document["bufferViews"] =
        json!([{ "buffer": 0, "byteLength": 12 }, { "buffer": 0, "byteOffset": 12, "byteLength": 4 }]);
    let message = read_with(document, &[0; 16]).unwrap_err().to_string();
    assert!(message.contains("10200000 triangles; at most 10000000"), "{message}");
}

proptest! {
    /// No file makes the reader panic, and what it lets through is sound.
    #[test]
    fn any_bytes_give_a_mesh_or_an_error(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        digits in any::<bool>(),
    ) {
        let mut file = glb(&document(), &bytes());
        for (at, byte) in changes {
            let at = at.index(file.len());
            // Other digits in place of digits reach deeper than bytes that break the grammar.
            if !digits { file[at] = byte } else if file[at].is_ascii_digit() { file[at] = b'0' + byte % 10 }
        }
        if let Ok(mesh) = read("a.glb", &file) {
            for t in mesh.triangles() {
                prop_assert!(t.vertices.iter().all(|&v| (v as usize) < mesh.vertices_m().len()));
                prop_assert!((t.material as usize) < mesh.material_names().len());
            }
            prop_assert!(mesh.vertices_m().iter().flatten().all(|c| c.is_finite()));
        }
    }
}

/// A document whose first material has these extras, in a room folder without tables.
fn described(extras: Value) -> TempDir {
    let folder = TempDir::new().unwrap();
    let mut document = document();
    document["materials"][0]["extras"] = extras;
    document["materials"][1]["extras"] = json!({ "exporter": "of another program" });
    let data = base64::engine::general_purpose::STANDARD.encode(bytes());
    document["buffers"][0]["uri"] = format!("data:application/octet-stream;base64,{data}").into();
    std::fs::write(folder.path().join("room.gltf"), document.to_string()).unwrap();
    let toml = "room.mesh = \"room.gltf\"\nbands.centres_hz = [500, 1000]\nmaterials.material_1.absorption = [0.4, 0.5]\n";
    std::fs::write(folder.path().join("room.toml"), toml).unwrap();
    folder
}

#[test]
fn extras_of_a_material_are_its_table() {
    let extras = json!({ "absorption": [0.1, 0.2, 0.3], "scattering": [0.5, 0.6, 0.7], "centres_hz": [500, 1000, 2000], "cost": 3 });
    let folder = described(extras.clone());
    let mesh = Mesh::read(folder.path().join("room.gltf")).unwrap();
    assert_eq!(
        mesh.surfaces().keys().collect::<Vec<_>>(),
        ["wall"],
        "extras of other programs are left alone"
    );
    let wall = &mesh.surfaces()["wall"];
    assert_eq!(
        (wall.absorption().values(), wall.scattering().values()),
        (&[0.1, 0.2, 0.3][..], &[0.5, 0.6, 0.7][..])
    );
    #[cfg(feature = "rooms")]
    {
        let room = MeasuredRoom::read(folder.path()).unwrap();
        let wall = room.materials().get("wall").unwrap().clone();
        assert_eq!(wall.absorption.unwrap().values(), [0.1, 0.2]);
        assert_eq!(wall.scattering.values(), [0.5, 0.6]);
        assert!(
            room.notes()
                .iter()
                .any(|note| note.to_string() == "wall: no table; that of the mesh file is used")
        );
        // A table of the room file goes before.
        let path = folder.path().join("room.toml");
        let own = std::fs::read_to_string(&path).unwrap() + "materials.wall.absorption = [0.8, 0.9]\n";
        std::fs::write(&path, own).unwrap();
        let room = MeasuredRoom::read(folder.path()).unwrap();
        assert_eq!(room.materials().get("wall").unwrap().absorption.as_ref().unwrap().values(), [0.8, 0.9]);
    }
}

#[test]
fn extras_that_are_no_table_are_refused() {
    for (extras, words) in [
        (json!({ "absorption": [0.1, 0.2] }), "materials[0].extras.absorption"),
        (json!({ "absorption": 0.1 }), "materials[0].extras.absorption: is `0.1`; a list of numbers"),
        (json!({ "absorption": [0.1, null], "centres_hz": [500, 1000] }), "a list of numbers"),
        (json!({ "absorption": [0.1, 1.2], "centres_hz": [500, 1000] }), "absorption is 1.2"),
        (json!({ "absorption": [0.1, 0.2], "centres_hz": [500, 900] }), "materials[0].extras.centres_hz"),
        (
            json!({ "absorption": [0.1, 0.2], "scattering": [-0.1, 0.2], "centres_hz": [500, 1000] }),
            "materials[0].extras.scattering",
        ),
    ] {
        let folder = described(extras.clone());
        let error = Mesh::read(folder.path().join("room.gltf")).unwrap_err().to_string();
        assert!(error.contains("room.gltf") && error.contains(words), "{extras}: {error}");
    }
}
