//! Any bytes as a WAV file: a signal whose length the header promised, or an error.

#![no_main]

mod scratch;

use libfuzzer_sys::fuzz_target;
use sabine_acoustics::{Channel, probe_audio, read_audio};

fuzz_target!(|bytes: &[u8]| {
    let path = scratch::file("sound.wav", bytes);
    let Ok(info) = probe_audio(&path) else {
        assert!(read_audio(&path, Channel::Mean).is_err(), "read although the header is refused");
        return;
    };
    for channel in [Channel::Mono, Channel::Index(1), Channel::Mean] {
        if let Ok(signal) = read_audio(&path, channel) {
            assert_eq!(signal.samples().len() as u64, info.frames);
            assert_eq!(signal.sample_rate_hz(), info.sample_rate_hz);
            assert!(signal.samples().iter().all(|s| s.is_finite()));
        }
    }
});
