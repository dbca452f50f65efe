//! How the coordinates of a mesh file are meant, and which files it may name.

use crate::Error;
use crate::error::check_range;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::PathBuf;

/// The unit of a mesh file's coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
pub enum LengthUnit {
    /// Metre.
    #[default]
    #[serde(rename = "m")]
    Metre,
    /// Centimetre.
    #[serde(rename = "cm")]
    Centimetre,
    /// Millimetre.
    #[serde(rename = "mm")]
    Millimetre,
    /// Inch, 25.4 mm.
    #[serde(rename = "in")]
    Inch,
    /// Foot, 0.3048 m.
    #[serde(rename = "ft")]
    Foot,
}

impl LengthUnit {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Metre, Self::Centimetre, Self::Millimetre, Self::Inch, Self::Foot];

    /// Its length in metres.
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 0.01,
            Self::Millimetre => 0.001,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
        }
    }

    /// Its symbol, as in `room.toml`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::Inch => "in",
            Self::Foot => "ft",
        }
    }

    /// Its name in the plural.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Metre => "metres",
            Self::Centimetre => "centimetres",
            Self::Millimetre => "millimetres",
            Self::Inch => "inches",
            Self::Foot => "feet",
        }
    }
}

/// The axis of a mesh file that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
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
    pub(crate) fn other(self) -> Self {
        match self {
            Self::Z => Self::Y,
            Self::Y => Self::Z,
        }
    }

    /// What a point that was read with this axis up would be with the other.
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

/// How [`crate::Mesh::read_with`] reads a mesh file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshOptions {
    /// Unit of the coordinates; default metres.
    pub unit: LengthUnit,
    /// The axis that points up; `None`: z in OBJ, y in glTF, as that format says.
    pub up_axis: Option<UpAxis>,
    /// Folder below which all files that the mesh names must lie; `None`: the folder of the mesh.
    pub folder: Option<PathBuf>,
    /// Read files outside that folder, too: only for meshes that you trust.
    pub allow_outside: bool,
}

/// From coordinates of a file to metres, z up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    pub unit: LengthUnit,
    pub up_axis: UpAxis,
}

impl Placement {
    pub fn apply(&self, point: [f64; 3]) -> Result<[f64; 3], Error> {
        let metres = self.up_axis.turned(point).map(|c| c * self.unit.metres());
        for c in metres {
            check_range("vertex coordinate (m)", c, -1e5, 1e5, "finite and within 100 km")?;
        }
        Ok(metres)
    }
}
