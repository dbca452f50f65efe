//! The command `sabine` as a user runs it: what it writes, and what it says of bad input.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod console;
mod diagnose;
mod fit;
mod listen;
mod live;
mod long_files;
mod match_room;
mod replace;
mod rooms;
mod trace;

use std::process::Command;

/// A command of the program.
fn sabine(job: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sabine"));
    command.arg(job);
    command
}
