//! Tests of `sabine-scene` from outside: one binary, a module for each subject.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

#[cfg(all(unix, feature = "rooms"))]
mod faults;
#[cfg(feature = "gltf")]
mod glb_files;
#[cfg(all(feature = "rooms", feature = "gltf"))]
mod gltf_files;
#[cfg(target_os = "linux")]
mod hostile_sizes;
#[cfg(feature = "rooms")]
mod measured_rooms;
mod obj_against_tobj;
#[cfg(feature = "rooms")]
mod parameter_tables;
#[cfg(feature = "tables")]
mod position_tables;
#[cfg(unix)]
#[path = "../../../acoustics/tests/faults/process.rs"]
mod process;
#[cfg(feature = "rew-http")]
mod rew_server;
#[cfg(feature = "rooms")]
mod room_reading;
#[cfg(feature = "sofa")]
mod sofa_files;
