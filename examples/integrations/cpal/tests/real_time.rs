//! Neither callback allocates or frees: in a program of its own, whose allocator counts.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_acoustics::ImpulseResponse;
use sabine_with_cpal::{Input, Player, PlayerConfig, Watch, microphone};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, Stats, StatsAlloc};
use std::alloc::System;
use std::sync::Arc;

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// What the allocator was asked for meanwhile.
fn counted(work: impl FnOnce()) -> Stats {
    let region = Region::new(ALLOCATOR);
    work();
    region.change()
}

/// Without the usual harness, whose own thread allocates while a test begins.
fn main() {
    assert_eq!(counted(|| drop(vec![1.0_f32; 10])).deallocations, 1, "the allocator counts");

    let room = |gain: f32| [0, 1].map(|_| ImpulseResponse::new(vec![gain; 30_000], 48_000).unwrap());
    let config = PlayerConfig { sample_rate_hz: 48_000, channels: 6, wet: 0.01, dry: 0.0, longest_s: 1.0 };
    let watch = Arc::new(Watch::default());
    let (mut writer, reader) = microphone(2, 48_000, 48_000, 0.02, &watch).unwrap();
    let mut player = Player::new(Input::Microphone(reader), &room(0.5), config, &watch).unwrap();
    let control = player.control();
    let (input, mut output) = (vec![1000_i16; 2 * 4096], vec![0_u16; 6 * 4096]);
    for round in 0..100 {
        if round % 20 == 10 {
            control.exchange(&room(0.01 * round as f32)).unwrap();
        }
        // A microphone that runs dry, and one that runs over.
        let input = if round < 50 { &input[..2 * 100] } else { &input };
        let asked = counted(|| {
            for frames in [0, 1, 64, 441, 1024, 4096] {
                writer.write(input);
                player.fill(&mut output[..6 * frames]);
            }
        });
        assert_eq!((asked.allocations, asked.deallocations, asked.reallocations), (0, 0, 0), "round {round}");
    }
    let figures = watch.figures();
    assert!(figures.microphone_short > 50 && figures.microphone_left_out > 50_000, "{figures:?}");
    assert!(output.iter().any(|&sample| sample != 32_768), "it is heard");
}
