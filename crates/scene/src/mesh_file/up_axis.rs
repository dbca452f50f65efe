//! Which axis of a mesh file points up.

#[cfg(feature = "rooms")]
use serde::{Deserialize, Serialize};
use std::fmt;

/// The axis of a mesh file that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "rooms", derive(Deserialize, Serialize))]
#[cfg_attr(feature = "rooms", serde(rename_all = "lowercase"))]
pub enum UpAxis {
    /// y: (x, y, z) of the file becomes (x, -z, y).
    Y,
    /// z: coordinates are taken as they are.
    Z,
}

impl UpAxis {
    /// The point of a file, z up.
    pub(crate) fn turned(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Y => [x, -z, y],
            Self::Z => [x, y, z],
        }
    }

    /// The other axis.
    #[cfg(feature = "rooms")]
    pub(crate) fn other(self) -> Self {
        match self {
            Self::Z => Self::Y,
            Self::Y => Self::Z,
        }
    }

    /// What a point that was read with this axis up would be with the other.
    #[cfg(any(feature = "rooms", feature = "gltf"))]
    pub(crate) fn to_other(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Z => [x, -z, y],
            Self::Y => [x, z, -y],
        }
    }
}

impl fmt::Display for UpAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Y => "y",
            Self::Z => "z",
        })
    }
}
