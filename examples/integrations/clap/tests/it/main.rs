//! The plug-in as a host sees it.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

#[path = "../host/mod.rs"]
mod host;

mod bad_input;
mod entry;
mod parameters;
mod shelf;
mod sound;
mod state;
