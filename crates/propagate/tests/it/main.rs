//! Tracing, rendering and waves.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod agreement;
mod ambisonics;
mod binaural;
mod box_room;
mod conformance;
mod diffraction;
mod directivity;
mod laws;
mod merging;
mod moving;
mod no_box;
mod octave_filter;
mod placement;
mod real_rooms;
mod real_waves;
mod rendering;
mod scenes;
mod shoebox;
mod tessellations;
mod waves;
mod wedge_oracles;
mod weight_window;
