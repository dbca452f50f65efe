//! What a simulation of a room gets wrong against measured responses.

use crate::failure::{Failure, refused};
use crate::interrupt::interruptible;
use crate::room::Room;
use pyo3::prelude::*;
use sabine::diagnose::{DiagnoseConfig, Diagnoser, catalogue};

/// Diagnoses a room that was read from a folder: the diagnosis as JSON, as in `diagnosis.json`, and the extended model as TOML.
///
/// # Errors
/// Settings are refused, the room has no responses, or what [`Diagnoser::diagnose`] says.
#[pyfunction]
pub fn diagnose(
    py: Python<'_>,
    room: &Room,
    rays: usize,
    effects: Option<Vec<String>>,
    hold_out: Vec<String>,
    seed: u64,
    allow_leaks: bool,
) -> Result<(String, String), Failure> {
    let measured = room.measured.as_ref().ok_or_else(|| {
        refused("room: it has no measured responses to compare with; read a room folder that has some")
    })?;
    let mut diagnoser =
        Diagnoser::new(DiagnoseConfig { rays, seed, allow_leaks, ..DiagnoseConfig::default() })?;
    if let Some(effects) = effects {
        diagnoser = diagnoser.with_only(&effects)?;
    }
    interruptible(py, |observer| {
        let diagnosis = diagnoser.diagnose(measured, &hold_out, observer)?;
        Ok((serde_json::to_string(&diagnosis)?, diagnosis.model.to_toml()?))
    })
}

/// Names of the effects that a diagnosis weighs.
#[pyfunction]
pub fn effects() -> Vec<String> {
    catalogue().iter().map(|effect| effect.info().id.to_string()).collect()
}
