//! Closest hits per second, ours and those of plain parry. `cargo bench -p sabine-propagate --bench closest_hit`
#![allow(clippy::unwrap_used, missing_docs)] // a panic is how a bench fails; criterion's macros write no docs

mod rooms;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;
use rooms::{finely_meshed, furnished, rays};
use sabine_paths::RayScene;
use sabine_propagate::MeshScene;
use sabine_scene::Scene;
use std::hint::black_box;

fn scenes() -> Vec<(String, Scene)> {
    let mut scenes: Vec<(String, Scene)> = [1, 29, 91]
        .map(|cells| finely_meshed(cells, 0.1, 0.1))
        .map(|scene| (format!("box of {}", scene.triangles().len()), scene))
        .into();
    let scene = furnished(0.1, 0.1);
    scenes.push((format!("furnished, {}", scene.triangles().len()), scene));
    scenes
}

fn tri_mesh(scene: &Scene) -> TriMesh {
    let vector = |v: &[f64; 3]| Vector::new(v[0] as f32, v[1] as f32, v[2] as f32);
    let indices = scene.triangles().iter().map(|t| t.vertices).collect();
    TriMesh::new(scene.vertices().iter().map(vector).collect(), indices).unwrap()
}

/// Unit normals, for hits that come with one.
fn normals(scene: &Scene) -> Vec<[f64; 3]> {
    (0..scene.triangles().len())
        .map(|i| {
            let [a, b, c] = scene.corners_m(i);
            let (p, q): ([f64; 3], [f64; 3]) =
                (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
            let n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
            let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
            n.map(|x| x / length)
        })
        .collect()
}

fn closest_hits(criterion: &mut Criterion) {
    let rays = rays(65_536);
    let single: Vec<Ray> = rays
        .iter()
        .map(|(o, d)| {
            let vector = |v: &[f64; 3]| Vector::new(v[0] as f32, v[1] as f32, v[2] as f32);
            Ray::new(vector(o), vector(d))
        })
        .collect();
    for (name, scene) in scenes() {
        let mut group = criterion.benchmark_group(format!("closest_hit/{name}"));
        group.throughput(Throughput::Elements(rays.len() as u64)).sample_size(20);
        let mesh = MeshScene::new(&scene).unwrap();
        let normals = normals(&scene);
        group.bench_function("sabine", |bencher| {
            bencher.iter(|| {
                for (origin, direction) in &rays {
                    let hit = mesh.closest_hit(*origin, *direction, f64::INFINITY);
                    black_box(hit.map(|h| (h.distance, normals[h.triangle as usize])));
                }
            });
        });
        let merged = MeshScene::merged(&scene).unwrap();
        group.bench_function("sabine, flat walls merged", |bencher| {
            bencher.iter(|| {
                for (origin, direction) in &rays {
                    let hit = merged.closest_hit(*origin, *direction, f64::INFINITY);
                    black_box(hit.map(|h| (h.distance, normals[h.triangle as usize])));
                }
            });
        });
        group.bench_function("sabine, any hit within 2 m", |bencher| {
            bencher.iter(|| {
                for (origin, direction) in &rays {
                    black_box(mesh.any_hit(*origin, *direction, 2.0));
                }
            });
        });
        let peer = tri_mesh(&scene);
        group.bench_function("parry3d", |bencher| {
            bencher.iter(|| {
                for ray in &single {
                    black_box(peer.cast_local_ray_and_get_normal(ray, f32::MAX, false));
                }
            });
        });
        group.finish();
    }
}

fn building(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("build");
    group.sample_size(10);
    for (name, scene) in
        scenes().into_iter().chain([("box of 1,010,892".into(), finely_meshed(290, 0.1, 0.1))])
    {
        group.throughput(Throughput::Elements(scene.triangles().len() as u64));
        group.bench_with_input(BenchmarkId::new("sabine", &name), &scene, |bencher, scene| {
            bencher.iter(|| MeshScene::new(scene).unwrap());
        });
        group.bench_with_input(
            BenchmarkId::new("sabine, flat walls merged", &name),
            &scene,
            |bencher, scene| {
                bencher.iter(|| MeshScene::merged(scene).unwrap());
            },
        );
        group.bench_with_input(BenchmarkId::new("parry3d", &name), &scene, |bencher, scene| {
            bencher.iter(|| tri_mesh(scene));
        });
    }
    group.finish();
}

criterion_group!(benches, closest_hits, building);
criterion_main!(benches);
