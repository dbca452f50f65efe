//! The oracles, the laboratory, the fixtures and the import table.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod box_modes;
mod fixtures;
mod hidden_effects;
mod hidden_laws;
mod hidden_modes;
mod imports;
mod laboratory;
mod oracles;
mod polyhedra;
mod rooms;
mod screened_room;
mod spectrum;
mod wave_grid;
#[allow(dead_code)] // of these oracles, the half plane alone is used here
#[path = "../../../propagate/tests/it/wedge_oracles/mod.rs"]
mod wedge_oracles;
