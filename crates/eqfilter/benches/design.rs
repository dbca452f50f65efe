//! Time of a design: `cargo bench -p sabine-eqfilter --bench design`.
#![allow(missing_docs)] // criterion's macros

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use sabine_acoustics::{Bands, PerBand};
use sabine_eqfilter::{EqDesigner, EqFilter, EqFilterConfig};
use std::hint::black_box;

fn design(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("design");
    let bands = Bands::EQ;
    let moderate = PerBand::new(bands, vec![4.0, -3.0, 6.0, -5.0, 0.0, 3.0, -8.0]).expect("seven bands");
    let hard = PerBand::from_fn(bands, |b| if b % 2 == 0 { 15.0 } else { -15.0 });
    for rate_hz in [16_000, 48_000] {
        let config = EqFilterConfig::PAPER;
        let designer = EqDesigner::new(bands, rate_hz, config).expect("valid");
        group.throughput(Throughput::Elements(designer.taps() as u64));
        let id = |name: &str| BenchmarkId::new(name, format!("{} taps", designer.taps()));
        group.bench_function(id("plan"), |b| {
            b.iter(|| EqDesigner::new(bands, rate_hz, black_box(config)));
        });
        group.bench_function(id("planned"), |b| b.iter(|| designer.design(black_box(&moderate))));
        group.bench_function(id("planned, 15 dB alternating"), |b| {
            b.iter(|| designer.design(black_box(&hard)));
        });
        group.bench_function(id("EqFilter::design"), |b| {
            b.iter(|| EqFilter::design(black_box(&moderate), rate_hz, config));
        });
        group.bench_function(id("window method"), |b| {
            b.iter(|| EqFilter::window_method(black_box(&moderate), rate_hz, config));
        });
        let filter = designer.design(&moderate).expect("valid");
        group.bench_function(id("minimum phase"), |b| {
            b.iter(|| black_box(&filter).clone().into_minimum_phase());
        });
    }
    group.finish();
}

criterion_group!(benches, design);
criterion_main!(benches);
