//! Augmentations, training sets and synthetic rooms.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod bad_input;
mod dataset;
mod drr_and_eq;
#[cfg(unix)]
mod faults;
mod material;
#[cfg(unix)]
#[path = "../../../acoustics/tests/faults/process.rs"]
mod process;
mod real_responses;
mod synthetic_rooms;
mod t60;
mod traced_rooms;
