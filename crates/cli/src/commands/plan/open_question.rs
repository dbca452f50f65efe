//! What a diagnosis leaves open, from its file.

use sabine::diagnose::{Effect, Hypothesis, OpenQuestion, UnknownLaw};
use sabine::paths::laws::Law;
use sabine::scene::MeasuredRoom;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Octaves agree to this share.
const SAME_HZ: f64 = 1e-3;

/// Of `diagnosis.json` what a plan needs.
#[derive(Deserialize)]
struct Diagnosis {
    bands_hz: Vec<f64>,
    causes: Vec<Hypothesis>,
    alternatives: Vec<String>,
    candidates: Vec<Hypothesis>,
    materials: BTreeMap<String, serde::de::IgnoredAny>,
    #[serde(default)]
    laws: Vec<Value>,
}

/// What a law has in a file of laws: a diagnosis says more of it.
const OF_LAW: [&str; 6] = ["id", "target", "surface", "formula", "words", "parameters"];

/// A diagnosis that serves no plan.
#[derive(Debug, thiserror::Error)]
pub enum DiagnosisFileError {
    #[error("{}: {source}", path.display())]
    Read {
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
    #[error("{}: no diagnosis.json of `sabine diagnose`: {source}", path.display())]
    Parse {
        path: PathBuf,
        #[source]
        source: serde_json::Error,
    },
    #[error("{}: {field}: a diagnosis of another room: it has {found}, the room has {expected}", path.display())]
    OtherRoom { path: PathBuf, field: &'static str, found: String, expected: String },
}

/// The open question of a diagnosis of this room, and the laws that it found. A law that was found is a hypothesis by its own identifier; effects
/// that a planner does not know are no alternatives.
///
/// # Errors
/// [`DiagnosisFileError`]: the file cannot be read, is no diagnosis, or has other materials or octaves than the room.
pub fn read(
    path: &Path,
    room: &MeasuredRoom,
    knows: impl Fn(&str) -> bool,
) -> Result<(OpenQuestion, Vec<Law>), DiagnosisFileError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| DiagnosisFileError::Read { path: path.to_owned(), source })?;
    let no_diagnosis = |source| DiagnosisFileError::Parse { path: path.to_owned(), source };
    let mut found: Diagnosis = serde_json::from_str(&text).map_err(no_diagnosis)?;
    let other = |field, found: String, expected: String| {
        Err(DiagnosisFileError::OtherRoom { path: path.to_owned(), field, found, expected })
    };
    let mut expected: Vec<&str> = room.scene().materials().iter().map(|m| m.name.as_str()).collect();
    expected.sort_unstable();
    let materials: Vec<&str> = found.materials.keys().map(String::as_str).collect();
    if materials != expected {
        return other("materials", materials.join(", "), expected.join(", "));
    }
    let bands: Vec<f64> = room.bands().iter_hz().collect();
    let same = |(a, b): (&f64, &f64)| (a / b - 1.0).abs() < SAME_HZ;
    if bands.len() != found.bands_hz.len() || !bands.iter().zip(&found.bands_hz).all(same) {
        return other("bands_hz", format!("{:?}", found.bands_hz), format!("{bands:?}"));
    }
    let laws = found.laws.iter().map(law).collect::<Result<Vec<Law>, _>>().map_err(no_diagnosis)?;
    let is_law = |cause: &Hypothesis| cause.effect == UnknownLaw.id();
    for (cause, law) in found.causes.iter_mut().filter(|cause| is_law(cause)).zip(&laws) {
        *cause = Hypothesis::of(law.id());
    }
    found.candidates.retain(|one| knows(&one.effect));
    Ok((OpenQuestion::of_diagnosis(&found.causes, &found.alternatives, &found.candidates), laws))
}

/// A law of a diagnosis, which may have no surface.
fn law(entry: &Value) -> Result<Law, serde_json::Error> {
    let own = |(key, value): (&String, &Value)| {
        (OF_LAW.contains(&key.as_str()) && !value.is_null()).then(|| (key.clone(), value.clone()))
    };
    let table: serde_json::Map<String, Value> =
        entry.as_object().into_iter().flatten().filter_map(own).collect();
    serde_json::from_value(Value::Object(table))
}
