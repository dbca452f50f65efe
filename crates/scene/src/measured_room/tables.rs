//! What the tables of `room.toml` come to: bands, materials, places.

use super::MaterialPrior;
use super::file::{MaterialTable, PlaceTable};
use crate::error::Error;
use crate::scene::Receiver;
use sabine_acoustics::{Bands, Error as ValueError, Material, OutOfRange, PerBand, library_material};
use std::collections::{BTreeMap, HashSet};
use std::path::Path;

/// Scattering of a material that does not state it (the format's default).
pub(super) const DEFAULT_SCATTERING: f64 = 0.1;

/// The bands of a list of centres.
pub(super) fn bands(centres_hz: &[f64]) -> Result<Bands, Error> {
    if centres_hz.is_empty() {
        return Err(ValueError::Empty { what: "the list of centres" }.into());
    }
    for &centre in centres_hz {
        OutOfRange::check(
            "centre (Hz)",
            centre,
            49.0,
            20_500.0,
            "the centre of an octave or third octave from 50 to 20000",
        )?;
    }
    Ok(Bands::from_centres_hz(centres_hz)?)
}

/// One for each name of a material.
pub(super) type ByName<T> = BTreeMap<String, T>;

/// Materials by name, and how well each is known.
pub(super) fn materials(
    path: &Path,
    bands: Bands,
    tables: &ByName<MaterialTable>,
) -> Result<(ByName<Material>, ByName<MaterialPrior>), Error> {
    let mut found = (BTreeMap::new(), BTreeMap::new());
    for (name, table) in tables {
        let column = |field: &'static str, values: &Option<Vec<f64>>, low: f64, range: &'static str| {
            let checked = |values: &Vec<f64>| {
                values.iter().try_for_each(|&v| OutOfRange::check(field, v, low, 1.0, range))?;
                PerBand::new(bands, values.clone())
            };
            values
                .as_ref()
                .map(checked)
                .transpose()
                .map_err(|error| error.in_file(path, format!("materials.{name}.{field}")))
        };
        let absorption = column("absorption", &table.absorption, 0.0, "between 0 and 1")?;
        let sd = column("absorption_sd", &table.absorption_sd, 1e-4, "between 0.0001 and 1")?;
        let scattering = column("scattering", &table.scattering, 0.0, "between 0 and 1")?;
        let uniform = |value| PerBand::uniform(bands, value);
        let listed = match &table.library {
            None => None,
            Some(_) if absorption.is_some() => {
                return Err(Error::TwoTables.in_file(path, format!("materials.{name}.library")));
            }
            Some(entry) => Some(
                library_material(entry)
                    .and_then(|surface| surface.material(bands))
                    .map_err(|error| error.in_file(path, format!("materials.{name}.library")))?,
            ),
        };
        let absorption = absorption.or(listed.as_ref().map(|material| material.absorption().clone()));
        let scattering = scattering.or(listed.map(|material| material.scattering().clone()));
        let (mean, default_sd) = match &absorption {
            Some(table) => (table.clone(), MaterialPrior::TABLE_SD),
            None => (uniform(MaterialPrior::UNKNOWN_ABSORPTION), MaterialPrior::UNKNOWN_ABSORPTION_SD),
        };
        let material = Material::new(mean, scattering.unwrap_or_else(|| uniform(DEFAULT_SCATTERING)))
            .map_err(|error| error.in_file(path, format!("materials.{name}")))?;
        let prior = MaterialPrior { absorption, absorption_sd: sd.unwrap_or_else(|| uniform(default_sd)) };
        found.0.insert(name.clone(), material);
        found.1.insert(name.clone(), prior);
    }
    Ok(found)
}

/// Sources or receivers: the file says the same of both.
pub(super) fn places(path: &Path, kind: &str, tables: &[PlaceTable]) -> Result<Vec<Receiver>, Error> {
    let mut ids = HashSet::new();
    let mut places = Vec::with_capacity(tables.len());
    for (i, table) in tables.iter().enumerate() {
        let in_field = |error: Error, name: &str| error.in_file(path, format!("{kind}[{i}].{name}"));
        if table.id.trim().is_empty() {
            return Err(in_field(ValueError::Empty { what: "the identifier" }.into(), "id"));
        }
        if !ids.insert(&table.id) {
            return Err(in_field(Error::DuplicateId { id: table.id.clone() }, "id"));
        }
        let position_m = position(&table.position_m).map_err(|e| in_field(e, "position_m"))?;
        let axis = table.orientation.as_deref().map(direction).transpose();
        let axis = axis.map_err(|e| in_field(e, "orientation"))?;
        places.push(Receiver { id: table.id.clone(), position_m, axis });
    }
    Ok(places)
}

fn position(values: &[f64]) -> Result<[f64; 3], Error> {
    let position =
        <[f64; 3]>::try_from(values).map_err(|_| ValueError::Length { expected: 3, found: values.len() })?;
    for coordinate in position {
        OutOfRange::check("position (m)", coordinate, -1e5, 1e5, "finite and within 100 km")?;
    }
    Ok(position)
}

fn direction(values: &[f64]) -> Result<[f64; 3], Error> {
    let axis = position(values)?;
    let length = axis.iter().map(|c| c * c).sum::<f64>().sqrt();
    OutOfRange::check("length of the unit vector", length, 0.99, 1.01, "1")?;
    Ok(axis.map(|c| c / length))
}
