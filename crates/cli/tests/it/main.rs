//! The command `sabine` as a user runs it: what it writes, and what it says of bad input.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

#[cfg(target_os = "linux")] // peak memory is read from /proc; named pipes and devices
mod bad_inputs;
mod console;
mod diagnose;
mod estimate;
mod exchange;
#[cfg(unix)]
mod faults;
mod fit;
mod laws;
mod listen;
mod live;
mod long_files;
mod match_room;
mod model;
mod plan;
#[cfg(unix)]
#[path = "../../../acoustics/tests/faults/process.rs"]
mod process;
mod replace;
mod rooms;
mod sheet;
mod sweep;
mod tables;
mod trace;

use std::process::Command;

/// A command of the program.
fn sabine(job: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sabine"));
    command.arg(job);
    command
}
