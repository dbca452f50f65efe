//! The path tracer.

use crate::error::check_range;
use crate::event_mixture::{EventMixture, EventProbabilities};
use crate::image_sources::add_exact_paths;
use crate::mesh_scene::MeshScene;
use crate::placement::check_placement;
use crate::random::{direction, generator};
use crate::vector::{Vec3, dot, norm, scale, sub};
use crate::walk::{ReceiverSphere, before_hit, next_hit, reflected, visible};
use crate::{Error, MeshReport};
use rand::Rng;
use rayon::prelude::*;
use sabine_acoustics::{
    Air, Contribution, Observer, PathSet, Propagator, Receiver, Reflection, Scene, Source, report,
};
use std::f64::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};

/// Rays that one task traces: fixed, so that the result does not depend on the number of threads.
const CHUNK: usize = 256;
/// Chunks between which their paths are gathered.
const CHUNKS_AT_ONCE: usize = 64;

/// Settings of [`PathTracer`].
#[derive(Clone, Debug, PartialEq)]
pub struct TracerConfig {
    /// Number of rays, 1 to 100 million. The standard error falls with its square root.
    pub rays: usize,
    /// Paths are followed for so long after emission, 1 ms to 60 s.
    pub duration_s: f64,
    /// Same seed, same paths, on any number of threads.
    pub seed: u64,
    /// Specular paths of up to so many reflections (0 to 10) are found exactly, by image sources.
    pub image_order: usize,
    /// Radius of the sphere that counts rays whose last reflection is specular and beyond [`TracerConfig::image_order`],
    /// 1 cm to 10 m; it shrinks to the distance of the nearest surface.
    pub receiver_radius_m: f64,
    /// Trace a mesh through whose holes more than one ray in a thousand escapes: what escapes is lost, as through an open
    /// window.
    pub allow_leaks: bool,
}

impl Default for TracerConfig {
    fn default() -> Self {
        Self {
            rays: 20_000,
            duration_s: 1.5,
            seed: 0,
            image_order: 3,
            receiver_radius_m: 0.5,
            allow_leaks: false,
        }
    }
}

impl TracerConfig {
    pub(crate) fn check(&self) -> Result<(), Error> {
        check_range("rays", self.rays as f64, 1.0, 1e8, "between 1 and 100 million")?;
        check_range("duration_s", self.duration_s, 1e-3, 60.0, "between 1 ms and 60 s")?;
        check_range("image_order", self.image_order as f64, 0.0, 10.0, "between 0 and 10")?;
        check_range("receiver_radius_m", self.receiver_radius_m, 0.01, 10.0, "between 1 cm and 10 m")
    }
}

/// Finds paths by rays from the source, each kind of path by the estimator that suits it and by no other:
///
/// | path | found by |
/// |---|---|
/// | direct | exactly |
/// | specular reflections only, up to `image_order` | image sources: exactly |
/// | specular reflections only, more than that | rays through a sphere about the receiver |
/// | last reflection scattered | a connection from the scattering point to the receiver |
/// | scattered earlier, last reflection specular | rays through the sphere |
///
/// At each surface a ray is reflected specularly **or** by Lambert's law, at random with the scattering coefficient. A ray
/// draws for one octave; the balance heuristic makes its paths serve all octaves without bias. Rays end by length, never
/// by energy, so that the paths hold for any absorption.
///
/// Long specular chains through facets that neither rays nor the exhaustive search (up to 20,000 sequences of planes)
/// find are missing from the image sources; each carries less than about 1 / `rays` of the source's energy.
#[derive(Clone, Debug)]
pub struct PathTracer {
    config: TracerConfig,
}

impl PathTracer {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting outside its range.
    pub fn new(config: TracerConfig) -> Result<Self, Error> {
        config.check()?;
        Ok(Self { config })
    }

    /// The settings.
    pub fn config(&self) -> &TracerConfig {
        &self.config
    }

    fn run(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, Error> {
        let mesh = MeshScene::new(scene)?;
        let clearance_m = check_placement(&mesh, source, receiver)?;
        let leaks = MeshReport::new(scene, &mesh, source.position_m)?;
        if !self.config.allow_leaks {
            leaks.check()?;
        }
        let max_length_m = self.config.duration_s * air.speed_of_sound_m_s();
        let mut paths = PathSet::new(scene.materials().len(), max_length_m);
        let (from, to) = (source.position_m, receiver.position_m);
        let (order, rays, seed) = (self.config.image_order, self.config.rays, self.config.seed);
        report(observer, "image sources", 0, 1)?;
        add_exact_paths(&mut paths, &mesh, from, to, order, rays.min(1 << 17), seed);
        let tracing = Tracing {
            mesh: &mesh,
            probabilities: EventProbabilities::new(scene.materials().iter().map(|m| &m.material)),
            sphere: ReceiverSphere { centre: to, radius_m: self.config.receiver_radius_m.min(clearance_m) },
            source: from,
            materials: scene.materials().len(),
            max_length_m,
            config: &self.config,
        };
        let total = rays as u64;
        let done = AtomicU64::new(0);
        report(observer, "tracing", 0, total)?;
        let chunks = rays.div_ceil(CHUNK);
        for group in (0..chunks).step_by(CHUNKS_AT_ONCE) {
            let parts: Vec<PathSet> = (group..chunks.min(group + CHUNKS_AT_ONCE))
                .into_par_iter()
                .map(|chunk| {
                    let range = chunk * CHUNK..rays.min((chunk + 1) * CHUNK);
                    let count = range.len() as u64;
                    let part = tracing.chunk(range);
                    let behind = done.fetch_add(count, Ordering::Relaxed) + count;
                    report(observer, "tracing", behind, total)?;
                    Ok(part)
                })
                .collect::<Result<_, Error>>()?;
            for part in parts {
                if paths.chain_count() + part.chain_count() > u32::MAX as usize {
                    return Err(Error::TooManyReflections { limit: u32::MAX as usize });
                }
                paths.append(&part);
            }
        }
        if paths.is_empty() {
            let (source_id, receiver_id) = (source.id.clone(), receiver.id.clone());
            return Err(Error::NoPath { source_id, receiver_id, max_length_m });
        }
        Ok(paths)
    }
}

impl Propagator for PathTracer {
    fn trace(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, sabine_acoustics::Error> {
        Ok(self.run(scene, source, receiver, air, observer)?)
    }
}

/// What all rays of one trace share.
struct Tracing<'a> {
    mesh: &'a MeshScene,
    probabilities: EventProbabilities,
    sphere: ReceiverSphere,
    source: Vec3,
    materials: usize,
    max_length_m: f64,
    config: &'a TracerConfig,
}

/// The reflections of one ray; they enter the path set when a contribution needs them.
struct ChainOfRay {
    events: Vec<(u32, Reflection)>,
    stored: usize,
    last: u32,
}

impl ChainOfRay {
    fn store(&mut self, paths: &mut PathSet) -> u32 {
        for &(material, reflection) in &self.events[self.stored..] {
            self.last = paths.reflect(self.last, material, reflection);
        }
        self.stored = self.events.len();
        self.last
    }
}

impl Tracing<'_> {
    fn chunk(&self, rays: std::ops::Range<usize>) -> PathSet {
        let mut paths = PathSet::new(self.materials, self.max_length_m);
        let mut chain = ChainOfRay { events: Vec::new(), stored: 0, last: PathSet::DIRECT };
        for ray in rays {
            chain.events.clear();
            (chain.stored, chain.last) = (0, PathSet::DIRECT);
            self.ray(ray, &mut chain, &mut paths);
        }
        paths
    }

    fn ray(&self, ray: usize, chain: &mut ChainOfRay, paths: &mut PathSet) {
        let mut random = generator(self.config.seed, ray as u64);
        let batch = Some((ray % usize::from(PathSet::BATCHES)) as u8);
        let bands = self.probabilities.bands();
        let hero = random.random_range(0..bands);
        let mut mixture = EventMixture::new(bands);
        // Each ray carries an equal share of the source's power, 4 pi in units in which the direct sound is 1 / d2.
        let log_share = (4.0 * PI / self.config.rays as f64).ln();
        let log_volume = self.sphere.volume_m3().ln();
        let receiver = self.sphere.centre;
        let mut heading = direction(&mut random);
        let departure = heading;
        let mut origin = self.source;
        let mut travelled_m = 0.0;
        let (mut ever_scattered, mut just_scattered) = (false, false);
        loop {
            let hit = next_hit(self.mesh, origin, &mut heading, &mut random);
            let leg_m = hit.map_or(f64::INFINITY, |h| h.distance);
            // Paths that image sources have found, and those that a connection has found, are not counted again.
            let counts = !just_scattered && (ever_scattered || chain.events.len() > self.config.image_order);
            if counts
                && !chain.events.is_empty()
                && let Some((middle_m, chord_m)) = self.sphere.chord(origin, heading, leg_m)
                && travelled_m + middle_m <= self.max_length_m
            {
                let stored = chain.store(paths);
                paths.push(Contribution {
                    length_m: travelled_m + middle_m,
                    log_weight: log_share + chord_m.ln() - log_volume - mixture.log_density(),
                    chain: stored,
                    tail: PathSet::DIRECT,
                    departure,
                    arrival: scale(heading, -1.0),
                    batch,
                });
            }
            let Some(hit) = hit else { return };
            travelled_m += hit.distance;
            if travelled_m >= self.max_length_m {
                return;
            }
            let surface = &self.mesh.surfaces.triangles[hit.triangle as usize];
            let scattering = self.probabilities.scattering(surface.material, hero);
            just_scattered = random.random::<f64>() < scattering;
            ever_scattered |= just_scattered;
            let reflection = if just_scattered { Reflection::Scattered } else { Reflection::Specular };
            mixture.apply(&self.probabilities, surface.material, just_scattered);
            chain.events.push((surface.material, reflection));
            origin = before_hit(origin, heading, hit.distance);
            if just_scattered {
                let line = sub(receiver, origin);
                let distance_m = norm(line);
                let cosine = dot(line, surface.normal_against(heading)) / distance_m;
                let length_m = travelled_m + distance_m;
                if cosine > 0.0 && length_m <= self.max_length_m && visible(self.mesh, origin, receiver) {
                    // Lambert: cos / pi of the power per steradian, thinned by the square of the distance.
                    let log_spread = (cosine / (PI * distance_m * distance_m)).ln();
                    let stored = chain.store(paths);
                    paths.push(Contribution {
                        length_m,
                        log_weight: log_share + log_spread - mixture.log_density(),
                        chain: stored,
                        tail: PathSet::DIRECT,
                        departure,
                        arrival: scale(line, -1.0 / distance_m),
                        batch,
                    });
                }
            }
            heading = reflected(surface, heading, reflection, &mut random);
        }
    }
}
