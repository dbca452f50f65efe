//! The rays of one trace, from the source and from the receiver.

use crate::TracerConfig;
use crate::event_mixture::EventDensity;
use crate::guide::Guide;
use crate::prepared_scene::PreparedScene;
use crate::random::{direction, generator};
use crate::ray::{Met, RECEIVER, Ray, SOURCE, Walk};
use crate::techniques::Use;
use crate::vector::{Vec3, dot, mirror, norm, scale, sub};
use crate::walk::{Sphere, before_hit, next_hit, visible};
use crate::weight_window::{Fate, WeightWindow};
use rand::Rng;
use sabine_paths::PathSet;
use std::f64::consts::PI;

/// Pairs of rays that may meet each other, at most: so many are kept in memory by each thread.
const MOST_PAIRS: usize = 256;
/// Ways on which one ray may go, at most.
const MOST_WALKS: usize = 64;

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
    /// What rays from each end carry on average.
    windows: Option<[WeightWindow; 2]>,
    /// Where more rays are sent than by chance, for each class of octaves.
    guides: Vec<Option<Guide>>,
    config: &'a TracerConfig,
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
        let window =
            |end: usize| scene.weight_window(ends_m[end], max_length_m, pairs, config.seed ^ end as u64);
        let windows = config.weight_window.then(|| [window(SOURCE), window(RECEIVER)]);
        let guides = match &windows {
            Some(windows) if config.path_guiding => {
                scene.guides(&windows[SOURCE], ends_m[SOURCE], max_length_m, config.seed)
            }
            _ => (0..scene.probabilities.classes()).map(|_| None).collect(),
        };
        Self {
            scene,
            max_length_m,
            guides,
            windows,
            ends: [sphere(SOURCE), sphere(RECEIVER)],
            pairs: parts * pairs.div_ceil(parts).next_multiple_of(scene.probabilities.round()),
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
        // All walks from each end, and where those of each pair end.
        let mut walks: [Vec<Walk>; 2] = [Vec::new(), Vec::new()];
        let mut until: Vec<[usize; 2]> = vec![[0; 2]];
        for pair in part * pairs..(part + 1) * pairs {
            for (end, walks) in walks.iter_mut().enumerate().take(self.ends_in_use()) {
                let mut random = generator(self.config.seed, (2 * pair + end) as u64);
                self.walk((end, pair, batch), &mut random, walks, &mut paths);
            }
            until.push([walks[SOURCE].len(), walks[RECEIVER].len()]);
        }
        if self.config.bidirectional {
            let mut random = generator(!self.config.seed, part as u64);
            let [out, back] = &mut walks;
            for ends in until.windows(2) {
                let of = |end: usize| ends[0][end]..ends[1][end];
                for out in &mut out[of(SOURCE)] {
                    for back in &mut back[of(RECEIVER)] {
                        self.join(out, back, batch, &mut random, &mut paths);
                    }
                }
            }
            self.meet(out, back, batch, &mut random, &mut paths);
        }
        (paths, (pairs * self.ends_in_use()) as u64)
    }

    /// How many lines and meetings are used for paths of so many reflections: about as many of each as a ray draws lines
    /// to the opposite end. The more reflections, the more of them find the same kind of path.
    pub fn usage(&self, reflections: usize, density: EventDensity) -> Use {
        if !self.config.bidirectional {
            return Use { lines: 0.0, meetings: 0.0 };
        }
        let rivals = self.rivals(density.same_class);
        Use { lines: self.line_share(reflections), meetings: rivals * self.meeting_share(reflections) }
    }

    /// Rays from one end that a ray from the other end may meet: those of its part that draw for the same class, which is this share of all.
    fn rivals(&self, same_class: f64) -> f64 {
        (self.pairs / self.parts) as f64 * same_class
    }

    /// Share of the lines between two rays that are used.
    pub fn line_share(&self, reflections: usize) -> f64 {
        let splits = reflections.saturating_sub(1) as f64;
        (1.0 / (splits * self.scene.mean_scattering)).min(1.0)
    }

    /// Share of the meetings that are used.
    pub fn meeting_share(&self, reflections: usize) -> f64 {
        let rivals = self.rivals(self.scene.probabilities.same_class());
        let expected = reflections as f64 * rivals * self.scene.patches.full_m2() / self.scene.surface_m2;
        (1.0 / expected).min(1.0)
    }

    /// Energy that each ray carries, the direct sound being 1 / d2: an equal share of 4 pi for all rays from its end.
    pub fn log_share(&self) -> f64 {
        (4.0 * PI / self.pairs as f64).ln()
    }

    /// Follows one ray from an end of the path, on all ways into which it is split, and adds what it finds at the opposite end.
    fn walk(
        &self,
        (end, number, batch): (usize, usize, u8),
        random: &mut impl Rng,
        walks: &mut Vec<Walk>,
        paths: &mut PathSet,
    ) {
        let first = walks.len();
        // Both rays of a pair draw for the same class, and each class gets its share of the turns within a part.
        let (hero, turn) = self.scene.probabilities.turn(number);
        let (heading, log_rays) = match &self.guides[hero] {
            Some(guide) => guide.emitted((end == SOURCE).then_some(turn), random),
            None => (direction(random), 0.0),
        };
        let start = (&self.ends[end], heading);
        let mut ray = Ray::new(end, hero, batch, start);
        (ray.at.log_rays, ray.at.log_guided) = (log_rays, log_rays);
        let mut waiting = vec![ray];
        while let Some(mut ray) = waiting.pop() {
            while !ray.ended
                && let Some(met) = self.leg(&mut ray, random, paths)
            {
                let most = MOST_WALKS.saturating_sub(walks.len() - first + waiting.len());
                self.reflect(&mut ray, &met, most, &mut waiting, random, paths);
            }
            walks.push(ray.walk);
        }
    }

    /// Follows a ray to the next surface and adds what it finds at the opposite end on its way. None where it ends.
    fn leg(&self, ray: &mut Ray, random: &mut impl Rng, paths: &mut PathSet) -> Option<Met> {
        let there = &self.ends[1 - ray.end];
        let depth = ray.walk.depth();
        let at = &mut ray.at;
        let hit = next_hit(&self.scene.mesh, at.origin, &mut at.heading, random);
        let leg_m = hit.map_or(f64::INFINITY, |h| h.distance);
        // Specular paths that image sources have found, and those that a line has found, are not counted again.
        if at.mirrored
            && (at.ever_scattered || depth > self.exact_order)
            && let Some((middle_m, chord_m)) = there.chord(at.origin, at.heading, leg_m)
            && at.travelled_m + middle_m <= self.max_length_m
        {
            let density = at.mixture.density(&self.scene.probabilities);
            let share = match self.config.bidirectional {
                true => at.ways.share_of_sphere(there.radius_m, self.usage(depth, density)),
                false => 1.0,
            };
            let log_density = density.log + there.volume_m3().ln();
            let log_weight = self.log_share() + (share * chord_m).ln() - log_density;
            let (length_m, back) = (at.travelled_m + middle_m, scale(at.heading, -1.0));
            ray.push(length_m, log_weight, back, paths);
        }
        let (hit, at) = (hit?, &mut ray.at);
        at.travelled_m += hit.distance;
        if at.travelled_m >= self.max_length_m {
            return None;
        }
        at.stretch_m += hit.distance;
        let surface = &self.scene.mesh.surfaces.triangles[hit.triangle as usize];
        let normal = surface.normal_against(at.heading);
        at.origin = before_hit(at.origin, at.heading, hit.distance);
        let cosine = -dot(at.heading, normal);
        let mut ways = at.ways;
        if !at.mirrored {
            if at.ever_scattered {
                ways.inner_stretch(at.stretch_m, at.cosine_out * cosine);
            } else {
                ways.first_stretch(at.stretch_m, cosine);
            }
        }
        let plane = &self.scene.mesh.surfaces.planes[surface.plane as usize];
        let patch = self.scene.patches.at(surface.plane, plane, at.origin, at.heading);
        let kept = &self.scene.ln_kept[surface.material as usize];
        at.ln_energy.iter_mut().zip(kept).for_each(|(energy, kept)| *energy += kept);
        let of = |windows: &[WeightWindow; 2]| windows[ray.end].importance(&at.ln_energy, at.travelled_m);
        let carried = self.windows.as_ref().map(of);
        Some(Met { normal, material: surface.material, cosine, ways, patch, carried })
    }

    /// Mirrors or scatters a ray; one that carries much goes both ways. Then it is split, or ends, as the weight window asks.
    fn reflect(
        &self,
        ray: &mut Ray,
        met: &Met,
        most: usize,
        waiting: &mut Vec<Ray>,
        random: &mut impl Rng,
        paths: &mut PathSet,
    ) {
        let scattering = self.scene.probabilities.scattering(met.material, ray.walk.hero);
        let incoming = Some(ray.at.log_rays);
        let both = scattering > 0.0 && scattering < 1.0 && most > 1;
        if both && WeightWindow::is_above(met.importance(ray)) {
            let mut scattered = ray.split_off(paths);
            scattered.at.log_rays += scattering.ln();
            // It came here but once.
            self.scatter(&mut scattered, met, None, random, paths);
            self.split(&mut scattered, met, most - 1, waiting, random, paths);
            waiting.push(scattered);
            ray.at.log_rays += (1.0 - scattering).ln();
            self.mirror(ray, met, incoming);
            return;
        }
        if random.random::<f64>() < scattering {
            self.scatter(ray, met, incoming, random, paths);
        } else {
            self.mirror(ray, met, incoming);
        }
        self.split(ray, met, most, waiting, random, paths);
    }

    /// Splits a ray after a reflection into `most` parts at most, or ends it.
    fn split(
        &self,
        ray: &mut Ray,
        met: &Met,
        most: usize,
        waiting: &mut Vec<Ray>,
        random: &mut impl Rng,
        paths: &mut PathSet,
    ) {
        // A ray that was sent for what its direction promises carries less until the promise is kept.
        let promised = (-ray.at.log_guided).exp();
        match WeightWindow::fate(met.importance(ray) * promised) {
            // Parts of a ray that was mirrored would go the same way.
            Fate::Parts(parts) if !ray.at.mirrored => {
                let parts = parts.min(most).max(1);
                ray.at.log_rays -= (parts as f64).ln();
                for _ in 1..parts {
                    let mut part = ray.split_off(paths);
                    part.at.set_out(met.normal, self.guides[ray.walk.hero].as_ref(), random);
                    waiting.push(part);
                }
            }
            Fate::Parts(_) => {}
            Fate::Roulette(survival) => {
                ray.at.log_rays -= survival.ln();
                ray.ended = random.random::<f64>() >= survival;
            }
        }
    }

    /// Goes on from a surface as from a mirror.
    fn mirror(&self, ray: &mut Ray, met: &Met, incoming: Option<f64>) {
        ray.arrive(met, incoming, None);
        let at = &mut ray.at;
        at.mixture.apply(&self.scene.probabilities, met.material, false);
        at.mirrored = true;
        at.heading = mirror(at.heading, met.normal);
    }

    /// Goes on from a surface that scatters, and adds the line from there to the opposite end.
    fn scatter(
        &self,
        ray: &mut Ray,
        met: &Met,
        incoming: Option<f64>,
        random: &mut impl Rng,
        paths: &mut PathSet,
    ) {
        let area_m2 = self.scene.patches.area_m2(met.patch);
        ray.arrive(met, incoming, Some(area_m2));
        let at = &mut ray.at;
        at.mixture.apply(&self.scene.probabilities, met.material, true);
        at.mirrored = false;
        at.ways = met.ways;
        at.ways.scattered_on(area_m2);
        at.ever_scattered = true;
        at.log_guided = 0.0;
        let there = &self.ends[1 - ray.end];
        let line = sub(there.centre, at.origin);
        let distance_m = norm(line);
        let cosine = dot(line, met.normal) / distance_m;
        let length_m = at.travelled_m + distance_m;
        if cosine > 0.0 && length_m <= self.max_length_m && visible(&self.scene.mesh, at.origin, there.centre)
        {
            let density = at.mixture.density(&self.scene.probabilities);
            let share = match self.config.bidirectional {
                true => at.ways.share_of_line(distance_m, cosine, self.usage(ray.walk.depth(), density)),
                false => 1.0,
            };
            // Lambert: cos / pi of the power per steradian, thinned by the square of the distance.
            let log_spread = (share * cosine / (PI * distance_m * distance_m)).ln();
            let log_weight = self.log_share() + log_spread - density.log;
            ray.push(length_m, log_weight, scale(line, -1.0 / distance_m), paths);
        }
        ray.at.set_out(met.normal, self.guides[ray.walk.hero].as_ref(), random);
    }
}
