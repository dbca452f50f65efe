//! Time of a fit: eight octaves, six materials, rays from 1,000 to 16,000 (each some 230 paths).

// A bench that cannot be set up should fail; criterion's macro writes a function without documentation.
#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../tests/it/ergodic/mod.rs"]
mod ergodic;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use ergodic::Ergodic;
use sabine_acoustics::{Air, Bands, Estimate, Material, PerBand};
use sabine_optimize::{AbsorptionPrior, FitConfig, FitProblem, MaterialFitter, SlopeObjective};

fn fits(criterion: &mut Criterion) {
    let octaves = Bands::SIMULATION;
    let materials = vec![Material::uniform(octaves, 0.1, 0.5).unwrap(); 6];
    let priors = vec![AbsorptionPrior::uniform(octaves, 0.15, 0.1); 6];
    let targets = [1.4, 1.2, 1.0, 0.8, 0.7, 0.6, 0.4].map(Estimate::exact).to_vec();
    let targets = PerBand::new(Bands::T60, targets).unwrap();
    let mut group = criterion.benchmark_group("fit_t60");
    group.sample_size(10);
    for rays in [1000, 4000, 16000] {
        let shares = vec![0.35, 0.3, 0.2, 0.1, 0.04, 0.01];
        let paths = Ergodic { shares, mean_free_path_m: 3.0, rays, duration_s: 2.0 }.trace(1);
        group.throughput(Throughput::Elements(paths.len() as u64));
        for objective in [SlopeObjective::DecayCurve, SlopeObjective::Paper, SlopeObjective::Li2018] {
            let fitter = MaterialFitter::new(FitConfig { objective, ..FitConfig::default() }).unwrap();
            group.bench_function(BenchmarkId::new(format!("{objective:?}"), rays), |bencher| {
                bencher.iter(|| {
                    fitter
                        .fit_t60(
                            &[&paths],
                            &FitProblem::new(&materials, &priors, &Air::default()),
                            &targets,
                            &(),
                        )
                        .unwrap()
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, fits);
criterion_main!(benches);
