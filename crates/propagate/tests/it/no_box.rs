//! Rooms that are no box against the particles of the second laboratory, which share no code with the tracer.

use sabine_acoustics::{Material, PerBand};
use sabine_paths::{Conditions, Propagator};
use sabine_propagate::{PathTracer, TracerConfig};
use sabine_scene::Scene;
use sabine_testkit::{PolyhedralConfig, PolyhedralRoom, Polyhedron, at_night};
use std::time::Instant;

const SPAN_S: f64 = 0.05;
/// Largest difference in dB of what all receivers hear together, down to so many dB below all that arrives.
const ALLOWED_DB: [(f64, f64); 2] = [(-30.0, 0.15), (-40.0, 0.25)];

/// Levels re all that arrives between which figures are printed.
const LEVELS_DB: [(f64, f64); 4] = [(0.0, -10.0), (-10.0, -20.0), (-20.0, -30.0), (-30.0, -40.0)];

/// What all receivers hear together, `[band][span]`.
type Heard = Vec<Vec<f64>>;

/// By the particles of the laboratory.
fn counted(laboratory: &PolyhedralRoom) -> Heard {
    let each = (SPAN_S / PolyhedralRoom::BIN_S) as usize;
    let energies = laboratory.energies();
    let spans =
        |bins: &[f64]| -> Vec<f64> { bins.chunks_exact(each).map(|span| span.iter().sum()).collect() };
    let mut heard = vec![vec![0.0; energies[0][0].len() / each]; energies[0].len()];
    for of_receiver in &energies {
        for (sums, bins) in heard.iter_mut().zip(of_receiver) {
            sums.iter_mut().zip(spans(bins)).for_each(|(sum, e)| *sum += e);
        }
    }
    heard
}

/// By rays, at true absorption; each receiver has rays of its own. They are drawn for the scene's scattering and for more of it in some octaves.
fn traced(laboratory: &PolyhedralRoom, spans: usize, config: &TracerConfig, more: &[f64]) -> Heard {
    let scene = scattering_more(laboratory.scene(), more);
    let materials = laboratory.true_materials().unwrap();
    let (source, air) = (laboratory.source(), laboratory.air());
    let mut heard = vec![vec![0.0; spans]; materials[0].bands().len()];
    for (index, receiver) in laboratory.receivers().iter().enumerate() {
        let (seed, duration_s) = (config.seed + index as u64, spans as f64 * SPAN_S);
        let tracer = PathTracer::new(TracerConfig { seed, duration_s, ..config.clone() }).unwrap();
        let paths = tracer.trace(&scene, source, receiver, &air, &()).unwrap();
        let response = paths.energy_response(&Conditions::new(&materials, &air), SPAN_S).unwrap();
        for (band, sums) in heard.iter_mut().enumerate() {
            sums.iter_mut().zip(response.band(band)).for_each(|(sum, e)| *sum += e);
        }
    }
    heard
}

/// The scene in which octaves scatter these shares more, in turn.
fn scattering_more(scene: &Scene, more: &[f64]) -> Scene {
    let materials = scene.materials().iter().map(|named| {
        let (absorption, scattering) = (named.material.absorption(), named.material.scattering());
        let scattering = PerBand::from_fn(scattering.bands(), |band| {
            let stated = scattering.values()[band];
            stated + (1.0 - stated) * more[band % more.len()]
        });
        Material::new(absorption.clone(), scattering).unwrap()
    });
    scene.with_materials(materials.collect()).unwrap()
}

#[test]
fn late_sound_is_that_of_particles() {
    is_that_of_particles(Polyhedron::SlopedCeiling);
}

#[test]
#[ignore = "nightly: half a minute, and another shape is not ignored"]
fn late_sound_in_a_furnished_room_is_that_of_particles() {
    is_that_of_particles(Polyhedron::Furnished);
}

fn is_that_of_particles(shape: Polyhedron) {
    let receivers = if at_night() { 12 } else { 4 };
    let config = PolyhedralConfig { seed: 5551, shape, receivers, ..PolyhedralConfig::default() };
    let laboratory = PolyhedralRoom::new(config).unwrap();
    let counted = counted(&laboratory);
    let config = TracerConfig { rays: 40_000, ..TracerConfig::default() };
    let traced = traced(&laboratory, counted[0].len(), &config, &[0.0]);
    for (band, (counted, traced)) in counted.iter().zip(&traced).enumerate() {
        let whole: f64 = counted.iter().sum();
        for (span, (particles, rays)) in counted.iter().zip(traced).enumerate() {
            let level_db = 10.0 * (particles / whole).log10();
            let off_db = 10.0 * (rays / particles).log10();
            println!("{shape:?}, band {band}, {span}: {level_db:.1} dB, rays {off_db:+.3} dB");
            for (down_to_db, allowed_db) in ALLOWED_DB {
                assert!(
                    level_db < down_to_db || off_db.abs() < allowed_db,
                    "{shape:?} {band} {span}: {off_db} dB"
                );
            }
        }
    }
}

/// Prints how far late sound lies off that of particles, with guided directions and without, in four rooms from a seed on.
#[test]
#[ignore = "figures for docs/validation/propagate.md"]
fn late_sound_with_guided_directions() {
    let first: u64 = std::env::var("SABINE_SEED").map_or(1, |seed| seed.parse().unwrap());
    println!("| room | below all that arrives (dB) | off without (dB) | off with (dB) | times as long |");
    let shapes = [Polyhedron::L, Polyhedron::SlopedCeiling, Polyhedron::Wedge, Polyhedron::Furnished];
    for (seed, shape) in (first..).zip(shapes) {
        let config = PolyhedralConfig { seed, shape, ..PolyhedralConfig::default() };
        let laboratory = PolyhedralRoom::new(config).unwrap();
        let counted = counted(&laboratory);
        let run = |path_guiding: bool| {
            let started = Instant::now();
            let all: Vec<Heard> = (0..8)
                .map(|seed| {
                    let config = TracerConfig {
                        rays: 3_000,
                        seed: 1000 * seed,
                        path_guiding,
                        ..TracerConfig::default()
                    };
                    traced(&laboratory, counted[0].len(), &config, &[0.0])
                })
                .collect();
            (all, started.elapsed().as_secs_f64())
        };
        let ((without, without_s), (with, with_s)) = (run(false), run(true));
        for level_db in LEVELS_DB {
            let off_db = |traced: &[Heard]| off_db(&counted, traced, level_db).0;
            let (without_db, with_db, times) = (off_db(&without), off_db(&with), with_s / without_s);
            let down = down(level_db);
            println!("| {shape:?} {seed} | {down} | {without_db:.2} | {with_db:.2} | {times:.2} |");
        }
    }
}

/// Prints how far late sound lies off that of particles where rays are drawn for several scatterings, as a diagnosis does, in four rooms from a
/// seed on.
#[test]
#[ignore = "figures for docs/validation/propagate.md"]
fn late_sound_as_a_diagnosis_traces_it() {
    let first: u64 = std::env::var("SABINE_SEED").map_or(1, |seed| seed.parse().unwrap());
    let equal_parts: &[f64] = &[0.0, 0.12, 0.4, 0.85];
    let mostly_stated: &[f64] = &[0.0, 0.12, 0.0, 0.4, 0.0, 0.85, 0.0];
    let ways = [(&[0.0][..], false), (equal_parts, false), (mostly_stated, false), (mostly_stated, true)];
    println!(
        "| room | below all that arrives (dB) | as stated | in equal parts | mostly as stated | the same, guided |"
    );
    let shapes = [Polyhedron::L, Polyhedron::SlopedCeiling, Polyhedron::Wedge, Polyhedron::Furnished];
    for (seed, shape) in (first..).zip(shapes) {
        let config = PolyhedralConfig { seed, shape, ..PolyhedralConfig::default() };
        let laboratory = PolyhedralRoom::new(config).unwrap();
        let counted = counted(&laboratory);
        let run = |(more, path_guiding): (&[f64], bool)| -> Vec<Heard> {
            let one = |seed: u64| {
                let own = TracerConfig { rays: 3_000, seed: 1000 * seed, path_guiding, ..Default::default() };
                traced(&laboratory, counted[0].len(), &own, more)
            };
            (0..8).map(one).collect()
        };
        let heard = ways.map(run);
        for level_db in LEVELS_DB {
            let figures = heard.iter().map(|heard| {
                let (off_db, mean_db) = off_db(&counted, heard, level_db);
                format!(" {off_db:.2} ({mean_db:+.2}) |")
            });
            println!("| {shape:?} {seed} | {} |{}", down(level_db), figures.collect::<String>());
        }
    }
}

/// How far what rays bring lies off what particles do, in dB: root mean square and mean, over the spans in which particles lie between these
/// levels re all that arrives.
fn off_db(counted: &Heard, traced: &[Heard], (from_db, to_db): (f64, f64)) -> (f64, f64) {
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
    for (band, counted) in counted.iter().enumerate() {
        let whole: f64 = counted.iter().sum();
        for (span, particles) in counted.iter().enumerate() {
            let level_db = 10.0 * (particles / whole).log10();
            if level_db <= from_db && level_db > to_db {
                for heard in traced {
                    let off = 10.0 * (heard[band][span] / particles).log10();
                    sum += off;
                    squares += off * off;
                    count += 1.0;
                }
            }
        }
    }
    (f64::sqrt(squares / count), sum / count)
}

fn down((from_db, to_db): (f64, f64)) -> String {
    format!("{:.0} to {:.0}", from_db.abs(), to_db.abs())
}
