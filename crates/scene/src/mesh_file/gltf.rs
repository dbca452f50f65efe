//! The part of glTF 2.0 that a room needs: the triangles of the default scene, the names of their materials, and what their extras say.
//!
//! The crate `gltf` knows the grammar and the container. Numbers are read here: its accessors take the file at its word, so
//! that a length or an index past the end overflows or panics. Every size is checked against the bytes that are there, and
//! against a limit, before memory is taken.

mod buffers;
mod extras;
mod glb;

use super::MeshDraft;
use crate::error::Error;
use buffers::Buffers;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use gltf::json::{Root, deserialize};
use sabine_acoustics::{Error as ValueError, OutOfRange};
use std::collections::HashMap;
use std::path::Path;

/// Triangles and vertices that one file may ask for: a node can repeat a mesh in a few bytes.
const MOST_TRIANGLES: u64 = 10_000_000;
const MOST_VERTICES: u64 = 3 * MOST_TRIANGLES;

/// Beginnings of extensions without which a mesh looks different, but has the same shape.
const LOOKS: [&str; 6] =
    ["KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "KHR_animation_"];

/// Columns of an affine transformation: three axes and the origin.
type Affine = [[f64; 3]; 4];

/// As the file has it: the draft turns what comes out.
const IDENTITY: Affine = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];

/// Reads a glTF or GLB file; `path` is for the errors and for the buffers beside it, which must lie below `folder`, if one
/// is named.
pub(super) fn parse_gltf(
    path: &Path,
    bytes: &[u8],
    folder: Option<&Path>,
    draft: &mut MeshDraft,
) -> Result<(), Error> {
    let format = |source: Box<dyn std::error::Error + Send + Sync>| Error::MeshFormat {
        path: path.to_owned(),
        source,
    };
    let glb;
    let (json, blob) = if bytes.starts_with(b"glTF") {
        // The header's own 12 bytes count; the crate subtracts them unseen.
        let promised = bytes.get(8..12).map_or(12, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        if promised < 12 {
            let error = Error::BeyondBuffer { needed_bytes: 12, found_bytes: promised.into() };
            return Err(error.in_file(path, "header"));
        }
        glb = gltf::binary::Glb::from_slice(bytes).map_err(|e| format(e.into()))?;
        (&glb.json[..], glb.bin.as_deref())
    } else {
        (bytes, None)
    };
    let root: Root = deserialize::from_slice(json).map_err(|e| format(e.into()))?;
    if !root.asset.version.starts_with("2.") {
        let error = Error::UnsupportedMesh { found: root.asset.version.clone(), expected: "glTF 2" };
        return Err(error.in_file(path, "asset.version"));
    }
    let foreign = |name: &&String| !LOOKS.iter().any(|known| name.starts_with(known));
    if let Some(name) = root.extensions_required.iter().find(foreign) {
        let expected = "extensions that change no shape";
        let error = Error::UnsupportedMesh { found: name.clone(), expected };
        return Err(error.in_file(path, "extensionsRequired"));
    }
    draft.mesh.surfaces = extras::surfaces(path, json)?;
    let buffers = Buffers::load(path, &root, blob, folder)?;
    Reader { path, root: &root, buffers, draft, vertices: 0, triangles: 0 }.scene()
}

struct Reader<'a> {
    path: &'a Path,
    root: &'a Root,
    buffers: Buffers<'a>,
    draft: &'a mut MeshDraft,
    /// Asked for so far.
    vertices: u64,
    triangles: u64,
}

impl Reader<'_> {
    /// Visits the nodes of the default scene (the first where the file names none), parents first.
    fn scene(&mut self) -> Result<(), Error> {
        let root = self.root;
        let index = root.scene.map_or(0, |scene| scene.value());
        let scene = item("scene", &root.scenes, index).map_err(|e| e.in_file(self.path, "scene"))?;
        let mut seen = vec![false; root.nodes.len()];
        let mut waiting: Vec<(usize, Affine)> =
            scene.nodes.iter().rev().map(|node| (node.value(), IDENTITY)).collect();
        while let Some((index, parent)) = waiting.pop() {
            let field = || format!("nodes[{index}]");
            let node =
                item("node", &root.nodes, index).map_err(|e| e.in_file(self.path, "scenes and nodes"))?;
            if std::mem::replace(&mut seen[index], true) {
                return Err(Error::NodeTwice { node: index }.in_file(self.path, field()));
            }
            let placed = chain(&parent, &own(node).map_err(|e| e.in_file(self.path, field()))?);
            if let Some(mesh) = node.mesh {
                let mesh = mesh.value();
                let primitives =
                    &item("mesh", &root.meshes, mesh).map_err(|e| e.in_file(self.path, field()))?.primitives;
                let mut bases = HashMap::new();
                for (i, primitive) in primitives.iter().enumerate() {
                    self.primitive(primitive, &placed, &mut bases)
                        .map_err(|e| e.in_file(self.path, format!("meshes[{mesh}].primitives[{i}]")))?;
                }
            }
            let children = node.children.iter().flatten().rev();
            waiting.extend(children.map(|child| (child.value(), placed)));
        }
        Ok(())
    }

    /// `bases` tells where the vertices of an accessor begin, which the primitives of a mesh often share.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        placed: &Affine,
        bases: &mut HashMap<usize, u32>,
    ) -> Result<(), Error> {
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            // Points and lines reflect nothing.
            Checked::Valid(_) => return Ok(()),
            Checked::Invalid => {
                let expected = "the modes 0 to 6";
                return Err(Error::UnsupportedMesh { found: "mode".into(), expected });
            }
        };
        let accessors = &self.root.accessors;
        let positions = primitive
            .attributes
            .get(&Checked::Valid(Semantic::Positions))
            .ok_or(ValueError::Empty { what: "attributes.POSITION" })?
            .value();
        let vertices = item("accessor", accessors, positions)?.count.0;
        let corners = match primitive.indices {
            Some(index) => item("accessor", accessors, index.value())?.count.0,
            None => vertices,
        };
        let faces = if mode == Mode::Triangles { corners / 3 } else { corners.saturating_sub(2) };
        if mode == Mode::Triangles && corners % 3 != 0 {
            return Err(ValueError::Length { expected: 3 * faces as usize, found: corners as usize }.into());
        }
        self.triangles = within("triangles", self.triangles, faces, MOST_TRIANGLES)?;
        let base = match bases.get(&positions) {
            Some(&base) => base,
            None => {
                self.vertices = within("vertices", self.vertices, vertices, MOST_VERTICES)?;
                let base = self.draft.mesh.vertices_m.len() as u32;
                for point in self.buffers.positions(self.root, positions)? {
                    self.draft.vertex(applied(placed, point.map(f64::from)))?;
                }
                bases.insert(positions, base);
                base
            }
        };
        let indices = match primitive.indices {
            Some(index) => self.buffers.indices(self.root, index.value())?,
            None => (0..vertices as u32).collect(),
        };
        if let Some(&wild) = indices.iter().find(|&&i| u64::from(i) >= vertices) {
            return Err(
                ValueError::Index { what: "vertex", index: wild as usize, count: vertices as usize }.into()
            );
        }
        let unnamed;
        let name = match primitive.material {
            None => None,
            Some(index) => {
                let index = index.value();
                let material = item("material", &self.root.materials, index)?;
                unnamed = format!("material_{index}");
                Some(material.name.as_deref().filter(|name| !name.is_empty()).unwrap_or(&unnamed))
            }
        };
        let mirrored = determinant(placed) < 0.0;
        for i in 0..faces as usize {
            let [a, mut b, mut c] = match mode {
                Mode::TriangleFan => [i + 1, i + 2, 0],
                Mode::TriangleStrip => [i, i + 1 + i % 2, i + 2 - i % 2],
                _ => [3 * i, 3 * i + 1, 3 * i + 2],
            }
            .map(|corner| indices[corner]);
            // Strips are stitched together by triangles that repeat a corner.
            if mode == Mode::TriangleStrip && (a == b || b == c || c == a) {
                continue;
            }
            if mirrored {
                std::mem::swap(&mut b, &mut c);
            }
            self.draft.face(name, &[base + a, base + b, base + c])?;
        }
        Ok(())
    }
}

/// An item of a list, or which index is wild.
fn item<'a, T>(what: &'static str, list: &'a [T], index: usize) -> Result<&'a T, Error> {
    list.get(index).ok_or(ValueError::Index { what, index, count: list.len() }.into())
}

fn within(what: &'static str, so_far: u64, more: u64, limit: u64) -> Result<u64, Error> {
    let found = so_far.saturating_add(more);
    if found <= limit { Ok(found) } else { Err(Error::MeshTooLarge { what, found, limit }) }
}

/// The node's own transformation: its matrix, or scale, rotation and translation in this order.
fn own(node: &Node) -> Result<Affine, Error> {
    if let Some(m) = node.matrix {
        return Ok(std::array::from_fn(|column| std::array::from_fn(|row| f64::from(m[4 * column + row]))));
    }
    let [x, y, z, w] = node.rotation.unwrap_or_default().0.map(f64::from);
    let length = (x * x + y * y + z * z + w * w).sqrt();
    OutOfRange::check("length of the rotation's quaternion", length, 0.99, 1.01, "1")?;
    let [x, y, z, w] = [x, y, z, w].map(|c| c / length);
    let axes = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)],
        [2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)],
        [2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)],
    ];
    let scale = node.scale.unwrap_or([1.0; 3]).map(f64::from);
    let origin = node.translation.unwrap_or([0.0; 3]).map(f64::from);
    let [x, y, z]: [[f64; 3]; 3] = std::array::from_fn(|i| axes[i].map(|c| c * scale[i]));
    Ok([x, y, z, origin])
}

/// The transformation of a direction: without the origin.
fn turned([x, y, z, _]: &Affine, v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| x[i] * v[0] + y[i] * v[1] + z[i] * v[2])
}

fn applied(affine: &Affine, p: [f64; 3]) -> [f64; 3] {
    let v = turned(affine, p);
    std::array::from_fn(|i| v[i] + affine[3][i])
}

/// First `inner`, then `outer`.
fn chain(outer: &Affine, [x, y, z, origin]: &Affine) -> Affine {
    [turned(outer, *x), turned(outer, *y), turned(outer, *z), applied(outer, *origin)]
}

fn determinant([x, y, z, _]: &Affine) -> f64 {
    x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0])
        + x[2] * (y[0] * z[1] - y[1] * z[0])
}
