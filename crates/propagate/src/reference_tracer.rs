//! The tracer to check tracers against: as plain as it can be.

use crate::brute_force_scene::BruteForceScene;
use crate::mesh_scene::MeshScene;
use crate::placement::check_placement;
use crate::random::{direction, generator};
use crate::vector::{norm, scale, sub};
use crate::walk::{Sphere, before_hit, next_hit, reflected, visible};
use crate::{Error, TracerConfig};
use rand::Rng;
use sabine_acoustics::{Air, Observer, report};
use sabine_paths::{Contribution, PathSet, Propagator, Reflection};
use sabine_scene::{Receiver, Scene, Source};
use std::f64::consts::PI;

/// Unidirectional tracing with a spherical receiver, to be read and to be compared with: every triangle is tested, every
/// reflected path is counted by the sphere, and each reflection is scattered with the coefficient's mean over the octaves.
///
/// It is unbiased wherever it answers, and slow. [`TracerConfig::image_order`],
/// [`TracerConfig::merge_coplanar`] and [`TracerConfig::allow_leaks`] mean nothing to it.
#[derive(Clone, Debug)]
pub struct ReferenceTracer {
    config: TracerConfig,
}

impl ReferenceTracer {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting outside its range.
    pub fn new(config: TracerConfig) -> Result<Self, Error> {
        config.check()?;
        Ok(Self { config })
    }
}

impl Propagator for ReferenceTracer {
    fn trace(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, sabine_acoustics::Error> {
        let clearance_m = check_placement(&MeshScene::new(scene)?, source, receiver)?;
        let room = BruteForceScene::new(scene)?;
        let max_length_m = self.config.duration_s * air.speed_of_sound_m_s();
        let mut paths = PathSet::new(scene.materials().len(), max_length_m);
        let sphere =
            Sphere { centre: receiver.position_m, radius_m: self.config.receiver_radius_m.min(clearance_m) };
        let mean_scattering: Vec<f64> = scene
            .materials()
            .iter()
            .map(|named| {
                let values = named.material.scattering().values();
                values.iter().sum::<f64>() / values.len() as f64
            })
            .collect();

        // The direct sound: 1 / d2, if nothing stands between.
        let line = sub(receiver.position_m, source.position_m);
        let distance_m = norm(line);
        if distance_m <= max_length_m && visible(&room, source.position_m, receiver.position_m) {
            paths.push(Contribution {
                length_m: distance_m,
                log_weight: -2.0 * distance_m.ln(),
                chain: PathSet::DIRECT,
                tail: PathSet::DIRECT,
                departure: scale(line, 1.0 / distance_m),
                arrival: scale(line, -1.0 / distance_m),
                batch: None,
            });
        }

        let rays = self.config.rays;
        for ray in 0..rays {
            if ray % 256 == 0 {
                report(observer, "reference tracing", ray as u64, rays as u64)?;
            }
            let mut random = generator(self.config.seed, ray as u64);
            let departure = direction(&mut random);
            let (mut origin, mut heading) = (source.position_m, departure);
            let mut chain = PathSet::DIRECT;
            let mut travelled_m = 0.0;
            let mut log_weight = (4.0 * PI / rays as f64).ln();
            while let Some(hit) = next_hit(&room, origin, &mut heading, &mut random) {
                // The sphere counts every leg but the first, which the direct sound has counted.
                if chain != PathSet::DIRECT
                    && let Some((middle_m, chord_m)) = sphere.chord(origin, heading, hit.distance)
                    && travelled_m + middle_m <= max_length_m
                {
                    paths.push(Contribution {
                        length_m: travelled_m + middle_m,
                        log_weight: log_weight + (chord_m / sphere.volume_m3()).ln(),
                        chain,
                        tail: PathSet::DIRECT,
                        departure,
                        arrival: scale(heading, -1.0),
                        batch: Some((ray % usize::from(PathSet::BATCHES)) as u8),
                    });
                }
                travelled_m += hit.distance;
                if travelled_m >= max_length_m {
                    break;
                }
                let surface = &room.surfaces.triangles[hit.triangle as usize];
                let probability = mean_scattering[surface.material as usize];
                let scattered = random.random::<f64>() < probability;
                let reflection = if scattered { Reflection::Scattered } else { Reflection::Specular };
                log_weight -= if scattered { probability } else { 1.0 - probability }.ln();
                chain = paths.reflect(chain, surface.material, reflection);
                origin = before_hit(origin, heading, hit.distance);
                heading = reflected(surface, heading, reflection, &mut random);
            }
        }
        if paths.is_empty() {
            let (source_id, receiver_id) = (source.id.clone(), receiver.id.clone());
            return Err(Error::NoPath { source_id, receiver_id, max_length_m }.into());
        }
        Ok(paths)
    }
}
