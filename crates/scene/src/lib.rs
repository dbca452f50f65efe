//! Rooms: what encloses the sound, where it starts and where it is heard, and how rooms come from and go to disk.
//!
//! It stands between the vocabulary (`sabine-acoustics`) and the paths (`sabine-paths`): a tracer takes a [`Scene`], a
//! [`Source`] and a [`Receiver`] from here.
//!
//! ```text
//!  OBJ, glTF ─► Mesh ─┐
//!  room.toml ─────────┼─► MeasuredRoom ─► Scene, Source, Receiver, material priors, responses
//!  floor plan ─► DrawnRoom ─► a room folder, ready to be read
//! ```
//!
//! ```toml
//! [dependencies]
//! sabine-scene = "0.1"
//! ```
//!
//! # Example
//! A room of 4 x 5 x 3 m and what theory expects of it:
//! ```
//! use sabine_acoustics::{Air, Bands, Material};
//! use sabine_scene::{DiffuseRoom, FloorPlan, NamedMaterial, schroeder_frequency_hz};
//!
//! let bands = Bands::octaves(500.0, 2000.0)?;
//! let surface = |name: &str, absorption| -> Result<NamedMaterial, sabine_acoustics::Error> {
//!     Ok(NamedMaterial { name: name.into(), material: Material::uniform(bands, absorption, 0.1)? })
//! };
//! let plan = FloorPlan::rectangle(4.0, 5.0)?;
//! // Floor, ceiling and four walls by index.
//! let scene = plan.extruded(3.0, vec![surface("carpet", 0.3)?, surface("plaster", 0.1)?], [0, 1], &[1; 4])?;
//! assert!((scene.volume_m3() - 60.0).abs() < 1e-9);
//!
//! // Sabine: 0.161 V / A, and a little air.
//! let t60_s = DiffuseRoom::of_scene(&scene, &Air::default(), bands)?.at_hz(500.0).unwrap().sabine_t60_s();
//! assert!((t60_s - 0.161 * 60.0 / (20.0 * 0.3 + 74.0 * 0.1)).abs() < 0.02);
//! assert!((schroeder_frequency_hz(t60_s, 60.0) - 220.0).abs() < 10.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Contents
//! - [`Scene`]: triangles with [`NamedMaterial`]s; [`Source`], [`Receiver`]; [`WeldReport`] of what was closed in a mesh.
//! - [`Mesh`]: OBJ, and glTF with the feature `gltf`; units and the axis that points up ([`MeshOptions`]).
//! - [`FloorPlan`]: corners of a room, or four of a rectangle.
//! - Theory of diffuse fields, kept apart from measurement: [`DiffuseRoom`] (Sabine, Eyring, Millington, Fitzroy,
//!   Arau-Puchades, critical distance, mean free path), [`schroeder_frequency_hz`].
//! - With the feature `rooms`: [`MeasuredRoom`] (a folder with `room.toml`, a mesh, responses and tables of parameters), [`Materials`] (tables of
//!   absorption from file to file), [`DrawnRoom`] (a folder from a floor plan), [`NewRoom`] (a folder from measurements),
//!   [`Measurements`] (responses and places from REW's text, tables and SOFA files), [`RoomModel`] (what to put them into).
//!
//! # Does not
//! - trace: `sabine-paths` has the trait, `sabine-propagate` a tracer.
//! - repair meshes beyond welding vertices: what leaks is for the tracer to find and say.
//! - read BIM or CAD files, textures, or anything outside a room's folder unless asked.
//!
//! # Units
//! Metres, x y z with z up once a mesh is read; Hz, degrees Celsius, kPa. Absorption and scattering are shares of energy at random
//! incidence, 0 to 1.
//!
//! # Accuracy
//! | what | how good | shown by |
//! |---|---|---|
//! | OBJ files | as `tobj` reads them | `tests/it/obj_against_tobj.rs` |
//! | rooms from and to disk | every fault of the format has its error; a written room reads as it was | `tests/it/measured_rooms.rs`, `tests/it/room_reading.rs` |
//! | SOFA files | those of Python's `sofar` to the bit; written ones read by `sofar`, `netCDF4`, `h5py` | `tests/it/sofa_files.rs`, `docs/validation/peers/sofa_peers.py` |
//! | answers of REW's local interface | to the bit; refusals, silence, damage each have their error (a mock server; no REW was at hand) | `tests/it/rew_server.rs` |
//! | hostile sizes | refused before memory is taken | `tests/it/hostile_sizes.rs` |
//!
//! # Features
//! - `rooms` (default): room folders and tables of materials.
//! - `gltf`: [`Mesh::read`] reads glTF and GLB besides OBJ.
//! - `rew-http`: responses from the Room EQ Wizard while it runs ([`Measurements::read_rew`]).
//! - `sofa`: room responses from and to SOFA files (AES69).
//! - `tables`: tables of sound files and positions (CSV).
//!
//! # References
//! - H. Kuttruff: Room Acoustics, 6th edition, 2017.
//! - H. Arau-Puchades: An improved reverberation formula. Acustica 65, 1988.

mod error;
mod floor_plan;
#[cfg(any(feature = "rooms", feature = "gltf"))]
mod inside_folder;
#[cfg(feature = "rooms")]
mod measured_room;
#[cfg(feature = "rooms")]
mod measurements;
mod mesh_file;
mod scene;
#[cfg(feature = "rooms")]
mod table_lines;
mod theory;
#[cfg(feature = "rooms")]
mod toml_field;
mod weld;

pub use error::Error;
pub use floor_plan::FloorPlan;
#[cfg(feature = "rooms")]
pub use measured_room::materials::{MaterialTable, Materials};
#[cfg(feature = "rooms")]
pub use measured_room::{
    DrawnRoom, Levels, MaterialPrior, MeasuredRoom, Measurement, NewResponse, NewRoom, ParameterEntry,
    PositionSd, ReadOptions, ResponseEntry, RoomModel, RoomNote, TimeZero,
};
#[cfg(feature = "sofa")]
pub use measurements::SofaConvention;
#[cfg(feature = "rooms")]
pub use measurements::{ImportOptions, Measurements};
pub use mesh_file::Mesh;
pub use mesh_file::mesh_options::{LengthUnit, MeshOptions};
pub use mesh_file::up_axis::UpAxis;
pub use scene::{NamedMaterial, Receiver, Scene, Source, Triangle};
pub use theory::{DiffuseRoom, schroeder_frequency_hz};
pub use weld::WeldReport;
