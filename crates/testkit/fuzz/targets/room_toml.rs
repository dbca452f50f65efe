//! Any bytes as the room file of a good mesh and response: a room, or an error.

#![no_main]

mod scratch;

use libfuzzer_sys::fuzz_target;
use sabine_scene::MeasuredRoom;
use std::sync::Once;

static MESH: Once = Once::new();

fuzz_target!(|bytes: &[u8]| {
    MESH.call_once(|| {
        scratch::file("room.obj", b"v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nusemtl ground\nf 1 3 2\nusemtl cloth\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
        // 16 bit, mono, 8 kHz, 400 samples: 50 ms.
        let mut wav = b"RIFF\x44\x03\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0\x40\x1f\0\0\x80\x3e\0\0\x02\0\x10\0data\x20\x03\0\0".to_vec();
        wav.extend([1u8; 800]);
        scratch::file("response.wav", &wav);
    });
    let path = scratch::file("room.toml", bytes);
    let Some(folder) = path.parent() else { return };
    if let Ok(room) = MeasuredRoom::read(folder) {
        assert_eq!(room.priors().len(), room.scene().materials().len());
        for entry in room.responses() {
            assert!(entry.source < room.sources().len() && entry.receiver < room.receivers().len());
        }
        for index in 0..room.responses().len() {
            let _ = room.load_response(index);
        }
    }
});
