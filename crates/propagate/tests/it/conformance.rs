//! Tracers of the workspace under the conformance checks that are open to every tracer, in one table.
//!
//! `cargo test -p sabine-propagate --test it conformance:: -- --nocapture` prints it.

use sabine_acoustics::Error;
use sabine_paths::conformance::check;
use sabine_paths::{Contribution, PathSet, Propagator};
use sabine_propagate::{PathTracer, ReferenceTracer, TracerConfig};
use sabine_scene::{Receiver, Scene, Source};
use sabine_testkit::{ShoeboxImages, at_night};

fn config(rays: usize) -> TracerConfig {
    TracerConfig { rays, duration_s: 0.6, ..TracerConfig::default() }
}

#[test]
fn tracers_conform() {
    let tracers: [(&str, Box<dyn Propagator>, bool); 3] = [
        ("PathTracer", Box::new(PathTracer::new(config(4000)).unwrap()), true),
        // Its Monte-Carlo error falls slowly: a sphere catches what the path tracer joins.
        (
            "ReferenceTracer",
            Box::new(ReferenceTracer::new(config(if at_night() { 200_000 } else { 50_000 })).unwrap()),
            true,
        ),
        ("ShoeboxImages", Box::new(ShoeboxImages::new(0.3).unwrap()), false),
    ];
    for (name, tracer, scatters) in tracers {
        let checks = check(&*tracer, scatters).unwrap();
        checks.iter().for_each(|check| println!("{name:16} {check}"));
        let failed: Vec<String> =
            checks.iter().filter(|check| !check.passed()).map(ToString::to_string).collect();
        assert!(failed.is_empty(), "{name}: {failed:?}");
    }
}

/// A tracer with a fault: each must be found by the check that is made for it.
struct Faulty(fn(&mut Contribution));

impl Propagator for Faulty {
    fn trace(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &sabine_acoustics::Air,
        observer: &dyn sabine_acoustics::Observer,
    ) -> Result<PathSet, Error> {
        let right = ShoeboxImages::new(0.05)?.trace(scene, source, receiver, air, observer)?;
        let mut paths = PathSet::new(right.materials(), right.max_length_m());
        // Chains are copied one by one: a parent comes before its children.
        for chain in 1..right.chain_count() as u32 {
            let (parent, material, reflection) = right.last_reflection(chain).unwrap();
            paths.reflect(parent, material, reflection);
        }
        for i in 0..right.len() {
            let mut contribution = Contribution {
                length_m: f64::from(right.lengths_m()[i]),
                log_weight: f64::from(right.log_weights()[i]),
                chain: right.chains()[i],
                tail: right.tails()[i],
                departure: right.departure(i),
                arrival: right.arrival(i),
                batch: right.batch(i),
            };
            (self.0)(&mut contribution);
            paths.try_push(contribution)?;
        }
        Ok(paths)
    }
}

#[test]
fn faults_are_found_by_their_checks() {
    let failed = |fault: fn(&mut Contribution)| -> Vec<&'static str> {
        let mut names: Vec<_> = check(&Faulty(fault), false)
            .unwrap()
            .into_iter()
            .filter(|check| !check.passed())
            .map(|check| check.name)
            .collect();
        names.dedup();
        names
    };
    assert!(failed(|_| {}).is_empty());
    // Pressure in place of energy: 1/d.
    assert!(failed(|path| path.log_weight *= 0.5).contains(&"direct sound"));
    assert_eq!(failed(|path| std::mem::swap(&mut path.departure, &mut path.arrival)), ["direct sound"]);
    assert_eq!(failed(|path| path.length_m *= 1.01), ["direct sound"]);
    // Reflections twice as strong as they are.
    let louder = |path: &mut Contribution| {
        path.log_weight += if path.chain == PathSet::DIRECT { 0.0 } else { 2f64.ln() };
    };
    assert_eq!(failed(louder), ["first reflections"]);
    // What depends on which end is the source.
    let one_way = |path: &mut Contribution| path.log_weight += 0.2 * path.departure[0];
    assert!(failed(one_way).contains(&"reciprocity"));
}

#[test]
fn what_a_tracer_reports_wrongly_is_an_error() {
    let ahead = [1.0, 0.0, 0.0];
    let right = Contribution {
        length_m: 1.0,
        log_weight: 0.0,
        chain: PathSet::DIRECT,
        tail: PathSet::DIRECT,
        departure: ahead,
        arrival: ahead,
        batch: None,
    };
    let mut paths = PathSet::new(1, 10.0);
    paths.try_push(right).unwrap();
    for (wrong, word) in [
        (Contribution { chain: 1, ..right }, "chain 1"),
        (Contribution { tail: 7, ..right }, "chain 7"),
        (Contribution { batch: Some(PathSet::BATCHES), ..right }, "batch 32"),
        (Contribution { length_m: f64::NAN, ..right }, "length"),
        (Contribution { length_m: -1.0, ..right }, "length"),
        (Contribution { log_weight: f64::INFINITY, ..right }, "log weight"),
    ] {
        let error = paths.try_push(wrong).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
    assert_eq!(paths.len(), 1);
}
