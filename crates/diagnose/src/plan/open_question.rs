//! What a diagnosis leaves open, from its document.

use crate::effect::Effect;
use crate::effects::UnknownLaw;
use crate::plan::hypothesis::{Hypothesis, OpenQuestion};
use sabine_paths::laws::Law;
use sabine_scene::MeasuredRoom;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// Octaves agree to this share.
const SAME_HZ: f64 = 1e-3;
/// What a law has in a file of laws: a diagnosis says more of it.
const OF_LAW: [&str; 6] = ["id", "target", "surface", "formula", "words", "parameters"];

/// Of `diagnosis.json` what a plan needs.
#[derive(Deserialize)]
struct Document {
    bands_hz: Vec<f64>,
    causes: Vec<Hypothesis>,
    alternatives: Vec<String>,
    candidates: Vec<Hypothesis>,
    materials: BTreeMap<String, serde::de::IgnoredAny>,
    #[serde(default)]
    laws: Vec<Value>,
}

/// A diagnosis that serves no plan.
#[derive(Debug, thiserror::Error)]
pub enum QuestionError {
    /// It is no JSON, lacks a field, or has a law that is none.
    #[error("no diagnosis.json of `sabine diagnose`: {0}")]
    Parse(#[from] serde_json::Error),
    /// Its materials or octaves are not those of the room.
    #[error("{field}: a diagnosis of another room: it has {found}, the room has {expected}")]
    OtherRoom {
        /// `materials` or `bands_hz`.
        field: &'static str,
        /// What the diagnosis has.
        found: String,
        /// What the room has.
        expected: String,
    },
}

impl OpenQuestion {
    /// The open question of a diagnosis of this room, given as its `diagnosis.json`, and the laws that it found. Such a law is a hypothesis by its
    /// own identifier; effects that the planner does not know ([`Planner::knows`](crate::Planner::knows)) are no alternatives.
    ///
    /// # Errors
    /// [`QuestionError`]: the text is no diagnosis, or has other materials or octaves than the room.
    pub fn of_json(
        text: &str,
        room: &MeasuredRoom,
        knows: impl Fn(&str) -> bool,
    ) -> Result<(Self, Vec<Law>), QuestionError> {
        let mut found: Document = serde_json::from_str(text)?;
        let other =
            |field, found: String, expected: String| Err(QuestionError::OtherRoom { field, found, expected });
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
        let laws = found.laws.iter().map(law).collect::<Result<Vec<Law>, _>>()?;
        let is_law = |cause: &Hypothesis| cause.effect == UnknownLaw.id();
        for (cause, law) in found.causes.iter_mut().filter(|cause| is_law(cause)).zip(&laws) {
            *cause = Hypothesis::of(law.id());
        }
        found.candidates.retain(|one| knows(&one.effect));
        Ok((Self::of_diagnosis(&found.causes, &found.alternatives, &found.candidates), laws))
    }
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
