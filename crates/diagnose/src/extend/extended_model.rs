//! A room as a diagnosis found it: what is stated, and an ordered list of changes.

use crate::error::Error;
use crate::extend::applied_changes::AppliedChanges;
use crate::extend::extended_room::ExtendedRoom;
use crate::extend::model_change::ModelChange;
use crate::extend::model_checks::Fault;
use crate::extend::uncertainty::Uncertainty;
use crate::found_parameter::FoundParameter;
use sabine_acoustics::{Error as Cause, OutOfRange, write_atomically};
use sabine_paths::laws::Law;
use sabine_scene::MeasuredRoom;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::Path;

/// What a diagnosis changes in a room: an overlay over the room file. As TOML it is the `extended_model.toml` that `sabine diagnose` writes.
///
/// Causes stand in the order in which they were named, each with its parameters, their 90 % intervals, and the changes that it makes. Where
/// two make the same change (a temperature, the gains of the loudspeaker) the later one counts; changes of different things (two positions,
/// two panels) add up.
///
/// ```
/// use sabine_diagnose::{ExtendedModel, ModelCause, ModelChange};
/// let mut model = ExtendedModel::default();
/// model.centres_hz = vec![125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0];
/// model.causes.push(ModelCause::new("time_zero", vec![ModelChange::Latency(0.003)]));
/// assert!(model.to_toml()?.ends_with("[[causes]]\nid = \"time_zero\"\n\n[[causes.changes]]\nlatency_s = 0.003\n"));
/// # Ok::<(), sabine_diagnose::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ExtendedModel {
    version: Version,
    /// Nominal octave centres of everything given by octave, in Hz.
    pub centres_hz: Vec<f64>,
    /// Absorption by material and octave.
    #[serde(default)]
    pub absorption: BTreeMap<String, Vec<f64>>,
    /// The causes that are at work, in order.
    #[serde(default)]
    pub causes: Vec<ModelCause>,
    /// How sure the numbers of the model are, all together; none for one that was not fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Uncertainty>,
}

/// A cause in a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ModelCause {
    /// Identifier: that of an effect of the catalogue, of a law, or your own.
    pub id: String,
    /// What it concerns (a receiver, a material ...), where the effect has several cases.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subject: Option<String>,
    /// What was found of it. Changes count when sound is rendered, not these.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<FoundParameter>,
    /// What it changes; empty for a cause that is named and not rendered, or whose change is absorption alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<ModelChange>,
}

impl ModelCause {
    /// A cause that makes some changes, whose parameters nobody fitted.
    pub fn new(id: impl Into<String>, changes: Vec<ModelChange>) -> Self {
        Self { id: id.into(), subject: None, parameters: Vec::new(), changes }
    }

    /// The same cause, of something of several: a receiver, a material.
    #[must_use]
    pub fn about(self, subject: impl Into<String>) -> Self {
        Self { subject: Some(subject.into()), ..self }
    }

    /// The law that is this cause, if it is one.
    pub fn law(&self) -> Option<&Law> {
        self.changes.iter().find_map(|change| match change {
            ModelChange::Law(law) => Some(&**law),
            _ => None,
        })
    }

    /// Whether another is the same cause of the same thing.
    pub fn is_same(&self, other: &Self) -> bool {
        (&self.id, &self.subject) == (&other.id, &other.subject)
    }

    /// Its identifier, with its subject where it has one: `position_error (r2)`.
    pub fn name(&self) -> String {
        match &self.subject {
            Some(subject) => format!("{} ({subject})", self.id),
            None => self.id.clone(),
        }
    }
}

impl ExtendedModel {
    /// Reads a model from a TOML file. Names are checked by [`ExtendedModel::room`], which knows them.
    ///
    /// # Errors
    /// [`Error::Model`] for what is not such a file, another version of the format and a change of an unknown kind;
    /// [`Error::Acoustics`] if it cannot be read or, naming file and field, for a list that is not as long as `centres_hz` and a value out of
    /// range.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let text =
            std::fs::read_to_string(path).map_err(|source| Cause::Io { path: path.to_owned(), source })?;
        Self::from_toml(&text, path)
    }

    /// Reads the text of such a file, which has this path.
    ///
    /// # Errors
    /// As [`ExtendedModel::read`], but for those of reading.
    pub fn from_toml(text: &str, path: &Path) -> Result<Self, Error> {
        let model: Self = toml::from_str(text)
            .map_err(|source| Error::Model { path: path.to_owned(), source: Box::new(source) })?;
        model.check().map_err(|(field, source)| Cause::InFile {
            path: path.to_owned(),
            field,
            source: Box::new(source),
        })?;
        Ok(model)
    }

    /// The model as TOML.
    ///
    /// # Errors
    /// [`Error::Acoustics`] with the cause [`Cause::Implementation`] if a value has no form in TOML, which none has that passes
    /// the checks of [`ExtendedModel::read`].
    pub fn to_toml(&self) -> Result<String, Error> {
        Ok(toml::to_string(self).map_err(|e| Cause::implementation("extended model as TOML", e))?)
    }

    /// Writes the model to a TOML file, whole or not at all.
    ///
    /// # Errors
    /// As [`ExtendedModel::to_toml`]; [`Error::Acoustics`] if it cannot be written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let text = self.to_toml()?;
        Ok(write_atomically(path.as_ref(), |file| file.write_all(text.as_bytes()))?)
    }

    /// Everything that can be said without the room.
    pub(super) fn check(&self) -> Result<(), Fault> {
        for (i, cause) in self.causes.iter().enumerate() {
            if self.causes[..i].iter().any(|other| other.is_same(cause)) {
                let field = "number of causes of this name and subject";
                let twice = OutOfRange { field, value: 2.0, range: "at most 1" };
                return Err((format!("causes, {}", cause.name()), twice.into()));
            }
        }
        self.applied().check()?;
        self.uncertainty.as_ref().map_or(Ok(()), |uncertainty| uncertainty.check(&self.numbers()))
    }

    /// What all changes make of the room together.
    pub fn applied(&self) -> AppliedChanges {
        let mut all = AppliedChanges {
            centres_hz: self.centres_hz.clone(),
            absorption: self.absorption.clone(),
            ..AppliedChanges::default()
        };
        self.causes.iter().flat_map(|cause| &cause.changes).for_each(|change| all.apply(change.clone()));
        all
    }

    /// The room as the model has it. Octaves that the model lacks take the nearest one's values.
    ///
    /// # Errors
    /// [`Error::Displacement`] for surfaces that cannot stand where the model has them;
    /// [`Error::InModel`] naming the field, for a name that the room does not have, a list that is not as long as `centres_hz`, a
    /// value out of range, or a source whose axis neither the model nor the room file states.
    pub fn room(&self, room: &MeasuredRoom) -> Result<ExtendedRoom, Error> {
        self.applied().room(room)
    }

    /// The model with a law after its causes, in the place of one of the same identifier.
    #[must_use]
    pub fn with_law(self, law: Law) -> Self {
        let known =
            self.causes.iter().position(|cause| cause.law().is_some_and(|known| known.id() == law.id()));
        let mut model = known.into_iter().fold(self, Self::without);
        model.causes.push(ModelCause::new(law.id().to_owned(), vec![ModelChange::Law(Box::new(law))]));
        model
    }

    /// The model without a cause, by its place. Absorption stays as it was found beside it.
    ///
    /// # Panics
    /// If there is no such place.
    #[must_use]
    pub fn without(mut self, place: usize) -> Self {
        self.causes.remove(place);
        self.uncertainty = self.uncertainty.and_then(|uncertainty| uncertainty.without_cause(place));
        self
    }

    /// This model, and then the causes of another. Absorption is this one's; materials that it does not have are the other's. Nothing is known
    /// of how the numbers of one model depend on those of the other.
    ///
    /// # Errors
    /// [`Error::ModelsDisagree`] if their octaves differ, or if both have the same cause.
    pub fn merged(mut self, other: Self) -> Result<Self, Error> {
        if self.centres_hz != other.centres_hz {
            return Err(Error::ModelsDisagree { field: "centres_hz".to_owned() });
        }
        if let Some(twice) =
            other.causes.iter().find(|cause| self.causes.iter().any(|own| own.is_same(cause)))
        {
            return Err(Error::ModelsDisagree { field: format!("causes, {}", twice.name()) });
        }
        let own: BTreeSet<String> = self.absorption.keys().cloned().collect();
        let added = other.uncertainty.and_then(|u| u.moved(self.causes.len(), &own));
        self.uncertainty = Uncertainty::joined(self.uncertainty, added);
        for (material, absorption) in other.absorption {
            self.absorption.entry(material).or_insert(absorption);
        }
        self.causes.extend(other.causes);
        Ok(self)
    }

    /// So many models that could be as well, drawn from how sure the numbers of this one are: a normal distribution about them, cut off where
    /// a number leaves its range. They have no parameters and no uncertainty of their own. A model without uncertainty is drawn as it stands.
    /// Same seed, same draws.
    ///
    /// # Errors
    /// [`Error::InModel`] naming `uncertainty` for a number that the model does not have, or if hardly any draw is a model.
    pub fn draws(&self, count: usize, seed: u64) -> Result<Vec<Self>, Error> {
        let in_model = |(field, source)| Error::InModel { field, source: Box::new(source) };
        let plain = Self {
            uncertainty: None,
            causes: self.causes.iter().map(|c| ModelCause { parameters: Vec::new(), ..c.clone() }).collect(),
            ..self.clone()
        };
        let Some(uncertainty) = &self.uncertainty else { return Ok(vec![plain; count]) };
        let build = |numbers| plain.with_numbers(numbers).filter(|model| model.check().is_ok());
        uncertainty.draws(&plain.numbers(), build, count, seed).map_err(in_model)
    }

    /// The 90 % interval of each number whose uncertainty the model states, by its JSON pointer.
    pub fn intervals_90(&self) -> Vec<(&str, [f64; 2])> {
        self.uncertainty.as_ref().map_or_else(Vec::new, |own| own.intervals_90(&self.numbers()))
    }

    /// Absorption and changes as JSON, in which a pointer finds a number.
    fn numbers(&self) -> Value {
        let changes = |cause: &ModelCause| json!({ "changes": cause.changes });
        json!({ "absorption": self.absorption, "causes": self.causes.iter().map(changes).collect::<Vec<_>>() })
    }

    /// The model with other numbers in its absorption and changes.
    fn with_numbers(&self, mut numbers: Value) -> Option<Self> {
        let mut model = self.clone();
        model.absorption = serde_json::from_value(numbers["absorption"].take()).ok()?;
        for (i, cause) in model.causes.iter_mut().enumerate() {
            cause.changes = serde_json::from_value(numbers["causes"][i]["changes"].take()).ok()?;
        }
        Some(model)
    }
}

/// The version of the format: this program writes and reads one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Version;

impl Version {
    const NUMBER: u32 = 2;
}

impl Serialize for Version {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u32(Self::NUMBER)
    }
}

impl<'de> Deserialize<'de> for Version {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        match u32::deserialize(from)? {
            Self::NUMBER => Ok(Self),
            other => Err(serde::de::Error::custom(format!(
                "version {other} of extended models is not read, {} is: run the diagnosis again",
                Self::NUMBER
            ))),
        }
    }
}
