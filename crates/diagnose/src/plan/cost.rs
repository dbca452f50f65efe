//! What a measurement takes, in minutes.

use crate::plan::error::PlanError;
use crate::plan::measurement::{Kind, PlannedMeasurement};
use sabine_acoustics::OutOfRange;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Minutes that each kind of measurement takes.
///
/// ```
/// use sabine_diagnose::CostTable;
/// let table = CostTable::from_toml("climate_min = 240.0\n".as_ref(), "cost.toml".as_ref())?;
/// assert_eq!((table.climate_min, table.microphone_min), (240.0, 2.0));
/// assert!(CostTable::from_toml("climate = 240.0".as_ref(), "cost.toml".as_ref()).is_err());
/// # Ok::<(), sabine_diagnose::PlanError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CostTable {
    /// A microphone at another place.
    pub microphone_min: f64,
    /// A source at another place.
    pub source_min: f64,
    /// A source turned.
    pub source_turned_min: f64,
    /// Everything again in other air.
    pub climate_min: f64,
}

impl Default for CostTable {
    fn default() -> Self {
        Self { microphone_min: 2.0, source_min: 5.0, source_turned_min: 3.0, climate_min: 120.0 }
    }
}

impl CostTable {
    /// Longest time of a measurement: a week.
    const MAX_MIN: f64 = 10_080.0;
    /// Shortest: a second.
    const MIN_MIN: f64 = 1.0 / 60.0;

    /// Of a TOML file with any of the fields of this type; those that it lacks have their defaults.
    ///
    /// # Errors
    /// [`PlanError::CostFile`], and as [`CostTable::from_toml`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, PlanError> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path)
            .map_err(|source| PlanError::CostFile { path: path.to_owned(), source })?;
        Self::from_toml(&text, path)
    }

    /// Of the text of such a file, which has this path.
    ///
    /// # Errors
    /// [`PlanError::CostTable`] for what is no table of these fields, [`PlanError::Cost`] for a time that is not between a second and a week.
    pub fn from_toml(text: &str, path: &Path) -> Result<Self, PlanError> {
        let table: Self = toml::from_str(text)
            .map_err(|source| PlanError::CostTable { path: path.to_owned(), source: Box::new(source) })?;
        table.check().map_err(|source| PlanError::Cost { path: path.to_owned(), source })?;
        Ok(table)
    }

    /// Checks all times.
    pub(crate) fn check(&self) -> Result<(), OutOfRange> {
        let times = [
            ("microphone_min", self.microphone_min),
            ("source_min", self.source_min),
            ("source_turned_min", self.source_turned_min),
            ("climate_min", self.climate_min),
        ];
        times.into_iter().try_for_each(|(field, minutes)| {
            OutOfRange::check(field, minutes, Self::MIN_MIN, Self::MAX_MIN, "between a second and a week")
        })
    }

    /// Minutes of a measurement.
    pub fn minutes(&self, measurement: &PlannedMeasurement) -> f64 {
        match measurement.kind() {
            Kind::Microphone => self.microphone_min,
            Kind::Source => self.source_min,
            Kind::SourceTurned => self.source_turned_min,
            Kind::Climate => self.climate_min,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_tables_are_refused_by_file_and_field() {
        let refused = |text: &str| match CostTable::from_toml(text, Path::new("my/cost.toml")) {
            Ok(table) => panic!("{table:?}"),
            Err(error) => error.to_string(),
        };
        for (text, words) in [
            ("microphone_min = -1.0", "microphone_min"),
            ("climate_min = nan", "climate_min"),
            ("source_min = \"five\"", "source_min"),
            ("silence_min = 1.0", "silence_min"),
            ("minutes", "expected"),
        ] {
            let message = refused(text);
            assert!(message.contains("my/cost.toml") && message.contains(words), "{message}");
        }
        let missing = CostTable::read("/nowhere/cost.toml");
        assert!(matches!(missing, Err(PlanError::CostFile { .. })));
    }
}
