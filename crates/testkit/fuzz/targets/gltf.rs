//! Any bytes as a glTF or GLB file: a sound mesh, or an error.

#![no_main]

mod mesh;
mod scratch;

use libfuzzer_sys::fuzz_target;

// The first bytes say which of the two it is, not the ending of the name.
fuzz_target!(|bytes: &[u8]| mesh::check(&scratch::file("room.glb", bytes)));
