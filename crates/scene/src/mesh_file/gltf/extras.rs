//! What a glTF material's `extras` say about sound: `absorption`, `scattering`, `centres_hz`.
//!
//! glTF leaves `extras` to applications (glTF 2.0, section 3.10); these keys are our own, and those of `room.toml`.

use crate::error::Error;
use sabine_acoustics::{Bands, Error as ValueError, Material, OutOfRange, PerBand};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Scattering of a material whose extras state none, as in `room.toml`.
const DEFAULT_SCATTERING: f64 = 0.1;

#[derive(Deserialize)]
struct Document {
    #[serde(default)]
    materials: Vec<MaterialExtras>,
}

#[derive(Deserialize)]
struct MaterialExtras {
    #[serde(default)]
    name: String,
    #[serde(default)]
    extras: Value,
}

/// The surfaces that extras describe, by the names of the materials; extras without `absorption` are of another program.
pub(super) fn surfaces(path: &Path, json: &[u8]) -> Result<BTreeMap<String, Material>, Error> {
    // The grammar was checked before; what is no list of materials holds none.
    let document: Document = serde_json::from_slice(json).unwrap_or(Document { materials: Vec::new() });
    let mut found = BTreeMap::new();
    for (index, MaterialExtras { name, extras }) in document.materials.into_iter().enumerate() {
        let Some(absorption) = extras.get("absorption") else { continue };
        let field = |key: &str| format!("materials[{index}].extras.{key}");
        let column = |key: &str, values: &Value| numbers(values).map_err(|e| e.in_file(path, field(key)));
        let absorption = column("absorption", absorption)?;
        let bands = match extras.get("centres_hz") {
            None => Bands::T60,
            Some(centres) => Bands::from_centres_hz(&column("centres_hz", centres)?)
                .map_err(|error| Error::from(error).in_file(path, field("centres_hz")))?,
        };
        let per_band = |key: &'static str, values: Vec<f64>| {
            let checked =
                values.iter().try_for_each(|&v| OutOfRange::check(key, v, 0.0, 1.0, "between 0 and 1"));
            let checked = checked.map_err(ValueError::from).and_then(|()| PerBand::new(bands, values));
            checked.map_err(|error| Error::from(error).in_file(path, field(key)))
        };
        let absorption = per_band("absorption", absorption)?;
        let scattering = match extras.get("scattering") {
            None => PerBand::uniform(bands, DEFAULT_SCATTERING),
            Some(values) => per_band("scattering", column("scattering", values)?)?,
        };
        let material = Material::new(absorption, scattering)
            .map_err(|error| Error::from(error).in_file(path, field("absorption")))?;
        let name = if name.is_empty() { format!("material_{index}") } else { name };
        if found.get(&name).is_some_and(|other| *other != material) {
            return Err(Error::DuplicateId { id: name }.in_file(path, field("absorption")));
        }
        found.insert(name, material);
    }
    Ok(found)
}

fn numbers(values: &Value) -> Result<Vec<f64>, Error> {
    let list =
        values.as_array().and_then(|list| list.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>());
    list.ok_or_else(|| Error::Unit {
        found: values.to_string().chars().take(60).collect(),
        expected: "a list of numbers",
    })
}
