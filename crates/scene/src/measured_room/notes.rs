//! What a user should know of a room before numbers are believed: its size, and what its file leaves open.

use super::{MaterialPrior, MeasuredRoom, turned};
use crate::mesh_file::mesh_options::LengthUnit;
use crate::mesh_file::up_axis::UpAxis;
use sabine_acoustics::Engineering;
use std::fmt;

/// A longer room than this, or a smaller one than that, may be in other units (m).
const LONGEST_M: f64 = 100.0;
const SHORTEST_M: f64 = 1.0;
/// Usual height of a room (m), which tells units apart, and how far from it a room may be (logarithm: four times).
const USUAL_HEIGHT_M: f64 = 3.0;
const MAX_MISFIT: f64 = 1.4;
/// Farther from the origin than this many times its size, and than 1 km, a room is oddly placed.
const FAR: f64 = 100.0;
const FAR_M: f64 = 1000.0;

/// Something that a user should know of a room; its text is one sentence.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RoomNote {
    /// The room file states no absorption for a material: a guess is used.
    GuessedAbsorption {
        /// Name of the material.
        material: String,
        /// Its area in m2.
        area_m2: f64,
        /// Its share of the room's equivalent absorption area under the guess, 0 to 1: least and largest over the bands.
        share: (f64, f64),
    },
    /// A material without table has the name of a library entry and takes its table.
    LibraryTable {
        /// Name of the material.
        material: String,
    },
    /// A material without table takes that of the mesh file.
    MeshTable {
        /// Name of the material.
        material: String,
    },
    /// The size is unusual in metres.
    UnusualSize {
        /// The longest side in m.
        longest_m: f64,
        /// The unit in which it would be usual.
        unit: Option<LengthUnit>,
    },
    /// The floor seems to be a wall.
    LiesOnItsSide {
        /// The axis that seems to point up.
        up_axis: UpAxis,
    },
    /// The room lies far from the origin of its coordinates.
    FarFromOrigin {
        /// How far, in m.
        distance_m: f64,
    },
    /// No surface absorbs anything.
    NothingAbsorbs {
        /// Centres of the bands, in Hz.
        bands_hz: Vec<f64>,
    },
}

impl fmt::Display for RoomNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::GuessedAbsorption { material, area_m2, share: (low, high) } => {
                let (low, high) = (100.0 * low, 100.0 * high);
                let share =
                    if high - low < 1.0 { format!("{high:.0}") } else { format!("{low:.0} to {high:.0}") };
                write!(
                    f,
                    "{material}: no absorption is stated; {} ± {} is a guess ({} m2, {share} % of the equivalent absorption area)",
                    MaterialPrior::UNKNOWN_ABSORPTION,
                    MaterialPrior::UNKNOWN_ABSORPTION_SD,
                    digits(*area_m2),
                )
            }
            Self::LibraryTable { material } => {
                write!(f, "{material}: no table; that of the material library is used")
            }
            Self::MeshTable { material } => {
                write!(f, "{material}: no table; that of the mesh file is used")
            }
            Self::UnusualSize { longest_m, unit: Some(unit) } => write!(
                f,
                "{} m long: is the mesh in {}? Then add units = \"{}\" to [room]",
                digits(*longest_m),
                unit.plural(),
                unit.symbol()
            ),
            Self::UnusualSize { longest_m, unit: None } => {
                write!(f, "{} m long: is the mesh in metres? [room] may state its units", digits(*longest_m))
            }
            Self::LiesOnItsSide { up_axis } => write!(
                f,
                "the floor seems to be a wall: does the {up_axis} axis of the mesh point up? Then add up_axis = \"{up_axis}\" to [room]"
            ),
            Self::FarFromOrigin { distance_m } => {
                write!(f, "the room lies {} m from the origin of its coordinates", digits(*distance_m))
            }
            Self::NothingAbsorbs { bands_hz } => {
                let list = bands_hz.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
                write!(f, "no surface absorbs sound at {list} Hz: only the air ends it")
            }
        }
    }
}

/// Four significant digits.
fn digits(value: f64) -> Engineering {
    if value == 0.0 || !value.is_finite() {
        return Engineering(value);
    }
    let scale = 10f64.powi(3 - value.abs().log10().floor() as i32);
    // Dividing by a power of ten gives the nearest number to the decimal; multiplying by its inverse does not.
    let rounded = (value * scale).round();
    Engineering(if scale.is_finite() && scale > 0.0 { rounded / scale } else { value })
}

impl MeasuredRoom {
    /// Size, volume and surface in one line, for the head of every output.
    ///
    /// ```
    /// let room = sabine_scene::MeasuredRoom::read("../../fixtures/room")?;
    /// assert_eq!(room.size_line(), "room: 8 x 6.8 x 3.96 m (along x, y, z), volume 145.7 m3, surface 187.3 m2");
    /// # Ok::<(), sabine_scene::Error>(())
    /// ```
    pub fn size_line(&self) -> String {
        let [low, high] = self.scene.bounds_m();
        let [x, y, z] = [0, 1, 2].map(|k| digits(high[k] - low[k]));
        let (volume, surface) = (digits(self.scene.volume_m3()), digits(self.scene.surface_m2()));
        format!("room: {x} x {y} x {z} m (along x, y, z), volume {volume} m3, surface {surface} m2")
    }

    /// What should be known before its numbers are believed; empty for a room that leaves no question.
    pub fn notes(&self) -> Vec<RoomNote> {
        let mut notes = Vec::new();
        let [low, high] = self.scene.bounds_m();
        let size = [0, 1, 2].map(|k| high[k] - low[k]);
        let longest_m = size.into_iter().fold(0.0, f64::max);
        let [units_stated, axis_stated] = self.stated;
        if !units_stated && !(SHORTEST_M..=LONGEST_M).contains(&longest_m) {
            notes.push(RoomNote::UnusualSize { longest_m, unit: likely_unit(size) });
        }
        let suspected = || turned::suspected(&self.scene, self.up_axis, &self.sources, &self.receivers);
        if let Some(up_axis) = (!axis_stated).then(suspected).flatten() {
            notes.push(RoomNote::LiesOnItsSide { up_axis });
        }
        let middle = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]));
        let distance_m = middle.iter().map(|c| c * c).sum::<f64>().sqrt();
        if distance_m > (FAR * longest_m).max(FAR_M) {
            notes.push(RoomNote::FarFromOrigin { distance_m });
        }
        let library = self.named_as_in_library.iter();
        notes.extend(library.map(|name| RoomNote::LibraryTable { material: name.clone() }));
        let mesh = self.described_by_mesh.iter();
        notes.extend(mesh.map(|name| RoomNote::MeshTable { material: name.clone() }));
        notes.extend(self.guessed());
        let bands = self.bands();
        let silent = |&(i, _): &(usize, f64)| {
            self.scene.materials().iter().all(|named| named.material.absorption().values()[i] <= 0.0)
        };
        let bands_hz: Vec<f64> = bands.iter_hz().enumerate().filter(silent).map(|(_, hz)| hz).collect();
        if !bands_hz.is_empty() {
            notes.push(RoomNote::NothingAbsorbs { bands_hz });
        }
        notes
    }

    /// The materials whose absorption the room file leaves open ([`RoomNote::GuessedAbsorption`]).
    pub fn guessed(&self) -> Vec<RoomNote> {
        let areas_m2 = self.scene.material_areas_m2();
        let materials = self.scene.materials();
        let absorption = |m: usize, band: usize| materials[m].material.absorption().values()[band];
        let share = |m: usize| {
            let of_band = |band: usize| {
                let whole: f64 = (0..materials.len()).map(|k| areas_m2[k] * absorption(k, band)).sum();
                if whole > 0.0 { areas_m2[m] * absorption(m, band) / whole } else { 0.0 }
            };
            let shares = (0..self.bands().len()).map(of_band);
            shares.fold((1.0f64, 0.0f64), |(low, high), share| (low.min(share), high.max(share)))
        };
        let unknown = |m: &usize| self.priors[*m].absorption.is_none();
        let note = |m: usize| RoomNote::GuessedAbsorption {
            material: materials[m].name.clone(),
            area_m2: areas_m2[m],
            share: share(m),
        };
        (0..materials.len()).filter(unknown).map(note).collect()
    }
}

/// The unit in which a room of this size in metres would be about 3 m high and neither too long nor too short, if there is one.
fn likely_unit(size: [f64; 3]) -> Option<LengthUnit> {
    let misfit = |unit: &LengthUnit| (size[2] * unit.metres() / USUAL_HEIGHT_M).ln().abs();
    let usual = |unit: &LengthUnit| {
        let longest_m = size.into_iter().fold(0.0, f64::max) * unit.metres();
        *unit != LengthUnit::Metre
            && (SHORTEST_M..=LONGEST_M).contains(&longest_m)
            && misfit(unit) < MAX_MISFIT
    };
    LengthUnit::ALL.into_iter().filter(usual).min_by(|a, b| misfit(a).total_cmp(&misfit(b)))
}
