//! Specular paths that were found once are looked for again.

use crate::image_sources::validated;
use crate::mesh_scene::MeshScene;
use crate::vector::{Vec3, along, mirror, norm, sub};
use crate::walk::before_hit;
use sabine_paths::{PathSet, RayScene};
use std::collections::BTreeMap;

/// Frames for which a sequence of planes that carries no path is remembered.
const FORGOTTEN_AFTER: u64 = 100;
/// Paths of this length difference and distance of their images are one: directions are stored to 0.005 degrees (m).
const SAME_LENGTH_M: f64 = 1e-4;
const SAME_IMAGE_M: f64 = 0.02;

/// Sequences of planes that carried a specular path, each with the last frame in which it did.
///
/// In a room of many planes the tracer's search for image sources knows only what its few rays of this frame met; what those of
/// older frames met is validated again at the places of the moment, so that early reflections do not flicker.
#[derive(Clone, Debug, Default)]
pub(crate) struct EarlyMemory {
    sequences: BTreeMap<Vec<u32>, u64>,
    frame: u64,
}

impl EarlyMemory {
    /// Learns from the exact paths of this frame, and adds those that only older frames know of.
    pub fn complete(&mut self, paths: &mut PathSet, mesh: &MeshScene, [source, receiver]: [Vec3; 2]) {
        self.frame += 1;
        let frame = self.frame;
        let mut images = Vec::new();
        for path in (0..paths.len()).filter(|&i| paths.is_exact(i)) {
            let length_m = f64::from(paths.lengths_m()[path]);
            images.push((length_m, along(receiver, paths.arrival(path), length_m)));
            if let Some(sequence) = sequence(paths, path, mesh, source) {
                self.sequences.insert(sequence, frame);
            }
        }
        for (sequence, seen) in self.sequences.iter_mut().filter(|(_, seen)| **seen < frame) {
            let Some(path) = validated(mesh, source, receiver, sequence) else { continue };
            *seen = frame;
            let image = along(receiver, path.arrival, path.length_m);
            let known = images.iter().any(|(length_m, other)| {
                (length_m - path.length_m).abs() < SAME_LENGTH_M && norm(sub(*other, image)) < SAME_IMAGE_M
            });
            if !known && path.length_m <= paths.max_length_m() {
                path.push_to(paths);
                images.push((path.length_m, image));
            }
        }
        self.sequences.retain(|_, seen| *seen + FORGOTTEN_AFTER > frame);
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.sequences.clear();
    }
}

/// The planes that an exact path meets: its way is followed from the source. `None` for the direct path.
fn sequence(paths: &PathSet, path: usize, mesh: &MeshScene, source: Vec3) -> Option<Vec<u32>> {
    let mut reflections = 0;
    let mut chain = paths.chains()[path];
    while let Some((parent, ..)) = paths.last_reflection(chain) {
        reflections += 1;
        chain = parent;
    }
    let (mut origin, mut heading) = (source, paths.departure(path));
    let mut sequence = Vec::with_capacity(reflections);
    for _ in 0..reflections {
        let hit = mesh.closest_hit(origin, heading, f64::INFINITY)?;
        let surface = &mesh.surfaces.triangles[hit.triangle as usize];
        sequence.push(surface.plane);
        origin = before_hit(origin, heading, hit.distance);
        heading = mirror(heading, surface.normal);
    }
    Some(sequence).filter(|sequence| !sequence.is_empty())
}
