//! How well a room file says that its places are known.

use super::file::{MeasurementTable, PlaceTable};
use crate::error::Error;
use sabine_acoustics::{Error as ValueError, OutOfRange};
use std::collections::BTreeMap;
use std::path::Path;

/// How well places are known, as the room file states it: one standard deviation along each axis, 0.1 mm to 1 m.
///
/// ```
/// use sabine_scene::PositionSd;
/// let stated = PositionSd {
///     all_m: Some(0.02),
///     receivers_m: [("r7".to_owned(), 0.1)].into(), // read off a photograph
///     ..PositionSd::default()
/// };
/// assert_eq!((stated.receiver_m("r1"), stated.receiver_m("r7")), (Some(0.02), Some(0.1)));
/// assert_eq!(PositionSd::default().source_m("s1"), None); // PositionSd::DEFAULT_M is then to be assumed
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PositionSd {
    /// Of every place that has none of its own: `position_sd_m` of `[measurement]`.
    pub all_m: Option<f64>,
    /// Of single sources, by name.
    pub sources_m: BTreeMap<String, f64>,
    /// Of single receivers, by name.
    pub receivers_m: BTreeMap<String, f64>,
}

impl PositionSd {
    /// What is assumed where the file is silent: places taken with a tape measure.
    pub const DEFAULT_M: f64 = 0.01;

    /// Of a source; none where the file is silent.
    pub fn source_m(&self, id: &str) -> Option<f64> {
        self.sources_m.get(id).copied().or(self.all_m)
    }

    /// Of a receiver; none where the file is silent.
    pub fn receiver_m(&self, id: &str) -> Option<f64> {
        self.receivers_m.get(id).copied().or(self.all_m)
    }

    /// What the file states.
    pub(super) fn read(
        path: &Path,
        measurement: Option<&MeasurementTable>,
        sources: &[PlaceTable],
        receivers: &[PlaceTable],
    ) -> Result<Self, Error> {
        let all_m = measurement.and_then(|table| table.position_sd_m);
        if let Some(sd_m) = all_m {
            check(sd_m).map_err(|error| error.in_file(path, "measurement.position_sd_m"))?;
        }
        let own = |kind: &str, tables: &[PlaceTable]| -> Result<BTreeMap<String, f64>, Error> {
            let mut found = BTreeMap::new();
            for (i, table) in tables.iter().enumerate() {
                let Some(sd_m) = table.position_sd_m else { continue };
                check(sd_m).map_err(|error| error.in_file(path, format!("{kind}[{i}].position_sd_m")))?;
                found.insert(table.id.clone(), sd_m);
            }
            Ok(found)
        };
        Ok(Self { all_m, sources_m: own("sources", sources)?, receivers_m: own("receivers", receivers)? })
    }

    /// A name that no place has would be lost in the file.
    pub(super) fn check_names<'a>(
        &self,
        sources: impl Iterator<Item = &'a str> + Clone,
        receivers: impl Iterator<Item = &'a str> + Clone,
    ) -> Result<(), Error> {
        let unknown_source =
            self.sources_m.keys().find(|id| sources.clone().all(|known| known != id.as_str()));
        let unknown = unknown_source
            .or(self.receivers_m.keys().find(|id| receivers.clone().all(|known| known != id.as_str())));
        match unknown {
            Some(id) => Err(ValueError::UnknownId { id: id.clone() }.into()),
            None => Ok(()),
        }
    }
}

fn check(sd_m: f64) -> Result<(), ValueError> {
    OutOfRange::check("position_sd_m", sd_m, 1e-4, 1.0, "between 0.1 mm and 1 m")?;
    Ok(())
}
