//! A box with known answers: image sources by formula (Allen and Berkley 1979), and energies read from paths without air.
//! Shares no code with the tracer.
#![allow(dead_code)] // each test binary uses its part

use sabine_acoustics::*;
use sabine_paths::*;
use sabine_scene::*;

/// An image source: its distance and how often each wall (x0, x1, y0, y1, floor, ceiling) reflected.
pub struct Image {
    pub distance_m: f64,
    pub hits: [u32; 6],
}

impl Image {
    pub fn order(&self) -> u32 {
        self.hits.iter().sum()
    }
}

/// All images within a distance of the receiver.
pub fn images(size_m: [f64; 3], source: [f64; 3], receiver: [f64; 3], max_m: f64) -> Vec<Image> {
    // Along one axis: offset from the receiver, and hits of the low and the high wall.
    let axis = |i: usize| -> Vec<(f64, u32, u32)> {
        let reach = (max_m / (2.0 * size_m[i])).ceil() as i64 + 1;
        (-reach..=reach)
            .flat_map(|n| {
                let shift = 2.0 * n as f64 * size_m[i];
                let turns = n.unsigned_abs() as u32;
                // Unmirrored: |n| hits of either wall. Mirrored at the low wall: one more or one less.
                let mirrored = ((n - 1).unsigned_abs() as u32, turns);
                [
                    (shift + source[i] - receiver[i], turns, turns),
                    (shift - source[i] - receiver[i], mirrored.0, mirrored.1),
                ]
            })
            .collect()
    };
    let [xs, ys, zs] = [axis(0), axis(1), axis(2)];
    let mut found = Vec::new();
    for &(x, x0, x1) in &xs {
        for &(y, y0, y1) in &ys {
            for &(z, z0, z1) in &zs {
                let distance_m = (x * x + y * y + z * z).sqrt();
                if distance_m <= max_m {
                    found.push(Image { distance_m, hits: [x0, x1, y0, y1, z0, z1] });
                }
            }
        }
    }
    found
}

/// Energy in time bins of images whose walls reflect `reflectance` of the energy, without air.
pub fn image_energy(
    images: &[Image],
    reflectance: [f64; 6],
    speed_m_s: f64,
    bin_s: f64,
    bins: usize,
) -> Vec<f64> {
    let mut energy = vec![0.0; bins];
    for image in images {
        if let Some(bin) = energy.get_mut((image.distance_m / speed_m_s / bin_s) as usize) {
            let left: f64 = image.hits.iter().zip(reflectance).map(|(&n, r)| r.powi(n as i32)).product();
            *bin += left / image.distance_m.powi(2);
        }
    }
    energy
}

/// Energy of one band in time bins for each batch of rays (the exact paths last), without air.
pub fn batch_energies(
    paths: &PathSet,
    materials: &[Material],
    band: usize,
    speed_m_s: f64,
    bin_s: f64,
) -> Vec<Vec<f64>> {
    let gain = paths.log_reflectance(materials, band).unwrap();
    let bins = (paths.max_length_m() / speed_m_s / bin_s) as usize + 1;
    let batches = usize::from(PathSet::BATCHES);
    let mut energy = vec![vec![0.0; bins]; batches + 1];
    for i in 0..paths.len() {
        let bin = (f64::from(paths.lengths_m()[i]) / speed_m_s / bin_s) as usize;
        let batch = paths.batch(i).map_or(batches, usize::from);
        energy[batch][bin] += f64::from(
            paths.log_weights()[i] + gain[paths.chains()[i] as usize] + gain[paths.tails()[i] as usize],
        )
        .exp();
    }
    energy
}

pub fn total(parts: &[Vec<f64>]) -> Vec<f64> {
    let mut sum = vec![0.0; parts[0].len()];
    for part in parts {
        sum.iter_mut().zip(part).for_each(|(s, e)| *s += e);
    }
    sum
}

/// A statistic of the whole with its jackknife standard error over independent parts (Efron 1982).
pub fn jackknife(parts: &[Vec<f64>], statistic: impl Fn(&[f64]) -> f64) -> Estimate {
    let sum = total(parts);
    let n = parts.len() as f64;
    let without: Vec<f64> = parts
        .iter()
        .map(|part| {
            let rest: Vec<f64> = sum.iter().zip(part).map(|(s, p)| (s - p) * n / (n - 1.0)).collect();
            statistic(&rest)
        })
        .collect();
    let mean = without.iter().sum::<f64>() / n;
    let scatter: f64 = without.iter().map(|w| (w - mean).powi(2)).sum();
    Estimate::new(statistic(&sum), ((n - 1.0) / n * scatter).sqrt())
}

pub fn t30_s(energy: &[f64], bin_s: f64) -> f64 {
    EnergyDecayCurve::from_energy(energy, bin_s).decay_time_s(-5.0, -35.0).unwrap()
}

pub fn materials_of(scene: &Scene) -> Vec<Material> {
    scene.materials().iter().map(|named| named.material.clone()).collect()
}

pub fn uniform_box(size_m: [f64; 3], bands: Bands, absorption: f64, scattering: f64) -> Scene {
    let m = Material::uniform(bands, absorption, scattering).unwrap();
    Scene::shoebox(size_m, std::array::from_fn(|_| m.clone())).unwrap()
}

pub fn source(position_m: [f64; 3]) -> Source {
    Source::omni("S", position_m).unwrap()
}

pub fn receiver(position_m: [f64; 3]) -> Receiver {
    Receiver::omni("R", position_m).unwrap()
}
