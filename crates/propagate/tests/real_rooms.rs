//! Real models, where their files are present: BRAS CR1 to CR4 (Aspoeck et al. 2020), dEchorate.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod shoebox;

use sabine_acoustics::*;
use sabine_propagate::*;
use shoebox::*;
use std::path::{Path, PathBuf};

fn rooms() -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms"));
    if path.is_dir() {
        return Some(path.to_path_buf());
    }
    eprintln!("skipped: {} is absent", path.display());
    None
}

/// As much of OBJ as these files use; one material throughout.
fn read_obj(path: &Path) -> Scene {
    let text = std::fs::read_to_string(path).unwrap();
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let at: Vec<f64> = words.map(|w| w.parse().unwrap()).collect();
                vertices.push([at[0], at[1], at[2]]);
            }
            Some("f") => {
                let corners: Vec<u32> =
                    words.map(|w| w.split('/').next().unwrap().parse::<u32>().unwrap() - 1).collect();
                for i in 1..corners.len() - 1 {
                    triangles
                        .push(Triangle { vertices: [corners[0], corners[i], corners[i + 1]], material: 0 });
                }
            }
            _ => {}
        }
    }
    let material = Material::uniform(OctaveBands::T60, 0.1, 0.2).unwrap();
    Scene::new(vertices, triangles, vec![NamedMaterial { name: "all".into(), material }]).unwrap()
}

/// All `position_m` under a heading of `room.toml`.
fn positions(toml: &str, heading: &str) -> Vec<[f64; 3]> {
    toml.split(heading)
        .skip(1)
        .filter_map(|part| {
            let list = part.split("position_m").nth(1)?.split('[').nth(1)?.split(']').next()?;
            let at: Vec<f64> = list.split(',').map(|c| c.trim().parse().unwrap()).collect();
            Some([at[0], at[1], at[2]])
        })
        .collect()
}

#[test]
fn every_source_and_receiver_of_the_real_rooms_is_inside_and_traced() {
    let Some(rooms) = rooms() else { return };
    for name in
        ["bras_cr1_doorangle1", "bras_cr1_doorangle3", "bras_cr2", "bras_cr3", "bras_cr4", "dechorate_011111"]
    {
        let scene = read_obj(&rooms.join(name).join("room.obj"));
        let toml = std::fs::read_to_string(rooms.join(name).join("room.toml")).unwrap();
        let (sources, receivers) = (positions(&toml, "[[sources]]"), positions(&toml, "[[receivers]]"));
        assert!(!sources.is_empty() && !receivers.is_empty(), "{name}");
        let report = MeshReport::inspect(&scene, sources[0]).unwrap();
        eprintln!(
            "{name}: {} triangles, {} planes, {:.0} m3, escape rate {:.5}, {:?}",
            scene.triangles().len(),
            report.planes,
            report.volume_m3,
            report.escape_rate,
            report.warnings()
        );
        let config = TracerConfig { rays: 500, duration_s: 0.3, ..Default::default() };
        let tracer = PathTracer::new(config).unwrap();
        for from in &sources {
            for to in receivers.iter().take(3) {
                let start = std::time::Instant::now();
                let paths = tracer.trace(&scene, &source(*from), &receiver(*to), &Air::default(), &());
                let paths = paths.unwrap_or_else(|e| panic!("{name} {from:?} {to:?}: {e}"));
                let exact = (0..paths.len()).filter(|&i| paths.is_exact(i)).count();
                eprintln!("  {from:?} {to:?}: {} paths, {exact} exact, {:?}", paths.len(), start.elapsed());
                assert!(paths.len() > exact);
            }
        }
        // Outside is outside.
        let error = tracer
            .trace(&scene, &source([1e3, 0.0, 0.0]), &receiver(receivers[0]), &Air::default(), &())
            .unwrap_err();
        assert!(error.to_string().contains("outside"), "{name}: {error}");
    }
}
