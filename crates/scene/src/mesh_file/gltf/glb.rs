//! A room as a GLB file: binary glTF 2.0 (ISO/IEC 12113:2022).

use super::{MOST_TRIANGLES, MOST_VERTICES, within};
use crate::error::Error;
use crate::mesh_file::up_axis::UpAxis;
use crate::scene::{NamedMaterial, Scene};
use serde_json::{Value, json};

/// Chunk types and alignment (glTF 2.0, section 4.4).
const JSON: &[u8; 4] = b"JSON";
const BIN: &[u8; 4] = b"BIN\0";
const ALIGNED: usize = 4;
/// glTF's numbers for 32-bit floats, 32-bit indices, vertices and indices.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34_962;
const ELEMENT_ARRAY_BUFFER: u32 = 34_963;

impl Scene {
    /// The mesh as a GLB file (binary glTF 2.0): metres, y up as glTF has it, coordinates in single precision, one primitive for each material.
    /// Materials state `absorption`, `scattering` and `centres_hz` (Hz) in their `extras`, which [`Mesh::read`](crate::Mesh::read) reads again;
    /// both of their sides are drawn.
    ///
    /// # Errors
    /// [`Error::MeshTooLarge`] beyond what [`Mesh::read`](crate::Mesh::read) takes: 10 million triangles, 30 million vertices.
    ///
    /// ```
    /// use sabine_acoustics::{Bands, Material};
    /// use sabine_scene::Scene;
    /// let wall = Material::uniform(Bands::T60, 0.1, 0.1)?;
    /// let room = Scene::shoebox([6.0, 5.0, 3.0], std::array::from_fn(|_| wall.clone()))?;
    /// assert!(room.to_glb()?.starts_with(b"glTF"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn to_glb(&self) -> Result<Vec<u8>, Error> {
        within("vertices", 0, self.vertices().len() as u64, MOST_VERTICES)?;
        within("triangles", 0, self.triangles().len() as u64, MOST_TRIANGLES)?;
        let points: Vec<[f32; 3]> =
            self.vertices().iter().map(|&p| UpAxis::Y.to_other(p).map(|c| c as f32)).collect();
        let mut bytes: Vec<u8> = points.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        let vertex_bytes = bytes.len();
        let bound = |of: fn(f32, f32) -> f32| {
            let first = points.first().copied().unwrap_or_default();
            points.iter().fold(first, |a, b| std::array::from_fn(|k| of(a[k], b[k])))
        };
        let mut accessors = vec![json!({
            "bufferView": 0, "componentType": FLOAT, "count": points.len(), "type": "VEC3",
            "min": bound(f32::min), "max": bound(f32::max),
        })];
        let mut primitives = Vec::new();
        for material in 0..self.materials().len() {
            let own = self.triangles().iter().filter(|t| t.material as usize == material);
            let indices: Vec<u32> = own.flat_map(|t| t.vertices).collect();
            // An accessor holds one number at least.
            if indices.is_empty() {
                continue;
            }
            primitives.push(json!({
                "attributes": { "POSITION": 0 }, "indices": accessors.len(), "material": material,
            }));
            accessors.push(json!({
                "bufferView": 1, "byteOffset": bytes.len() - vertex_bytes, "componentType": UNSIGNED_INT,
                "count": indices.len(), "type": "SCALAR",
            }));
            bytes.extend(indices.iter().flat_map(|i| i.to_le_bytes()));
        }
        let document = json!({
            "asset": { "version": "2.0", "generator": concat!("sabine-scene ", env!("CARGO_PKG_VERSION")) },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0, "name": "room" }],
            "meshes": [{ "primitives": primitives }],
            "materials": self.materials().iter().map(material).collect::<Vec<Value>>(),
            "accessors": accessors,
            "bufferViews": [
                { "buffer": 0, "byteLength": vertex_bytes, "target": ARRAY_BUFFER },
                {
                    "buffer": 0, "byteOffset": vertex_bytes, "byteLength": bytes.len() - vertex_bytes,
                    "target": ELEMENT_ARRAY_BUFFER,
                },
            ],
            "buffers": [{ "byteLength": bytes.len() }],
        });
        Ok(container(document.to_string().into_bytes(), bytes))
    }
}

fn material(named: &NamedMaterial) -> Value {
    let NamedMaterial { name, material } = named;
    json!({
        "name": name,
        "doubleSided": true,
        "extras": {
            "absorption": material.absorption().values(),
            "scattering": material.scattering().values(),
            "centres_hz": material.bands().iter_hz().collect::<Vec<f64>>(),
        },
    })
}

/// Header and two chunks, the first filled up with spaces, the second with zeros.
fn container(mut json: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(ALIGNED), b' ');
    binary.resize(binary.len().next_multiple_of(ALIGNED), 0);
    let chunk = |kind: &[u8; 4], bytes: Vec<u8>| [&length(&bytes)[..], kind, &bytes].concat();
    let chunks = [chunk(JSON, json), chunk(BIN, binary)].concat();
    let whole = (12 + chunks.len()) as u32;
    [b"glTF".as_slice(), &2u32.to_le_bytes(), &whole.to_le_bytes(), &chunks].concat()
}

/// The limits on vertices and triangles keep it below 1 GB.
fn length(bytes: &[u8]) -> [u8; 4] {
    (bytes.len() as u32).to_le_bytes()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine_acoustics::{Bands, Material};

    /// By the crate `gltf`, which checks every index, type and required bound; our own reader does not ask it to.
    #[test]
    fn another_reader_finds_nothing_amiss() {
        let wall = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
        let room = Scene::shoebox([4.5, 3.0, 2.0], std::array::from_fn(|_| wall.clone())).unwrap();
        let bytes = room.to_glb().unwrap();
        let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(&bytes).unwrap();
        assert_eq!(document.buffers().next().unwrap().length(), blob.unwrap().len());
        let mesh = document.meshes().next().unwrap();
        let faces: usize = mesh.primitives().map(|p| p.indices().unwrap().count() / 3).sum();
        let bounds = mesh.primitives().next().unwrap().bounding_box();
        // y is up, and what was y points towards the viewer.
        assert_eq!((faces, bounds.min, bounds.max), (12, [0.0, 0.0, -3.0], [4.5, 2.0, 0.0]));
    }
}
