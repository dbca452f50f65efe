//! The fixture's room fitted to its two responses at 2 kHz, where weights and materials swing between two places if they may.

use sabine_acoustics::{Bands, Material};
use sabine_optimize::{AbsorptionPrior, FitConfig, FitProblem, MaterialFitter, MeasuredDecay, MeasuredPair};
use sabine_paths::{PathSet, Propagator};
use sabine_propagate::{PathTracer, TracerConfig};
use sabine_scene::MeasuredRoom;

#[test]
fn weights_that_follow_the_materials_do_not_swing_for_ever() {
    let room = MeasuredRoom::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room")).unwrap();
    let bands = Bands::octaves(2000.0, 2000.0).unwrap();
    let materials: Vec<Material> =
        room.scene().materials().iter().map(|m| m.material.resampled(bands)).collect();
    let priors = AbsorptionPrior::of_room(&room, bands);
    let scene = room.scene().with_materials(materials.clone()).unwrap();
    // Without damping the weights swing with some of these.
    for seed in 1..=8 {
        let measured: Vec<(MeasuredDecay, PathSet)> = (0..2)
            .map(|i| {
                let entry = &room.responses()[i];
                let (source, receiver) = (&room.sources()[entry.source], &room.receivers()[entry.receiver]);
                let config = TracerConfig { rays: 5000, duration_s: 1.0, seed, ..TracerConfig::default() };
                let tracer = PathTracer::new(config).unwrap();
                let paths = tracer.trace(&scene, source, receiver, &room.air(), &()).unwrap();
                (MeasuredDecay::new(&room.load_response(i).unwrap(), bands).unwrap(), paths)
            })
            .collect();
        let pairs: Vec<MeasuredPair<'_>> =
            measured.iter().map(|(measured, paths)| MeasuredPair { measured, paths }).collect();
        let config = FitConfig { arrival_error_s: 2.9e-4, ..FitConfig::default() };
        let fitter = MaterialFitter::new(config).unwrap();
        let done = fitter.fit_responses(
            &pairs,
            room.measurement(),
            &FitProblem::new(&materials, &priors, &room.air()),
            &(),
        );
        // One band: if it has not converged, none has, and that is an error.
        assert!(done.is_ok(), "seed {seed}: {}", done.unwrap_err());
    }
}
