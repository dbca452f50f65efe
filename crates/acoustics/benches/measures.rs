//! What measuring a response costs, by its length and sample rate.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use sabine_acoustics::{BandParameters, Bands, FilterBank, ImpulseResponse, RoomParameters, equalisation};
use std::hint::black_box;

/// Duration in seconds and sample rate in Hz: a response of the estimator's training, and one as it is measured.
const SIZES: [(f64, u32); 2] = [(1.5, 16000), (3.0, 48000)];

/// A decay of 0.6 s, 60 dB above the noise.
fn response(duration_s: f64, sample_rate_hz: u32) -> ImpulseResponse {
    let mut rng = rand_pcg::Pcg64::seed_from_u64(1);
    let mut gaussian = || -> f64 { StandardNormal.sample(&mut rng) };
    let rate = f64::from(sample_rate_hz);
    let samples = (0..(duration_s * rate) as usize)
        .map(|i| {
            let envelope = 10f64.powf(-3.0 * i as f64 / rate / 0.6);
            (0.1 * (envelope * gaussian() + 1e-3 * gaussian())) as f32
        })
        .collect();
    ImpulseResponse::new(samples, sample_rate_hz).expect("finite samples")
}

fn measures(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("response");
    for (duration_s, rate) in SIZES {
        let response = response(duration_s, rate);
        let bank = FilterBank::new(Bands::T60, rate).expect("a sample rate in range");
        let name = format!("{duration_s} s at {rate} Hz");
        group.throughput(Throughput::Elements(response.samples().len() as u64));
        group.bench_function(BenchmarkId::new("split into 7 octaves", &name), |bencher| {
            bencher.iter(|| black_box(bank.split(black_box(response.samples()))));
        });
        group.bench_function(BenchmarkId::new("all parameters in 7 octaves", &name), |bencher| {
            bencher.iter(|| black_box(RoomParameters::measure(black_box(&response), Bands::T60)));
        });
        group.bench_function(BenchmarkId::new("full band", &name), |bencher| {
            bencher.iter(|| black_box(BandParameters::full_band(black_box(&response))));
        });
        group.bench_function(BenchmarkId::new("equalisation in 7 octaves", &name), |bencher| {
            bencher.iter(|| black_box(equalisation(black_box(&response), Bands::EQ)));
        });
    }
    group.finish();
}

criterion_group!(benches, measures);
criterion_main!(benches);
