//! Any bytes as an OBJ file: a sound mesh, or an error.

#![no_main]

mod mesh;
mod scratch;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| mesh::check(&scratch::file("room.obj", bytes)));
