//! Rays traced per second, from their start to their share of the path set. `cargo bench -p sabine-propagate --bench tracing`
#![allow(clippy::unwrap_used, missing_docs)] // a panic is how a bench fails; criterion's macros write no docs

mod rooms;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rooms::finely_meshed;
use sabine_acoustics::*;
use sabine_paths::Conditions;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::*;

fn traces(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("trace");
    group.sample_size(10);
    let (source, receiver) =
        (Source::omni("S", [2.0, 3.0, 1.5]).unwrap(), Receiver::omni("R", [7.0, 4.0, 1.6]).unwrap());
    let rays = 10_000;
    group.throughput(Throughput::Elements(rays as u64));
    let meshes = [(1, true), (29, false), (29, true), (64, false), (64, true)];
    for ((cells, merge_coplanar), scattering) in
        meshes.into_iter().flat_map(|mesh| [(mesh, 0.0), (mesh, 0.3)])
    {
        let scene = finely_meshed(cells, 0.1, scattering);
        let config = TracerConfig { rays, duration_s: 1.5, merge_coplanar, ..Default::default() };
        let tracer = PathTracer::new(config).unwrap();
        let merged = if merge_coplanar { "merged" } else { "each met by itself" };
        let name = format!("{} triangles, {merged}, scattering {scattering}", scene.triangles().len());
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            group.bench_function(BenchmarkId::new(&name, format!("{threads} threads")), |bencher| {
                bencher.iter(|| {
                    pool.install(|| tracer.trace(&scene, &source, &receiver, &Air::default(), &()))
                        .unwrap()
                        .len()
                });
            });
        }
    }
    group.finish();
}

fn renders(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("render");
    group.sample_size(10);
    let scene = finely_meshed(1, 0.2, 0.3);
    let paths = PathTracer::new(TracerConfig { rays: 10_000, duration_s: 1.0, ..Default::default() })
        .unwrap()
        .trace(
            &scene,
            &Source::omni("S", [2.0, 3.0, 1.5]).unwrap(),
            &Receiver::omni("R", [7.0, 4.0, 1.6]).unwrap(),
            &Air::default(),
            &(),
        )
        .unwrap();
    let materials: Vec<Material> = scene.materials().iter().map(|m| m.material.clone()).collect();
    for statistics in [Statistics::Gaussian, Statistics::DecayMatched] {
        let renderer = PressureRenderer::new(RenderConfig { statistics, ..Default::default() }).unwrap();
        group.bench_function(BenchmarkId::from_parameter(format!("{statistics:?}")), |bencher| {
            bencher.iter(|| renderer.render(&paths, &Conditions::new(&materials, &Air::default())).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, traces, renders);
criterion_main!(benches);
