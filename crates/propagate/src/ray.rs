//! A ray, and where it has been.

use crate::event_mixture::{EventMixture, EventProbabilities};
use crate::guide::Guide;
use crate::patches::Patch;
use crate::random::lambert;
use crate::techniques::Ways;
use crate::vector::{Vec3, dot};
use crate::walk::Sphere;
use crate::weight_window::MAX_BANDS;
use rand::Rng;
use sabine_paths::{Contribution, Incidence, PathSet, Reflection};

/// The ends of the paths.
pub(crate) const SOURCE: usize = 0;
pub(crate) const RECEIVER: usize = 1;

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
    /// Logarithm of the number of rays for which this one comes here; none if another does so that goes on otherwise.
    pub incoming: Option<f64>,
    /// The same after the reflection.
    pub log_rays: f64,
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

/// A ray, as far as it was followed, from the end of the paths or from where it was split off.
pub(crate) struct Walk {
    /// Direction in which it began at the end of the paths.
    pub heading: Vec3,
    /// Its own reflections.
    pub arrivals: Vec<Arrival>,
    /// Class of octaves whose scattering coefficients it obeys.
    pub hero: usize,
    /// Reflections before its own.
    before: usize,
    /// Chains of those, and of the first of its own, as far as a contribution has needed them.
    chains: Vec<u32>,
}

/// A ray that is being followed from an end.
pub(crate) struct Ray {
    pub end: usize,
    pub batch: u8,
    pub walk: Walk,
    pub at: Progress,
    /// By roulette.
    pub ended: bool,
}

/// A surface that a ray has met.
pub(crate) struct Met {
    /// Towards the side from which the ray came.
    pub normal: Vec3,
    pub material: u32,
    pub cosine: f64,
    /// Of the way to this point.
    pub ways: Ways,
    pub patch: Patch,
    /// What a ray that stands for one carries, in units of what rays carry on average; none without a weight window.
    pub carried: Option<f64>,
}

impl Met {
    /// What a ray carries, in units of what rays carry on average.
    pub fn importance(&self, ray: &Ray) -> f64 {
        self.carried.map_or(1.0, |carried| carried * ray.at.log_rays.exp())
    }
}

/// Where a ray is.
#[derive(Clone)]
pub(crate) struct Progress {
    pub origin: Vec3,
    pub heading: Vec3,
    pub travelled_m: f64,
    pub mixture: EventMixture,
    pub ways: Ways,
    pub ever_scattered: bool,
    /// Since the last scattering, or the beginning: how far, from which cosine, and whether over a mirror.
    pub stretch_m: f64,
    pub cosine_out: f64,
    pub mirrored: bool,
    /// Energy that is left, by octave.
    pub ln_energy: [f64; MAX_BANDS],
    /// Logarithm of the number of rays that it stands for.
    pub log_rays: f64,
    /// What the direction in which it was last sent has added to that.
    pub log_guided: f64,
}

impl Walk {
    /// The chain of the first `depth` reflections.
    pub fn chain(&mut self, depth: usize, paths: &mut PathSet) -> u32 {
        while self.before + self.chains.len() <= depth {
            let arrival = &self.arrivals[self.chains.len() - 1];
            let scattered = arrival.area_m2.is_some();
            let reflection = if scattered { Reflection::Scattered } else { Reflection::Specular };
            let incidence = Incidence::Cosine(arrival.cosine);
            let last = self.chains[self.chains.len() - 1];
            let longer = paths.reflect_at(last, arrival.material, reflection, incidence);
            self.chains.push(longer);
        }
        self.chains[depth - self.before]
    }

    /// Reflections so far.
    pub fn depth(&self) -> usize {
        self.before + self.arrivals.len()
    }
}

impl Ray {
    /// A ray that leaves the middle of an end's sphere.
    pub fn new(end: usize, hero: usize, batch: u8, (sphere, heading): (&Sphere, Vec3)) -> Self {
        let walk = Walk { heading, arrivals: Vec::new(), hero, before: 0, chains: vec![PathSet::DIRECT] };
        let at = Progress {
            origin: sphere.centre,
            heading,
            travelled_m: 0.0,
            mixture: EventMixture::NONE,
            ways: Ways::new(sphere.radius_m),
            ever_scattered: false,
            stretch_m: 0.0,
            cosine_out: 1.0,
            mirrored: false,
            ln_energy: [0.0; MAX_BANDS],
            log_rays: 0.0,
            log_guided: 0.0,
        };
        Self { end, batch, walk, at, ended: false }
    }

    /// A ray that goes on from here, its reflections so far being those of this one.
    pub fn split_off(&mut self, paths: &mut PathSet) -> Self {
        let before = self.walk.depth();
        let chains = vec![self.walk.chain(before, paths)];
        let Walk { heading, hero, .. } = self.walk;
        Self {
            walk: Walk { heading, arrivals: Vec::new(), hero, before, chains },
            at: self.at.clone(),
            ..*self
        }
    }

    /// Adds a reflection.
    pub fn arrive(&mut self, met: &Met, incoming: Option<f64>, area_m2: Option<f64>) {
        let at = &self.at;
        self.walk.arrivals.push(Arrival {
            depth: self.walk.depth() + 1,
            point: at.origin,
            normal: met.normal,
            material: met.material,
            cosine: met.cosine.clamp(0.0, 1.0),
            travelled_m: at.travelled_m,
            mixture: at.mixture,
            ways: met.ways,
            patch: met.patch,
            area_m2,
            incoming,
            log_rays: at.log_rays,
        });
    }

    /// Adds a path along all reflections so far: its length, the logarithm of its weight for one ray, and its direction at the opposite end,
    /// outward along the path.
    pub fn push(&mut self, length_m: f64, log_weight: f64, direction: Vec3, paths: &mut PathSet) {
        let walked = self.walk.chain(self.walk.depth(), paths);
        let (chain, tail, departure, arrival) = match self.end {
            SOURCE => (walked, PathSet::DIRECT, self.walk.heading, direction),
            _ => (PathSet::DIRECT, walked, direction, self.walk.heading),
        };
        let (log_weight, batch) = (log_weight + self.at.log_rays, Some(self.batch));
        paths.push(Contribution { length_m, log_weight, chain, tail, departure, arrival, batch });
    }
}

impl Progress {
    /// Is scattered on by a surface, by Lambert's law.
    pub fn set_out(&mut self, normal: Vec3, guide: Option<&Guide>, random: &mut impl Rng) {
        let (heading, log_rays) = match guide {
            Some(guide) => guide.scattered(normal, random),
            None => (lambert(random, normal), 0.0),
        };
        self.heading = heading;
        self.log_rays += log_rays - self.log_guided;
        self.log_guided = log_rays;
        (self.stretch_m, self.cosine_out) = (0.0, dot(self.heading, normal));
    }
}
