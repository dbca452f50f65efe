//! Small files that claim to be huge are refused before memory is taken for them: the reader has 768 MiB of address space
//! and the claims are of gigabytes.

use crate::process;
use sabine_acoustics::{Channel, probe_audio, read_audio};
use sabine_scene::Mesh;
use std::path::Path;

/// A WAV file of 16-bit samples that says what it likes about itself.
fn wav(channels: u16, format_bytes: u32, data_bytes: u32, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"RIFF\xff\xff\xff\xffWAVEfmt ".to_vec();
    bytes.extend(format_bytes.to_le_bytes());
    bytes.extend([1, 0]);
    bytes.extend(channels.to_le_bytes());
    bytes.extend(48_000u32.to_le_bytes());
    bytes.extend((96_000 * u32::from(channels)).to_le_bytes());
    bytes.extend((2 * channels).to_le_bytes());
    bytes.extend([16, 0]);
    bytes.extend(b"data");
    bytes.extend(data_bytes.to_le_bytes());
    bytes.extend(data);
    bytes
}

/// A mesh of one triangle whose accessors say what they like; `positions` and `indices` are their fields.
#[cfg(feature = "gltf")]
fn gltf(positions: &str, indices: &str, buffer_bytes: u64) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "buffers":[{{"byteLength":{buffer_bytes},"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA="}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":6}}],
        "accessors":[{{"componentType":5126,"type":"VEC3",{positions}}},{{"componentType":5123,"type":"SCALAR",{indices}}}]}}"#
    )
}

fn refused(what: &str, path: &Path, message: &str, part: &str) {
    assert!(message.contains(&path.display().to_string()), "{what}: no file in {message}");
    assert!(message.contains(part), "{what}: \"{part}\" is not in {message}");
}

#[test]
#[ignore = "run by the other test in a process of its own"]
fn child_reads() {
    let Some(folder) = process::folder() else { return };
    let sound = folder.join("sound.wav");
    for (what, bytes, part) in [
        ("4 GB of samples", wav(1, 16, 0xffff_fff0, &[0; 64]), "4294967280"),
        ("4 GB of 64 channels", wav(64, 16, 0xffff_ff80, &[0; 256]), "4294967168"),
        ("a format of 4 GB", wav(1, 0xffff_fff0, 64, &[0; 64]), "sound.wav"),
    ] {
        std::fs::write(&sound, bytes).unwrap();
        refused(what, &sound, &read_audio(&sound, Channel::Mean).unwrap_err().to_string(), part);
        refused(what, &sound, &probe_audio(&sound).unwrap_err().to_string(), part);
    }
    let mesh = folder.join("room.obj");
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (what, text, part) in [
        ("an index of 10^8", format!("{corners}f 1 2 100000000\n"), "100000000"),
        ("a face of a million corners", format!("{corners}f {}\n", "1 2 3 ".repeat(333_334)), "1024"),
    ] {
        std::fs::write(&mesh, text).unwrap();
        refused(what, &mesh, &Mesh::read(&mesh).unwrap_err().to_string(), part);
    }
    #[cfg(feature = "gltf")]
    {
        let mesh = folder.join("room.gltf");
        let (whole, three) = (r#""bufferView":0,"count":3"#, r#""bufferView":1,"count":3"#);
        std::fs::write(&mesh, gltf(whole, three, 44)).unwrap();
        assert_eq!(Mesh::read(&mesh).unwrap().triangles().len(), 1, "the mesh itself is sound");
        let sparse = |count: u64, view: usize| {
            format!(
                r#""count":{count},"sparse":{{"count":1,"indices":{{"bufferView":1,"componentType":5123}},"values":{{"bufferView":{view}}}}}"#
            )
        };
        for (what, text, part) in [
            ("10^8 indices", gltf(whole, r#""bufferView":1,"count":100000002"#, 44), "triangles"),
            ("3 * 10^7 indices", gltf(whole, r#""bufferView":1,"count":29999997"#, 44), "ends at byte"),
            ("10^8 points", gltf(r#""bufferView":0,"count":100000000"#, three, 44), "vertices"),
            ("2 * 10^7 points", gltf(r#""bufferView":0,"count":20000000"#, three, 44), "ends at byte"),
            ("10^18 points", gltf(r#""bufferView":0,"count":1000000000000000000"#, three, 44), "vertices"),
            ("points that are nowhere", gltf(&sparse(29_999_999, 0), three, 44), "not in the file"),
            ("indices that are nowhere", gltf(whole, &sparse(29_999_997, 1), 44), "not in the file"),
            ("a buffer of 4 GB", gltf(whole, three, 4_294_967_295), "4294967295"),
        ] {
            std::fs::write(&mesh, text).unwrap();
            refused(what, &mesh, &Mesh::read(&mesh).unwrap_err().to_string(), part);
        }
        // A GLB whose header claims more than there is.
        let mesh = folder.join("room.glb");
        let mut bytes = b"glTF\x02\0\0\0\xff\xff\xff\xff\xf0\xff\xff\xffJSON".to_vec();
        bytes.extend([b' '; 64]);
        std::fs::write(&mesh, bytes).unwrap();
        refused("a GLB of 4 GB", &mesh, &Mesh::read(&mesh).unwrap_err().to_string(), "room.glb");
    }
    process::done();
}

#[test]
fn claims_of_gigabytes_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    process::with_memory("hostile_sizes::child_reads", folder.path(), 768 << 10);
}
