//! What could be measured next.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A measurement that could be made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
#[non_exhaustive]
pub enum PlannedMeasurement {
    /// A microphone at another place, with all sources.
    Microphone {
        /// Metres.
        position_m: [f64; 3],
    },
    /// A source at another place, its orientation kept, heard at the microphones of the room file.
    Source {
        /// Its name.
        source: String,
        /// Metres.
        position_m: [f64; 3],
    },
    /// A source turned about the vertical where it stands, heard at the microphones of the room file.
    SourceTurned {
        /// Its name.
        source: String,
        /// Degrees to its left.
        degrees: f64,
    },
    /// Everything again in other air.
    Climate {
        /// Degrees Celsius.
        temperature_c: f64,
        /// Per cent.
        relative_humidity_percent: f64,
    },
}

/// The kinds of measurements, for their cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Microphone,
    Source,
    SourceTurned,
    Climate,
}

impl PlannedMeasurement {
    pub(crate) fn kind(&self) -> Kind {
        match self {
            Self::Microphone { .. } => Kind::Microphone,
            Self::Source { .. } => Kind::Source,
            Self::SourceTurned { .. } => Kind::SourceTurned,
            Self::Climate { .. } => Kind::Climate,
        }
    }

    /// Where a microphone or a source would stand, in metres.
    pub fn position_m(&self) -> Option<[f64; 3]> {
        match self {
            Self::Microphone { position_m } | Self::Source { position_m, .. } => Some(*position_m),
            _ => None,
        }
    }
}

impl fmt::Display for PlannedMeasurement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Microphone { position_m: [x, y, z] } => {
                write!(f, "a microphone at ({x:.2}, {y:.2}, {z:.2}) m")
            }
            Self::Source { source, position_m: [x, y, z] } => {
                write!(f, "source {source} at ({x:.2}, {y:.2}, {z:.2}) m")
            }
            Self::SourceTurned { source, degrees } => {
                write!(f, "source {source} turned by {degrees:.0} degrees to its left")
            }
            Self::Climate { temperature_c, relative_humidity_percent } => {
                write!(
                    f,
                    "everything again at {temperature_c:.0} deg C and {relative_humidity_percent:.0} % humidity"
                )
            }
        }
    }
}
