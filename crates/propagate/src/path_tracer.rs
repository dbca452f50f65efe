//! The path tracer.

use crate::Error;
use crate::image_sources::add_exact_paths;
use crate::placement::check_placement;
use crate::prepared_scene::PreparedScene;
use crate::tracing::Tracing;
use rayon::prelude::*;
use sabine_acoustics::{Air, NoReading, Observer, OutOfRange, Reading, report};
use sabine_paths::{Conditions, PathParameters, PathSet, Propagator};
use sabine_scene::{DiffuseRoom, Receiver, Scene, Source};
use std::sync::atomic::{AtomicU64, Ordering};

/// Parts of the rays between which their paths are gathered.
const PARTS_AT_ONCE: usize = 64;

/// The first trace of [`PathTracer::trace_until_t30`] lasts this many times the longest reverberation time by Eyring's formula; rooms that
/// are not diffuse ring longer.
const DURATION_FACTOR: f64 = 1.2;
/// It lasts so long at least, in seconds.
const LEAST_DURATION_S: f64 = 0.3;

/// Settings of [`PathTracer`].
#[derive(Clone, Debug, PartialEq)]
pub struct TracerConfig {
    /// Number of rays, 1 to 100 million, rounded up to as many for each batch ([`PathSet::BATCHES`]) and each set of scattering
    /// coefficients. The standard error falls with its square root.
    pub rays: usize,
    /// Half of the rays start at the receiver, and the halves are joined. Else all start at the source.
    pub bidirectional: bool,
    /// Paths are followed for so long after emission, 1 ms to 60 s.
    pub duration_s: f64,
    /// Same seed, same paths, on any number of threads.
    pub seed: u64,
    /// Specular paths of up to so many reflections (0 to 10) are found exactly, by image sources.
    pub image_order: usize,
    /// Where the mesh is a cuboid (six whole faces at right angles, each of one material, nothing inside), specular paths have
    /// a closed form. If this is above zero, about so many of any order are taken from it instead of those up to `image_order`: all
    /// of them, or a random choice that favours those that carry most with the scene's materials, each standing for others like it;
    /// rays then count none that is specular throughout. 0 to 10 million; 200,000 serve most rooms. Worth it where little is
    /// scattered.
    pub cuboid_paths: usize,
    /// Radius of the spheres about both ends that count rays whose last reflection is specular and beyond
    /// [`TracerConfig::image_order`],
    /// 1 cm to 10 m; it shrinks to the distance of the nearest surface.
    pub receiver_radius_m: f64,
    /// Splits rays that carry much with the scene's materials, and ends by Russian roulette most of those that carry little
    /// (a weight window), so that the late decay does not hang on the few that no absorber has met. Paths hold for any absorption
    /// either way; which rays are many is decided by the scene's own.
    pub weight_window: bool,
    /// Draws up to a quarter of all directions, at both ends and where rays scatter, by how long sound stays in them with the scene's
    /// materials: to and fro between hard walls while the rest of the room falls silent (path guiding). Only with
    /// [`TracerConfig::weight_window`]; paths hold for any absorption all the same. Off unless switched on: it pays where a few surfaces are
    /// hard, the rest soft and little is scattered, and takes time elsewhere.
    pub path_guiding: bool,
    /// Adds the ways around one edge where the direct line is blocked ([`DiffractingEdges`](crate::DiffractingEdges)), so that a
    /// screen casts a shadow and not a black hole.
    pub diffraction: bool,
    /// Rays meet flat walls of many triangles as few ([`MeshScene::merged`](crate::MeshScene::merged)): the same points, but
    /// for rounding, in less time. Materials, areas, edges and image sources are those of the scene's own triangles.
    pub merge_coplanar: bool,
    /// Trace a mesh through whose holes more than one ray in a thousand escapes: what escapes is lost, as through an open
    /// window.
    pub allow_leaks: bool,
}

impl Default for TracerConfig {
    fn default() -> Self {
        Self {
            rays: 20_000,
            bidirectional: true,
            duration_s: 1.5,
            seed: 0,
            image_order: 3,
            cuboid_paths: 0,
            receiver_radius_m: 0.5,
            weight_window: true,
            path_guiding: false,
            diffraction: false,
            merge_coplanar: true,
            allow_leaks: false,
        }
    }
}

impl TracerConfig {
    pub(crate) fn check(&self) -> Result<(), Error> {
        OutOfRange::check("rays", self.rays as f64, 1.0, 1e8, "between 1 and 100 million")?;
        OutOfRange::check("duration_s", self.duration_s, 1e-3, 60.0, "between 1 ms and 60 s")?;
        OutOfRange::check("image_order", self.image_order as f64, 0.0, 10.0, "between 0 and 10")?;
        OutOfRange::check("cuboid_paths", self.cuboid_paths as f64, 0.0, 1e7, "between 0 and 10 million")?;
        Ok(OutOfRange::check(
            "receiver_radius_m",
            self.receiver_radius_m,
            0.01,
            10.0,
            "between 1 cm and 10 m",
        )?)
    }
}

/// Finds paths by rays from the source and from the receiver (bidirectional path tracing: Veach 1997, chapter 10; for sound
/// Cao et al. 2016, ACM Transactions on Graphics 35(6)). Each path counts once, whichever way it is found:
///
/// | path | found by |
/// |---|---|
/// | direct | exactly |
/// | specular reflections only, up to `image_order` (`cuboid_paths` in a cuboid) | image sources: exactly |
/// | specular reflections only, more than that | rays from either end through a sphere about the other |
/// | with scattering | all that apply of: a line from the last scattering to the other end; a line between a ray from the source and one from the receiver; two such rays that meet on a patch of wall; where the last reflection is specular, the other end's sphere |
///
/// The ways that apply to one path share it by the balance heuristic. At each surface a ray is reflected specularly **or**
/// by Lambert's law, at random with the scattering coefficient. A ray draws for one set of scattering coefficients; the
/// balance heuristic makes its paths serve all octaves without bias. With [`TracerConfig::weight_window`], rays are split where
/// they carry much with the scene's absorption and play Russian roulette where they carry little; with
/// [`TracerConfig::path_guiding`] more of them go where sound stays for long. Paths hold for any absorption all the same.
///
/// With [`TracerConfig::bidirectional`] off, all rays start at the source and neither join nor meet.
///
/// Spheres and meetings blur: arrivals by the sphere's radius, or the patch's width, over the speed of sound. Long specular
/// chains through facets that neither rays nor the exhaustive search (up to 20,000 sequences of planes) find are missing from
/// the image sources; each carries less than about 1 / `rays` of the source's energy.
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

    /// Makes a scene ready for traces with these settings.
    ///
    /// # Errors
    /// [`Error::NoSurface`] if all triangles have zero area.
    pub fn prepare(&self, scene: &Scene) -> Result<PreparedScene, Error> {
        PreparedScene::new(scene, &self.config)
    }

    /// Traces until T30 can be read in every band under these conditions, but not beyond [`TracerConfig::duration_s`]: the first trace is
    /// as long as a diffuse room would need, and each further one twice as long. The materials of the scene say what is expected.
    ///
    /// # Errors
    /// As [`Propagator::trace`], [`DiffuseRoom::of_scene`] and [`PathParameters::read`].
    pub fn trace_until_t30(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        conditions: &Conditions,
        observer: &dyn Observer,
    ) -> Result<(PathSet, PathParameters), Error> {
        let bands = conditions.materials[0].bands();
        let expected = DiffuseRoom::of_scene(scene, conditions.air, bands)?;
        let longest_s = expected.values().iter().map(DiffuseRoom::eyring_t60_s).fold(0.0, f64::max);
        let most_s = self.config.duration_s;
        let mut duration_s = (DURATION_FACTOR * longest_s).max(LEAST_DURATION_S).min(most_s);
        loop {
            let tracer = Self::new(TracerConfig { duration_s, ..self.config.clone() })?;
            let paths = tracer.trace(scene, source, receiver, conditions.air, observer)?;
            let parameters = PathParameters::read(&paths, conditions)?;
            let is_cut = |t30: &Reading| matches!(t30, Err(NoReading::DynamicRange { .. }));
            if !parameters.t30_s.values().iter().any(is_cut) || duration_s >= most_s {
                return Ok((paths, parameters));
            }
            duration_s = (2.0 * duration_s).min(most_s);
        }
    }

    /// As [`Propagator::trace`], in a scene that was prepared with the same settings but for rays, duration and seed. Holes are
    /// not looked for: see [`PreparedScene::check_leaks`].
    ///
    /// # Errors
    /// For a source or receiver that cannot be traced, and `Cancelled`.
    pub fn trace_prepared(
        &self,
        scene: &PreparedScene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, Error> {
        check_placement(&scene.mesh, source, receiver)?;
        self.trace_placed(scene, source, receiver, air, observer)
    }

    fn trace_placed(
        &self,
        scene: &PreparedScene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, Error> {
        let max_length_m = self.config.duration_s * air.speed_of_sound_m_s();
        let mut paths = PathSet::new(scene.materials, max_length_m);
        let (from, to) = (source.position_m, receiver.position_m);
        let (order, rays, seed) = (self.config.image_order, self.config.rays, self.config.seed);
        report(observer, "image sources", 0, 1)?;
        match &scene.cuboid {
            Some(cuboid) if self.config.cuboid_paths > 0 => {
                cuboid.add_paths(&mut paths, from, to, self.config.cuboid_paths, &scene.named, seed);
            }
            _ => add_exact_paths(&mut paths, &scene.mesh, from, to, order, rays.min(1 << 17), seed),
        }
        if let Some(edges) = &scene.edges {
            report(observer, "edges", 0, 1)?;
            edges.add_paths(&mut paths, &scene.mesh, from, to);
        }
        let tracing = Tracing::new(scene, &self.config, [from, to], max_length_m);
        let total = tracing.rays() as u64;
        let done = AtomicU64::new(0);
        report(observer, "tracing", 0, total)?;
        let parts = tracing.parts();
        for group in (0..parts).step_by(PARTS_AT_ONCE) {
            let traced: Vec<PathSet> = (group..parts.min(group + PARTS_AT_ONCE))
                .into_par_iter()
                .map(|part| {
                    let (traced, rays) = tracing.part(part);
                    let behind = done.fetch_add(rays, Ordering::Relaxed) + rays;
                    report(observer, "tracing", behind, total)?;
                    Ok(traced)
                })
                .collect::<Result<_, Error>>()?;
            for part in traced {
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
        let prepared = self.prepare(scene)?;
        // A place that no sound can reach is the better answer than the holes through which it would get there.
        check_placement(&prepared.mesh, source, receiver)?;
        if !self.config.allow_leaks {
            prepared.check_leaks(scene, source.position_m)?;
        }
        Ok(self.trace_placed(&prepared, source, receiver, air, observer)?)
    }
}
