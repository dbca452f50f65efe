//! What rough walls send: particles in a box, and noise under the energy that they bring.

use super::columns::Columns;
use super::stream::{Purpose, stream};
use super::truth::{Medium, Truth};
use rand::Rng;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Particles in each band, and the batches in which they fly, each with random numbers of its own.
const PARTICLES: usize = 40_000;
const BATCHES: usize = 16;
/// Radius of the receivers' spheres in metres; places are 0.6 m from the walls.
const RADIUS_M: f64 = 0.5;
/// Time step in which passages are counted, in seconds.
const STEP_S: f64 = 1e-3;
/// Energies are averaged over this share of their age.
const SMOOTHING: f64 = 0.08;
/// Share of its energy at which a particle is given up.
const LEAST: f64 = 1e-8;

/// Energy per second that has been scattered at least once, at every receiver of a source.
pub(crate) struct ScatteredField {
    steps: usize,
    bands: usize,
    /// `[receiver][band][step]`, energy per second.
    energy: Vec<f64>,
}

impl ScatteredField {
    /// `None` where no wall scatters.
    pub(crate) fn new(truth: &Truth, medium: &Medium, source: usize) -> Option<Self> {
        if truth.materials.iter().flat_map(|m| &m.scattering).all(|&s| s == 0.0) {
            return None;
        }
        let bands = truth.bands_hz.len();
        let steps = (truth.duration_s / STEP_S).ceil() as usize;
        let receivers = truth.receivers_m.len();
        let tasks: Vec<(usize, usize)> = (0..bands).flat_map(|b| (0..BATCHES).map(move |i| (b, i))).collect();
        let flown: Vec<Vec<f64>> =
            tasks.par_iter().map(|&(band, batch)| fly(truth, medium, source, band, batch, steps)).collect();
        let mut energy = vec![0.0; receivers * bands * steps];
        for (&(band, _), batch) in tasks.iter().zip(flown) {
            for receiver in 0..receivers {
                let from = &batch[receiver * steps..(receiver + 1) * steps];
                let to = &mut energy[(receiver * bands + band) * steps..][..steps];
                to.iter_mut().zip(from).for_each(|(t, f)| *t += f);
            }
        }
        Some(Self { steps, bands, energy })
    }

    /// Adds Gaussian noise under the energy at a receiver, the same noise in all bands.
    pub(crate) fn add(&self, truth: &Truth, pair: (usize, usize), columns: &mut Columns) {
        let index = pair.0 * truth.receivers_m.len() + pair.1;
        let mut random = stream(truth.seed, Purpose::Scattered, index);
        let envelopes: Vec<Envelope> = (0..self.bands)
            .map(|b| Envelope::new(&self.energy[(pair.1 * self.bands + b) * self.steps..][..self.steps]))
            .collect();
        let gains: Vec<f64> = truth.source_gains_db.iter().map(|db| 10f64.powf(db / 20.0)).collect();
        for i in 0..columns.samples[0].len() {
            let time_s = columns.start_s + i as f64 / columns.rate_hz;
            let noise: f64 = random.sample(StandardNormal);
            for ((column, envelope), gain) in columns.samples.iter_mut().zip(&envelopes).zip(&gains) {
                column[i] += noise * gain * (envelope.at(time_s) / columns.rate_hz).sqrt();
            }
        }
    }
}

/// Energy per second over time, averaged over longer and longer intervals, with straight lines in dB between their middles.
struct Envelope {
    middles_s: Vec<f64>,
    values: Vec<f64>,
}

impl Envelope {
    fn new(steps: &[f64]) -> Self {
        // Silence before the first passage stays silence.
        let first = steps.iter().position(|&e| e > 0.0).unwrap_or(steps.len());
        let (mut middles_s, mut values) = (vec![first as f64 * STEP_S], vec![0.0]);
        let mut from = first;
        while from < steps.len() {
            let width = ((from as f64 * SMOOTHING) as usize).clamp(2, 50).min(steps.len() - from);
            values.push(steps[from..from + width].iter().sum::<f64>() / width as f64);
            middles_s.push((from as f64 + 0.5 * width as f64) * STEP_S);
            from += width;
        }
        Self { middles_s, values }
    }

    fn at(&self, time_s: f64) -> f64 {
        let after = self.middles_s.partition_point(|&m| m <= time_s);
        if after == 0 {
            return 0.0;
        }
        let (Some(&next), before) = (self.middles_s.get(after), self.middles_s[after - 1]) else {
            return self.values[after - 1];
        };
        let (a, b) = (self.values[after - 1], self.values[after]);
        let x = (time_s - before) / (next - before);
        if a > 0.0 && b > 0.0 { a * (b / a).powf(x) } else { a + x * (b - a) }
    }
}

/// One batch of particles in one band: energy per second, `[receiver][step]`.
fn fly(truth: &Truth, medium: &Medium, source: usize, band: usize, batch: usize, steps: usize) -> Vec<f64> {
    let mut random =
        stream(truth.seed, Purpose::Particles, (source * truth.bands_hz.len() + band) * BATCHES + batch);
    let start = &truth.sources[source];
    let surfaces: [(f64, f64); 6] = truth.faces.map(|m| {
        let material = &truth.materials[m];
        (1.0 - material.absorption[band], material.scattering[band])
    });
    let mut energy = vec![0.0; truth.receivers_m.len() * steps];
    let step_m = STEP_S * medium.speed_m_s;
    let longest_m = steps as f64 * step_m;
    let count = PARTICLES / BATCHES;
    // All particles together carry 4 pi: energy 1 at 1 m.
    let share = 4.0 * PI / (count * BATCHES) as f64 / (4.0 / 3.0 * PI * RADIUS_M.powi(3)) / STEP_S;
    for _ in 0..count {
        let mut position = start.position_m;
        let mut direction = anywhere(&mut random);
        let cosine = (0..3).map(|k| direction[k] * start.axis[k]).sum();
        let mut carried = share * start.gain(band, cosine).powi(2);
        let least = LEAST * carried;
        let (mut flown_m, mut scattered) = (0.0, false);
        while flown_m < longest_m && carried * (-medium.exponents_per_m[band] * flown_m).exp() > least {
            let (distance_m, face) = next_wall(truth.size_m, position, direction);
            if scattered {
                for (receiver, &place) in truth.receivers_m.iter().enumerate() {
                    let Some((near, far)) = chord(position, direction, place, distance_m) else { continue };
                    let length_m = flown_m + 0.5 * (near + far);
                    let step = (length_m / step_m) as usize;
                    if step < steps {
                        let microphone = &truth.microphones[receiver];
                        let cosine = -(0..3).map(|k| direction[k] * microphone.axis[k]).sum::<f64>();
                        let heard = microphone.gain(band, cosine).powi(2);
                        energy[receiver * steps + step] +=
                            heard * carried * (far - near) * (-medium.exponents_per_m[band] * length_m).exp();
                    }
                }
            }
            flown_m += distance_m;
            (0..3).for_each(|k| position[k] += distance_m * direction[k]);
            let axis = face / 2;
            position[axis] = if face % 2 == 0 { 0.0 } else { truth.size_m[axis] };
            let (reflected, scattering) = surfaces[face];
            carried *= reflected;
            if random.random::<f64>() < scattering {
                scattered = true;
                direction = lambert(&mut random, face);
            } else {
                direction[axis] = -direction[axis];
            }
        }
    }
    energy
}

/// Distance to the wall ahead, and which it is.
fn next_wall(size_m: [f64; 3], position: [f64; 3], direction: [f64; 3]) -> (f64, usize) {
    let mut best = (f64::INFINITY, 0);
    for axis in 0..3 {
        let (wall, face) = if direction[axis] > 0.0 { (size_m[axis], 2 * axis + 1) } else { (0.0, 2 * axis) };
        // A wall that is never met is infinitely far away.
        let distance = ((wall - position[axis]) / direction[axis]).max(0.0);
        if distance < best.0 {
            best = (distance, face);
        }
    }
    best
}

fn anywhere(random: &mut Pcg64Mcg) -> [f64; 3] {
    let z = 2.0 * random.random::<f64>() - 1.0;
    let azimuth = TAU * random.random::<f64>();
    let flat = (1.0 - z * z).sqrt();
    [flat * azimuth.cos(), flat * azimuth.sin(), z]
}

/// Into the room from a face, as often as the cosine to its normal: a point of the unit disc, lifted onto the half sphere.
fn lambert(random: &mut Pcg64Mcg, face: usize) -> [f64; 3] {
    let square: f64 = random.random();
    let azimuth = TAU * random.random::<f64>();
    let normal = (1.0 - square).sqrt().max(1e-6);
    let mut direction = [0.0; 3];
    direction[face / 2] = if face.is_multiple_of(2) { normal } else { -normal };
    direction[(face / 2 + 1) % 3] = square.sqrt() * azimuth.cos();
    direction[(face / 2 + 2) % 3] = square.sqrt() * azimuth.sin();
    direction
}

/// Where a flight over a distance enters and leaves a receiver's sphere.
fn chord(from: [f64; 3], direction: [f64; 3], centre: [f64; 3], distance_m: f64) -> Option<(f64, f64)> {
    let way: [f64; 3] = std::array::from_fn(|k| centre[k] - from[k]);
    let middle: f64 = (0..3).map(|k| way[k] * direction[k]).sum();
    let square = RADIUS_M * RADIUS_M - (way.iter().map(|c| c * c).sum::<f64>() - middle * middle);
    if square <= 0.0 {
        return None;
    }
    let half = square.sqrt();
    let (near, far) = ((middle - half).max(0.0), (middle + half).min(distance_m));
    (far > near).then_some((near, far))
}
