//! Measured responses with their places in a model of the room, and what the model gets wrong.

use crate::error::Error;
use crate::room::RoomSpec;
use sabine_acoustics::{ImpulseResponse, Observer, OutOfRange};
use sabine_diagnose::{DiagnoseConfig, Diagnoser};
use sabine_scene::{
    Levels, MeasuredRoom, Measurement, Measurements, NewResponse, Receiver, Source, TimeZero,
};
use serde::Deserialize;
use serde_json::Value;

/// Most rays of a diagnosis in a page.
const MAX_RAYS: f64 = 2e4;

/// A request for a diagnosis.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct DiagnoseSpec {
    /// The room.
    pub room: RoomSpec,
    /// Rays for each pair, 100 to 20,000.
    pub rays: usize,
    /// Seed of rays and simulated measurements.
    #[serde(default)]
    pub seed: u64,
    /// When sample 0 was taken: `emission`, `common` or `per_response`.
    pub time_zero: TimeZero,
    /// What levels mean: `absolute`, `common` or `per_response`.
    pub levels: Levels,
}

/// Responses that are gathered one by one.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    sources: Vec<Source>,
    receivers: Vec<Receiver>,
    responses: Vec<NewResponse>,
}

impl Survey {
    /// Adds a response between two places in metres.
    ///
    /// # Errors
    /// A place is refused.
    pub fn add(&mut self, samples: ImpulseResponse, [from, to]: [[f64; 3]; 2]) -> Result<(), Error> {
        let known = self.sources.iter().position(|source| source.position_m == from);
        let source = match known {
            Some(index) => self.sources[index].id.clone(),
            None => {
                let id = format!("s{}", self.sources.len() + 1);
                self.sources.push(Source::omni(&id, from)?);
                id
            }
        };
        let known = self.receivers.iter().position(|receiver| receiver.position_m == to);
        let receiver = match known {
            Some(index) => self.receivers[index].id.clone(),
            None => {
                let id = format!("r{}", self.receivers.len() + 1);
                self.receivers.push(Receiver::omni(&id, to)?);
                id
            }
        };
        let name = format!("{}_{source}_{receiver}", self.responses.len() + 1);
        let response =
            NewResponse { source, receiver, name, air: None, session: None, recorded_at: None, samples };
        self.responses.push(response);
        Ok(())
    }

    /// The room with its responses, as the library has it.
    ///
    /// # Errors
    /// What [`RoomSpec::model`] and [`sabine_scene::NewRoom::in_memory`] say.
    pub fn room(&self, spec: &DiagnoseSpec) -> Result<MeasuredRoom, Error> {
        let set = Measurements {
            sources: self.sources.clone(),
            receivers: self.receivers.clone(),
            air: None,
            measurement: Measurement { time_zero: spec.time_zero, levels: spec.levels },
            shoebox_m: None,
            responses: self.responses.clone(),
            notes: Vec::new(),
        };
        Ok(set.into_room(spec.room.model()?, None).in_memory()?)
    }

    /// Says what the model gets wrong, in the form of `diagnosis.json`. The wave equation is left out: it takes minutes on one core.
    ///
    /// # Errors
    /// [`Error::OutOfRange`]; as [`Survey::room`] and [`Diagnoser::diagnose`].
    pub fn diagnose(&self, spec: &DiagnoseSpec, observer: &dyn Observer) -> Result<Value, Error> {
        OutOfRange::check("rays", spec.rays as f64, 100.0, MAX_RAYS, "between 100 and 20,000")?;
        let room = self.room(spec)?;
        let (rays, seed) = (spec.rays, spec.seed);
        let config = DiagnoseConfig { rays, seed, wave_solutions: false, ..DiagnoseConfig::default() };
        let found = Diagnoser::new(config)?.diagnose(&room, &[], observer)?;
        Ok(serde_json::to_value(&found)?)
    }
}
