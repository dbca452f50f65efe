//! The programs behind the tables.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod effect_atlas;
mod five_rooms;
#[cfg(target_os = "linux")] // memory is read from /proc
mod soak;
