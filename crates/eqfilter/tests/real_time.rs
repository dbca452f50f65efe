//! The callback neither allocates nor frees: in a program of its own, whose allocator counts.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_acoustics::ImpulseResponse;
use sabine_eqfilter::{RoomReverb, RoomReverbConfig};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, Stats, StatsAlloc};
use std::alloc::System;

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

    let room = |gain: f32| [0, 1, 2, 3].map(|_| ImpulseResponse::new(vec![gain; 9000], 48_000).unwrap());
    let config = RoomReverbConfig { inputs: 2, outputs: 2, ..RoomReverbConfig::default() };
    let mut reverb = RoomReverb::new(&room(0.5), config).unwrap();
    let control = reverb.control();
    let (input, mut output) = (vec![0.1; 4096], vec![0.0; 4096]);
    let (mut exchanges, mut retired) = (0, 0);
    for round in 0..200 {
        // What other threads do, between two calls: responses, gains, and old responses dropped.
        if round % 20 == 0 {
            retired += usize::from(control.collect());
            control.exchange(&room(round as f32)).unwrap();
            control.set_wet(0.01 * round as f32).unwrap();
            exchanges += 1;
        }
        let callback = counted(|| {
            for frames in [0, 1, 64, 441, 1024, 2048] {
                let (input, output) = (&input[..2 * frames], &mut output[..2 * frames]);
                reverb.process_interleaved(input, output).unwrap();
            }
            let [left, right] = [&input[..300], &input[300..600]];
            let (a, b) = output.split_at_mut(2048);
            reverb.process_planar(&[left, right], &mut [&mut a[..300], &mut b[..300]]).unwrap();
            assert!(reverb.process_interleaved(&input[..3], &mut output[..4]).is_err());
            if round == 150 {
                reverb.clear();
            }
        });
        let asked = (callback.allocations, callback.deallocations, callback.reallocations);
        assert_eq!(asked, (0, 0, 0), "round {round}");
    }
    retired += usize::from(control.collect());
    assert_eq!((exchanges, retired), (10, 10), "every exchange ended, and its responses came back");
}
