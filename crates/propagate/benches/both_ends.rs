//! What rays from both ends gain over rays from the source alone: the ratio of variance times time.
//! `cargo bench -p sabine-propagate --bench both_ends`
#![allow(clippy::unwrap_used)] // a panic is how a bench fails

mod rooms;

use rooms::finely_meshed;
use sabine_acoustics::*;
use sabine_paths::Conditions;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::*;
use std::path::Path;
use std::time::Instant;

/// Independent traces of each kind, in turn, so that what else the machine does falls on both alike.
const TRACES: u64 = 12;
/// Levels of the decay curve at which the error is read, in dB below the total.
const LEVELS_DB: [f64; 4] = [-5.0, -10.0, -20.0, -30.0];
const BIN_S: f64 = 2e-3;
const BAND: usize = 3;

/// Energy that is left at each bin, in the octave that is looked at.
fn remaining(paths: &PathSet, materials: &[Material]) -> Vec<f64> {
    let response = paths.energy_response(&Conditions::new(materials, &Air::default()), BIN_S).unwrap();
    let mut left: Vec<f64> = response.band(BAND).to_vec();
    for i in (1..left.len()).rev() {
        left[i - 1] += left[i];
    }
    left
}

fn compare(name: &str, scene: &Scene, from: [f64; 3], to: [f64; 3], duration_s: f64, rays: usize) {
    let (source, receiver) = (Source::omni("S", from).unwrap(), Receiver::omni("R", to).unwrap());
    let materials: Vec<Material> = scene.materials().iter().map(|m| m.material.clone()).collect();
    let mut seconds = [0.0; 2];
    let mut curves: [Vec<Vec<f64>>; 2] = [Vec::new(), Vec::new()];
    for seed in 0..TRACES {
        for (which, bidirectional) in [false, true].into_iter().enumerate() {
            let config = TracerConfig {
                rays,
                duration_s,
                seed,
                bidirectional,
                allow_leaks: true,
                ..Default::default()
            };
            let tracer = PathTracer::new(config).unwrap();
            let prepared = tracer.prepare(scene).unwrap();
            let start = Instant::now();
            let paths = tracer.trace_prepared(&prepared, &source, &receiver, &Air::default(), &()).unwrap();
            seconds[which] += start.elapsed().as_secs_f64() / TRACES as f64;
            curves[which].push(remaining(&paths, &materials));
        }
    }
    let bins = curves[0][0].len();
    let mean = |bin: usize| curves.iter().flatten().map(|c| c[bin]).sum::<f64>() / (2 * TRACES) as f64;
    print!("| {name} | {:.2} / {:.2} |", seconds[0], seconds[1]);
    for level_db in LEVELS_DB {
        let bin = (0..bins).find(|&b| mean(b) <= mean(0) * 10f64.powf(level_db / 10.0)).unwrap_or(bins - 1);
        let error_db = [0, 1].map(|which: usize| {
            let values: Vec<f64> = curves[which].iter().map(|c| c[bin]).collect();
            let middle = values.iter().sum::<f64>() / values.len() as f64;
            let spread = values.iter().map(|v| (v - middle).powi(2)).sum::<f64>() / (values.len() - 1) as f64;
            10.0 / std::f64::consts::LN_10 * spread.sqrt() / middle
        });
        let gain = (error_db[0] / error_db[1]).powi(2) * seconds[0] / seconds[1];
        print!(" {:.2} / {:.2} dB: {gain:.1} |", error_db[0], error_db[1]);
    }
    println!();
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap();
    println!(
        "one thread; source alone / both ends: seconds, spread of the decay curve over {TRACES} seeds at a level, and how many times"
    );
    println!("less time both ends need for the same spread (each known to about a half)\n");
    println!("| room | seconds | -5 dB | -10 dB | -20 dB | -30 dB |\n|---|---|---|---|---|---|");
    for scattering in [0.1, 0.3, 1.0] {
        let scene = finely_meshed(1, 0.1, scattering);
        compare(
            &format!("box, scattering {scattering}"),
            &scene,
            [2.0, 3.0, 1.5],
            [7.0, 4.0, 1.6],
            1.2,
            4000,
        );
    }
    let rooms = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/rooms");
    for folder in ["bras_cr1_doorangle1", "bras_cr1_doorangle3"] {
        let Ok(room) = MeasuredRoom::read(rooms.join(folder)) else {
            println!("{folder}: skipped, the data is not there");
            continue;
        };
        for scattering in [0.1, 0.3] {
            let given = room.scene().materials();
            let materials = given.iter().map(|named| {
                let bands = named.material.bands();
                Material::new(named.material.absorption().clone(), PerBand::uniform(bands, scattering))
                    .unwrap()
            });
            let scene = room.scene().with_materials(materials.collect()).unwrap();
            let (source, receiver) = (&room.sources()[0], &room.receivers()[0]);
            let name = format!("{folder}, {} to {}, scattering {scattering}", source.id, receiver.id);
            compare(&name, &scene, source.position_m, receiver.position_m, 1.0, 8000);
        }
    }
}
