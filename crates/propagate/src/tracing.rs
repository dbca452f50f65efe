//! The rays of one trace, from the source and from the receiver.

use crate::TracerConfig;
use crate::event_mixture::{EventMixture, EventProbabilities};
use crate::patches::Patch;
use crate::prepared_scene::PreparedScene;
use crate::random::{direction, generator};
use crate::techniques::{Use, Ways};
use crate::vector::{Vec3, dot, norm, scale, sub};
use crate::walk::{Sphere, before_hit, next_hit, reflected, visible};
use rand::Rng;
use sabine_paths::{Contribution, Incidence, PathSet, Reflection};
use std::f64::consts::PI;

/// The ends of the paths.
const SOURCE: usize = 0;
const RECEIVER: usize = 1;
/// Pairs of rays that may meet each other, at most: so many are kept in memory by each thread.
const MOST_PAIRS: usize = 256;

/// What all rays of one trace share.
pub(crate) struct Tracing<'a> {
    pub scene: &'a PreparedScene,
    pub max_length_m: f64,
    ends: [Sphere; 2],
    /// Rays from each end; where only the source sends any, all of them.
    pairs: usize,
    /// Parts into which they are split, all of the same size: so many for each batch, with so many rays for each class.
    parts: usize,
    /// Specular paths of up to so many reflections are found by others.
    exact_order: usize,
    config: &'a TracerConfig,
}

/// A reflection of a ray.
pub(crate) struct Arrival {
    /// Number of reflections so far, this one included.
    pub depth: usize,
    /// Just before the surface.
    pub point: Vec3,
    /// Towards the side from which the ray came.
    pub normal: Vec3,
    pub material: u32,
    /// Cosine of the angle between the ray and the normal.
    pub cosine: f64,
    pub travelled_m: f64,
    /// Of the reflections before this one.
    pub mixture: EventMixture,
    /// Of the way to this point, which may or may not scatter.
    pub ways: Ways,
    pub patch: Patch,
    /// Area of wall in the patch, if the ray is scattered there.
    pub area_m2: Option<f64>,
}

impl Arrival {
    /// The way to this point and on, by scattering.
    pub fn ways_on(&self) -> Ways {
        let mut ways = self.ways;
        ways.scattered_on(self.area_m2.unwrap_or(0.0));
        ways
    }

    /// Density of the reflections so far, this one being scattered.
    pub fn mixture_on(&self, probabilities: &EventProbabilities) -> EventMixture {
        let mut mixture = self.mixture;
        mixture.apply(probabilities, self.material, true);
        mixture
    }
}

/// A ray, as far as it was followed.
pub(crate) struct Walk {
    /// Direction in which it began.
    pub heading: Vec3,
    pub arrivals: Vec<Arrival>,
    /// Class of octaves whose scattering coefficients it obeys.
    pub hero: usize,
    /// Chains of the first reflections, as far as a contribution has needed them.
    chains: Vec<u32>,
}

impl Walk {
    /// The chain of the first `depth` reflections.
    pub fn chain(&mut self, depth: usize, paths: &mut PathSet) -> u32 {
        while self.chains.len() <= depth {
            let arrival = &self.arrivals[self.chains.len() - 1];
            let scattered = arrival.area_m2.is_some();
            let reflection = if scattered { Reflection::Scattered } else { Reflection::Specular };
            let incidence = Incidence::Cosine(arrival.cosine);
            let last = self.chains[self.chains.len() - 1];
            let longer = paths.reflect_at(last, arrival.material, reflection, incidence);
            self.chains.push(longer);
        }
        self.chains[depth]
    }
}

impl<'a> Tracing<'a> {
    pub fn new(
        scene: &'a PreparedScene,
        config: &'a TracerConfig,
        ends_m: [Vec3; 2],
        max_length_m: f64,
    ) -> Self {
        let sphere = |end: usize| Sphere {
            centre: ends_m[end],
            radius_m: config.receiver_radius_m.min(scene.mesh.nearest(ends_m[end]).1),
        };
        let pairs = if config.bidirectional { config.rays.div_ceil(2) } else { config.rays };
        let batches = usize::from(PathSet::BATCHES);
        let parts = batches * pairs.div_ceil(batches * MOST_PAIRS);
        Self {
            scene,
            max_length_m,
            ends: [sphere(SOURCE), sphere(RECEIVER)],
            pairs: parts * pairs.div_ceil(parts).next_multiple_of(scene.probabilities.classes()),
            parts,
            exact_order: match scene.cuboid {
                Some(_) if config.cuboid_paths > 0 => usize::MAX,
                _ => config.image_order,
            },
            config,
        }
    }

    /// Number of parts into which the rays are split.
    pub fn parts(&self) -> usize {
        self.parts
    }

    /// Number of rays.
    pub fn rays(&self) -> usize {
        self.pairs * self.ends_in_use()
    }

    fn ends_in_use(&self) -> usize {
        if self.config.bidirectional { 2 } else { 1 }
    }

    /// Traces the rays of one part; returns their number as well.
    pub fn part(&self, part: usize) -> (PathSet, u64) {
        let mut paths = PathSet::new(self.scene.materials, self.max_length_m);
        let pairs = self.pairs / self.parts;
        let batch = (part % usize::from(PathSet::BATCHES)) as u8;
        let mut walks: [Vec<Walk>; 2] = [Vec::new(), Vec::new()];
        for pair in part * pairs..(part + 1) * pairs {
            let mut random = generator(self.config.seed, 2 * pair as u64);
            // Both rays of a pair draw for the same class, and all classes get their turns within a part.
            let hero = pair % self.scene.probabilities.classes();
            walks[SOURCE].push(self.walk(SOURCE, hero, batch, &mut random, &mut paths));
            if self.config.bidirectional {
                let mut random = generator(self.config.seed, 2 * pair as u64 + 1);
                walks[RECEIVER].push(self.walk(RECEIVER, hero, batch, &mut random, &mut paths));
            }
        }
        if self.config.bidirectional {
            let mut random = generator(!self.config.seed, part as u64);
            let [out, back] = &mut walks;
            for (out, back) in out.iter_mut().zip(back.iter_mut()) {
                self.join(out, back, batch, &mut random, &mut paths);
            }
            self.meet(out, back, batch, &mut random, &mut paths);
        }
        (paths, (pairs * self.ends_in_use()) as u64)
    }

    /// How many lines and meetings are used for paths of so many reflections: about as many of each as a ray draws lines
    /// to the opposite end. The more reflections, the more of them find the same kind of path.
    pub fn usage(&self, reflections: usize) -> Use {
        if !self.config.bidirectional {
            return Use { lines: 0.0, meetings: 0.0 };
        }
        let splits = reflections.saturating_sub(1) as f64;
        let lines = (1.0 / (splits * self.scene.mean_scattering)).min(1.0);
        Use { lines, meetings: self.rivals() * self.meeting_share(reflections) }
    }

    /// Rays from one end that a ray from the other end may meet: those of its part that draw for the same class.
    fn rivals(&self) -> f64 {
        (self.pairs / self.parts) as f64 / self.scene.probabilities.classes() as f64
    }

    /// Share of the meetings that are used.
    pub fn meeting_share(&self, reflections: usize) -> f64 {
        let expected =
            reflections as f64 * self.rivals() * self.scene.patches.full_m2() / self.scene.surface_m2;
        (1.0 / expected).min(1.0)
    }

    /// Energy that each ray carries, the direct sound being 1 / d2: an equal share of 4 pi for all rays from its end.
    pub fn log_share(&self) -> f64 {
        (4.0 * PI / self.pairs as f64).ln()
    }

    /// Follows one ray from an end of the path and adds what it finds at the opposite end.
    fn walk(&self, end: usize, hero: usize, batch: u8, random: &mut impl Rng, paths: &mut PathSet) -> Walk {
        let (here, there) = (&self.ends[end], &self.ends[1 - end]);
        let log_share = self.log_share();
        let log_volume = there.volume_m3().ln();
        let mut heading = direction(random);
        let mut walk = Walk { heading, arrivals: Vec::new(), hero, chains: vec![PathSet::DIRECT] };
        let mut mixture = EventMixture::new(self.scene.probabilities.classes());
        let mut ways = Ways::new(here.radius_m);
        let (mut origin, mut travelled_m) = (here.centre, 0.0);
        let mut ever_scattered = false;
        // Since the last scattering, or the beginning: how far, from which cosine, and whether over a mirror.
        let (mut stretch_m, mut cosine_out, mut mirrored) = (0.0, 1.0, false);
        loop {
            let hit = next_hit(&self.scene.mesh, origin, &mut heading, random);
            let leg_m = hit.map_or(f64::INFINITY, |h| h.distance);
            let depth = walk.arrivals.len();
            // Specular paths that image sources have found, and those that a line has found, are not counted again.
            if mirrored
                && (ever_scattered || depth > self.exact_order)
                && let Some((middle_m, chord_m)) = there.chord(origin, heading, leg_m)
                && travelled_m + middle_m <= self.max_length_m
            {
                let share = match self.config.bidirectional {
                    true => ways.share_of_sphere(there.radius_m, self.usage(depth)),
                    false => 1.0,
                };
                let log_weight = log_share + (share * chord_m).ln() - log_volume - mixture.log_density();
                let length_m = travelled_m + middle_m;
                let found = Found { length_m, log_weight, direction: scale(heading, -1.0) };
                push(paths, end, &mut walk, depth, found, batch);
            }
            let Some(hit) = hit else { return walk };
            travelled_m += hit.distance;
            if travelled_m >= self.max_length_m {
                return walk;
            }
            stretch_m += hit.distance;
            let surface = &self.scene.mesh.surfaces.triangles[hit.triangle as usize];
            let material = surface.material;
            let scattered = random.random::<f64>() < self.scene.probabilities.scattering(material, hero);
            let reflection = if scattered { Reflection::Scattered } else { Reflection::Specular };
            let normal = surface.normal_against(heading);
            let point = before_hit(origin, heading, hit.distance);
            let cosine_in = -dot(heading, normal);
            let mut ways_here = ways;
            if !mirrored {
                if ever_scattered {
                    ways_here.inner_stretch(stretch_m, cosine_out * cosine_in);
                } else {
                    ways_here.first_stretch(stretch_m, cosine_in);
                }
            }
            let plane = &self.scene.mesh.surfaces.planes[surface.plane as usize];
            let patch = self.scene.patches.at(surface.plane, plane, point, heading);
            let area_m2 = scattered.then(|| self.scene.patches.area_m2(patch));
            let depth = depth + 1;
            walk.arrivals.push(Arrival {
                depth,
                point,
                normal,
                material,
                cosine: cosine_in.clamp(0.0, 1.0),
                travelled_m,
                mixture,
                ways: ways_here,
                patch,
                area_m2,
            });
            mixture.apply(&self.scene.probabilities, material, scattered);
            origin = point;
            heading = reflected(surface, heading, reflection, random);
            mirrored = !scattered;
            let Some(area_m2) = area_m2 else { continue };
            ways = ways_here;
            ways.scattered_on(area_m2);
            ever_scattered = true;
            (stretch_m, cosine_out) = (0.0, dot(heading, normal));
            let line = sub(there.centre, point);
            let distance_m = norm(line);
            let cosine = dot(line, normal) / distance_m;
            let length_m = travelled_m + distance_m;
            if cosine > 0.0 && length_m <= self.max_length_m && visible(&self.scene.mesh, point, there.centre)
            {
                let share = match self.config.bidirectional {
                    true => ways.share_of_line(distance_m, cosine, self.usage(depth)),
                    false => 1.0,
                };
                // Lambert: cos / pi of the power per steradian, thinned by the square of the distance.
                let log_spread = (share * cosine / (PI * distance_m * distance_m)).ln();
                let log_weight = log_share + log_spread - mixture.log_density();
                let found = Found { length_m, log_weight, direction: scale(line, -1.0 / distance_m) };
                push(paths, end, &mut walk, depth, found, batch);
            }
        }
    }
}

/// A path that one ray has found by itself.
struct Found {
    length_m: f64,
    log_weight: f64,
    /// Outward from the opposite end, along the path.
    direction: Vec3,
}

/// Adds a path along the first `depth` reflections of a ray from `end`.
fn push(paths: &mut PathSet, end: usize, walk: &mut Walk, depth: usize, found: Found, batch: u8) {
    let walked = walk.chain(depth, paths);
    let Found { length_m, log_weight, direction } = found;
    let (chain, tail, departure, arrival) = match end {
        SOURCE => (walked, PathSet::DIRECT, walk.heading, direction),
        _ => (PathSet::DIRECT, walked, direction, walk.heading),
    };
    paths.push(Contribution { length_m, log_weight, chain, tail, departure, arrival, batch: Some(batch) });
}
