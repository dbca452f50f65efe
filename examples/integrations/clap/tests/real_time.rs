//! The audio thread neither allocates nor frees, seen through the host's interface: in a program of its own, whose allocator counts.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod host;

use host::{Rack, change, decay, noise, state};
use sabine_acoustics::{SampleFormat, write_wav};
use sabine_clap_plugin::Parameter;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, Stats, StatsAlloc};
use std::alloc::System;
use std::sync::atomic::Ordering;

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

    let folder = tempfile::tempdir().unwrap();
    let paths = [1, 2].map(|seed| {
        let path = folder.path().join(format!("{seed}.wav"));
        write_wav(&path, &decay(30_000 * seed, seed as u32), 48_000, SampleFormat::Float32).unwrap();
        path
    });
    let mut rack = Rack::with_room(&paths[0], 0.0, 0.0);
    let mut player = rack.start(44.1e3, 4096, 2);
    let mut input = noise(4096, 3, 0.5);
    input[17] = f32::NAN;
    let mut calls = 0;
    for round in 0..100 {
        // What other threads do between two calls: another room, and old responses dropped.
        if round % 25 == 10 {
            assert!(rack.load(state(&paths[round / 25 % 2], -3.0, -(round as f64) / 2.0).as_bytes()));
        }
        rack.call_back();
        let gain = f64::from(round as u32) / 2.0 - 45.0;
        for frames in [0, 1, 64, 441, 1024, 4096] {
            let events = [
                change(0, Parameter::Wet, gain),
                change(frames / 3, Parameter::Dry, -gain),
                change(frames / 2, Parameter::Room, (round % 2) as f64),
            ];
            let part = &input[..frames];
            let mut asked = None;
            player.call(&[part, part], &events, |call| asked = Some(counted(call)));
            let asked = asked.unwrap();
            let asked = (asked.allocations, asked.deallocations, asked.reallocations);
            assert_eq!(asked, (0, 0, 0), "round {round}, {frames} frames");
            calls += 1;
        }
        let reset = counted(|| player.processor.reset());
        assert_eq!((reset.allocations, reset.deallocations, reset.reallocations), (0, 0, 0));
    }
    assert_eq!(calls, 600);
    assert!(rack.asked.tail_changes.load(Ordering::Relaxed) > 0, "rooms were exchanged meanwhile");
    rack.stop(player);
}
