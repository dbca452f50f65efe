//! Tests of `sabine-acoustics` from outside: one binary, a module for each subject.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod air_reference;
#[cfg(feature = "audio")]
mod audio_files;
#[cfg(feature = "audio")]
mod audio_formats;
mod decay_accuracy;
mod hard_input;
mod listener_measures;
#[cfg(feature = "audio")]
mod real_responses;
#[cfg(feature = "audio")]
mod response_files;
mod speech_transmission;
mod sweeps;
mod synthetic;
