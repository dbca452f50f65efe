//! Which measurement decides, before it is made.

use crate::failure::{Failure, refused};
use crate::interrupt::interruptible;
use crate::laws::Laws;
use crate::room::Room;
use pyo3::prelude::*;
use sabine::diagnose::{CostTable, DiagnoseConfig, OpenQuestion, PlanConfig, Planner};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// How to plan, as `sabine.plan` says it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Settings<'py> {
    laws: Option<PyRef<'py, Laws>>,
    microphones: usize,
    sources: usize,
    candidates: usize,
    clearance_m: f64,
    places_m: Vec<[f64; 3]>,
    minutes: BTreeMap<String, f64>,
    rays: usize,
    seed: u64,
    allow_leaks: bool,
}

/// Plans the next measurements of a room, after a diagnosis (`diagnosis.json`) or without one: the plan as JSON, as in `plan.json`, with each
/// measurement in words.
///
/// # Errors
/// Settings, laws or the diagnosis are refused, the room was not read from a folder, or what [`Planner::plan`] says.
#[pyfunction]
pub fn plan(
    py: Python<'_>,
    room: &Room,
    diagnosis: Option<String>,
    settings: Settings<'_>,
) -> Result<String, Failure> {
    let stated = room.measured.as_ref();
    let stated = stated.ok_or_else(|| refused("room: a plan is for a room folder; read one"))?;
    let Settings { rays, seed, allow_leaks, .. } = settings;
    let mut planner = Planner::new(PlanConfig {
        diagnose: DiagnoseConfig { rays, seed, allow_leaks, ..DiagnoseConfig::default() },
        microphones: settings.microphones,
        sources: settings.sources,
        candidates: settings.candidates,
        clearance_m: settings.clearance_m,
        places_m: settings.places_m,
        cost: cost(&settings.minutes)?,
    })?;
    if let Some(laws) = &settings.laws {
        planner =
            planner.with_laws(laws.laws().to_vec()).map_err(|error| refused(format!("laws: {error}")))?;
    }
    let mut question = None;
    if let Some(text) = &diagnosis {
        let asked = OpenQuestion::of_json(text, stated, |id| planner.knows(id));
        let (asked, mut found) = asked.map_err(|error| refused(format!("diagnosis: {error}")))?;
        found.retain(|law| !planner.knows(law.id()));
        planner = planner.with_laws(found).map_err(|error| refused(format!("diagnosis: {error}")))?;
        question = Some(asked);
    }
    interruptible(py, |observer| {
        let plan = planner.plan(stated, question.as_ref(), observer)?;
        let mut told: Value = serde_json::to_value(&plan)?;
        for (number, weighed) in plan.candidates.iter().enumerate() {
            told["candidates"][number]["words"] = json!(weighed.measurement.to_string());
        }
        Ok(told.to_string())
    })
}

fn cost(minutes: &BTreeMap<String, f64>) -> Result<CostTable, Failure> {
    let mut table = CostTable::default();
    for (kind, &minutes) in minutes {
        let field = match kind.as_str() {
            "microphone" => &mut table.microphone_min,
            "source" => &mut table.source_min,
            "source_turned" => &mut table.source_turned_min,
            "climate" => &mut table.climate_min,
            other => {
                return Err(refused(format!(
                    "minutes: {other:?} is none of microphone, source, source_turned, climate"
                )));
            }
        };
        *field = minutes;
    }
    Ok(table)
}
