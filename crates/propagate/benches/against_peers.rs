//! What `docs/validation/peers/propagate_peers.py` compares: one run on one thread, printed as JSON lines; the scenes and
//! rays that another engine is to repeat are written to the folder given as an argument. With `hits` after it, whole traces are left out.
//! With `decays` and the folder of a measured room instead, late energies of many seeds for `time_to_accuracy.py`.
#![allow(clippy::unwrap_used, missing_docs)] // a panic is how a bench fails

mod rooms;

use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;
use rooms::{finely_meshed, furnished, rays};
use sabine_acoustics::*;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::*;
use std::hint::black_box;
use std::path::Path;
use std::sync::LazyLock;
use std::time::Instant;

/// Seconds that this thread has had the processor, where Linux tells; else those of the clock.
fn spent_s() -> f64 {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|line| line.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| START.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

/// As [`median_s`], in time of this thread on the processor.
fn median_spent_s<T>(mut work: impl FnMut() -> T) -> f64 {
    let mut seconds: Vec<f64> = (0..8)
        .map(|_| {
            let start = spent_s();
            black_box(work());
            spent_s() - start
        })
        .skip(1)
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds[3]
}

/// Seconds that `work` takes: the median of five, after one to warm up.
fn median_s<T>(mut work: impl FnMut() -> T) -> f64 {
    let mut seconds: Vec<f64> = (0..6)
        .map(|_| {
            let start = Instant::now();
            black_box(work());
            start.elapsed().as_secs_f64()
        })
        .skip(1)
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds[2]
}

fn write<const N: usize>(folder: &Path, name: &str, numbers: impl IntoIterator<Item = [u8; N]>) {
    let bytes: Vec<u8> = numbers.into_iter().flatten().collect();
    std::fs::write(folder.join(name), bytes).unwrap();
}

fn hits(folder: &Path) {
    let rays = rays(262_144);
    let single = |v: &[f64; 3]| Vector::new(v[0] as f32, v[1] as f32, v[2] as f32);
    let rounded: Vec<Ray> = rays.iter().map(|(o, d)| Ray::new(single(o), single(d))).collect();
    write(
        folder,
        "rays.f32",
        rays.iter().flat_map(|(o, d)| o.iter().chain(d)).map(|&c| (c as f32).to_le_bytes()),
    );
    let scenes = [1, 29, 91].map(|cells| ("box", finely_meshed(cells, 0.1, 0.1)));
    for (name, scene) in scenes.into_iter().chain([("furnished", furnished(0.1, 0.1))]) {
        let triangles = scene.triangles().len();
        let name = format!("{name}_{triangles}");
        let vertices = scene.vertices().as_flattened().iter().map(|&c| (c as f32).to_le_bytes());
        write(folder, &format!("{name}.vertices.f32"), vertices);
        let indices = scene.triangles().iter().flat_map(|t| t.vertices).map(u32::to_le_bytes);
        write(folder, &format!("{name}.triangles.u32"), indices);

        let mesh = MeshScene::new(&scene).unwrap();
        let ours = median_spent_s(|| {
            rays.iter()
                .filter_map(|(o, d)| mesh.closest_hit(*o, *d, f64::INFINITY))
                .map(|h| h.distance)
                .sum::<f64>()
        });
        let sum: f64 = rays
            .iter()
            .filter_map(|(o, d)| mesh.closest_hit(*o, *d, f64::INFINITY))
            .map(|h| h.distance)
            .sum();
        let vertices = scene.vertices().iter().map(single).collect();
        let peer = TriMesh::new(vertices, scene.triangles().iter().map(|t| t.vertices).collect()).unwrap();
        let theirs = median_spent_s(|| {
            let found =
                rounded.iter().filter_map(|ray| peer.cast_local_ray_and_get_normal(ray, f32::MAX, false));
            found.map(|hit| hit.time_of_impact).sum::<f32>()
        });
        let per_second = |seconds: f64| rays.len() as f64 / seconds;
        println!(
            "{{\"what\": \"hits\", \"scene\": \"{name}\", \"sabine\": {:.0}, \"parry3d\": {:.0}, \"mean_m\": {:.6}}}",
            per_second(ours),
            per_second(theirs),
            sum / rays.len() as f64
        );
    }
}

fn paths() {
    let (source, receiver) =
        (Source::omni("S", [2.0, 3.0, 1.5]).unwrap(), Receiver::omni("R", [7.0, 4.0, 1.6]).unwrap());
    let rays = 10_000;
    for (cells, scattering) in [1, 29, 64].into_iter().flat_map(|cells| [(cells, 0.0), (cells, 0.3)]) {
        let scene = finely_meshed(cells, 0.1, scattering);
        // What a trace costs before its rays: the hierarchy, the report on the mesh, placement, image sources.
        let few = PathTracer::new(TracerConfig { rays: 32, duration_s: 1.5, ..Default::default() }).unwrap();
        let before_s =
            median_s(|| few.trace(&scene, &source, &receiver, &Air::default(), &()).unwrap().len());
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let tracer =
                PathTracer::new(TracerConfig { rays, duration_s: 1.5, ..Default::default() }).unwrap();
            let trace = || tracer.trace(&scene, &source, &receiver, &Air::default(), &()).unwrap().len();
            let seconds = pool.install(|| median_s(trace));
            println!(
                "{{\"what\": \"paths\", \"triangles\": {}, \"scattering\": {scattering}, \"threads\": {threads}, \
                 \"before_s\": {before_s:.4}, \
                 \"rays_per_s\": {:.0}, \"seconds\": {seconds:.4}}}",
                scene.triangles().len(),
                rays as f64 / seconds
            );
        }
    }
}

/// Octaves from 62.5 Hz to 8 kHz: the fourth is 500 Hz.
const OCTAVE_500_HZ: usize = 3;
/// Bins of energy, in seconds.
const BIN_S: f64 = 0.01;
/// Traces of each room, each with a seed of its own.
const SEEDS: u64 = 24;
/// Rays of each.
const RAYS: usize = 10_000;
/// Longest decay.
const DECAY_S: f64 = 3.0;

/// Late energies at 500 Hz in the box, in a furnished room and, at absorption 0.1, in the mesh of a measured room: `SEEDS` traces of each on one
/// thread, with the time of each. Meshes and places are written for others to trace.
fn decays(folder: &Path, measured: Option<&str>) {
    let box_places = [[2.0, 3.0, 1.5], [7.0, 4.0, 1.6]];
    let mut rooms = vec![
        ("box, specular", finely_meshed(1, 0.1, 0.0), box_places),
        ("box", finely_meshed(1, 0.1, 0.3), box_places),
        ("furnished", furnished(0.1, 0.3), box_places),
    ];
    if let Some(room) = measured.map(|folder| MeasuredRoom::read(folder).unwrap()) {
        let plain = Material::uniform(Bands::SIMULATION, 0.1, 0.3).unwrap();
        let scene = room.scene();
        let materials =
            scene.materials().iter().map(|m| NamedMaterial { name: m.name.clone(), material: plain.clone() });
        let scene =
            Scene::new(scene.vertices().to_vec(), scene.triangles().to_vec(), materials.collect()).unwrap();
        let places = [room.sources()[0].position_m, room.receivers()[0].position_m];
        rooms.push(("measured", scene, places));
    }
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for (name, scene, [source_m, receiver_m]) in &rooms {
        let (source, receiver) =
            (Source::omni("S", *source_m).unwrap(), Receiver::omni("R", *receiver_m).unwrap());
        let materials: Vec<Material> = scene.materials().iter().map(|m| m.material.clone()).collect();
        let air = Air::default();
        let trace = |seed: u64| -> (f64, Vec<f64>) {
            let config = TracerConfig {
                rays: RAYS,
                duration_s: DECAY_S,
                seed,
                allow_leaks: true,
                ..Default::default()
            };
            let tracer = PathTracer::new(config).unwrap();
            let start = Instant::now();
            let paths = tracer.trace(scene, &source, &receiver, &air, &()).unwrap();
            let energies = paths.energies(&Conditions::new(&materials, &air)).unwrap();
            let mut bins = vec![0.0; (DECAY_S / BIN_S) as usize];
            for (length_m, energy) in paths.lengths_m().iter().zip(&energies[OCTAVE_500_HZ]) {
                let bin = (f64::from(*length_m) / air.speed_of_sound_m_s() / BIN_S) as usize;
                if let Some(bin) = bins.get_mut(bin) {
                    *bin += f64::from(*energy);
                }
            }
            (start.elapsed().as_secs_f64(), bins)
        };
        one_thread.install(|| trace(SEEDS));
        let (seconds, bins): (Vec<f64>, Vec<Vec<f64>>) =
            (0..SEEDS).map(|seed| one_thread.install(|| trace(seed))).unzip();
        let vertices = scene.vertices().iter().map(|v| format!("v {} {} {}\n", v[0], v[1], v[2]));
        let faces = scene.triangles().iter().map(|t| t.vertices.map(|v| v + 1));
        let faces = faces.map(|[a, b, c]| format!("f {a} {b} {c}\n"));
        std::fs::write(folder.join(format!("{name}.obj")), vertices.chain(faces).collect::<String>())
            .unwrap();
        println!(
            "{{\"what\": \"decays\", \"room\": \"{name}\", \"triangles\": {}, \"scattering\": {}, \"rays\": {RAYS}, \
             \"places_m\": {:?}, \"speed_m_s\": {}, \"seconds\": {seconds:?}, \"bins\": {bins:?}}}",
            scene.triangles().len(),
            scene.materials()[0].material.scattering().values()[OCTAVE_500_HZ],
            [source_m, receiver_m],
            air.speed_of_sound_m_s(),
        );
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter(|argument| !argument.starts_with('-'));
    let Some(folder) = arguments.next() else {
        eprintln!("pass a folder to write scenes and rays to");
        return;
    };
    std::fs::create_dir_all(&folder).unwrap();
    let which = arguments.next();
    if which.as_deref() == Some("decays") {
        return decays(Path::new(&folder), arguments.next().as_deref());
    }
    hits(Path::new(&folder));
    if which.as_deref() != Some("hits") {
        paths();
    }
}
