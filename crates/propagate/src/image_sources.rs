//! Specular reflections of low order, exactly: mirror images of the source in the planes of the mesh.

use crate::mesh_scene::MeshScene;
use crate::random::{direction, generator};
use crate::surfaces::Plane;
use crate::vector::{Vec3, along, dot, mirror, norm, scale, sub};
use crate::walk::{before_hit, next_hit, visible};
use rayon::prelude::*;
use sabine_paths::{Contribution, Incidence, PathSet, RayScene, Reflection};
use std::collections::BTreeSet;

/// Up to so many sequences of planes are all tried; of more, only those that rays find.
const EXHAUSTIVE: usize = 20_000;
/// A path may pass a surface by this much before it counts as blocked (m): what merging coplanar triangles allows.
const SLACK_M: f64 = 1e-3;
/// Paths whose images agree to this are one path (m): two orders of the same planes meet in an edge.
const SAME_IMAGE_M: f64 = 1e-6;

/// Sequences of planes that may carry a specular path, from the source on.
fn candidates(
    scene: &MeshScene,
    ends: [Vec3; 2],
    order: usize,
    rays: usize,
    seed: u64,
) -> BTreeSet<Vec<u32>> {
    let planes = scene.surfaces.planes.len();
    let mut found = BTreeSet::new();
    // All sequences without immediate repetition, as long as they are few.
    let mut level: Vec<Vec<u32>> = vec![Vec::new()];
    let mut complete = 0;
    for length in 1..=order {
        // First order is one test for each plane: always affordable.
        if length > 1 && level.len().saturating_mul(planes) > EXHAUSTIVE {
            break;
        }
        level = level
            .iter()
            .flat_map(|sequence| {
                (0..planes as u32).filter(|p| sequence.last() != Some(p)).map(|p| {
                    let mut longer = sequence.clone();
                    longer.push(p);
                    longer
                })
            })
            .collect();
        found.extend(level.iter().cloned());
        complete = length;
    }
    if complete == order {
        return found;
    }
    // Longer ones: what specular rays meet, sent from both ends.
    let seen: Vec<Vec<u32>> = (0..2 * rays as u64)
        .into_par_iter()
        .map(|i| {
            let reverse = i % 2 == 1;
            let mut random = generator(seed ^ 0x1A6E, i);
            let (mut origin, mut heading) = (ends[usize::from(reverse)], direction(&mut random));
            let mut sequence: Vec<u32> = Vec::with_capacity(order);
            while sequence.len() < order {
                let Some(hit) = next_hit(scene, origin, &mut heading, &mut random) else { break };
                let surface = &scene.surfaces.triangles[hit.triangle as usize];
                sequence.push(surface.plane);
                origin = before_hit(origin, heading, hit.distance);
                heading = mirror(heading, surface.normal);
            }
            if reverse {
                sequence.reverse();
            }
            // The parity mark is dropped below; it only tells which end the sequence began at.
            sequence.push(u32::from(reverse));
            sequence
        })
        .collect();
    for mut sequence in seen {
        let reverse = sequence.pop() == Some(1);
        for length in complete + 1..=sequence.len() {
            let part = if reverse { &sequence[sequence.len() - length..] } else { &sequence[..length] };
            if !part.windows(2).any(|pair| pair[0] == pair[1]) {
                found.insert(part.to_vec());
            }
        }
    }
    found
}

/// A specular path that was checked leg by leg.
pub(crate) struct ExactPath {
    image: Vec3,
    materials: Vec<u32>,
    /// Cosine of incidence of each reflection.
    cosines: Vec<f64>,
    pub length_m: f64,
    departure: Vec3,
    pub arrival: Vec3,
}

impl ExactPath {
    /// Adds the path to a set.
    pub fn push_to(&self, paths: &mut PathSet) {
        let chain =
            self.materials.iter().zip(&self.cosines).fold(PathSet::DIRECT, |chain, (&material, &cosine)| {
                paths.reflect_at(chain, material, Reflection::Specular, Incidence::Cosine(cosine))
            });
        paths.push(Contribution {
            length_m: self.length_m,
            log_weight: -2.0 * self.length_m.ln(),
            chain,
            tail: PathSet::DIRECT,
            departure: self.departure,
            arrival: self.arrival,
            batch: None,
        });
    }
}

fn mirrored(point: Vec3, plane: &Plane) -> Vec3 {
    along(point, plane.normal, -2.0 * plane.height(point))
}

/// Unfolds one sequence of planes: the path from receiver back to source must meet exactly these planes, in this order,
/// within the mesh, and nothing else.
pub(crate) fn validated(
    scene: &MeshScene,
    source: Vec3,
    receiver: Vec3,
    sequence: &[u32],
) -> Option<ExactPath> {
    let planes = &scene.surfaces.planes;
    let mut images = Vec::with_capacity(sequence.len() + 1);
    images.push(source);
    for (i, &plane) in sequence.iter().enumerate() {
        images.push(mirrored(images[i], &planes[plane as usize]));
    }
    let image = images[sequence.len()];
    let length_m = norm(sub(image, receiver));
    let mut materials = Vec::with_capacity(sequence.len());
    let mut cosines = Vec::with_capacity(sequence.len());
    let mut point = receiver;
    let mut arrival = None;
    for (i, &id) in sequence.iter().enumerate().rev() {
        let plane = &planes[id as usize];
        let line = sub(images[i + 1], point);
        let heading = scale(line, 1.0 / norm(line));
        let (from, to) = (plane.height(point), plane.height(images[i + 1]));
        // The image lies behind its mirror, seen from here.
        if from * to >= 0.0 {
            return None;
        }
        let distance = norm(line) * from / (from - to);
        let hit = scene.closest_hit(point, heading, distance + SLACK_M)?;
        let surface = &scene.surfaces.triangles[hit.triangle as usize];
        // In an edge two planes are equally near, and the ray may report the other one.
        let material = if surface.plane == id {
            surface.material
        } else if hit.distance >= distance - 1e-9 * (1.0 + distance) {
            let beyond = scene.surfaces.triangles.iter().find(|s| {
                s.plane == id && s.intersect(point, heading).is_some_and(|t| t <= distance + SLACK_M)
            })?;
            beyond.material
        } else {
            return None;
        };
        arrival.get_or_insert(heading);
        materials.push(material);
        cosines.push(dot(heading, plane.normal).abs());
        point = before_hit(point, heading, distance.min(hit.distance));
    }
    if !visible(scene, point, source) {
        return None;
    }
    materials.reverse();
    cosines.reverse();
    let out = sub(point, source);
    Some(ExactPath {
        image,
        materials,
        cosines,
        length_m,
        departure: scale(out, 1.0 / norm(out)),
        arrival: arrival?,
    })
}

/// Adds the direct path and all specular paths of up to `order` reflections to `paths`.
pub(crate) fn add_exact_paths(
    paths: &mut PathSet,
    scene: &MeshScene,
    source: Vec3,
    receiver: Vec3,
    order: usize,
    rays: usize,
    seed: u64,
) {
    let line = sub(receiver, source);
    let distance_m = norm(line);
    if distance_m <= paths.max_length_m() && visible(scene, source, receiver) {
        let departure = scale(line, 1.0 / distance_m);
        paths.push(Contribution {
            length_m: distance_m,
            log_weight: -2.0 * distance_m.ln(),
            chain: PathSet::DIRECT,
            tail: PathSet::DIRECT,
            departure,
            arrival: scale(departure, -1.0),
            batch: None,
        });
    }
    if order == 0 {
        return;
    }
    let sequences: Vec<Vec<u32>> =
        candidates(scene, [source, receiver], order, rays, seed).into_iter().collect();
    let max_length_m = paths.max_length_m();
    let mut exact: Vec<ExactPath> = sequences
        .par_iter()
        .filter_map(|sequence| validated(scene, source, receiver, sequence))
        .filter(|path| path.length_m <= max_length_m)
        .collect();
    exact.sort_by(|a, b| a.length_m.total_cmp(&b.length_m).then(a.materials.cmp(&b.materials)));
    let mut kept: Vec<(f64, Vec3)> = Vec::new();
    for path in exact {
        let near = kept.iter().rev().take_while(|(length, _)| path.length_m - length < SAME_IMAGE_M);
        if near.into_iter().any(|(_, image)| norm(sub(*image, path.image)) < SAME_IMAGE_M) {
            continue;
        }
        kept.push((path.length_m, path.image));
        path.push_to(paths);
    }
}
