//! Readings per octave as a page shows them: value, interval, or the reason why there is none.

use sabine_acoustics::{PerBand, Reading};
use serde::Serialize;

/// Quantile of the 95 % interval.
const QUANTILE: f64 = 1.96;

/// A value with its 95 % interval, or a reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// What was read.
    Value {
        /// The value.
        value: f64,
        /// Lower end of the 95 % interval.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// Why nothing was read.
    Absent {
        /// In words.
        reason: String,
    },
}

/// A quantity in all bands.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its symbol in ISO 3382.
    pub name: &'static str,
    /// Its unit; empty where it has none.
    pub unit: &'static str,
    /// One for each band.
    pub cells: Vec<Cell>,
}

impl Row {
    /// The readings of a quantity.
    pub fn new(name: &'static str, unit: &'static str, readings: &PerBand<Reading>) -> Self {
        let cell = |reading: &Reading| match reading {
            Ok(estimate) => {
                let (low, high) = estimate.interval(QUANTILE);
                Cell::Value { value: estimate.value, low, high }
            }
            Err(reason) => Cell::Absent { reason: reason.to_string() },
        };
        Self { name, unit, cells: readings.values().iter().map(cell).collect() }
    }
}
