//! Particles in any mesh, counted at all receivers at once and in all bands.

use super::Surface;
use super::images::Image;
use crate::geometry::{Vec3, add, anywhere, chord, cross, dot, hit, lambert, norm, scale, sub};
use crate::laboratory::stream::{Purpose, stream};
use rand::Rng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Batches in which particles fly, each with random numbers of its own: the same result on any number of threads.
const BATCHES: usize = 64;
/// Radius of the receivers' spheres in metres; places are farther from all surfaces.
pub(super) const RADIUS_M: f64 = 0.5;
/// Width of a bin of energy in seconds.
pub(super) const BIN_S: f64 = 5e-4;
/// Particles are resampled after so long, in seconds, ...
const STEP_S: f64 = 0.02;
/// ... if the sum of the squares of their shares of the energy is so many times that of equal shares.
const UNEVEN: f64 = 1.5;
/// Spans in which energy is to be known to this standard error, relative to itself: a twentieth is what 12 microphones' noise leaves of an octave in
/// 20 ms ...
const SPAN_S: f64 = 0.05;
const KNOWN_TO: f64 = 0.05;
/// ... down to this share of all that arrives, -45 dB, at which comparisons end.
const LEAST: f64 = 3e-5;
/// A particle has left its wall once it is this far away, in metres.
const LIFT_OFF_M: f64 = 1e-7;

/// What flies, and where it is counted.
pub(super) struct Flight<'a> {
    pub seed: u64,
    /// In one round.
    pub particles: usize,
    /// Rounds end with so many, converged or not.
    pub most_particles: usize,
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
        let (bands, bins) = (self.exponents_per_m.len(), self.bins());
        let mut sum = vec![0.0; self.receivers.len() * bands * bins];
        // What all receivers hear together, for each batch, `[band * spans + span]`.
        let mut together: Vec<Vec<f64>> = Vec::new();
        let most = self.most_particles.div_ceil(self.particles).max(1);
        let mut rounds = 0;
        while rounds < most && !(rounds > 0 && self.is_converged(&together)) {
            let batches = rounds * BATCHES..(rounds + 1) * BATCHES;
            for batch in batches.into_par_iter().map(|batch| self.fly(batch)).collect::<Vec<_>>() {
                sum.iter_mut().zip(&batch).for_each(|(s, b)| *s += b);
                together.push(self.spans(&batch));
            }
            rounds += 1;
        }
        sum.iter_mut().for_each(|s| *s /= rounds as f64);
        let of_receiver = |r: &[f64]| r.chunks(bins).map(<[f64]>::to_vec).collect();
        sum.chunks(bands * bins).map(of_receiver).collect()
    }

    /// Energy of a batch at all receivers, `[band * spans + span]`.
    fn spans(&self, energy: &[f64]) -> Vec<f64> {
        let (bands, bins) = (self.exponents_per_m.len(), self.bins());
        let each = (SPAN_S / BIN_S) as usize;
        let count = bins.div_ceil(each);
        let mut sums = vec![0.0; bands * count];
        for (i, of_band) in energy.chunks(bins).enumerate() {
            let own = &mut sums[(i % bands) * count..][..count];
            own.iter_mut().zip(of_band.chunks(each)).for_each(|(s, bins)| *s += bins.iter().sum::<f64>());
        }
        sums
    }

    /// Whether the energy that all receivers hear together is known to [`KNOWN_TO`] wherever it is compared.
    fn is_converged(&self, together: &[Vec<f64>]) -> bool {
        let count = together.len() as f64;
        let spans = together[0].len() / self.exponents_per_m.len();
        let means: Vec<f64> =
            (0..together[0].len()).map(|i| together.iter().map(|b| b[i]).sum::<f64>() / count).collect();
        means.chunks(spans).enumerate().all(|(band, means)| {
            let least = LEAST * means.iter().sum::<f64>();
            means.iter().enumerate().filter(|(_, mean)| **mean > least).all(|(span, mean)| {
                let off = |batch: &Vec<f64>| (batch[band * spans + span] - mean).powi(2);
                let variance = together.iter().map(off).sum::<f64>() / (count - 1.0);
                (variance / count).sqrt() < KNOWN_TO * mean
            })
        })
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
        let bands = self.exponents_per_m.len();
        let count = self.particles.div_ceil(BATCHES);
        let share = 4.0 * PI / (count * BATCHES) as f64 / (4.0 / 3.0 * PI * RADIUS_M.powi(3));
        let faces: Vec<Face> = self.triangles.iter().map(Face::new).collect();
        let mut energy = vec![0.0; self.receivers.len() * bands * self.bins()];
        let mut swarm = Swarm {
            particles: (0..count)
                .map(|_| Particle {
                    place: self.source,
                    direction: anywhere(&mut random),
                    reflections: 0,
                    specular: true,
                })
                .collect(),
            carried: vec![share; count * bands],
        };
        let steps = (self.duration_s / STEP_S).ceil() as usize;
        for step in 0..steps {
            let ends_s = [step as f64 * STEP_S, ((step + 1) as f64 * STEP_S).min(self.duration_s)];
            for (particle, carried) in swarm.particles.iter_mut().zip(swarm.carried.chunks_mut(bands)) {
                let ways_m = ends_s.map(|s| s * self.speed_m_s);
                self.advance((particle, carried), ways_m, &faces, &mut random, &mut energy);
            }
            swarm.resample(bands, &mut random);
        }
        energy
    }

    /// One particle flies from one length of its way to another, and is counted.
    fn advance(
        &self,
        (particle, carried): (&mut Particle, &mut [f64]),
        [mut length_m, to_m]: [f64; 2],
        faces: &[Face],
        random: &mut Pcg64Mcg,
        energy: &mut [f64],
    ) {
        while length_m < to_m {
            // None through a seam where three surfaces meet: one particle of millions.
            let (place, direction) = (particle.place, particle.direction);
            let hit = first_hit(faces, place, direction);
            let left_m = to_m - length_m;
            let flown_m = hit.map_or(left_m, |(_, distance)| distance.min(left_m));
            if !(particle.specular && particle.reflections <= self.without_order) {
                self.count((place, direction), [length_m, flown_m], carried, energy);
            }
            length_m += flown_m;
            particle.place = add(place, scale(direction, flown_m));
            carried
                .iter_mut()
                .zip(self.exponents_per_m)
                .for_each(|(carried, exponent)| *carried *= (-exponent * flown_m).exp());
            let Some((triangle, _)) = hit.filter(|(_, distance)| *distance <= left_m) else {
                if hit.is_none() {
                    carried.fill(0.0);
                }
                return;
            };
            particle.reflections += 1;
            let surface = self.surfaces[triangle];
            carried.iter_mut().zip(&surface.kept).for_each(|(carried, kept)| *carried *= kept);
            let normal = faces[triangle].normal;
            let inward = if dot(normal, direction) > 0.0 { scale(normal, -1.0) } else { normal };
            particle.direction = if random.random::<f64>() < surface.scattering {
                particle.specular = false;
                lambert(random, inward)
            } else {
                sub(direction, scale(inward, 2.0 * dot(direction, inward)))
            };
        }
    }

    /// Adds what a straight flight leaves in the receivers' spheres.
    fn count(
        &self,
        (place, direction): (Vec3, Vec3),
        [length_m, flown_m]: [f64; 2],
        carried: &[f64],
        energy: &mut [f64],
    ) {
        let (bands, bins) = (self.exponents_per_m.len(), self.bins());
        for (receiver, centre) in self.receivers.iter().enumerate() {
            let Some((near, far)) = chord(sub(place, *centre), direction, RADIUS_M, flown_m) else {
                continue;
            };
            let middle_m = 0.5 * (near + far);
            let bin = ((length_m + middle_m) / self.speed_m_s / BIN_S) as usize;
            if bin >= bins {
                continue;
            }
            for (band, (carried, exponent)) in carried.iter().zip(self.exponents_per_m).enumerate() {
                energy[(receiver * bands + band) * bins + bin] +=
                    (far - near) * carried * (-exponent * middle_m).exp();
            }
        }
    }
}

/// Where a particle is, and what became of it on the way.
#[derive(Clone, Copy)]
struct Particle {
    place: Vec3,
    direction: Vec3,
    reflections: usize,
    specular: bool,
}

/// The particles of a batch, and what they carry, `[particle * bands + band]`.
struct Swarm {
    particles: Vec<Particle>,
    carried: Vec<f64>,
}

impl Swarm {
    /// Draws as many particles again, each as often as it carries a share of the energy that is left, so that the late decay does not hang on
    /// the few that no absorber has met: all receivers hear the same particles, and would be off together. What a particle carries is
    /// shared among its copies, and made up for where it was unlikely to be drawn: every energy stays right on average (resampling, as in Liu
    /// and Chen, JASA (Statistics) 90, 1995). Octaves have an equal say. Only where the shares have become uneven.
    fn resample(&mut self, bands: usize, random: &mut Pcg64Mcg) {
        let count = self.particles.len() as f64;
        let mut sums = vec![0.0; bands];
        for carried in self.carried.chunks(bands) {
            sums.iter_mut().zip(carried).for_each(|(sum, carried)| *sum += carried);
        }
        if sums.contains(&0.0) {
            return;
        }
        let share = |carried: &[f64]| -> f64 {
            carried.iter().zip(&sums).map(|(carried, sum)| carried / sum).sum::<f64>() / bands as f64
        };
        let shares: Vec<f64> = self.carried.chunks(bands).map(share).collect();
        if shares.iter().map(|s| s * s).sum::<f64>() * count < UNEVEN {
            return;
        }
        let (mut particles, mut all_carried) =
            (Vec::with_capacity(self.particles.len()), Vec::with_capacity(self.carried.len()));
        let mut passed = random.random::<f64>();
        for (i, share) in shares.iter().enumerate() {
            let expected = share * count;
            let before = passed.floor();
            passed += expected;
            for _ in 0..(passed.floor() - before) as usize {
                particles.push(self.particles[i]);
                let carried = &self.carried[i * bands..(i + 1) * bands];
                all_carried.extend(carried.iter().map(|carried| carried / expected));
            }
        }
        *self = Self { particles, carried: all_carried };
    }
}

/// A triangle and its plane.
struct Face {
    corners: [Vec3; 3],
    normal: Vec3,
    /// Distance of the plane from the origin, along the normal.
    along_m: f64,
}

impl Face {
    fn new(corners: &[Vec3; 3]) -> Self {
        let [a, b, c] = *corners;
        let normal = cross(sub(b, a), sub(c, a));
        let normal = scale(normal, 1.0 / norm(normal));
        Self { corners: *corners, normal, along_m: dot(normal, a) }
    }
}

/// The nearest face that a ray meets. Most planes are met behind it or beyond another face, and their triangles not looked at.
fn first_hit(faces: &[Face], place: Vec3, direction: Vec3) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    for (i, face) in faces.iter().enumerate() {
        let to_plane_m = (face.along_m - dot(face.normal, place)) / dot(face.normal, direction);
        // What rounding may add to the distance is left to the triangle.
        let limit_m = best.map_or(f64::INFINITY, |(_, distance)| distance + LIFT_OFF_M);
        if !(0.5 * LIFT_OFF_M..=limit_m).contains(&to_plane_m) {
            continue;
        }
        if let Some(distance) = hit(place, direction, face.corners)
            && distance > LIFT_OFF_M
            && best.is_none_or(|(_, nearest)| distance <= nearest)
        {
            best = Some((i, distance));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polyhedra::{Planted, PolyhedralConfig, PolyhedralRoom, Polyhedron};

    fn room(seed: u64, shape: Polyhedron) -> PolyhedralRoom {
        let planted = Planted::Nothing;
        PolyhedralRoom::new(PolyhedralConfig { seed, shape, planted, ..PolyhedralConfig::default() }).unwrap()
    }

    /// What all receivers hear together in a band, in spans of 50 ms, with other particles for each seed.
    fn decays(
        room: &PolyhedralRoom,
        band: usize,
        [particles, most]: [usize; 2],
        seeds: u64,
    ) -> Vec<Vec<f64>> {
        let (surfaces, exponents) = (room.surfaces(), room.exponents_per_m());
        let of_seed = |seed: u64| {
            let (particles, most_particles) = (particles, most);
            let flight = Flight { seed, particles, most_particles, ..room.flight(&surfaces, &exponents) };
            let mut sums = vec![0.0; flight.bins()];
            for of_receiver in &flight.energies() {
                sums.iter_mut().zip(&of_receiver[band]).for_each(|(s, e)| *s += e);
            }
            sums.chunks((SPAN_S / BIN_S) as usize).map(|bins| bins.iter().sum()).collect()
        };
        (0..seeds).map(of_seed).collect()
    }

    /// Of the spans down to -42 dB, mean and standard deviation relative to it.
    fn spreads(decays: &[Vec<f64>]) -> Vec<[f64; 2]> {
        let count = decays.len() as f64;
        let of = |span: usize| {
            let mean = decays.iter().map(|d| d[span]).sum::<f64>() / count;
            let variance = decays.iter().map(|d| (d[span] - mean).powi(2)).sum::<f64>() / (count - 1.0);
            [mean, variance.sqrt() / mean]
        };
        let all: Vec<[f64; 2]> = (0..decays[0].len()).map(of).collect();
        let whole: f64 = all.iter().map(|[mean, _]| mean).sum();
        all.into_iter().filter(|[mean, _]| *mean > 6e-5 * whole).collect()
    }

    /// A room with two hard walls and soft furniture, at 2 kHz. Where particles that carry much are not copied, 20,000 of them tell late energy to 0.8 of
    /// itself, and most draws far too low.
    #[test]
    fn copies_of_what_carries_much_steady_the_late_decay() {
        let found = spreads(&decays(&room(3_945_343_240, Polyhedron::Furnished), 4, [20_000; 2], 8));
        assert!(found.len() > 8 && found.iter().all(|[_, sd]| *sd < 0.5), "{found:?}");
    }

    /// A choice among 32 particles and one among 313 carry the same on average.
    #[test]
    fn copies_change_no_energy_on_average() {
        let room = room(5550, Polyhedron::SlopedCeiling);
        let found = spreads(&decays(&room, 5, [20_000; 2], 12));
        let other = spreads(&decays(&room, 5, [2_000, 2_000], 120));
        for ([few, few_sd], [many, many_sd]) in other.iter().zip(&found) {
            let error = (few_sd.powi(2) / 120.0 + many_sd.powi(2) / 12.0).sqrt();
            assert!((few / many - 1.0).abs() < 4.0 * error, "{few} {many} {error}");
        }
    }

    #[test]
    fn as_many_fly_as_it_takes() {
        let room = room(5550, Polyhedron::SlopedCeiling);
        let found = decays(&room, 5, [20_000, 3_000_000], 2);
        for [_, sd] in spreads(&found) {
            // Of a difference of two, of which each has a twentieth at most.
            assert!(sd < 4.0 * KNOWN_TO, "{found:?}");
        }
    }
}
