//! A room as a page describes it: a box or the text of an OBJ file, and surfaces of the library.

use crate::error::Error;
use sabine_acoustics::{Bands, OutOfRange, PerBand, library_material, material_library};
use sabine_scene::{
    LengthUnit, MaterialPrior, MaterialTable, Materials, Mesh, MeshOptions, RoomModel, UpAxis,
};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Bands of the simulation: what the page shows.
const BANDS: Bands = Bands::T60;

/// A room of a request.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct RoomSpec {
    /// Lengths of a box along x, y and z in metres; its surfaces are `floor`, `ceiling` and `walls`.
    pub size_m: Option<[f64; 3]>,
    /// The text of an OBJ file; its surfaces have the names after `usemtl`.
    pub obj: Option<String>,
    /// Unit of that file: m, cm, mm, in or ft.
    pub unit: LengthUnit,
    /// The axis of that file that points up: y or z.
    pub up_axis: Option<UpAxis>,
    /// For each surface a name of the library; one that is not listed is unknown.
    pub surfaces: BTreeMap<String, String>,
}

impl RoomSpec {
    /// Mesh and materials.
    ///
    /// # Errors
    /// [`Error::BoxOrMesh`]; what [`Mesh::obj_of_bytes`], [`RoomModel::new`] and [`RoomModel::of_box`] say; names that neither the room nor
    /// the library has.
    pub fn model(&self) -> Result<RoomModel, Error> {
        let table = |(surface, entry): (&String, &String)| {
            let sd = PerBand::uniform(BANDS, MaterialPrior::TABLE_SD);
            Ok(MaterialTable::new(surface, &library_material(entry)?.material(BANDS)?, &sd)?)
        };
        let tables = self.surfaces.iter().map(table).collect::<Result<Vec<_>, Error>>()?;
        let tables = if tables.is_empty() { None } else { Some(Materials::new(tables)?) };
        match (self.size_m, &self.obj) {
            (Some(size_m), None) => {
                for length_m in size_m {
                    OutOfRange::check("size (m)", length_m, 0.1, 1e3, "between 0.1 and 1000 m")?;
                }
                Ok(RoomModel::of_box([[0.0; 3], size_m], tables.as_ref())?)
            }
            (None, Some(obj)) => {
                let options =
                    MeshOptions { unit: self.unit, up_axis: self.up_axis, ..MeshOptions::default() };
                let mesh = Mesh::obj_of_bytes("room.obj", obj.as_bytes(), &options)?;
                Ok(RoomModel::new(mesh, tables.as_ref())?)
            }
            _ => Err(Error::BoxOrMesh),
        }
    }

    /// Names and areas of the surfaces, size and volume as JSON.
    ///
    /// # Errors
    /// As [`RoomSpec::model`].
    pub fn describe(&self) -> Result<Value, Error> {
        let scene = self.model()?.scene;
        let areas = scene.material_areas_m2();
        let surface = |(named, area_m2): (&sabine_scene::NamedMaterial, &f64)| json!({ "name": named.name, "area_m2": area_m2 });
        let surfaces: Vec<Value> = scene.materials().iter().zip(&areas).map(surface).collect();
        Ok(json!({ "bounds_m": scene.bounds_m(), "volume_m3": scene.volume_m3(), "surfaces": surfaces }))
    }
}

/// Names and descriptions of the surfaces of the library.
pub fn library_json() -> Value {
    let entry = |entry: &sabine_acoustics::LibraryMaterial| json!({ "name": entry.name, "description": entry.description });
    material_library().iter().map(entry).collect()
}
