//! Time of log-mel spectrograms: `cargo bench -p sabine-features`.
#![allow(missing_docs)] // criterion's macros

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use sabine_features::{LogMel, LogMelConfig, Stft};
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

fn log_mel(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("log_mel");
    let planned = LogMel::new(LogMelConfig::default()).expect("the default is valid");
    let mut scratch = planned.scratch();
    for seconds in [1, 4] {
        let samples = noise(16_000 * seconds);
        let mut out = vec![0.0; 32 * planned.stft().frames(samples.len())];
        group.throughput(Throughput::Elements(samples.len() as u64));
        group.bench_function(BenchmarkId::new("whole", format!("{seconds} s")), |b| {
            b.iter(|| planned.extract_into(black_box(&samples), &mut scratch, &mut out));
        });
    }
    let samples = noise(64_000);
    let mut stream = planned.stream();
    group.bench_function("stream/4 s by 128", |b| {
        b.iter(|| {
            for hop in black_box(&samples).chunks(128) {
                stream.push(hop, |levels| {
                    black_box(levels);
                });
            }
        });
    });
    group.finish();
}

fn stft(criterion: &mut Criterion) {
    let samples = noise(64_000);
    let stft = Stft::new(256, 128).expect("valid");
    let spectra = stft.forward(&samples);
    let mut group = criterion.benchmark_group("stft");
    group.throughput(Throughput::Elements(samples.len() as u64));
    group.bench_function("forward/4 s", |b| b.iter(|| stft.forward(black_box(&samples))));
    group.bench_function("inverse/4 s", |b| b.iter(|| stft.inverse(black_box(spectra.view()))));
    group.finish();
}

criterion_group!(benches, log_mel, stft);
criterion_main!(benches);
