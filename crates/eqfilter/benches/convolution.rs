//! Time of convolution: `cargo bench -p sabine-eqfilter --bench convolution`.
#![allow(missing_docs)] // criterion's macros

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use sabine_acoustics::ImpulseResponse;
use sabine_eqfilter::{PartitionedConfig, PartitionedConvolver, RoomReverb, RoomReverbConfig, convolve};
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

/// One second of a callback of 64 frames at 48 kHz: the time is the load of one core. Beside it, one convolver for each pair of
/// channels.
fn room_reverb(criterion: &mut Criterion) {
    for (seconds, inputs, outputs) in
        [(3.0, 1, 1), (3.0, 1, 2), (3.0, 2, 2), (3.0, 1, 9), (0.3, 1, 2), (0.3, 1, 9)]
    {
        let mut group =
            criterion.benchmark_group(format!("room reverb, {seconds} s, {inputs} in, {outputs} out"));
        let response = ImpulseResponse::new(noise((48e3 * seconds) as usize), 48_000).expect("finite");
        let config = RoomReverbConfig { inputs, outputs, longest_s: seconds, ..RoomReverbConfig::default() };
        let responses = vec![response.clone(); inputs * outputs];
        let mut reverb = RoomReverb::new(&responses, config).expect("valid");
        let second = noise(48_000 * inputs);
        let mut out = vec![0.0; 64 * outputs];
        group.bench_function("shared transforms", |b| {
            b.iter(|| {
                for frames in black_box(&second).chunks_exact(64 * inputs) {
                    reverb.process_interleaved(frames, &mut out).expect("whole frames");
                    black_box(&out);
                }
            });
        });
        let longest_response = response.samples().len();
        let config = PartitionedConfig { block: 64, longest_response, ..PartitionedConfig::default() };
        let mut convolvers: Vec<_> = responses
            .iter()
            .map(|response| PartitionedConvolver::new(response.samples(), config).expect("valid"))
            .collect();
        let mut out = vec![0.0; 64];
        group.bench_function("separate convolvers", |b| {
            b.iter(|| {
                for block in black_box(&second[..48_000]).chunks_exact(64) {
                    for convolver in &mut convolvers {
                        convolver.process_block(block, &mut out).expect("one block");
                        black_box(&out);
                    }
                }
            });
        });
        group.finish();
    }
}

criterion_group!(benches, offline, partitioned, room_reverb);
criterion_main!(benches);
