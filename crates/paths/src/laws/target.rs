//! What a law changes.

use crate::laws::unit::{Dimension, Unit};
use std::fmt;

/// What a law changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LawTarget {
    /// The energy of each path, in dB.
    Path,
    /// The energy at each meeting with a surface, in dB.
    Reflection,
    /// The arrival of each path, in ms.
    Delay,
    /// Energy that joins, per second, in dB re the direct sound at 1 m.
    Added,
    /// The recorded energy, in dB.
    Recorder,
}

impl LawTarget {
    /// All targets.
    pub const ALL: [Self; 5] = [Self::Path, Self::Reflection, Self::Delay, Self::Added, Self::Recorder];

    /// Its name in a file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::Reflection => "reflection",
            Self::Delay => "delay",
            Self::Added => "added",
            Self::Recorder => "recorder",
        }
    }

    /// The target of a name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|target| target.name() == name)
    }

    /// The unit of its formulas, in words.
    pub(crate) fn unit_text(self) -> &'static str {
        if self == Self::Delay { "a time" } else { "dB" }
    }

    /// The unit of its formulas.
    pub(crate) fn dimension(self) -> Dimension {
        if self == Self::Delay { Unit::SECOND } else { Unit::DECIBEL }
    }
}

impl fmt::Display for LawTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
