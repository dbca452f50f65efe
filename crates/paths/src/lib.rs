//! Paths of sound: the seam between tracing a room and everything after it.
//!
//! A tracer ([`Propagator`]) turns a scene, a source and a receiver into a [`PathSet`]; fits, renderers and diagnoses take it
//! from there. Absorption, air, directivity and the speed of sound change **without tracing again** ([`Conditions`]).
//!
//! ```text
//!  Scene, Source, Receiver ─► Propagator ─► PathSet ─┬─► energies ─► EnergyResponse ─► PathParameters (T30, C50, ...)
//!                                      Conditions ───┴─► sabine-optimize, sabine-propagate (sound), sabine-diagnose
//! ```
//!
//! ```toml
//! [dependencies]
//! sabine-paths = "0.1"
//! ```
//!
//! # Example
//! A floor's absorption changes, and with it the energy of its reflection:
//! ```
//! use sabine_acoustics::{Air, Bands, Material};
//! use sabine_paths::{Conditions, Contribution, PathSet, Reflection};
//!
//! let mut paths = PathSet::new(1, 100.0);
//! let floor = paths.reflect(PathSet::DIRECT, 0, Reflection::Specular);
//! let up = [0.0, 0.0, 1.0];
//! paths.push(Contribution {
//!     length_m: 5.0, log_weight: -2.0 * 5f64.ln(), chain: floor, tail: PathSet::DIRECT,
//!     departure: up, arrival: up, batch: None });
//! let bands = Bands::octaves(125.0, 125.0)?;
//! let energy = |absorption| -> Result<f32, sabine_acoustics::Error> {
//!     let floor = [Material::uniform(bands, absorption, 0.0)?];
//!     Ok(paths.energies(&Conditions::new(&floor, &Air::default()))?[0][0])
//! };
//! assert!((energy(0.6)? / energy(0.2)? - 0.5).abs() < 1e-6);
//! # Ok::<(), sabine_acoustics::Error>(())
//! ```
//!
//! # Contents
//! - [`PathSet`]: for every [`Contribution`] length, geometric weight, chain of [`Reflection`]s with material and angle of
//!   [`Incidence`], departure and arrival; [`EdgeDiffraction`].
//! - [`Conditions`]: materials, air, directivity and orientation of both ends, and [`laws`]: formulas that change what paths carry.
//! - [`conformance::check`]: what any [`Propagator`] must get right, for authors of tracers.
//! - [`PathParameters`]: parameters of ISO 3382-1 with the standard errors that the rays and the materials' tables leave.
//! - Traits: [`Propagator`] finds paths, [`RayScene`] answers which surface a ray meets first, [`Encoder`] puts sound from a
//!   direction into channels.
//!
//! # Does not
//! - trace or render: that is `sabine-propagate`, or any other implementor of its traits.
//! - know waves: a path carries energy; its phase is the renderer's.
//!
//! It has no error type of its own: what goes wrong with paths is a wrong value, [`sabine_acoustics::Error`].
//!
//! # Units
//! Metres, seconds, shares of energy. Energies are relative to that of the direct sound at 1 m.
//!
//! # Accuracy
//! | what | how good | shown by |
//! |---|---|---|
//! | standard errors of the parameters of paths | within 20 % of the spread over seeds (found: 7 %) | `tests/it/path_parameters.rs` |
//! | errors that uncertain absorption leaves in T30 | within 10 % of the spread over draws, 25 % for unknown materials (found: 4 and 6 %) | `tests/it/material_errors.rs` |
//!
//! # Features
//! - `threads` (default): paths are weighed on all threads (rayon). The numbers are the same without.
//! - `serde`: laws are read and written as tables of TOML or JSON.
//!
//! # References
//! - ISO 3382-1:2009. H. Kuttruff: Room Acoustics, 6th edition, 2017.
//! - B. Efron: The Jackknife, the Bootstrap and Other Resampling Plans, 1982 (standard errors over batches of rays).

mod conditions;
pub mod conformance;
mod edge_diffraction;
mod encoder;
pub mod laws;
mod packed_direction;
mod parallel;
mod path_parameters;
mod path_set;
mod propagator;
mod ray_scene;
mod reweighting;

pub use conditions::Conditions;
pub use edge_diffraction::{EdgeDiffraction, EdgePoint};
pub use encoder::Encoder;
pub use path_parameters::PathParameters;
pub use path_set::{Contribution, Incidence, PathSet, Reflection};
pub use propagator::Propagator;
pub use ray_scene::{RayHit, RayScene};
