//! Particles in any mesh, counted at all receivers at once and in all bands.

use super::Surface;
use super::images::Image;
use crate::geometry::{Vec3, add, anywhere, chord, cross, dot, first_hit, lambert, norm, scale, sub};
use crate::laboratory::stream::{Purpose, stream};
use rand::Rng;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Batches in which particles fly, each with random numbers of its own: the same result on any number of threads.
const BATCHES: usize = 64;
/// Radius of the receivers' spheres in metres; places are farther from all surfaces.
pub(super) const RADIUS_M: f64 = 0.5;
/// Width of a bin of energy in seconds.
pub(super) const BIN_S: f64 = 5e-4;
/// Share of its energy at which a particle is given up.
const LEAST: f64 = 1e-8;
/// A particle has left its wall once it is this far away, in metres.
const LIFT_OFF_M: f64 = 1e-7;

/// What flies, and where it is counted.
pub(super) struct Flight<'a> {
    pub seed: u64,
    pub particles: usize,
    pub triangles: &'a [[Vec3; 3]],
    /// Of each triangle.
    pub surfaces: &'a [&'a Surface],
    pub source: Vec3,
    pub receivers: &'a [Vec3],
    pub speed_m_s: f64,
    /// Attenuation of energy in air in each band, in 1/m.
    pub exponents_per_m: &'a [f64],
    pub duration_s: f64,
    /// Specular paths with so many reflections are counted elsewhere.
    pub without_order: usize,
}

impl Flight<'_> {
    /// Energy, `[receiver][band][bin]`. The particles together carry 4 pi: energy 1 at 1 m.
    pub fn energies(&self) -> Vec<Vec<Vec<f64>>> {
        let batches: Vec<Vec<f64>> = (0..BATCHES).into_par_iter().map(|batch| self.fly(batch)).collect();
        let (bands, bins) = (self.exponents_per_m.len(), self.bins());
        let mut sum = vec![0.0; self.receivers.len() * bands * bins];
        for batch in batches {
            sum.iter_mut().zip(batch).for_each(|(s, b)| *s += b);
        }
        let of_receiver = |r: &[f64]| r.chunks(bins).map(<[f64]>::to_vec).collect();
        sum.chunks(bands * bins).map(of_receiver).collect()
    }

    /// Of one specular path.
    pub fn image_energy(&self, image: &Image, band: usize) -> f64 {
        let surface = |&triangle: &usize| self.surfaces[triangle];
        let kept: f64 = image.met.iter().map(surface).map(|s| s.kept[band] * (1.0 - s.scattering)).product();
        kept * (-self.exponents_per_m[band] * image.length_m).exp() / image.length_m.powi(2)
    }

    fn bins(&self) -> usize {
        (self.duration_s / BIN_S).ceil() as usize
    }

    fn fly(&self, batch: usize) -> Vec<f64> {
        let mut random = stream(self.seed, Purpose::Particles, batch);
        let (bands, bins) = (self.exponents_per_m.len(), self.bins());
        let mut energy = vec![0.0; self.receivers.len() * bands * bins];
        let count = self.particles.div_ceil(BATCHES);
        let share = 4.0 * PI / (count * BATCHES) as f64 / (4.0 / 3.0 * PI * RADIUS_M.powi(3));
        let normals: Vec<Vec3> = self.triangles.iter().map(unit_normal).collect();
        let longest_m = self.duration_s * self.speed_m_s;
        let mut carried = vec![0.0; bands];
        for _ in 0..count {
            let (mut place, mut direction) = (self.source, anywhere(&mut random));
            let (mut length_m, mut reflections, mut specular) = (0.0, 0, true);
            carried.fill(1.0);
            while length_m < longest_m {
                // Through a seam where three surfaces meet: one particle of millions.
                let Some((triangle, distance)) =
                    first_hit(self.triangles, place, direction, LIFT_OFF_M, f64::INFINITY)
                else {
                    break;
                };
                if !(specular && reflections <= self.without_order) {
                    for (receiver, centre) in self.receivers.iter().enumerate() {
                        let Some((near, far)) = chord(sub(place, *centre), direction, RADIUS_M, distance)
                        else {
                            continue;
                        };
                        let way_m = length_m + 0.5 * (near + far);
                        let bin = (way_m / self.speed_m_s / BIN_S) as usize;
                        if bin < bins {
                            for (band, carried) in carried.iter().enumerate() {
                                energy[(receiver * bands + band) * bins + bin] +=
                                    share * (far - near) * carried;
                            }
                        }
                    }
                }
                length_m += distance;
                reflections += 1;
                place = add(place, scale(direction, distance));
                let surface = self.surfaces[triangle];
                let mut largest = 0.0f64;
                for ((carried, kept), exponent) in
                    carried.iter_mut().zip(&surface.kept).zip(self.exponents_per_m)
                {
                    *carried *= kept * (-exponent * distance).exp();
                    largest = largest.max(*carried);
                }
                if largest < LEAST {
                    break;
                }
                let normal = normals[triangle];
                let inward = if dot(normal, direction) > 0.0 { scale(normal, -1.0) } else { normal };
                direction = if random.random::<f64>() < surface.scattering {
                    specular = false;
                    lambert(&mut random, inward)
                } else {
                    sub(direction, scale(inward, 2.0 * dot(direction, inward)))
                };
            }
        }
        energy
    }
}

fn unit_normal([a, b, c]: &[Vec3; 3]) -> Vec3 {
    let normal = cross(sub(*b, *a), sub(*c, *a));
    scale(normal, 1.0 / norm(normal))
}
