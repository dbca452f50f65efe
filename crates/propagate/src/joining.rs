//! Paths made of a ray from the source and a ray from the receiver.

use crate::ray::Walk;
use crate::tracing::Tracing;
use crate::vector::{along, dot, norm, sub};
use crate::walk::visible;
use rand::Rng;
use sabine_paths::{Contribution, PathSet};
use std::f64::consts::PI;

/// Rays that meet on a patch must see each other at this height above it (m): a wall may stand across the patch.
const EYE_LEVEL_M: f64 = 0.01;

impl Tracing<'_> {
    /// Joins the two rays of a pair, each on one of its ways, along lines between points where both are scattered.
    pub fn join(
        &self,
        out: &mut Walk,
        back: &mut Walk,
        batch: u8,
        random: &mut impl Rng,
        paths: &mut PathSet,
    ) {
        let log_share = self.log_share();
        let scatterings = |walk: &Walk| -> Vec<usize> {
            (0..walk.arrivals.len()).filter(|&i| walk.arrivals[i].area_m2.is_some()).collect()
        };
        let points_back = scatterings(back);
        for i in scatterings(out) {
            let mut next = 0;
            while let Some(&nearest) = points_back.get(next) {
                // The share falls with the number of reflections, so the nearest one's bounds those of all that follow.
                let bound = self.line_share(out.arrivals[i].depth + back.arrivals[nearest].depth);
                next += passed_over(bound, random);
                let Some(&j) = points_back.get(next) else { break };
                next += 1;
                let (a, b) = (&out.arrivals[i], &back.arrivals[j]);
                if a.travelled_m + b.travelled_m >= self.max_length_m {
                    break;
                }
                let taken = self.line_share(a.depth + b.depth);
                if taken < bound && random.random::<f64>() * bound >= taken {
                    continue;
                }
                let line = sub(b.point, a.point);
                let distance_m = norm(line);
                let length_m = a.travelled_m + distance_m + b.travelled_m;
                let cosines = [dot(line, a.normal) / distance_m, -dot(line, b.normal) / distance_m];
                if cosines[0] <= 0.0
                    || cosines[1] <= 0.0
                    || length_m > self.max_length_m
                    || !visible(&self.scene.mesh, a.point, b.point)
                {
                    continue;
                }
                let probabilities = &self.scene.probabilities;
                let density =
                    a.mixture_on(probabilities).joint_density(&b.mixture_on(probabilities), probabilities);
                let used = self.usage(a.depth + b.depth, density);
                let product = cosines[0] * cosines[1];
                let share = a.ways_on().share_of_joint(&b.ways_on(), distance_m, product, used);
                // 16 pi g for each pair of rays, of which the share of a ray holds 4 pi.
                let spread = share / used.lines * 4.0 * product / (PI * distance_m * distance_m);
                let log_weight = log_share + spread.ln() - density.log + a.log_rays + b.log_rays;
                let (out_depth, back_depth) = (a.depth, b.depth);
                let (chain, tail) = (out.chain(out_depth, paths), back.chain(back_depth, paths));
                let (departure, arrival) = (out.heading, back.heading);
                let batch = Some(batch);
                paths.push(Contribution { length_m, log_weight, chain, tail, departure, arrival, batch });
            }
        }
    }

    /// Joins rays that come to the same patch of wall, where the one from the source is scattered.
    pub fn meet(
        &self,
        out: &mut [Walk],
        back: &mut [Walk],
        batch: u8,
        random: &mut impl Rng,
        paths: &mut PathSet,
    ) {
        let log_share = self.log_share();
        let mut waiting = Vec::new();
        for (walk, ray) in back.iter().zip(0u32..) {
            for (arrival, at) in walk.arrivals.iter().zip(0u32..) {
                if arrival.incoming.is_some() {
                    waiting.push((walk.hero, arrival.patch, ray, at));
                }
            }
        }
        waiting.sort_unstable();
        for walk in out {
            for i in 0..walk.arrivals.len() {
                let Some(area_m2) = walk.arrivals[i].area_m2.filter(|&area| area > 0.0) else { continue };
                let place = (walk.hero, walk.arrivals[i].patch);
                let first = waiting.partition_point(|&(hero, patch, ..)| (hero, patch) < place);
                let count = waiting[first..].partition_point(|&(hero, patch, ..)| (hero, patch) == place);
                let here = &waiting[first..first + count];
                let bound = self.meeting_share(walk.arrivals[i].depth);
                let mut next = passed_over(bound, random);
                while let Some(&(_, _, ray, at)) = here.get(next) {
                    next += 1 + passed_over(bound, random);
                    let (a, other) = (&walk.arrivals[i], &mut back[ray as usize]);
                    let b = &other.arrivals[at as usize];
                    let length_m = a.travelled_m + b.travelled_m;
                    // The point where they meet is a reflection of both.
                    let reflections = a.depth + b.depth - 1;
                    let taken = self.meeting_share(reflections);
                    if length_m > self.max_length_m
                        || (taken < bound && random.random::<f64>() * bound >= taken)
                    {
                        continue;
                    }
                    let eye = |point, normal| along(point, normal, EYE_LEVEL_M);
                    if !visible(&self.scene.mesh, eye(a.point, a.normal), eye(b.point, b.normal)) {
                        continue;
                    }
                    let probabilities = &self.scene.probabilities;
                    let density = a.mixture_on(probabilities).joint_density(&b.mixture, probabilities);
                    let used = self.usage(reflections, density);
                    let share = a.ways_on().share_of_meeting(&b.ways, area_m2, used);
                    // 16 pi for each pair of rays and over the area; a ray meets all its rivals.
                    let spread = share * 4.0 / (used.meetings * area_m2);
                    let log_rays = a.log_rays + b.incoming.unwrap_or(f64::NEG_INFINITY);
                    let log_weight = log_share + spread.ln() - density.log + log_rays;
                    let (out_depth, back_depth) = (a.depth, b.depth - 1);
                    let (chain, tail) = (walk.chain(out_depth, paths), other.chain(back_depth, paths));
                    let (departure, arrival) = (walk.heading, other.heading);
                    let batch = Some(batch);
                    paths.push(Contribution { length_m, log_weight, chain, tail, departure, arrival, batch });
                }
            }
        }
    }
}

/// How many are passed over before the next one is drawn, if each is drawn with this probability.
fn passed_over(probability: f64, random: &mut impl Rng) -> usize {
    if probability >= 1.0 {
        return 0;
    }
    // Uniform in (0, 1], so that the logarithm is finite.
    ((1.0 - random.random::<f64>()).ln() / (1.0 - probability).ln()) as usize
}
