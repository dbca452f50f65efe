//! Laws: short formulas that change what the model predicts.
//!
//! A [`Law`] is read, unit-checked, printed, differentiated and applied by the code of this module, no matter who wrote it. [`BoundLaws`] are laws whose
//! names have been found in a room ([`LawSite`]); [`Conditions`](crate::Conditions) carry them, so that energies, pressure, ambisonics and
//! parameters of paths have them.
//!
//! ```
//! use sabine_acoustics::{Air, Bands, Material};
//! use sabine_paths::laws::{BoundLaws, Law, LawParameter, LawSite, LawTarget};
//! use sabine_paths::{Conditions, Contribution, PathSet};
//! use sabine_scene::{Receiver, Scene, Source};
//!
//! let bands = Bands::octaves(500.0, 1000.0)?;
//! let scene = Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(|_| Material::uniform(bands, 0.1, 0.1).unwrap()))?;
//! let (source, receiver) = (Source::omni("s", [1.0; 3])?, Receiver::omni("r", [2.0; 3])?);
//! // Air takes another decibel for every 10 m, from 1 kHz up.
//! let a = LawParameter::new(0.1, [0.05, 0.2], "dB/m");
//! let law = Law::new("haze", LawTarget::Path, None, "-a * length_m * above(frequency_hz, f0)",
//!     [("a", a), ("f0", LawParameter::new(1.0, [0.7, 1.4], "kHz"))])?;
//! let (air, wall) = (Air::default(), [Material::uniform(bands, 0.1, 0.1)?]);
//! let laws = BoundLaws::new(&[law], &LawSite::new(&scene, &source, &receiver, &air))?;
//!
//! let mut paths = PathSet::new(1, 100.0);
//! let up = [0.0, 0.0, 1.0];
//! paths.push(Contribution {
//!     length_m: 20.0, log_weight: 0.0, chain: PathSet::DIRECT, tail: PathSet::DIRECT,
//!     departure: up, arrival: up, batch: None });
//! let conditions = Conditions::new(&wall, &air);
//! let (plain, hazy) = (paths.energies(&conditions)?, paths.energies(&conditions.with_laws(&laws))?);
//! assert_eq!(plain[0], hazy[0]);
//! assert!((10.0 * (hazy[1][0] / plain[1][0]).log10() + 2.0).abs() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Limits
//! - Paths record no heights, no azimuth about a surface's normal, no side of it and no plane: laws that ask for them are refused by name
//!   ([`LawFault::NotKnown`]), as is `level_db`.
//! - `delay` is the same in all bands.
//! - Formulas of at most 2,000 characters, nested 64 deep; 32 laws together; they add at most 200 dB to a path.

mod angles;
mod applied;
mod arithmetic;
mod blocks;
mod bound;
mod check;
mod columns;
mod error;
mod formula;
mod gain;
mod law;
mod parser;
mod reflections;
#[cfg(feature = "serde")]
mod table;
mod target;
mod unit;
mod values;
mod variable;

pub(crate) use applied::{AddedEnergy, PathLaws, delays_s};
pub use bound::{BoundLaws, LawSite, end_variable};
pub(crate) use columns::BLOCK;
pub(crate) use columns::Counted;
pub use error::{LawError, LawFault, Place};
pub use law::{Law, LawParameter};
pub use target::LawTarget;
pub use unit::Unit;
pub use values::{LawVariable, PathVariable};
