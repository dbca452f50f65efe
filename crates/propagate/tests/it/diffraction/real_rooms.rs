//! Edges of the measured rooms of BRAS: sound goes around them only in the shadow.

use super::*;
use sabine_acoustics::Air;
use sabine_paths::{Conditions, PathSet, RayScene};
use sabine_propagate::{DiffractingEdges, MeshScene};
use std::path::Path;

/// As much of OBJ as the models of BRAS use.
fn read_obj(path: &Path) -> Scene {
    let text = std::fs::read_to_string(path).unwrap();
    let (mut vertices, mut faces) = (Vec::<[f64; 3]>::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let at: Vec<f64> = words.map(|w| w.parse().unwrap()).collect();
                vertices.push([at[0], at[1], at[2]]);
            }
            Some("f") => {
                let corner = |w: &str| vertices[w.split('/').next().unwrap().parse::<usize>().unwrap() - 1];
                faces.push(words.map(corner).collect());
            }
            _ => {}
        }
    }
    scene(&faces)
}

/// All `position_m` under a heading of `room.toml`.
fn positions(toml: &str, heading: &str) -> Vec<[f64; 3]> {
    let list = |part: &str| -> Option<[f64; 3]> {
        let list = part.split("position_m").nth(1)?.split('[').nth(1)?.split(']').next()?;
        let at: Vec<f64> = list.split(',').map(|c| c.trim().parse().unwrap()).collect();
        Some([at[0], at[1], at[2]])
    };
    toml.split(heading).skip(1).filter_map(list).collect()
}

#[test]
fn real_rooms_have_edges_and_paths_over_them_only_in_the_shadow() {
    let rooms = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms"));
    if !rooms.is_dir() {
        eprintln!("skipped: {} is absent", rooms.display());
        return;
    }
    let mut in_shadow = 0;
    let mut state = 1u64;
    // A random number from 0 to 1 (Knuth's multiplier).
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    for name in ["bras_cr1_doorangle1", "bras_cr1_doorangle3", "bras_cr2", "bras_cr3", "bras_cr4"] {
        let scene = read_obj(&rooms.join(name).join("room.obj"));
        let toml = std::fs::read_to_string(rooms.join(name).join("room.toml")).unwrap();
        let mesh = MeshScene::new(&scene).unwrap();
        let start = std::time::Instant::now();
        let edges = DiffractingEdges::find(&scene, &mesh);
        eprintln!(
            "{name}: {} triangles, {} edges in {:?}",
            scene.triangles().len(),
            edges.len(),
            start.elapsed()
        );
        // What it costs at worst: between any two points of the box about the room.
        let bounds: Vec<[f64; 2]> = (0..3)
            .map(|axis| {
                let all = scene.vertices().iter().map(|v| v[axis]);
                [all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max)]
            })
            .collect();
        let (mut longest, mut most) = (std::time::Duration::ZERO, 0);
        for _ in 0..100 {
            let mut place = || {
                [0, 1, 2].map(|axis: usize| bounds[axis][0] + random() * (bounds[axis][1] - bounds[axis][0]))
            };
            let (mut paths, from, to) = (PathSet::new(1, 200.0), place(), place());
            let start = std::time::Instant::now();
            edges.add_paths(&mut paths, &mesh, from, to);
            longest = longest.max(start.elapsed());
            most = most.max(paths.len());
        }
        eprintln!("  100 random pairs: at most {longest:?} and {most} paths");
        for source in positions(&toml, "[[sources]]") {
            for receiver in positions(&toml, "[[receivers]]") {
                let start = std::time::Instant::now();
                let mut paths = PathSet::new(1, 200.0);
                edges.add_paths(&mut paths, &mesh, source, receiver);
                let took = start.elapsed();
                let line: Vec<f64> = (0..3).map(|i| receiver[i] - source[i]).collect();
                let d = distance(source, receiver);
                let heading = [line[0] / d, line[1] / d, line[2] / d];
                let blocked = mesh.closest_hit(source, heading, d - 1e-5).is_some();
                assert!(blocked || paths.is_empty(), "{name} {source:?} {receiver:?}");
                in_shadow += usize::from(blocked);
                let energies = paths.energies(&Conditions::new(&[hard()], &Air::default())).unwrap();
                for energy in energies.iter().flatten() {
                    assert!(energy.is_finite() && f64::from(*energy) < d.powi(-2));
                }
                if blocked {
                    let level = |e: &Vec<f32>| db(e.iter().map(|&e| f64::from(e)).sum::<f64>() * d * d);
                    let levels: Vec<f64> = energies.iter().map(level).collect();
                    eprintln!("  {source:?} {receiver:?}: {} paths, {took:?}, {levels:.1?} dB", paths.len());
                }
            }
        }
    }
    assert!(in_shadow > 0);
}
