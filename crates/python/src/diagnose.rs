//! What a simulation of a room gets wrong against measured responses.

use crate::failure::{Failure, refused};
use crate::interrupt::interruptible;
use crate::laws::Laws;
use crate::model::ExtendedModel;
use crate::room::Room;
use pyo3::prelude::*;
use sabine::diagnose::{DiagnoseConfig, Diagnoser, catalogue};

/// How to diagnose, as `sabine.diagnose` says it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Settings<'py> {
    rays: usize,
    effects: Option<Vec<String>>,
    also: Vec<String>,
    hold_out: Vec<String>,
    laws: Option<PyRef<'py, Laws>>,
    discover: String,
    model: Option<PyRef<'py, ExtendedModel>>,
    seed: u64,
    allow_leaks: bool,
}

impl Settings<'_> {
    fn diagnoser(&self) -> Result<Diagnoser, Failure> {
        let Self { rays, seed, allow_leaks, .. } = *self;
        let mut diagnoser =
            Diagnoser::new(DiagnoseConfig { rays, seed, allow_leaks, ..DiagnoseConfig::default() })?;
        if let Some(effects) = &self.effects {
            diagnoser = diagnoser.with_only(effects)?;
        }
        diagnoser = diagnoser.with_also(&self.also)?;
        if let Some(laws) = &self.laws {
            let known = diagnoser.with_laws(laws.laws().to_vec());
            diagnoser = known.map_err(|error| refused(format!("laws: {error}")))?;
        }
        diagnoser = match self.discover.as_str() {
            "always" => diagnoser.discovering(),
            "if_needed" => diagnoser.discovering_if_needed(),
            "never" => diagnoser,
            other => {
                return Err(refused(format!("discover: {other:?} is none of always, if_needed, never")));
            }
        };
        if let Some(model) = &self.model {
            let started = diagnoser.starting_from(model.model());
            diagnoser = started.map_err(|error| refused(format!("model: {error}")))?;
        }
        Ok(diagnoser)
    }
}

/// Diagnoses a room that was read from a folder: the diagnosis as JSON, as in `diagnosis.json`, and the extended model as TOML.
///
/// # Errors
/// Settings are refused, the room has neither responses nor tables, or what [`Diagnoser::diagnose`] says.
#[pyfunction]
pub fn diagnose(py: Python<'_>, room: &Room, settings: Settings<'_>) -> Result<(String, String), Failure> {
    let measured = room.measured.as_ref().ok_or_else(|| {
        refused("room: it has no measured responses, and no tables of parameters, to compare with; read a room folder that has some")
    })?;
    let (diagnoser, hold_out) = (settings.diagnoser()?, settings.hold_out);
    interruptible(py, |observer| {
        let diagnosis = diagnoser.diagnose(measured, &hold_out, observer)?;
        let mut document = serde_json::to_value(&diagnosis)?;
        document["threshold_nats"] = diagnoser.threshold_nats().into();
        Ok((document.to_string(), diagnosis.model.to_toml()?))
    })
}

/// Names of the effects that a diagnosis weighs.
#[pyfunction]
pub fn effects() -> Vec<String> {
    catalogue().iter().map(|effect| effect.info().id.to_string()).collect()
}
