//! What is hidden in a room.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// What the room file does not tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Planted {
    /// Nothing.
    Nothing,
    /// One microphone stands 15 to 30 cm elsewhere.
    Position,
    /// One material absorbs 0.2 to 0.3 more.
    Surface,
    /// The air is 6 to 10 K colder or warmer.
    Temperature,
    /// Recordings begin 2 to 5 ms late.
    Latency,
    /// One channel is 4 to 6 dB louder.
    Gain,
    /// One wall stands 20 to 45 cm farther out, or in.
    Wall,
    /// All surfaces scatter 0.3 to 0.45 more.
    Scattering,
    /// The loudspeaker has an octave response, 2.5 dB standard deviation.
    Response,
    /// A box of about 2 m x 0.8 m x 1 m stands in the room, and not in the mesh.
    Object,
}

impl Planted {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Nothing,
        Self::Position,
        Self::Surface,
        Self::Temperature,
        Self::Latency,
        Self::Gain,
        Self::Wall,
        Self::Scattering,
        Self::Response,
        Self::Object,
    ];

    /// Its name on a command line and in a record.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Position => "position",
            Self::Surface => "surface",
            Self::Temperature => "temperature",
            Self::Latency => "latency",
            Self::Gain => "gain",
            Self::Wall => "wall",
            Self::Scattering => "scattering",
            Self::Response => "response",
            Self::Object => "object",
        }
    }

    /// The effect that a diagnosis is to name, where its catalogue has one.
    pub fn effect(self) -> Option<&'static str> {
        match self {
            Self::Nothing => None,
            Self::Position => Some("position_error"),
            Self::Surface => Some("surface_absorption"),
            Self::Temperature => Some("sound_speed"),
            Self::Latency => Some("time_zero"),
            Self::Gain => Some("channel_fault"),
            Self::Wall => Some("surface_displacement"),
            Self::Scattering => Some("scattering"),
            Self::Response => Some("transducer_response"),
            Self::Object => Some("missing_object"),
        }
    }
}

impl fmt::Display for Planted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Planted {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|p| p.name() == text)
            .ok_or_else(|| format!("{text}: one of {} was expected", names()))
    }
}
