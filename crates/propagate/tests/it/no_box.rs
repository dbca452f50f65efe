//! Rooms that are no box against the particles of the second laboratory, which share no code with the tracer.

use sabine_paths::{Conditions, Propagator};
use sabine_propagate::{PathTracer, TracerConfig};
use sabine_testkit::{PolyhedralConfig, PolyhedralRoom, Polyhedron};

const SPAN_S: f64 = 0.05;
/// Largest difference in dB of what all receivers hear together, down to so many dB below all that arrives.
const ALLOWED_DB: [(f64, f64); 2] = [(-30.0, 0.15), (-40.0, 0.25)];

#[test]
fn late_sound_is_that_of_particles() {
    for shape in [Polyhedron::SlopedCeiling, Polyhedron::Furnished] {
        let config = PolyhedralConfig { seed: 5551, shape, ..PolyhedralConfig::default() };
        let laboratory = PolyhedralRoom::new(config).unwrap();
        let materials = laboratory.true_materials().unwrap();
        let bands = materials[0].bands();
        let spans = |bins: &[f64]| -> Vec<f64> {
            let each = (SPAN_S / PolyhedralRoom::BIN_S) as usize;
            bins.chunks_exact(each).map(|span| span.iter().sum()).collect()
        };
        let energies = laboratory.energies();
        let count = spans(&energies[0][0]).len();
        let mut counted = vec![vec![0.0; count]; bands.len()];
        for of_receiver in &energies {
            for (sums, bins) in counted.iter_mut().zip(of_receiver) {
                sums.iter_mut().zip(spans(bins)).for_each(|(sum, e)| *sum += e);
            }
        }
        let mut traced = vec![vec![0.0; count]; bands.len()];
        let (source, air) = (laboratory.source(), laboratory.air());
        for (index, receiver) in laboratory.receivers().iter().enumerate() {
            let config = TracerConfig {
                rays: 40_000,
                seed: index as u64,
                duration_s: count as f64 * SPAN_S,
                ..TracerConfig::default()
            };
            let tracer = PathTracer::new(config).unwrap();
            let paths = tracer.trace(laboratory.scene(), source, receiver, &air, &()).unwrap();
            let response = paths.energy_response(&Conditions::new(&materials, &air), SPAN_S).unwrap();
            for (band, sums) in traced.iter_mut().enumerate() {
                sums.iter_mut().zip(response.band(band)).for_each(|(sum, e)| *sum += e);
            }
        }
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
}
