//! The network, its training and its weights.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod bursts;
mod estimation;
#[cfg(unix)]
mod faults;
mod live;
mod odd_layouts;
#[cfg(unix)]
#[path = "../../../acoustics/tests/faults/process.rs"]
mod process;
mod several;
mod support;
mod training;
