//! Fits of materials.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod ergodic;
mod fit_t60;
mod gradient;
mod hand_worked;
mod mirrors;
mod other_tracers;
mod refusals;
mod retracing;
mod swinging_weights;
mod tables;
mod twelve_pairs;
mod two_room_flat;
mod under_conditions;
