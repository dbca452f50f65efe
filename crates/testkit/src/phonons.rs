//! Particles of sound in any closed mesh.

use crate::brute_force::corners;
use crate::filter::{Complement, add_pulse, join_bands};
use crate::geometry::{Vec3, add, anywhere, chord, cross, dot, first_hit, lambert, norm, scale, sub};
use crate::own_air::{energy_exponent_per_m, speed_of_sound_m_s};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Air, Bands, EnergyResponse, Error, ImpulseResponse, OutOfRange};
use sabine_scene::{Receiver, Scene, Source};
use std::f64::consts::PI;

/// Batches into which the particles fall: their scatter gives the standard errors, and each has its own random numbers, so that
/// the result is the same on any number of threads.
const BATCHES: usize = 32;
/// A particle has left its wall once it is this far away, in metres.
const LIFT_OFF_M: f64 = 1e-7;

/// How many particles fly, and for how long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhononConfig {
    /// Particles in each band; rounded up to a multiple of 32.
    pub particles: u32,
    /// Radius of the receiver's sphere in metres. It must not touch a wall, nor hold the source.
    pub detector_radius_m: f64,
    /// Time of flight in seconds.
    pub duration_s: f64,
    /// Seed of the random numbers.
    pub seed: u64,
}

impl Default for PhononConfig {
    fn default() -> Self {
        Self { particles: 20_000, detector_radius_m: 0.4, duration_s: 1.0, seed: 1 }
    }
}

/// Particles that leave the source in all directions, lose energy where they land, and fly on: like a mirror with probability 1 -
/// scattering, else after Lambert. Bands fly separately. A sphere about the receiver counts energy times chord over
/// volume, which is exact in the mean for any radius in a field that does not vary across it.
#[derive(Clone, Debug)]
pub struct Phonons {
    config: PhononConfig,
    triangles: Vec<[Vec3; 3]>,
    normals: Vec<Vec3>,
    /// Per triangle and band: (1 - absorption, scattering).
    surfaces: Vec<Vec<(f64, f64)>>,
    bands: Bands,
}

/// What [`Phonons::energy`] finds.
#[derive(Clone, Debug, PartialEq)]
pub struct PhononEnergy {
    /// Energy per bin and band with standard errors; the direct sound is exact.
    pub response: EnergyResponse,
    /// Mean distance between two reflections in metres, over all bands.
    pub mean_free_path_m: f64,
    /// Particles that flew out of the mesh: zero for a closed one.
    pub lost: u64,
}

/// A passage through the receiver's sphere.
struct Arrival {
    length_m: f64,
    energy: f64,
    sign: f64,
}

struct Batch {
    arrivals: Vec<Arrival>,
    flown_m: f64,
    reflections: u64,
    lost: u64,
}

impl Phonons {
    /// Copies the scene.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] without particles, or for a radius or duration that is not positive.
    pub fn new(scene: &Scene, config: PhononConfig) -> Result<Self, Error> {
        let checks = [
            ("particles", f64::from(config.particles)),
            ("detector radius (m)", config.detector_radius_m),
            ("duration (s)", config.duration_s),
        ];
        for (field, value) in checks {
            if !(value.is_finite() && value > 0.0) {
                return Err(OutOfRange { field, value, range: "positive" }.into());
            }
        }
        let triangles = corners(scene);
        let normal = |[a, b, c]: &[Vec3; 3]| {
            let n = cross(sub(*b, *a), sub(*c, *a));
            scale(n, 1.0 / norm(n))
        };
        let bands = scene.materials()[0].material.bands();
        let surface = |t: &sabine_scene::Triangle| {
            let m = &scene.materials()[t.material as usize].material;
            let pairs = m.absorption().values().iter().zip(m.scattering().values());
            pairs.map(|(a, s)| (1.0 - a, *s)).collect()
        };
        let normals = triangles.iter().map(normal).collect();
        let surfaces = scene.triangles().iter().map(surface).collect();
        Ok(Self { config, triangles, normals, surfaces, bands })
    }

    /// Energy in time bins. `None` for air means 20 C and no attenuation.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a bin width that is not positive.
    pub fn energy(
        &self,
        source: &Source,
        receiver: &Receiver,
        air: Option<&Air>,
        bin_s: f64,
    ) -> Result<PhononEnergy, Error> {
        let speed = speed_of_sound_m_s(air.unwrap_or(&Air::default()));
        let bins = (self.config.duration_s / bin_s).ceil() as usize;
        let (mut energy, mut standard_error) = (Vec::new(), Vec::new());
        let (mut flown_m, mut reflections, mut lost) = (0.0, 0, 0);
        for band in 0..self.bands.len() {
            let exponent = self.exponent(air, band);
            let batches = self.fly(source, receiver, band, exponent, speed);
            let mut column = vec![0.0; bins];
            let mut squares = vec![0.0; bins];
            for batch in &batches {
                let mut own = vec![0.0; bins];
                for arrival in &batch.arrivals {
                    if let Some(bin) = own.get_mut((arrival.length_m / speed / bin_s) as usize) {
                        *bin += arrival.energy;
                    }
                }
                for (bin, e) in own.into_iter().enumerate() {
                    column[bin] += e;
                    squares[bin] += e * e;
                }
                flown_m += batch.flown_m;
                reflections += batch.reflections;
                lost += batch.lost;
            }
            let n = BATCHES as f64;
            let error =
                |(sum, squares): (&f64, f64)| ((squares - sum * sum / n).max(0.0) * n / (n - 1.0)).sqrt();
            standard_error.extend(column.iter().zip(squares).map(error));
            if let Some(direct) = self.direct(source, receiver, exponent)
                && let Some(bin) = column.get_mut((direct.length_m / speed / bin_s) as usize)
            {
                *bin += direct.energy;
            }
            energy.extend(column);
        }
        let response = EnergyResponse::new(self.bands, bin_s, energy, standard_error)?;
        Ok(PhononEnergy { response, mean_free_path_m: flown_m / reflections as f64, lost })
    }

    /// Pressure: the direct sound as it is, and every passage as a pulse of random sign and of the passage's energy, so that the
    /// power in each band follows the energy response. Early reflections are smeared over the time that the sphere takes to cross.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a sample rate outside 1 kHz to 768 kHz.
    pub fn impulse_response(
        &self,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        sample_rate_hz: u32,
    ) -> Result<ImpulseResponse, Error> {
        let speed = speed_of_sound_m_s(air);
        let rate = f64::from(sample_rate_hz);
        let empty = || vec![vec![0.0; (self.config.duration_s * rate).ceil() as usize]; self.bands.len()];
        let (mut direct, mut tail) = (empty(), empty());
        for band in 0..self.bands.len() {
            let exponent = self.exponent(Some(air), band);
            if let Some(arrival) = self.direct(source, receiver, exponent) {
                add_pulse(&mut direct[band], arrival.length_m / speed * rate, arrival.energy.sqrt());
            }
            for batch in self.fly(source, receiver, band, exponent, speed) {
                for arrival in batch.arrivals {
                    let amplitude = arrival.sign * arrival.energy.sqrt();
                    add_pulse(&mut tail[band], arrival.length_m / speed * rate, amplitude);
                }
            }
        }
        let direct = join_bands(self.bands, direct, sample_rate_hz, Complement::Amplitude);
        let tail = join_bands(self.bands, tail, sample_rate_hz, Complement::Power);
        let samples = direct.into_iter().zip(tail).map(|(d, t)| (d + t) as f32).collect();
        ImpulseResponse::new(samples, sample_rate_hz)
    }

    fn exponent(&self, air: Option<&Air>, band: usize) -> f64 {
        air.map_or(0.0, |air| energy_exponent_per_m(air, self.bands.exact_hz(band)))
    }

    /// The direct sound, unless something is in its way.
    fn direct(&self, source: &Source, receiver: &Receiver, exponent: f64) -> Option<Arrival> {
        let way = sub(receiver.position_m, source.position_m);
        let length_m = norm(way);
        let direction = scale(way, 1.0 / length_m);
        if first_hit(&self.triangles, source.position_m, direction, LIFT_OFF_M, length_m).is_some() {
            return None;
        }
        let energy = (-exponent * length_m).exp() / (length_m * length_m);
        Some(Arrival { length_m, energy, sign: 1.0 })
    }

    /// All particles of a band, in batches.
    fn fly(
        &self,
        source: &Source,
        receiver: &Receiver,
        band: usize,
        exponent: f64,
        speed: f64,
    ) -> Vec<Batch> {
        let (from, to) = (source.position_m, receiver.position_m);
        let one = |batch: usize| self.fly_batch(from, to, band, exponent, speed, batch);
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get().min(BATCHES));
        let mut batches: Vec<(usize, Batch)> = std::thread::scope(|scope| {
            let worker = |first: usize| {
                move || (first..BATCHES).step_by(threads).map(|b| (b, one(b))).collect::<Vec<_>>()
            };
            let handles: Vec<_> = (0..threads).map(|first| scope.spawn(worker(first))).collect();
            handles
                .into_iter()
                .flat_map(|h| h.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect()
        });
        batches.sort_by_key(|(index, _)| *index);
        batches.into_iter().map(|(_, batch)| batch).collect()
    }

    fn fly_batch(&self, from: Vec3, to: Vec3, band: usize, exponent: f64, speed: f64, batch: usize) -> Batch {
        let stream = (band * BATCHES + batch) as u64;
        let mut random =
            Pcg64Mcg::seed_from_u64(self.config.seed ^ (stream + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let particles = self.config.particles.div_ceil(BATCHES as u32);
        let radius = self.config.detector_radius_m;
        // All particles together carry 4 pi: energy 1 at 1 m.
        let share = 4.0 * PI / (f64::from(particles) * BATCHES as f64) / (4.0 / 3.0 * PI * radius.powi(3));
        let longest = self.config.duration_s * speed;
        let mut result = Batch { arrivals: Vec::new(), flown_m: 0.0, reflections: 0, lost: 0 };
        for _ in 0..particles {
            let (mut position, mut direction) = (from, anywhere(&mut random));
            let mut incoming = direction;
            let (mut energy, mut length, mut first) = (1.0, 0.0, true);
            while length < longest && energy > 1e-12 {
                let mut landing = first_hit(&self.triangles, position, direction, LIFT_OFF_M, f64::INFINITY);
                if landing.is_none() {
                    // In an edge, closer to the next wall than the lift-off: start a little way back, inside the room.
                    position = sub(position, scale(incoming, 10.0 * LIFT_OFF_M));
                    landing = first_hit(&self.triangles, position, direction, LIFT_OFF_M, f64::INFINITY);
                }
                let Some((triangle, distance)) = landing else {
                    result.lost += 1;
                    break;
                };
                if !first && let Some((near, far)) = chord(sub(position, to), direction, radius, distance) {
                    let length_m = length + 0.5 * (near + far);
                    let energy = energy * share * (far - near) * (-exponent * length_m).exp();
                    let sign = if random.random::<bool>() { 1.0 } else { -1.0 };
                    result.arrivals.push(Arrival { length_m, energy, sign });
                }
                first = false;
                length += distance;
                result.flown_m += distance;
                result.reflections += 1;
                position = add(position, scale(direction, distance));
                let (reflected, scattering) = self.surfaces[triangle][band];
                energy *= reflected;
                let normal = self.normals[triangle];
                incoming = direction;
                let inward = if dot(normal, direction) > 0.0 { scale(normal, -1.0) } else { normal };
                direction = if random.random::<f64>() < scattering {
                    lambert(&mut random, inward)
                } else {
                    sub(direction, scale(inward, 2.0 * dot(direction, inward)))
                };
            }
        }
        result
    }
}
