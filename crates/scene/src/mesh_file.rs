//! Triangles and names of materials from a mesh file.

#[cfg(feature = "gltf")]
mod gltf;
pub(crate) mod mesh_options;
mod obj;
pub(crate) mod polygon;
pub(crate) mod up_axis;

use mesh_options::MeshOptions;
pub(crate) use polygon::triangulate;
use up_axis::UpAxis;

use crate::error::Error;
use crate::scene::{NamedMaterial, Scene, Triangle};
use mesh_options::Placement;
use sabine_acoustics::{Material, read_at_most};
use std::collections::{BTreeMap, HashMap};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The triangles of a file and the names of their materials, before anything is known about these materials.
///
/// | file | read | names |
/// |---|---|---|
/// | `.obj` | vertices, polygons (concave ones too) | `usemtl NAME`; no `.mtl` is needed or read |
/// | `.gltf`, `.glb` (feature `gltf`) | triangle lists, strips and fans of the default scene, nodes applied | of the material; `material_3` where the fourth has none |
///
/// Coordinates are metres, right-handed, z up; glTF is y up by definition and is turned: its (x, y, z) becomes (x, -z, y).
/// [`MeshOptions`] states other units and another axis, for [`Mesh::read_with`].
/// Faces that name no material get [`Mesh::DEFAULT_MATERIAL`]. Materials of one name are one material; they stand in the
/// order in which the faces first use them. Textures, normals, colours, cameras, skins and animations are not looked at.
///
/// ```
/// use sabine_acoustics::{Bands, Material};
/// use sabine_scene::Mesh;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("tent.obj");
/// std::fs::write(&path, "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nusemtl ground\nf 1 2 3\nusemtl cloth\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")?;
/// let mesh = Mesh::read(&path)?;
/// assert_eq!(mesh.material_names(), ["ground", "cloth"]);
/// let cloth = Material::uniform(Bands::SIMULATION, 0.2, 0.3)?;
/// let ground = Material::uniform(Bands::SIMULATION, 0.1, 0.5)?;
/// let scene = mesh.into_scene(&[("cloth".into(), cloth), ("ground".into(), ground)].into())?;
/// assert!((scene.volume_m3() - 32.0 / 3.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    path: PathBuf,
    vertices_m: Vec<[f64; 3]>,
    triangles: Vec<Triangle>,
    material_names: Vec<String>,
    surfaces: BTreeMap<String, Material>,
    faces_without_area: usize,
    faces_without_material: usize,
    up_axis: UpAxis,
}

impl Mesh {
    /// The material of faces that name none: those before the first `usemtl`, and glTF primitives without material.
    pub const DEFAULT_MATERIAL: &str = "default";

    /// Reads a file in metres; its ending (`.obj`, `.gltf`, `.glb`) says what it is.
    ///
    /// # Errors
    /// As [`Mesh::read_with`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::read_with(path, &MeshOptions::default())
    }

    /// Reads a file whose units and axes are stated; its ending (`.obj`, `.gltf`, `.glb`) says what it is.
    ///
    /// ```
    /// use sabine_scene::{LengthUnit, Mesh, MeshOptions, UpAxis};
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("sheet.obj");
    /// std::fs::write(&path, "v 0 0 0\nv 250 0 0\nv 0 300 0\nf 1 2 3\n")?;
    /// let options = MeshOptions { unit: LengthUnit::Centimetre, up_axis: Some(UpAxis::Y), ..Default::default() };
    /// let mesh = Mesh::read_with(&path, &options)?;
    /// assert_eq!(mesh.vertices_m()[1..], [[2.5, 0.0, 0.0], [0.0, 0.0, 3.0]]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::InFile`] with the cause [`Error::OutsideFolder`] for a glTF buffer outside the folder that may be read;
    /// [`sabine_acoustics::Error::Io`]; [`Error::UnknownMeshFormat`] for other endings and, without the feature `gltf`, [`Error::GltfFeature`];
    /// [`Error::InFile`] naming the line or the element, with the cause
    /// [`Error::ObjSyntax`], [`sabine_acoustics::Error::OutOfRange`], [`sabine_acoustics::Error::Length`], [`Error::CrossedPolygon`], [`sabine_acoustics::Error::Index`],
    /// [`Error::MeshTooLarge`], [`Error::BeyondBuffer`], [`Error::BufferUri`], [`Error::UnsupportedMesh`] or
    /// [`Error::NodeTwice`]; for extras [`Error::Unit`], [`Error::DuplicateId`], [`sabine_acoustics::Error::BandCount`],
    /// [`sabine_acoustics::Error::UnknownBand`], [`sabine_acoustics::Error::OutOfRange`]; [`Error::MeshFormat`] for what is no glTF.
    pub fn read_with(path: impl AsRef<Path>, options: &MeshOptions) -> Result<Self, Error> {
        let path = path.as_ref();
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        match ending.to_str() {
            Some("obj") => Self::obj_of_bytes(path, &read_at_most(path, u64::MAX)?, options),
            #[cfg(feature = "gltf")]
            Some("gltf" | "glb") => {
                let folder = match (&options.folder, options.allow_outside) {
                    (_, true) => None,
                    (Some(folder), false) => Some(folder.as_path()),
                    (None, false) => Some(path.parent().unwrap_or(Path::new(""))),
                };
                let mut draft = MeshDraft::new(path, placement(options, &ending));
                gltf::parse_gltf(path, &read_at_most(path, u64::MAX)?, folder, &mut draft)?;
                Ok(draft.mesh)
            }
            #[cfg(not(feature = "gltf"))]
            Some("gltf" | "glb") => Err(Error::GltfFeature { path: path.to_owned() }),
            _ => Err(Error::UnknownMeshFormat { path: path.to_owned() }),
        }
    }

    /// As [`Mesh::read_with`], from the bytes of an OBJ file; `name` stands in messages.
    ///
    /// ```
    /// use sabine_scene::{Mesh, MeshOptions};
    /// let mesh = Mesh::obj_of_bytes("dropped.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", &MeshOptions::default())?;
    /// assert_eq!(mesh.triangles().len(), 1);
    /// # Ok::<(), sabine_scene::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Mesh::read_with`] for what such a file may hold.
    pub fn obj_of_bytes(name: impl AsRef<Path>, bytes: &[u8], options: &MeshOptions) -> Result<Self, Error> {
        let path = name.as_ref();
        let mut draft = MeshDraft::new(path, placement(options, "obj".as_ref()));
        // Names may be in any old encoding; numbers and keywords are ASCII.
        obj::parse_obj(path, &String::from_utf8_lossy(bytes), &mut draft)?;
        Ok(draft.mesh)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Vertices in metres, z up, those of the file in its order.
    pub fn vertices_m(&self) -> &[[f64; 3]] {
        &self.vertices_m
    }

    /// Triangles; their materials are indices into [`Mesh::material_names`].
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Names of the materials that faces use, in the order of first use.
    pub fn material_names(&self) -> &[String] {
        &self.material_names
    }

    /// What the file itself says about the sound of its materials, by name: in glTF the `extras` of a material, with the lists
    /// `absorption` and, if wanted, `scattering` (0 to 1) and `centres_hz` (absent: octaves from 125 Hz to 8 kHz).
    pub fn surfaces(&self) -> &BTreeMap<String, Material> {
        &self.surfaces
    }

    /// Faces that are lines or points: left out, since nothing can be reflected by them.
    pub fn faces_without_area(&self) -> usize {
        self.faces_without_area
    }

    /// Faces that name no material and have [`Mesh::DEFAULT_MATERIAL`] for that reason.
    pub fn faces_without_material(&self) -> usize {
        self.faces_without_material
    }

    /// The axis of the file that was taken to point up.
    pub fn up_axis(&self) -> UpAxis {
        self.up_axis
    }

    /// Gives each material what it does to sound.
    ///
    /// # Errors
    /// [`Error::MaterialWithoutTable`] or [`Error::FacesWithoutMaterial`] for a material of the mesh that is not in the
    /// list; [`Error::InFile`] with the cause [`Error::TableWithoutMaterial`] for one in the list that no face has; else
    /// as [`Scene::new`], naming the file.
    pub fn into_scene(self, materials: &BTreeMap<String, Material>) -> Result<Scene, Error> {
        if let Some(name) = materials.keys().find(|name| !self.material_names.contains(name)) {
            let error = Error::TableWithoutMaterial { mesh: self.path.clone() };
            return Err(error.in_file(&self.path, format!("material `{name}`")));
        }
        let named = |name: &String| match materials.get(name) {
            Some(material) => Ok(NamedMaterial { name: name.clone(), material: material.clone() }),
            None if name == Self::DEFAULT_MATERIAL && self.faces_without_material > 0 => {
                Err(Error::FacesWithoutMaterial {
                    faces: self.faces_without_material,
                    mesh: self.path.clone(),
                })
            }
            None => Err(Error::MaterialWithoutTable { material: name.clone(), mesh: self.path.clone() }),
        };
        let materials = self.material_names.iter().map(named).collect::<Result<_, _>>()?;
        Ok(Scene::new(self.vertices_m, self.triangles, materials)
            .map_err(|error| error.in_file(&self.path, "mesh"))?)
    }
}

/// How a file of this ending lies, where the options leave it open.
fn placement(options: &MeshOptions, ending: &OsStr) -> Placement {
    let usual = if ending == "obj" { UpAxis::Z } else { UpAxis::Y };
    Placement { unit: options.unit, up_axis: options.up_axis.unwrap_or(usual) }
}

/// A mesh that is being read.
struct MeshDraft {
    mesh: Mesh,
    placement: Placement,
    /// Index of each material that is in use.
    materials: HashMap<String, u32>,
    /// Corners of the face at hand.
    points: Vec<[f64; 3]>,
}

impl MeshDraft {
    fn new(path: &Path, placement: Placement) -> Self {
        let mesh = Mesh {
            path: path.to_owned(),
            vertices_m: Vec::new(),
            triangles: Vec::new(),
            material_names: Vec::new(),
            surfaces: BTreeMap::new(),
            faces_without_area: 0,
            faces_without_material: 0,
            up_axis: placement.up_axis,
        };
        Self { mesh, placement, materials: HashMap::new(), points: Vec::new() }
    }

    /// Adds a vertex, given in the file's coordinates.
    fn vertex(&mut self, point: [f64; 3]) -> Result<(), Error> {
        self.mesh.vertices_m.push(self.placement.apply(point)?);
        Ok(())
    }

    /// Adds a polygon; its corners must be indices of vertices.
    fn face(&mut self, name: Option<&str>, corners: &[u32]) -> Result<(), Error> {
        let vertices = &self.mesh.vertices_m;
        self.points.clear();
        self.points.extend(corners.iter().map(|&i| vertices[i as usize]));
        let triangles = triangulate(&self.points)?;
        if triangles.is_empty() {
            self.mesh.faces_without_area += 1;
            return Ok(());
        }
        self.mesh.faces_without_material += usize::from(name.is_none());
        let name = name.unwrap_or(Mesh::DEFAULT_MATERIAL);
        let material = match self.materials.get(name) {
            Some(&known) => known,
            None => {
                let new = self.mesh.material_names.len() as u32;
                self.materials.insert(name.to_owned(), new);
                self.mesh.material_names.push(name.to_owned());
                new
            }
        };
        let indexed = |t: [usize; 3]| Triangle { vertices: t.map(|i| corners[i]), material };
        self.mesh.triangles.extend(triangles.into_iter().map(indexed));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_file::mesh_options::LengthUnit;
    use sabine_acoustics::Bands;
    use sabine_acoustics::Error as ValueError;

    /// A square without name beside one of glass.
    fn squares() -> Mesh {
        let placement = Placement { unit: LengthUnit::Metre, up_axis: UpAxis::Z };
        let mut draft = MeshDraft::new(Path::new("two.obj"), placement);
        draft.mesh.vertices_m = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        draft.face(None, &[0, 1, 2, 3]).unwrap();
        draft.face(Some("glass"), &[3, 2, 1, 0]).unwrap();
        draft.face(Some("paint"), &[0, 1, 0]).unwrap(); // no area: its material is in no use
        draft.mesh
    }

    #[test]
    fn materials_and_names_must_match() {
        let scene = |names: &[&str]| {
            let material = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
            squares().into_scene(&names.iter().map(|&name| (name.to_owned(), material.clone())).collect())
        };
        let whole = scene(&["glass", "default"]).unwrap();
        assert_eq!(
            whole.materials().iter().map(|m| m.name.as_str()).collect::<Vec<_>>(),
            ["default", "glass"]
        );
        assert_eq!((whole.triangles().len(), squares().faces_without_area()), (4, 1));
        assert!(matches!(scene(&["glass"]), Err(Error::FacesWithoutMaterial { faces: 1, .. })));
        assert!(
            matches!(scene(&["default"]), Err(Error::MaterialWithoutTable { material, .. }) if material == "glass")
        );
        let message = scene(&["default", "glass", "paint"]).unwrap_err().to_string();
        assert!(message.starts_with("two.obj: material `paint`: no face"), "{message}");
    }

    #[test]
    fn only_known_endings_are_read() {
        assert!(matches!(Mesh::read("room.step"), Err(Error::UnknownMeshFormat { .. })));
        assert!(matches!(Mesh::read("/nowhere/room.OBJ"), Err(Error::Acoustics(ValueError::Io { .. }))));
        let binary = Mesh::read("/nowhere/room.glb");
        if cfg!(feature = "gltf") {
            assert!(matches!(binary, Err(Error::Acoustics(ValueError::Io { .. }))));
        } else {
            assert!(matches!(binary, Err(Error::GltfFeature { .. })));
        }
    }
}
