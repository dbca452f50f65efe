//! Rays and paths per second. `cargo bench -p sabine-propagate`
#![allow(clippy::unwrap_used, missing_docs)] // a panic is how a bench fails; criterion's macros write no docs

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rand::{Rng, SeedableRng};
use sabine_acoustics::*;
use sabine_propagate::*;

const SIZE_M: [f64; 3] = [10.0, 7.0, 3.0];

/// The box, each wall cut into a grid of `cells` x `cells` rectangles.
fn finely_meshed(cells: u32, absorption: f64, scattering: f64) -> Scene {
    let material = Material::uniform(OctaveBands::SIMULATION, absorption, scattering).unwrap();
    let plain = Scene::shoebox(SIZE_M, std::array::from_fn(|_| material.clone())).unwrap();
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for wall in 0..6 {
        let [a, b, c] = plain.corners_m(2 * wall);
        let first = vertices.len() as u32;
        let at = |i: u32, j: u32| -> [f64; 3] {
            let (u, v) = (f64::from(i) / f64::from(cells), f64::from(j) / f64::from(cells));
            std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - b[k]))
        };
        vertices.extend((0..=cells).flat_map(|i| (0..=cells).map(move |j| (i, j))).map(|(i, j)| at(i, j)));
        for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
            let corner = |i: u32, j: u32| first + i * (cells + 1) + j;
            for corners in [
                [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)],
                [corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)],
            ] {
                triangles.push(Triangle { vertices: corners, material: wall as u32 });
            }
        }
    }
    Scene::new(vertices, triangles, plain.materials().to_vec()).unwrap()
}

fn closest_hits(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("closest_hit");
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let rays: Vec<([f64; 3], [f64; 3])> = (0..4096)
        .map(|_| {
            let origin = std::array::from_fn(|i| random.random_range(0.01..SIZE_M[i] - 0.01));
            let z: f64 = random.random_range(-1.0..1.0);
            let azimuth = random.random_range(0.0..std::f64::consts::TAU);
            let r = (1.0 - z * z).sqrt();
            (origin, [r * azimuth.cos(), r * azimuth.sin(), z])
        })
        .collect();
    group.throughput(Throughput::Elements(rays.len() as u64));
    for cells in [1, 29, 91] {
        let scene = finely_meshed(cells, 0.1, 0.1);
        let mesh = MeshScene::new(&scene).unwrap();
        group.bench_with_input(
            BenchmarkId::from_parameter(scene.triangles().len()),
            &mesh,
            |bencher, mesh| {
                bencher.iter(|| {
                    rays.iter().filter(|(o, d)| mesh.closest_hit(*o, *d, f64::INFINITY).is_some()).count()
                });
            },
        );
    }
    group.finish();
}

fn traces(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("trace");
    group.sample_size(10);
    let (source, receiver) =
        (Source::omni("S", [2.0, 3.0, 1.5]).unwrap(), Receiver::omni("R", [7.0, 4.0, 1.6]).unwrap());
    let rays = 10_000;
    group.throughput(Throughput::Elements(rays as u64));
    for (cells, scattering) in [(1, 0.0), (1, 0.3), (29, 0.3), (64, 0.3)] {
        let scene = finely_meshed(cells, 0.1, scattering);
        let tracer = PathTracer::new(TracerConfig { rays, duration_s: 1.5, ..Default::default() }).unwrap();
        let name = format!("{} triangles, scattering {scattering}", scene.triangles().len());
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
            bencher.iter(|| renderer.render(&paths, &materials, &Air::default()).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, closest_hits, traces, renders);
criterion_main!(benches);
