//! Keeping rays where the energy is.
//!
//! Rays draw directions, not energies: where surfaces absorb unevenly, most of them have met an absorber when the decay is 30 dB down, and
//! the few that have not carry all that is left. A weight window keeps their number where it is by splitting what carries much and playing
//! Russian roulette with what carries little (Kahn and Harris 1951; T. E. Booth and J. S. Hendricks, Fusion Technology 5, 1984: importance
//! estimation in forward Monte Carlo calculations). Each stands for more or fewer rays afterwards, so that every sum stays right on average,
//! with any absorption; the scene's own decides only how many rays are where.

use crate::mesh_scene::MeshScene;
use crate::random::{direction, generator};
use crate::vector::Vec3;
use crate::walk::{before_hit, next_hit, reflected};
use rand::Rng;
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::Material;
use sabine_paths::Reflection;
use std::ops::RangeInclusive;

/// Most octaves that are looked at.
pub(crate) const MAX_BANDS: usize = 10;
/// No surface is taken to keep less than this: what absorbs all by name may be given another absorption.
const LEAST_KEPT: f64 = 0.2;
/// Energy, in units of what a ray carries on average, outside of which it is split or plays roulette.
const WINDOW: RangeInclusive<f64> = 0.5..=2.0;
/// Into so many is a ray split at once, at most.
const MOST_PARTS: f64 = 8.0;
/// Steps of length in which the average is tabulated, at most.
const MOST_STEPS: usize = 400;
/// Walkers of the pilot: as few as one for so many rays, within these bounds.
const RAYS_PER_WALKER: usize = 32;
const WALKERS: RangeInclusive<usize> = 16..=512;
/// Turns a seed into that of the pilot.
const PILOT: u64 = 0x7069_6C6F_7400;

/// Logarithm of the share of energy that each material reflects in each octave.
pub(crate) type KeptEnergy = Vec<[f64; MAX_BANDS]>;

/// Of these materials; beyond the last octave they are as in it.
pub(crate) fn ln_kept<'a>(materials: impl Iterator<Item = &'a Material>) -> KeptEnergy {
    let of = |material: &Material| {
        let absorption = material.absorption().values();
        std::array::from_fn(|band| (1.0 - absorption[band.min(absorption.len() - 1)]).max(LEAST_KEPT).ln())
    };
    materials.map(of).collect()
}

/// What becomes of a ray after a reflection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fate {
    /// So many go on, each standing for as much of it.
    Parts(usize),
    /// It goes on with this probability, and then stands for as many more.
    Roulette(f64),
}

/// What a ray carries on average after a way of some length, by octave.
#[derive(Debug)]
pub(crate) struct WeightWindow {
    bands: usize,
    step_m: f64,
    /// Logarithm of the mean energy after each step, re that at the start.
    ln_mean: Vec<[f64; MAX_BANDS]>,
}

/// A scene as the pilot sees it.
#[derive(Clone, Copy)]
pub(crate) struct PilotScene<'a> {
    pub mesh: &'a MeshScene,
    /// By material.
    pub ln_kept: &'a KeptEnergy,
    /// Octaves, or the first [`MAX_BANDS`] of more.
    pub bands: usize,
    /// Scattering coefficient by material, mean over the octaves.
    pub scattering: &'a dyn Fn(u32) -> f64,
}

impl WeightWindow {
    /// Follows a few walkers from an end of the paths. Their number stays the same: after each step, those that carry little are replaced
    /// by copies of those that carry much (population control, systematic resampling), so that the mean is known down to any level.
    pub fn pilot(scene: PilotScene<'_>, from: Vec3, max_length_m: f64, rays: usize, seed: u64) -> Self {
        let surface_m2: f64 = scene.mesh.surfaces.triangles.iter().map(|t| t.area_m2).sum();
        // In a cube, three quarters of the mean free path.
        let step_m = (0.5 * (surface_m2 / 6.0).sqrt()).max(max_length_m / MOST_STEPS as f64);
        let count = (rays / RAYS_PER_WALKER).clamp(*WALKERS.start(), *WALKERS.end());
        let mut walkers: Vec<Walker> =
            (0..count as u64).map(|i| Walker::new(scene, from, generator(seed ^ PILOT, i))).collect();
        let mut random = generator(seed ^ PILOT, count as u64);
        let mut ln_mean = vec![[0.0; MAX_BANDS]];
        let mut level = [0.0; MAX_BANDS];
        let mut steps = 0;
        while (steps as f64) * step_m < max_length_m {
            steps += 1;
            walkers.iter_mut().for_each(|w| w.advance(scene, steps as f64 * step_m));
            for (band, level) in level.iter_mut().enumerate().take(scene.bands) {
                let mean = walkers.iter().map(|w| w.energy[band]).sum::<f64>() / count as f64;
                if mean > 0.0 {
                    *level += mean.ln();
                    walkers.iter_mut().for_each(|w| w.energy[band] /= mean);
                }
            }
            ln_mean.push(level);
            resample(&mut walkers, scene.bands, &mut random);
        }
        Self { bands: scene.bands, step_m, ln_mean }
    }

    /// Energy of a ray that stands for one, after a way of some length, in units of what rays carry on average: the mean over the octaves.
    pub fn importance(&self, ln_energy: &[f64; MAX_BANDS], travelled_m: f64) -> f64 {
        let at = travelled_m / self.step_m;
        let last = self.ln_mean.len() - 1;
        let step = (at as usize).min(last.saturating_sub(1));
        let (before, after) = (&self.ln_mean[step], &self.ln_mean[(step + 1).min(last)]);
        let share = (at - step as f64).min(1.0);
        let of = |band: usize| (ln_energy[band] - before[band] - share * (after[band] - before[band])).exp();
        (0..self.bands).map(of).sum::<f64>() / self.bands as f64
    }

    /// Nepers of energy by octave that rays lose on each metre, in the later half of the way.
    pub fn late_loss_per_m(&self) -> [f64; MAX_BANDS] {
        let last = self.ln_mean.len() - 1;
        let from = last / 2;
        std::array::from_fn(|band| {
            (self.ln_mean[from][band] - self.ln_mean[last][band])
                / ((last - from).max(1) as f64 * self.step_m)
        })
    }

    /// Whether a ray of this importance is to be split.
    pub fn is_above(importance: f64) -> bool {
        importance > *WINDOW.end()
    }

    /// What becomes of a ray of this importance.
    pub fn fate(importance: f64) -> Fate {
        if importance < *WINDOW.start() {
            Fate::Roulette(importance)
        } else if Self::is_above(importance) {
            Fate::Parts(importance.min(MOST_PARTS) as usize)
        } else {
            Fate::Parts(1)
        }
    }
}

/// One walker of the pilot.
#[derive(Clone)]
struct Walker {
    origin: Vec3,
    heading: Vec3,
    travelled_m: f64,
    /// Distance and triangle of the next surface; none where it is lost.
    next: Option<(f64, u32)>,
    energy: [f64; MAX_BANDS],
    random: Pcg64Mcg,
}

impl Walker {
    fn new(scene: PilotScene<'_>, from: Vec3, mut random: Pcg64Mcg) -> Self {
        let heading = direction(&mut random);
        let energy = [1.0; MAX_BANDS];
        let mut own = Self { origin: from, heading, travelled_m: 0.0, next: None, energy, random };
        own.look(scene);
        own
    }

    fn look(&mut self, scene: PilotScene<'_>) {
        let hit = next_hit(scene.mesh, self.origin, &mut self.heading, &mut self.random);
        self.next = hit.map(|hit| (hit.distance, hit.triangle));
        if self.next.is_none() {
            self.energy = [0.0; MAX_BANDS];
        }
    }

    /// Over all surfaces that come before a length of way.
    fn advance(&mut self, scene: PilotScene<'_>, until_m: f64) {
        while let Some((distance, triangle)) = self.next {
            if self.travelled_m + distance > until_m {
                return;
            }
            self.travelled_m += distance;
            let surface = &scene.mesh.surfaces.triangles[triangle as usize];
            for (energy, ln_kept) in self.energy.iter_mut().zip(&scene.ln_kept[surface.material as usize]) {
                *energy *= ln_kept.exp();
            }
            let scattered = self.random.random::<f64>() < (scene.scattering)(surface.material);
            let reflection = if scattered { Reflection::Scattered } else { Reflection::Specular };
            self.origin = before_hit(self.origin, self.heading, distance);
            self.heading = reflected(surface, self.heading, reflection, &mut self.random);
            self.look(scene);
        }
    }
}

/// Draws as many walkers as there are, each as often as it carries, on average; their energies, of mean one in each octave, become less by
/// that. One number places all draws (systematic resampling: G. Kitagawa, Journal of Computational and Graphical Statistics 5, 1996).
fn resample(walkers: &mut Vec<Walker>, bands: usize, random: &mut impl Rng) {
    let carried = |w: &Walker| w.energy[..bands].iter().sum::<f64>() / bands as f64;
    let shares: Vec<f64> = walkers.iter().map(carried).collect();
    if shares.iter().all(|s| WINDOW.contains(s)) || shares.iter().sum::<f64>() <= 0.0 {
        return;
    }
    let mut drawn = Vec::with_capacity(walkers.len());
    // Shares sum to the number of walkers, but for rounding.
    let (mut sum, mut mark) = (0.0, random.random::<f64>());
    for (walker, &share) in walkers.iter().zip(&shares) {
        sum += share;
        let first = drawn.len();
        while mark < sum && drawn.len() < walkers.len() {
            let mut copy = walker.clone();
            copy.energy.iter_mut().for_each(|e| *e /= share);
            // Copies go on in ways of their own.
            if drawn.len() > first {
                copy.random = Pcg64Mcg::new(
                    u128::from(copy.random.random::<u64>()) << 64 | u128::from(random.random::<u64>()),
                );
            }
            drawn.push(copy);
            mark += 1.0;
        }
    }
    if drawn.len() == walkers.len() {
        *walkers = drawn;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::{Bands, PerBand};
    use sabine_scene::Scene;

    const FROM: Vec3 = [1.0, 1.5, 1.2];

    fn scene(absorption: [f64; 6], scattering: f64) -> (Scene, KeptEnergy) {
        let bands = Bands::octaves(500.0, 1000.0).unwrap();
        let of = |a: f64| {
            let absorption = PerBand::new(bands, vec![a, 0.5 * a]).unwrap();
            Material::new(absorption, PerBand::uniform(bands, scattering)).unwrap()
        };
        let scene = Scene::shoebox([5.0, 4.0, 3.0], absorption.map(of)).unwrap();
        let kept = ln_kept(scene.materials().iter().map(|m| &m.material));
        (scene, kept)
    }

    #[test]
    fn the_mean_is_that_of_walkers_whose_number_nothing_controls() {
        let (scene, ln_kept) = scene([0.02, 0.02, 0.05, 0.05, 0.4, 0.7], 0.3);
        let mesh = MeshScene::new(&scene).unwrap();
        let pilot = PilotScene { mesh: &mesh, ln_kept: &ln_kept, bands: 2, scattering: &|_| 0.3 };
        let window = WeightWindow::pilot(pilot, FROM, 80.0, 512 * RAYS_PER_WALKER, 1);
        let count = 20_000;
        let mut walkers: Vec<Walker> =
            (0..count).map(|i| Walker::new(pilot, FROM, generator(9, i as u64))).collect();
        // The energies that walkers have themselves, in units of the pilot's mean, are one on average. Down to 25 dB in the first octave, where
        // plain walkers are still many.
        for until_m in [2.0, 10.0, 25.0, 45.0] {
            walkers.iter_mut().for_each(|w| w.advance(pilot, until_m));
            let carried: Vec<f64> =
                walkers.iter().map(|w| window.importance(&w.energy.map(f64::ln), until_m)).collect();
            let mean = carried.iter().sum::<f64>() / f64::from(count);
            let variance = carried.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / f64::from(count);
            // The pilot's own 512 walkers are known to a few percent.
            let margin = 4.0 * (variance / f64::from(count)).sqrt() + 0.2;
            assert!((mean - 1.0).abs() < margin, "{until_m} m: {mean} +- {margin}");
        }
    }

    #[test]
    fn even_surfaces_leave_rays_alone() {
        let (scene, ln_kept) = scene([0.1; 6], 1.0);
        let mesh = MeshScene::new(&scene).unwrap();
        let pilot = PilotScene { mesh: &mesh, ln_kept: &ln_kept, bands: 2, scattering: &|_| 1.0 };
        let window = WeightWindow::pilot(pilot, FROM, 60.0, 20_000, 1);
        // Hits on the way to 50 m: 4 V / S is 2.55 m, so about 20, to a fifth.
        let after = |hits: f64| [hits * 0.9f64.ln(), hits * 0.95f64.ln()];
        let mut energy = [0.0; MAX_BANDS];
        energy[..2].copy_from_slice(&after(50.0 / 2.55));
        let usual = window.importance(&energy, 50.0);
        assert!(usual > 0.8 && usual < 1.1, "{usual}");
        assert_eq!(WeightWindow::fate(usual), Fate::Parts(1));
    }

    #[test]
    fn what_carries_much_is_split_and_what_carries_little_plays() {
        assert_eq!(WeightWindow::fate(3.7), Fate::Parts(3));
        assert_eq!(WeightWindow::fate(2.0), Fate::Parts(1));
        assert_eq!(WeightWindow::fate(0.5), Fate::Parts(1));
        assert_eq!(WeightWindow::fate(0.2), Fate::Roulette(0.2));
        assert_eq!(WeightWindow::fate(1e9), Fate::Parts(8));
        assert!(WeightWindow::is_above(2.1) && !WeightWindow::is_above(1.9));
    }

    #[test]
    fn a_surface_that_takes_all_by_name_ends_no_ray_for_sure() {
        let (_, ln_kept) = scene([1.0; 6], 0.5);
        assert!(ln_kept.iter().all(|kept| kept[0] == 0.2f64.ln() && kept[1] == 0.5f64.ln()));
    }
}
