//! Real models, where their files are present: BRAS CR1 to CR4 (Aspoeck et al. 2020), dEchorate.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod shoebox;

use rand::{Rng, SeedableRng};
use sabine_acoustics::*;
use sabine_propagate::*;
use shoebox::*;
use std::path::Path;

fn rooms() -> Vec<(&'static str, MeasuredRoom)> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms"));
    if !path.is_dir() {
        eprintln!("skipped: {} is absent", path.display());
        return Vec::new();
    }
    ["bras_cr1_doorangle1", "bras_cr1_doorangle3", "bras_cr2", "bras_cr3", "bras_cr4", "dechorate_011111"]
        .map(|name| (name, MeasuredRoom::read(path.join(name)).unwrap()))
        .into()
}

/// How often the triangles surround a point, by solid angles (van Oosterom and Strackee 1983, Jacobson et al. 2013): shares
/// no code with the rays.
fn winding(scene: &Scene, p: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let angle = |i: usize| {
        let [a, b, c] = scene.corners_m(i).map(|q| std::array::from_fn(|k| q[k] - p[k]));
        let cross: [f64; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            b[i] * c[j] - b[j] * c[i]
        });
        let [la, lb, lc] = [a, b, c].map(|v: [f64; 3]| dot(v, v).sqrt());
        let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        2.0 * dot(a, cross).atan2(below)
    };
    (0..scene.triangles().len()).map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

#[test]
fn experiment() {
    for (name, room) in rooms() {
        let scene = room.scene();
        let mesh = MeshScene::new(scene).unwrap();
        let from = &room.sources()[0];
        println!("{name}\n{}", MeshReport::inspect(scene, from.position_m).unwrap());
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for v in scene.vertices() {
            for k in 0..3 {
                low[k] = low[k].min(v[k]);
                high[k] = high[k].max(v[k]);
            }
        }
        let mut points: Vec<(&str, [f64; 3])> = (0..600)
            .map(|_| {
                (
                    "box",
                    std::array::from_fn(|k| {
                        let d = high[k] - low[k];
                        low[k] - 0.1 * d + 1.2 * d * random.random::<f64>()
                    }),
                )
            })
            .collect();
        for _ in 0..400 {
            let t = random.random_range(0..scene.triangles().len());
            let [a, b, c] = scene.corners_m(t);
            let (u, v): (f64, f64) = (random.random(), random.random());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let e: [f64; 3] = std::array::from_fn(|k| b[k] - a[k]);
            let f: [f64; 3] = std::array::from_fn(|k| c[k] - a[k]);
            let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
            let l = n.iter().map(|x| x * x).sum::<f64>().sqrt();
            if l < 1e-9 {
                continue;
            }
            for s in [-0.02, 0.02] {
                points.push((
                    if s < 0.0 { "behind" } else { "front" },
                    std::array::from_fn(|k| a[k] + u * e[k] + v * f[k] + s * n[k] / l),
                ));
            }
        }
        let mut count = std::collections::BTreeMap::new();
        for (kind, p) in points {
            let w = winding(scene, p);
            let class = if (w + 1.0).abs() < 0.1 {
                "in"
            } else if w.abs() < 0.1 {
                "out"
            } else {
                "?"
            };
            let verdict = match check_placement(&mesh, from, &receiver(p)) {
                Ok(_) => "ok",
                Err(sabine_propagate::Error::Outside { .. }) => "outside",
                Err(sabine_propagate::Error::InsideBody { .. }) => "body",
                Err(_) => "touch",
            };
            *count.entry((kind, class, verdict)).or_insert(0) += 1;
        }
        println!("{count:#?}");
    }
}
