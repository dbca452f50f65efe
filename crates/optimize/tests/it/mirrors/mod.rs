//! A box of mirrors and what is heard in it, by image sources (testkit): no tracer and no code of the crate is involved.

// Each test file uses its own part of this module.
#![allow(dead_code)]

use rand::{Rng, SeedableRng};
use sabine_acoustics::{Air, Bands, FilterBank, Material, PerBand};
use sabine_scene::{NamedMaterial, Receiver, Scene, Source, Triangle};
use sabine_testkit::{Image, ShoeboxImages};
use std::f64::consts::PI;

pub const SIZE_M: [f64; 3] = [6.0, 4.5, 3.0];
pub const SOURCES: [[f64; 3]; 3] = [[1.3, 1.1, 1.5], [4.6, 3.2, 1.2], [2.9, 2.4, 2.1]];
pub const RECEIVERS: [[f64; 3]; 4] = [[4.9, 1.4, 1.4], [1.6, 3.6, 1.1], [3.4, 0.9, 1.9], [0.8, 2.0, 1.3]];

/// The octaves of a test, and what its responses are sampled with.
#[derive(Clone, Copy)]
pub struct Hearing {
    pub octaves: Bands,
    pub rate_hz: u32,
    pub duration_s: f64,
}

impl Hearing {
    /// Every image source a pulse of amplitude sqrt(energy) and random sign in each octave. With one sign for all, waves along
    /// a wall would be absorbed by it (the Fresnel zone of a path of 34 m at 1 kHz is 3.4 m wide), which no model of energies
    /// knows.
    pub fn pressure(&self, truth: &Scene, source: &Source, receiver: &Receiver, seed: u64) -> Vec<f32> {
        self.pressure_of_a_crooked_room(truth, source, receiver, seed, 0.0)
    }

    /// The same where every image but the source itself arrives too early or too late by normally distributed errors, in seconds.
    pub fn pressure_of_a_crooked_room(
        &self,
        truth: &Scene,
        source: &Source,
        receiver: &Receiver,
        seed: u64,
        arrival_error_s: f64,
    ) -> Vec<f32> {
        const HALF: i64 = 24;
        let mut random = rand_pcg::Pcg64::seed_from_u64(seed);
        let mut crooked = rand_pcg::Pcg64::seed_from_u64(seed + 1_000_000);
        let mut normal = move || -> f64 {
            let (u, v): (f64, f64) = (crooked.random(), crooked.random());
            (-2.0 * (1.0 - u).ln()).sqrt() * (2.0 * PI * v).cos()
        };
        let rate = f64::from(self.rate_hz);
        let mut columns = vec![vec![0f32; (self.duration_s * rate) as usize]; self.octaves.len()];
        let walls = Walls::of(truth);
        for image in self.images(truth, source, receiver) {
            let sign = if random.random::<bool>() { 1.0 } else { -1.0 };
            let off_s = if image.hits.iter().sum::<u32>() > 0 { arrival_error_s * normal() } else { 0.0 };
            let at = (image.length_m / Air::default().speed_of_sound_m_s() + off_s) * rate;
            let first = at.floor() as i64 - HALF + 1;
            let pulse: Vec<f64> = (first..first + 2 * HALF)
                .map(|i| {
                    let x = i as f64 - at;
                    let sinc = if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
                    sign * sinc * (0.5 * PI * x / HALF as f64).cos().powi(2)
                })
                .collect();
            for (b, column) in columns.iter_mut().enumerate() {
                let amplitude = walls.energy(&image, b).sqrt();
                for (i, p) in (first..).zip(&pulse) {
                    let Some(sample) = usize::try_from(i).ok().and_then(|i| column.get_mut(i)) else {
                        continue;
                    };
                    *sample += (amplitude * p) as f32;
                }
            }
        }
        let bank = FilterBank::new(self.octaves, self.rate_hz).unwrap();
        let mut sum = vec![0.0; columns[0].len()];
        for (b, column) in columns.iter().enumerate() {
            sum.iter_mut().zip(&bank.split(column).values()[b]).for_each(|(s, x)| *s += x);
        }
        sum
    }

    /// Every image source, nearest first.
    pub fn images(&self, truth: &Scene, source: &Source, receiver: &Receiver) -> Vec<Image> {
        let images = ShoeboxImages::new(self.duration_s).unwrap();
        images.images(truth, source, receiver, &Air::default()).unwrap()
    }
}

/// What the six faces absorb, and the air.
pub struct Walls {
    pub faces: Vec<PerBand<f64>>,
    exponents: PerBand<f64>,
}

impl Walls {
    pub fn of(truth: &Scene) -> Self {
        // Two triangles a face: x0, x1, y0, y1, floor, ceiling.
        let face = |f: usize| {
            let triangle = &truth.triangles()[2 * f];
            truth.materials()[triangle.material as usize].material.absorption().clone()
        };
        let faces: Vec<PerBand<f64>> = (0..6).map(face).collect();
        let exponents = Air::default().energy_exponent_per_m(faces[0].bands());
        Self { faces, exponents }
    }

    pub fn energy(&self, image: &Image, band: usize) -> f64 {
        let of = |(&n, a): (&u32, &PerBand<f64>)| f64::from(n) * (-a.values()[band]).ln_1p();
        let walls: f64 = image.hits.iter().zip(&self.faces).map(of).sum();
        (walls - self.exponents.values()[band] * image.length_m).exp() / image.length_m.powi(2)
    }
}

/// The box, its six faces made of the given materials; no scattering, so that image sources are the whole truth.
pub fn room(octaves: Bands, faces: [usize; 6], absorption: &[Vec<f64>]) -> Scene {
    let material = |a: &Vec<f64>| {
        let absorption = PerBand::new(octaves, a.clone()).unwrap();
        Material::new(absorption, PerBand::uniform(octaves, 0.0)).unwrap()
    };
    let plain = Material::uniform(octaves, 0.1, 0.0).unwrap();
    let shell = Scene::shoebox(SIZE_M, std::array::from_fn(|_| plain.clone())).unwrap();
    let triangle = |t: &Triangle| Triangle { material: faces[t.material as usize] as u32, ..*t };
    let triangles = shell.triangles().iter().map(triangle).collect();
    let named = absorption.iter().enumerate();
    let materials =
        named.map(|(k, a)| NamedMaterial { name: format!("m{k}"), material: material(a) }).collect();
    Scene::new(shell.vertices().to_vec(), triangles, materials).unwrap()
}
