//! Time of convolution: `cargo bench -p sabine-eqfilter --bench convolution`.
#![allow(missing_docs)] // criterion's macros

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use sabine_eqfilter::{PartitionedConfig, PartitionedConvolver, convolve};
use std::hint::black_box;

fn noise(length: usize) -> Vec<f32> {
    let mut state = 1_u32;
    (0..length)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state as f32 / u32::MAX as f32 - 0.5
        })
        .collect()
}

/// Ten seconds of sound at 48 kHz with an EQ filter and with a room response.
fn offline(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("convolve");
    let sound = noise(480_000);
    group.throughput(Throughput::Elements(sound.len() as u64));
    for taps in [1025, 3073, 144_000] {
        let response = noise(taps);
        group.bench_function(BenchmarkId::new("10 s at 48 kHz", taps), |b| {
            b.iter(|| convolve(black_box(&sound), black_box(&response)));
        });
    }
    group.finish();
}

/// One second of live input at 48 kHz: the time is the load of one core.
fn partitioned(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("partitioned");
    let second = noise(48_000);
    for (block, seconds) in [(64, 3), (128, 1), (128, 3), (512, 3)] {
        let longest_response = 48_000 * seconds;
        let config = PartitionedConfig { block, longest_response, ..Default::default() };
        let mut convolver = PartitionedConvolver::new(&noise(longest_response), config).expect("valid");
        let mut out = vec![0.0; block];
        group.throughput(Throughput::Elements(second.len() as u64));
        group.bench_function(
            BenchmarkId::new(format!("{seconds} s response"), format!("block {block}")),
            |b| {
                b.iter(|| {
                    for piece in black_box(&second).chunks_exact(block) {
                        convolver.process_block(piece, &mut out).expect("one block");
                        black_box(&out);
                    }
                });
            },
        );
    }
    group.finish();
}

criterion_group!(benches, offline, partitioned);
criterion_main!(benches);
