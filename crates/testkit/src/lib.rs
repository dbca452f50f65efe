//! Oracles for Sabine's tests: slow, plain, and sharing no code with what they test.
//!
//! This crate is never published. It imports `sabine-acoustics` alone, for the vocabulary: geometry, air, filters and random
//! walks are written here a second time, in another way than in the crates under test.
//!
//! - [`ShoeboxImages`]: all image sources of a box, as energy, as pressure and as a [`PathSet`](sabine_paths::PathSet).
//! - [`BoxModes`]: standing waves of a box whose walls have an impedance, exactly.
//! - [`WaveGrid`]: the wave equation in a box with thin screens, by finite differences.
//! - [`BruteForceRays`]: every ray against every triangle.
//! - [`Phonons`]: particles in any closed mesh, as energy with standard errors and as pressure: the truth behind the
//!   recording in `fixtures/`.
//! - [`Laboratory`]: random rooms, measured with any of the effects of [`Hidden`] at work.
//! - [`PolyhedralRoom`]: random rooms that are no box, by image sources in any mesh and particles.
//! - [`ScreenedRoom`]: random rooms with a screen, measured by [`WaveGrid`].
//! - [`assert_close`], [`assert_all_close`], [`assert_within_standard_errors`], [`read_golden`]: tolerances that say what they allow.
//!
//! What it does **not** do: run fast, read files of users, or follow diffraction but in [`WaveGrid`].
//!
//! ```
//! use sabine_acoustics::{Bands, Material};
//! use sabine_scene::{Receiver, Scene, Source};
//! use sabine_testkit::ShoeboxImages;
//! let bands = Bands::octaves(1000.0, 1000.0)?;
//! let hard = Material::uniform(bands, 0.1, 0.0)?;
//! let room = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| hard.clone()))?;
//! let (source, receiver) = (Source::omni("s", [2.0, 3.0, 1.5])?, Receiver::omni("r", [7.0, 4.0, 1.6])?);
//! let energy = ShoeboxImages::new(2.5)?.energy_response(&room, &source, &receiver, None, 5e-3)?;
//! // This room is not diffuse: Eyring says 1.327 s.
//! let t30_s = energy.decay_curve(0).decay_time_s(-5.0, -35.0)?;
//! assert!((t30_s - 2.118).abs() < 0.02, "{t30_s}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Lengths in metres, times in seconds, energies relative to the direct sound at 1 m.
//!
//! Accuracy: `tests/it/oracles.rs` holds the oracles against closed forms and against each other. References: J. B. Allen and D. A. Berkley, JASA 65
//! (1979) 943 (image sources); H. Kuttruff, *Room Acoustics* (particles, mean free path).

mod box_modes;
mod brute_force;
mod filter;
mod geometry;
mod laboratory;
mod night;
mod own_air;
mod phonons;
mod polyhedra;
mod shoebox;
mod tolerance;
mod wave_grid;

pub use box_modes::BoxModes;
pub use brute_force::BruteForceRays;
pub use laboratory::{
    End, Fault, Gap, Hidden, LabConfig, Laboratory, ScreenedConfig, ScreenedRoom, TrueMaterial,
    TrueMicrophone, TrueSession, TrueSource, Truth,
};
pub use night::at_night;
pub use phonons::{PhononConfig, PhononEnergy, Phonons};
pub use polyhedra::{MovedWall, Planted, PolyhedralConfig, PolyhedralRoom, Polyhedron};
pub use shoebox::{Image, ShoeboxImages};
pub use tolerance::{assert_all_close, assert_close, assert_within_standard_errors, read_golden};
pub use wave_grid::{GridResponse, ThinScreen, WaveGrid};
