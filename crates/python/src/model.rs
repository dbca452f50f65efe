//! Extended models: rooms as diagnoses found them.

use crate::failure::{Failure, refused};
use crate::room::Room;
use pyo3::prelude::*;
use sabine::acoustics::{ImpulseResponse, Material};
use sabine::diagnose::{ExtendedModel as Model, ExtendedRoom};
use sabine::paths::Conditions;
use sabine::paths::laws::Law;
use sabine::scene::{Receiver, Source};
use std::path::{Path, PathBuf};

/// The extended model of a file, or of text.
#[pyclass(frozen)]
pub struct ExtendedModel(Model);

#[pymethods]
impl ExtendedModel {
    /// That of a file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> Result<Self, Failure> {
        Ok(Self(py.detach(|| Model::read(path))?))
    }

    /// That of the text of a file.
    #[staticmethod]
    fn parse(text: &str) -> Result<Self, Failure> {
        Ok(Self(Model::from_toml(text, Path::new("model"))?))
    }
}

impl ExtendedModel {
    /// The model.
    pub fn model(&self) -> &Model {
        &self.0
    }
}

/// A room as a model has it.
pub struct Modelled {
    /// Mesh, materials, air and places.
    pub room: Room,
    extended: ExtendedRoom,
}

impl Modelled {
    /// Applies a model to a room, with laws that take the place of its own of the same identifier.
    ///
    /// # Errors
    /// The room was not read from a folder, the model does not fit it, or needs waves, which are not solved here.
    pub fn new(model: &ExtendedModel, room: &Room, laws: &[Law]) -> Result<Self, Failure> {
        let stated = room.measured.as_ref();
        let stated = stated.ok_or_else(|| refused("model: it is of a room folder; read one"))?;
        let model = laws.iter().cloned().fold(model.0.clone(), Model::with_law);
        let extended = model.room(stated).map_err(|error| refused(format!("model: {error}")))?;
        if let Some(below_hz) = extended.wave_below_hz {
            return Err(refused(format!(
                "model: its response below {below_hz} Hz is that of waves, which are not solved here; `sabine trace --model` does"
            )));
        }
        let measured = extended.measured_room(stated)?;
        Ok(Self { room: Room::of_measured(measured), extended })
    }

    /// What paths between two of its places are weighed under.
    ///
    /// # Errors
    /// One of them is no source or receiver of the room: nothing is known of its recordings.
    pub fn conditions<'a>(
        &'a self,
        materials: &'a [Material],
        source: &Source,
        receiver: &Receiver,
    ) -> Result<Conditions<'a>, Failure> {
        let named = |what: &str| refused(format!("{what}: with a model it is a name of the room"));
        // A position has a name, too, which one of the room may have by chance.
        let from = self.room.sources.iter().position(|known| known == source);
        let to = self.room.receivers.iter().position(|known| known == receiver);
        let (from, to) = (from.ok_or_else(|| named("source"))?, to.ok_or_else(|| named("receiver"))?);
        Ok(self.extended.conditions(materials, from, to))
    }

    /// Whether sound bends around edges.
    pub fn diffraction(&self) -> bool {
        self.extended.diffraction
    }

    /// Image sources of a cuboid whose pressures are added.
    pub fn cuboid_paths(&self) -> usize {
        self.extended.cuboid_paths
    }

    /// What happens to a response after propagation.
    ///
    /// # Errors
    /// The sample rate is one that the filters of the octaves do not take.
    pub fn finish(
        &self,
        source: &Source,
        receiver: &Receiver,
        response: ImpulseResponse,
        seed: u64,
    ) -> Result<ImpulseResponse, Failure> {
        Ok(self.extended.finish(&source.id, &receiver.id, response, seed)?)
    }
}
