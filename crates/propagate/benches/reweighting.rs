//! New absorption for paths that are there already. `cargo bench -p sabine-propagate --bench reweighting`
#![allow(clippy::unwrap_used, missing_docs)] // a panic is how a bench fails; criterion's macros write no docs

mod rooms;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rooms::finely_meshed;
use sabine_acoustics::*;
use sabine_paths::Conditions;
use sabine_paths::laws::{BoundLaws, Law, LawParameter, LawSite, LawTarget};
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::*;

/// Paths of the box until there are a million contributions, and what its walls are changed to.
fn a_million() -> (PathSet, Vec<Material>) {
    let scene = finely_meshed(1, 0.1, 0.3);
    let (source, receiver) =
        (Source::omni("S", [2.0, 3.0, 1.5]).unwrap(), Receiver::omni("R", [7.0, 4.0, 1.6]).unwrap());
    let trace = |rays: usize| {
        let config = TracerConfig { rays, duration_s: 1.5, ..Default::default() };
        PathTracer::new(config).unwrap().trace(&scene, &source, &receiver, &Air::default(), &()).unwrap()
    };
    let per_ray = trace(1_000).len() as f64 / 1_000.0;
    let paths = trace((1e6 / per_ray).round() as usize);
    let softer = (0..6).map(|i| {
        let absorption = 0.05 + 0.05 * f64::from(i);
        Material::uniform(Bands::SIMULATION, absorption, 0.2).unwrap()
    });
    (paths, softer.collect())
}

fn reweighting(criterion: &mut Criterion) {
    let (paths, materials) = a_million();
    println!("{} contributions, {} chains", paths.len(), paths.chain_count());
    let air = Air::default();
    let mut group = criterion.benchmark_group("reweight");
    group.sample_size(20).throughput(Throughput::Elements(paths.len() as u64));
    group.bench_function("reflectance of all chains, one band", |bencher| {
        bencher.iter(|| paths.log_reflectance(&materials, 3).unwrap());
    });
    group.bench_function("energies, eight bands", |bencher| {
        bencher.iter(|| paths.energies(&Conditions::new(&materials, &air)).unwrap());
    });
    group.bench_function("energy response in 1 ms, eight bands", |bencher| {
        bencher.iter(|| paths.energy_response(&Conditions::new(&materials, &air), 1e-3).unwrap());
    });
    for (name, law) in laws() {
        let scene = finely_meshed(1, 0.1, 0.3);
        let (source, receiver) =
            (Source::omni("S", [2.0, 3.0, 1.5]).unwrap(), Receiver::omni("R", [7.0, 4.0, 1.6]).unwrap());
        let bound = BoundLaws::new(&[law], &LawSite::new(&scene, &source, &receiver, &air)).unwrap();
        group.bench_function(format!("energies, eight bands, law of {name}"), |bencher| {
            bencher.iter(|| paths.energies(&Conditions::new(&materials, &air).with_laws(&bound)).unwrap());
        });
    }
    group.finish();
}

/// Laws of each kind of cost: the same for all paths or in all bands, by path and band, with an exponential for each, of a surface, of angles.
fn laws() -> Vec<(&'static str, Law)> {
    let law = |target, surface, formula: &str, parameters: &[(&str, f64, &str)]| {
        let parameter = |&(name, value, unit): &(&str, f64, &str)| {
            (name.to_owned(), LawParameter::new(value, [value - 1.0, value + 1.0], unit))
        };
        Law::new("law", target, surface, formula, parameters.iter().map(parameter)).unwrap()
    };
    let path = |formula, parameters| law(LawTarget::Path, None, formula, parameters);
    let (db, f) = (("a", 1.0, "dB"), ("f", 2.0, "kHz"));
    vec![
        ("the band", path("-a * above(frequency_hz, f)", &[db, f])),
        ("the length", path("-a * length_m / l", &[db, ("l", 30.0, "m")])),
        ("length and band", path("-a * length_m / l * (frequency_hz / f)^2", &[db, f, ("l", 30.0, "m")])),
        ("hits and band", path("-a * hits(4) * above(frequency_hz, f)", &[db, f])),
        ("an exponential by path", path("-a * exp(-length_m / l)", &[db, ("l", 30.0, "m")])),
        (
            "an exponential by path and band",
            path("-a * exp(-length_m / l * frequency_hz / f)", &[db, f, ("l", 30.0, "m")]),
        ),
        ("azimuth", path("-a * cos(departure_azimuth_deg - p)", &[db, ("p", 30.0, "deg")])),
        (
            "grazing sound",
            law(
                LawTarget::Reflection,
                Some("4"),
                "-a * (1 - cos_incidence)^2 * above(frequency_hz, f)",
                &[db, f],
            ),
        ),
    ]
}

criterion_group!(benches, reweighting);
criterion_main!(benches);
