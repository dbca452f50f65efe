//! The whole graph neither allocates nor frees in the audio thread: in a program of its own, whose allocator counts.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod graph;

use firewheel::Volume;
use graph::{Graph, decay, noise};
use sabine_with_firewheel::RoomNode;
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

    let room = |seed: u32| [0, 1, 2, 3].map(|n| decay(30_000, 4 * seed + n, 48_000)).to_vec();
    let mut graph = Graph::new(&room(0), RoomNode::default());
    graph.start(48_000).unwrap();
    let mut input = noise(2 * 4096, 1);
    let mut output = vec![0.0; 2 * 4096];
    let mut heard = Vec::new();
    for round in 0..100 {
        // What other threads do between two calls: another room, other gains, a bypass, gains that are refused.
        if round % 25 == 10 {
            graph.room.change_room(room(round)).unwrap();
        }
        let wet = if round % 10 == 9 { f32::NAN } else { -(round as f32) / 10.0 };
        graph.set_gains(RoomNode { wet: Volume::Decibels(wet), dry: Volume::Linear(0.1) });
        graph.context.queue_bypassed_for(graph.node, round % 20 == 19);
        input[17] = if round == 50 { f32::NAN } else { 0.1 };
        graph.context.update().unwrap();
        let stream = graph.stream.as_mut().unwrap();
        let asked = counted(|| {
            for frames in [0, 1, 64, 441, 1024, 4096] {
                stream.render(&input[..2 * frames], &mut output[..2 * frames]);
            }
        });
        let asked = (asked.allocations, asked.deallocations, asked.reallocations);
        assert_eq!(asked, (0, 0, 0), "round {round}");
        heard.push(output[2 * 4096 - 1]);
    }
    assert!(heard.windows(2).filter(|pair| pair[0] != pair[1]).count() > 50, "it is heard meanwhile");
}
