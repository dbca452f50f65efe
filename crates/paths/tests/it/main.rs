//! Tests of `sabine-paths` from outside: one binary, a module for each subject.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod laws;
mod material_errors;
mod path_parameters;
