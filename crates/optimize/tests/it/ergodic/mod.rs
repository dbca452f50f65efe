//! A room that mixes perfectly: after every mean free path a ray meets a surface drawn by area alone. With the paths of all
//! rays equally long between hits, its decay is Eyring's by construction; no tracer and no code of the crate is involved.

// Each test file uses its own part of this module.
#![allow(dead_code)]

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use sabine_acoustics::Air;
use sabine_paths::{Contribution, PathSet, Reflection};

#[derive(Clone)]
pub struct Ergodic {
    /// Share of each material in the surface; they sum to 1.
    pub shares: Vec<f64>,
    /// 4 V / S.
    pub mean_free_path_m: f64,
    pub rays: usize,
    pub duration_s: f64,
}

impl Ergodic {
    pub fn trace(&self, seed: u64) -> PathSet {
        let mut random = Pcg64::seed_from_u64(seed);
        let length_m = self.duration_s * Air::default().speed_of_sound_m_s();
        let mut paths = PathSet::new(self.shares.len(), length_m);
        let up = [0.0, 0.0, 1.0];
        let push = |paths: &mut PathSet, length_m: f64, log_weight: f64, chain: u32, batch: Option<u8>| {
            paths.push(Contribution {
                length_m,
                log_weight,
                chain,
                tail: PathSet::DIRECT,
                departure: up,
                arrival: up,
                batch,
            });
        };
        push(&mut paths, 1.0, 0.0, PathSet::DIRECT, None);
        for ray in 0..self.rays {
            let batch = (ray * usize::from(PathSet::BATCHES) / self.rays) as u8;
            let (mut chain, mut at_m) = (PathSet::DIRECT, random.random::<f64>() * self.mean_free_path_m);
            while at_m < length_m {
                let scattered = random.random::<f64>() < 0.5;
                let kind = if scattered { Reflection::Scattered } else { Reflection::Specular };
                chain = paths.reflect(chain, self.draw(random.random()), kind);
                // Either kind is drawn half the time: with scattering 0.5 the weight is twice that of the mean.
                let hits = at_m / self.mean_free_path_m;
                let log_weight = (1.0 / self.rays as f64).ln() + (hits.floor() + 1.0) * 2f64.ln();
                push(&mut paths, at_m, log_weight, chain, Some(batch));
                at_m += self.mean_free_path_m;
            }
        }
        paths
    }

    fn draw(&self, mut uniform: f64) -> u32 {
        for (k, share) in self.shares.iter().enumerate() {
            if uniform < *share {
                return k as u32;
            }
            uniform -= share;
        }
        self.shares.len() as u32 - 1
    }

    /// Eyring's reverberation time with air, in seconds.
    pub fn eyring_s(&self, absorption: &[f64], air: &Air, frequency_hz: f64) -> f64 {
        let reflected: f64 = self.shares.iter().zip(absorption).map(|(p, a)| p * (1.0 - a)).sum();
        let walls_db_per_m = -10.0 * reflected.log10() / self.mean_free_path_m;
        60.0 / ((walls_db_per_m + air.attenuation_db_per_m(frequency_hz)) * air.speed_of_sound_m_s())
    }
}
