//! How the coordinates of a mesh file are meant, and which files it may name.

use crate::error::Error;
use crate::mesh_file::up_axis::UpAxis;
use sabine_acoustics::OutOfRange;
#[cfg(feature = "rooms")]
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The unit of a mesh file's coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "rooms", derive(Deserialize, Serialize))]
pub enum LengthUnit {
    /// Metre.
    #[default]
    #[cfg_attr(feature = "rooms", serde(rename = "m"))]
    Metre,
    /// Centimetre.
    #[cfg_attr(feature = "rooms", serde(rename = "cm"))]
    Centimetre,
    /// Millimetre.
    #[cfg_attr(feature = "rooms", serde(rename = "mm"))]
    Millimetre,
    /// Inch, 25.4 mm.
    #[cfg_attr(feature = "rooms", serde(rename = "in"))]
    Inch,
    /// Foot, 0.3048 m.
    #[cfg_attr(feature = "rooms", serde(rename = "ft"))]
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
            OutOfRange::check("vertex coordinate (m)", c, -1e5, 1e5, "finite and within 100 km")?;
        }
        Ok(metres)
    }
}
