//! Windows per second in inference, by batch size, and from the waveform on.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use sabine_acoustics::Signal;
use sabine_estimator::{Estimator, Network, NetworkConfig, Parameters, Scratch};
use std::error::Error;
use std::hint::black_box;

fn inference(criterion: &mut Criterion) -> Result<(), Box<dyn Error>> {
    let mut group = criterion.benchmark_group("inference");
    for (name, config) in [("small", NetworkConfig::small()), ("averaged", NetworkConfig::averaged())] {
        let network = Network::new(&Parameters::random(&config, 1)?);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let inputs: Vec<f32> = (0..64 * network.input_len()).map(|i| (i as f32 * 0.37).sin()).collect();
        let mut scratch = Scratch::default();
        group.throughput(Throughput::Elements(1));
        group.bench_function(BenchmarkId::new(name, 1), |b| {
            b.iter(|| network.infer_with_scratch(black_box(&inputs[..network.input_len()]), &mut scratch));
        });
        group.throughput(Throughput::Elements(64));
        group.bench_function(BenchmarkId::new(name, 64), |b| {
            b.iter(|| pool.install(|| network.infer_batch(black_box(&inputs))));
        });
    }
    let estimator = Estimator::pretrained()?;
    let speech = Signal::new((0..64_000).map(|i| (i as f32 * 0.1).sin() * 0.1).collect(), 16_000)?;
    group.throughput(Throughput::Elements(1));
    group.bench_function("from the waveform", |b| b.iter(|| estimator.estimate_detailed(black_box(&speech))));
    group.finish();
    Ok(())
}

fn all(criterion: &mut Criterion) {
    inference(criterion).expect("networks that can be built");
}

criterion_group!(benches, all);
criterion_main!(benches);
