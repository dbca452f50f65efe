//! A room to put measurements into: a mesh file or a box, with the tables of its materials.

use super::MaterialPrior;
use super::materials::{MaterialTable, Materials};
use super::tables::DEFAULT_SCATTERING;
use crate::error::Error;
use crate::floor_plan::FloorPlan;
use crate::mesh_file::Mesh;
use crate::mesh_file::mesh_options::MeshOptions;
use crate::scene::{NamedMaterial, Scene};
use sabine_acoustics::{Bands, Error as ValueError, Material, PerBand, library_material};
use std::collections::BTreeMap;
use std::path::Path;

/// Mesh and materials of a room, and how well each material is known.
///
/// A material takes its table from the tables that are given, else from the mesh file ([`Mesh::surfaces`]), else from the library
/// entry of its name, else none: its absorption is then unknown, to be fitted.
///
/// ```
/// use sabine_scene::RoomModel;
/// let hall = RoomModel::of_box([[0.0, 0.0, 0.0], [20.0, 12.0, 6.0]], None)?;
/// assert!((hall.scene.volume_m3() - 1440.0).abs() < 1e-9);
/// let names: Vec<&str> = hall.scene.materials().iter().map(|m| m.name.as_str()).collect();
/// assert_eq!(names, ["floor", "ceiling", "walls"]);
/// assert!(hall.priors.iter().all(|prior| prior.absorption.is_none()));
/// # Ok::<(), sabine_scene::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct RoomModel {
    /// Mesh and materials.
    pub scene: Scene,
    /// What is known of each material, in the order of the scene.
    pub priors: Vec<MaterialPrior>,
}

impl RoomModel {
    /// The room of a mesh file.
    ///
    /// # Errors
    /// As [`Mesh::read_with`]; [`sabine_acoustics::Error::UnknownId`] for a table whose material no face has.
    pub fn of_mesh(
        path: impl AsRef<Path>,
        options: &MeshOptions,
        tables: Option<&Materials>,
    ) -> Result<Self, Error> {
        Self::new(Mesh::read_with(path, options)?, tables)
    }

    /// The room of a mesh.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::UnknownId`] for a table whose material no face has; else as [`Mesh::into_scene`].
    pub fn new(mesh: Mesh, tables: Option<&Materials>) -> Result<Self, Error> {
        let found = found(mesh.material_names(), mesh.surfaces(), tables)?;
        let mut materials = BTreeMap::new();
        for table in &found {
            materials.insert(table.name.clone(), table.material()?);
        }
        let scene = mesh.into_scene(&materials)?;
        Ok(Self { scene, priors: found.iter().map(MaterialTable::prior).collect() })
    }

    /// A box parallel to the axes between two opposite corners in metres; its surfaces are `floor`, `ceiling` and `walls`.
    ///
    /// # Errors
    /// As [`FloorPlan::new`] and [`FloorPlan::extruded`]; [`sabine_acoustics::Error::UnknownId`] for a table of another name.
    pub fn of_box(corners_m: [[f64; 3]; 2], tables: Option<&Materials>) -> Result<Self, Error> {
        let [[x, y, z], [x2, y2, z2]] = corners_m;
        let plan = FloorPlan::new(vec![[x, y], [x2, y], [x2, y2], [x, y2]])?;
        let found = found(&["floor", "ceiling", "walls"].map(str::to_owned), &BTreeMap::new(), tables)?;
        let materials = found
            .iter()
            .map(|table| Ok(NamedMaterial { name: table.name.clone(), material: table.material()? }));
        let materials = materials.collect::<Result<_, Error>>()?;
        let on_the_ground = plan.extruded(z2 - z, materials, [0, 1], &[2; 4])?;
        let vertices = on_the_ground.vertices().iter().map(|v| [v[0], v[1], v[2] + z]).collect();
        let scene =
            Scene::new(vertices, on_the_ground.triangles().to_vec(), on_the_ground.materials().to_vec())?;
        Ok(Self { scene, priors: found.iter().map(MaterialTable::prior).collect() })
    }
}

/// A table for each of the names.
fn found(
    names: &[String],
    surfaces: &BTreeMap<String, Material>,
    tables: Option<&Materials>,
) -> Result<Vec<MaterialTable>, Error> {
    if let Some(table) =
        tables.into_iter().flat_map(Materials::tables).find(|table| !names.contains(&table.name))
    {
        return Err(ValueError::UnknownId { id: table.name.clone() }.into());
    }
    let of_mesh = || surfaces.values().next().map_or(Bands::T60, Material::bands);
    let bands = tables.map_or_else(of_mesh, Materials::bands);
    let uniform = |value| PerBand::uniform(bands, value);
    let table = |name: &String| {
        if let Some(table) = tables.and_then(|tables| tables.get(name)) {
            return Ok(table.clone());
        }
        if let Some(surface) = surfaces.get(name) {
            let table = MaterialTable::new(
                name,
                surface,
                &PerBand::uniform(surface.bands(), MaterialPrior::TABLE_SD),
            );
            return table.map(|table| table.on(bands));
        }
        match library_material(name) {
            Ok(entry) => MaterialTable::new(name, &entry.material(bands)?, &uniform(MaterialPrior::TABLE_SD)),
            Err(_) => Ok(MaterialTable {
                name: name.clone(),
                absorption: None,
                absorption_sd: uniform(MaterialPrior::UNKNOWN_ABSORPTION_SD),
                scattering: uniform(DEFAULT_SCATTERING),
            }),
        }
    };
    names.iter().map(table).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_may_stand_anywhere() {
        let model = RoomModel::of_box([[-1.0, 2.0, -0.5], [4.0, 6.0, 2.5]], None).unwrap();
        assert_eq!(model.scene.bounds_m(), [[-1.0, 2.0, -0.5], [4.0, 6.0, 2.5]]);
        assert!((model.scene.volume_m3() - 60.0).abs() < 1e-9);
        assert!(RoomModel::of_box([[0.0; 3], [4.0, 6.0, 0.0]], None).is_err());
        assert!(RoomModel::of_box([[0.0; 3], [f64::NAN, 6.0, 3.0]], None).is_err());
    }

    #[test]
    fn tables_come_from_the_file_or_the_library_or_are_open() {
        let tables = Materials::from_toml(
            "bands.centres_hz = [500, 1000]\nmaterials.walls = { absorption = [0.2, 0.3] }",
        )
        .unwrap();
        let model = RoomModel::of_box([[0.0; 3], [4.0, 6.0, 3.0]], Some(&tables)).unwrap();
        assert_eq!(model.priors[2].absorption.as_ref().unwrap().values(), [0.2, 0.3]);
        assert_eq!(model.priors[0].absorption, None);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tent.obj");
        let text = "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nusemtl carpet_thin\nf 1 2 3\nusemtl cloth\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
        std::fs::write(&path, text).unwrap();
        let model = RoomModel::of_mesh(&path, &MeshOptions::default(), None).unwrap();
        let carpet = library_material("carpet_thin").unwrap().material(Bands::T60).unwrap();
        assert_eq!(model.priors[0].absorption.as_ref(), Some(carpet.absorption()));
        assert_eq!(model.priors[1].absorption, None);
        let error = RoomModel::of_mesh(&path, &MeshOptions::default(), Some(&tables)).unwrap_err();
        assert!(error.to_string().contains("walls"), "{error}");
    }
}
