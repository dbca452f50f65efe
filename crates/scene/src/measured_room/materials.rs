//! Materials from file to file: one table for each, in one form of TOML.

use super::file::{BandsTable, MaterialTable as FileTable};
use super::tables;
use super::{MaterialPrior, MeasuredRoom};
use crate::error::Error;
use sabine_acoustics::{Bands, Error as ValueError, Material, OutOfRange, PerBand, write_atomically};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;
use toml::Spanned;

/// Least standard deviation that a table may state: below it, a file says that a value is known beyond doubt.
const MIN_SD: f64 = 1e-4;
/// Decimals with which tables are written, as a factor.
const DECIMALS: f64 = 1e4;

/// What is known of a material, as a room file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialTable {
    /// Its name in the mesh.
    pub name: String,
    /// Random-incidence absorption (energy), 0 to 1; `None` where it is unknown and to be fitted.
    pub absorption: Option<PerBand<f64>>,
    /// Standard deviation of the absorption, 0.0001 to 1.
    pub absorption_sd: PerBand<f64>,
    /// Random-incidence scattering (energy), 0 to 1.
    pub scattering: PerBand<f64>,
}

impl MaterialTable {
    /// A table of these values. A standard deviation below 0.0001, of a material that was held for instance, becomes 0.0001: the
    /// least that a file may state.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::BandMismatch`] for a standard deviation of other bands, [`sabine_acoustics::Error::OutOfRange`] for one that is negative, above 1 or
    /// not a number.
    pub fn new(
        name: impl Into<String>,
        material: &Material,
        absorption_sd: &PerBand<f64>,
    ) -> Result<Self, Error> {
        let (left, right) = (material.bands(), absorption_sd.bands());
        if left != right {
            return Err(ValueError::BandMismatch { left, right }.into());
        }
        for &sd in absorption_sd.values() {
            OutOfRange::check("absorption_sd", sd, 0.0, 1.0, "between 0 and 1")?;
        }
        Ok(Self {
            name: name.into(),
            absorption: Some(material.absorption().clone()),
            absorption_sd: absorption_sd.map(|sd| sd.max(MIN_SD)),
            scattering: material.scattering().clone(),
        })
    }

    /// The surface; where the absorption is unknown, with [`MaterialPrior::UNKNOWN_ABSORPTION`].
    ///
    /// # Errors
    /// As [`Material::new`].
    pub fn material(&self) -> Result<Material, Error> {
        let unknown = || PerBand::uniform(self.scattering.bands(), MaterialPrior::UNKNOWN_ABSORPTION);
        Ok(Material::new(self.absorption.clone().unwrap_or_else(unknown), self.scattering.clone())?)
    }

    /// How well the absorption is known.
    pub fn prior(&self) -> MaterialPrior {
        MaterialPrior { absorption: self.absorption.clone(), absorption_sd: self.absorption_sd.clone() }
    }

    /// The table on other bands: a band takes the mean over those that lie in it, or else the nearest one's value.
    #[must_use]
    pub fn on(&self, bands: Bands) -> Self {
        Self {
            name: self.name.clone(),
            absorption: self.absorption.as_ref().map(|a| a.averaged(bands)),
            absorption_sd: self.absorption_sd.averaged(bands),
            scattering: self.scattering.averaged(bands),
        }
    }
}

/// The materials of a room, each by its name, in one run of bands: what a fit writes as `materials.toml` and
/// [`MeasuredRoom::with_materials`] takes.
///
/// The form is that of `room.toml`: `[bands]` with `centres_hz` and a table `[materials.NAME]` for each, so that the text can
/// also be pasted there.
///
/// ```
/// use sabine_scene::Materials;
/// let materials = Materials::from_toml(r#"
///     bands = { centres_hz = [500, 1000] }
///     materials.wall = { absorption = [0.10, 0.12], absorption_sd = [0.02, 0.02] }
///     materials.floor = {}
/// "#)?;
/// let names: Vec<&str> = materials.tables().iter().map(|table| table.name.as_str()).collect();
/// assert_eq!(names, ["wall", "floor"]);
/// let wall = materials.get("wall").ok_or("no wall")?;
/// assert_eq!(wall.absorption_sd.values(), [0.02, 0.02]);
/// assert_eq!(Materials::from_toml(&materials.to_toml()?)?, materials);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Materials {
    bands: Bands,
    tables: Vec<MaterialTable>,
}

impl Materials {
    /// Materials in this order.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Empty`] without any, [`sabine_acoustics::Error::BandMismatch`] for columns of different bands, [`Error::DuplicateId`] for a name that
    /// is there twice, [`sabine_acoustics::Error::OutOfRange`] for a value out of its range.
    pub fn new(tables: Vec<MaterialTable>) -> Result<Self, Error> {
        let first = tables.first().ok_or(ValueError::Empty { what: "the list of materials" })?;
        let bands = first.scattering.bands();
        for (i, table) in tables.iter().enumerate() {
            if tables[..i].iter().any(|other| other.name == table.name) {
                return Err(Error::DuplicateId { id: table.name.clone() });
            }
            let columns = [&table.absorption_sd, &table.scattering].into_iter().chain(&table.absorption);
            if let Some(other) = columns.map(PerBand::bands).find(|b| *b != bands) {
                return Err(ValueError::BandMismatch { left: bands, right: other }.into());
            }
            table.material()?;
            for &sd in table.absorption_sd.values() {
                OutOfRange::check("absorption_sd", sd, MIN_SD, 1.0, "between 0.0001 and 1")?;
            }
        }
        Ok(Self { bands, tables })
    }

    /// The bands of every table.
    pub fn bands(&self) -> Bands {
        self.bands
    }

    /// The tables, in order.
    pub fn tables(&self) -> &[MaterialTable] {
        &self.tables
    }

    /// The table of this name.
    pub fn get(&self, name: &str) -> Option<&MaterialTable> {
        self.tables.iter().find(|table| table.name == name)
    }

    /// The same on other bands, see [`MaterialTable::on`].
    #[must_use]
    pub fn on(&self, bands: Bands) -> Self {
        Self { bands, tables: self.tables.iter().map(|table| table.on(bands)).collect() }
    }

    /// Reads TOML; the order is that of the text. What a table leaves out gets the default of `room.toml`.
    ///
    /// # Errors
    /// [`Error::Toml`] and [`Error::InFile`] as for the materials of [`MeasuredRoom::read`]; the file is called `materials.toml`.
    pub fn from_toml(text: &str) -> Result<Self, Error> {
        Self::parse(text, Path::new("materials.toml"))
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Io`]; else as [`Materials::from_toml`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::parse(&super::read_text(path)?, path)
    }

    fn parse(text: &str, path: &Path) -> Result<Self, Error> {
        let MaterialsFile { bands, materials } =
            toml::from_str(text).map_err(|source| Error::toml(path, text, source))?;
        let bands = tables::bands(&bands.centres_hz).map_err(|e| e.in_file(path, "bands.centres_hz"))?;
        let mut order: Vec<(usize, String)> =
            materials.keys().map(|name| (name.span().start, name.get_ref().clone())).collect();
        order.sort();
        let by_name = materials.into_iter().map(|(name, table)| (name.into_inner(), table)).collect();
        let (surfaces, mut priors) = tables::materials(path, bands, &by_name)?;
        let table = |(_, name): (usize, String)| {
            let MaterialPrior { absorption, absorption_sd } = priors.remove(&name)?;
            let scattering = surfaces.get(&name)?.scattering().clone();
            Some(MaterialTable { name, absorption, absorption_sd, scattering })
        };
        Self::new(order.into_iter().filter_map(table).collect())
            .map_err(|error| error.in_file(path, "materials"))
    }

    /// Writes TOML, numbers to four decimals.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Implementation`], which numbers and names do not cause.
    pub fn to_toml(&self) -> Result<String, Error> {
        let bands = BandsTable { centres_hz: self.bands.iter_hz().collect() };
        let file = WrittenFile { bands, materials: InOrder(&self.tables) };
        toml::to_string(&file).map_err(|error| ValueError::implementation("materials.toml", error).into())
    }

    /// Writes a file, whole or not at all.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Io`]; else as [`Materials::to_toml`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let text = self.to_toml()?;
        Ok(write_atomically(path.as_ref(), |file| file.write_all(text.as_bytes()))?)
    }
}

impl MeasuredRoom {
    /// What is known of the room's materials, in the order of the scene.
    pub fn materials(&self) -> Materials {
        let table = |(named, prior): (&crate::NamedMaterial, &MaterialPrior)| MaterialTable {
            name: named.name.clone(),
            absorption: prior.absorption.clone(),
            absorption_sd: prior.absorption_sd.clone(),
            scattering: named.material.scattering().clone(),
        };
        let tables = self.scene().materials().iter().zip(self.priors()).map(table).collect();
        Materials { bands: self.bands(), tables }
    }

    /// The room with other tables for the materials that `materials` names. The room takes over their bands; materials that are
    /// not named keep their tables, on these bands.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::UnknownId`] for a material that the room does not have.
    pub fn with_materials(&self, materials: &Materials) -> Result<Self, Error> {
        let mut tables = self.materials().on(materials.bands);
        for other in &materials.tables {
            let own = tables.tables.iter_mut().find(|table| table.name == other.name);
            *own.ok_or_else(|| ValueError::UnknownId { id: other.name.clone() })? = other.clone();
        }
        let surfaces = tables.tables.iter().map(MaterialTable::material).collect::<Result<_, _>>()?;
        let scene = self.scene().with_materials(surfaces)?;
        let priors = tables.tables.iter().map(MaterialTable::prior).collect();
        let mut named_as_in_library = self.named_as_in_library.clone();
        named_as_in_library.retain(|name| materials.get(name).is_none());
        let mut described_by_mesh = self.described_by_mesh.clone();
        described_by_mesh.retain(|name| materials.get(name).is_none());
        Ok(Self { scene, priors, named_as_in_library, described_by_mesh, ..self.clone() })
    }

    /// The same with the tables of a file.
    ///
    /// # Errors
    /// As [`Materials::read`], and [`Error::InFile`] naming a material that the room does not have.
    pub fn with_materials_file(&self, path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        self.with_materials(&Materials::read(path)?).map_err(|error| error.in_file(path, "materials"))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialsFile {
    bands: BandsTable,
    materials: BTreeMap<Spanned<String>, FileTable>,
}

#[derive(Serialize)]
struct WrittenFile<'a> {
    bands: BandsTable,
    materials: InOrder<'a>,
}

struct InOrder<'a>(&'a [MaterialTable]);

impl Serialize for InOrder<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for table in self.0 {
            map.serialize_entry(&table.name, &FileTable::from(table))?;
        }
        map.end()
    }
}

impl From<&MaterialTable> for FileTable {
    fn from(table: &MaterialTable) -> Self {
        let rounded = |values: &PerBand<f64>| {
            values.values().iter().map(|v| (v * DECIMALS).round() / DECIMALS).collect()
        };
        Self {
            library: None,
            absorption: table.absorption.as_ref().map(rounded),
            absorption_sd: Some(rounded(&table.absorption_sd)),
            scattering: Some(rounded(&table.scattering)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIXTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");

    #[test]
    fn what_a_fit_writes_a_room_reads() {
        let room = MeasuredRoom::read(FIXTURE).unwrap();
        let bands = Bands::octaves(250.0, 4000.0).unwrap();
        // The last was held: its standard error is zero.
        let count = room.scene().materials().len();
        let table = |(k, named): (usize, &crate::NamedMaterial)| {
            let absorption = PerBand::from_fn(bands, |b| (10 + k + b) as f64 / 100.0);
            let material = named.material.resampled(bands).with_absorption(absorption).unwrap();
            let sd = PerBand::uniform(bands, if k + 1 == count { 0.0 } else { 0.03 });
            MaterialTable::new(named.name.clone(), &material, &sd).unwrap()
        };
        let tables = room.scene().materials().iter().enumerate().map(table).collect();
        let materials = Materials::new(tables).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("materials.toml");
        materials.write(&path).unwrap();
        let other = room.with_materials_file(&path).unwrap();
        assert_eq!(other.bands(), bands);
        assert_eq!(other.materials(), materials);
        let absorption = other.scene().materials()[0].material.absorption().clone();
        assert_eq!(absorption.values(), [0.10, 0.11, 0.12, 0.13, 0.14]);
        assert_eq!(other.priors()[0].absorption, Some(absorption));
        assert_eq!(other.priors()[count - 1].absorption_sd.values(), [1e-4; 5]);
        // The same text pasted into the room's own file.
        let own = std::fs::read_to_string(Path::new(FIXTURE).join("room.toml")).unwrap();
        let mut pasted: toml::Table = own.parse().unwrap();
        pasted.extend(materials.to_toml().unwrap().parse::<toml::Table>().unwrap());
        pasted.remove("responses");
        std::fs::write(folder.path().join("room.toml"), pasted.to_string()).unwrap();
        std::fs::copy(Path::new(FIXTURE).join("room.obj"), folder.path().join("room.obj")).unwrap();
        assert_eq!(MeasuredRoom::read(folder.path()).unwrap().materials(), materials);
    }

    #[test]
    fn materials_that_are_not_named_keep_their_tables() {
        let room = MeasuredRoom::read(FIXTURE).unwrap();
        let before = room.materials();
        let own = before.tables()[0].clone();
        let changed = MaterialTable { absorption_sd: PerBand::uniform(before.bands(), 0.5), ..own };
        let other = room.with_materials(&Materials::new(vec![changed.clone()]).unwrap()).unwrap();
        assert_eq!(other.materials().tables()[0], changed);
        assert_eq!(other.materials().tables()[1..], before.tables()[1..]);
    }

    #[test]
    fn a_material_of_another_room_is_named_with_the_file() {
        let room = MeasuredRoom::read(FIXTURE).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("other.toml");
        std::fs::write(&path, "bands.centres_hz = [500]\nmaterials.lava = { absorption = [0.3] }").unwrap();
        let message = room.with_materials_file(&path).unwrap_err().to_string();
        assert!(message.contains("other.toml") && message.contains("lava"), "{message}");
        for (text, named) in [
            ("bands.centres_hz = [500]\nmaterials.wall.absorption = [1.3]", "materials.wall.absorption"),
            ("bands.centres_hz = [500]\nmaterials.wall.colour = [1.0]", "colour"),
            ("bands.centres_hz = [500]\nmaterials = {}", "list of materials"),
            ("bands.centres_hz = [500, 900]\nmaterials.wall = {}", "bands.centres_hz"),
        ] {
            let message = Materials::from_toml(text).unwrap_err().to_string();
            assert!(message.contains("materials.toml") && message.contains(named), "{text}: {message}");
        }
    }
}
