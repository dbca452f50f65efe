//! Random numbers that depend on nothing but the seed and the ray.

use crate::vector::{Vec3, add, norm, scale};
use rand::Rng;
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// The generator of one ray: the same for the same seed and index, whichever thread asks.
pub(crate) fn generator(seed: u64, index: u64) -> Pcg64Mcg {
    let high = mixed(seed ^ mixed(index));
    let low = mixed(high.wrapping_add(index));
    Pcg64Mcg::new(u128::from(high) << 64 | u128::from(low))
}

/// SplitMix64 (Steele, Lea and Flood 2014): turns neighbouring numbers into unrelated ones.
fn mixed(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A direction, all being equally likely (Archimedes: the height on the sphere is uniform).
pub(crate) fn direction(random: &mut impl Rng) -> Vec3 {
    let z: f64 = 1.0 - 2.0 * random.random::<f64>();
    let azimuth = TAU * random.random::<f64>();
    let r = (1.0 - z * z).max(0.0).sqrt();
    [r * azimuth.cos(), r * azimuth.sin(), z]
}

/// A direction by Lambert's law about a unit normal: density cos / pi. A point on the unit sphere that touches the surface
/// is such a direction.
pub(crate) fn lambert(random: &mut impl Rng, normal: Vec3) -> Vec3 {
    loop {
        let sum = add(normal, direction(random));
        let length = norm(sum);
        // The one point opposite the normal has no direction.
        if length > 1e-6 {
            return scale(sum, 1.0 / length);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::dot;

    /// Pearson's statistic of counts that are all equally likely.
    fn chi_squared(counts: &[u32]) -> f64 {
        let expected = f64::from(counts.iter().sum::<u32>()) / counts.len() as f64;
        counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum()
    }

    #[test]
    fn scattered_directions_follow_lambert() {
        // Under Lambert's law the square of the sine is uniform, and so is the azimuth.
        let normal = crate::vector::unit([1.0, -2.0, 0.5]);
        let right = crate::vector::unit(crate::vector::cross(normal, [0.0, 0.0, 1.0]));
        let up = crate::vector::cross(right, normal);
        let mut random = generator(3, 0);
        let mut counts = vec![0u32; 20 * 20];
        for _ in 0..200_000 {
            let d = lambert(&mut random, normal);
            let cosine = dot(d, normal);
            assert!(cosine >= 0.0);
            let ring = ((1.0 - cosine * cosine) * 20.0) as usize;
            let sector = ((dot(d, up).atan2(dot(d, right)) / TAU).rem_euclid(1.0) * 20.0) as usize;
            counts[ring.min(19) * 20 + sector.min(19)] += 1;
        }
        // 399 degrees of freedom: mean 399, standard deviation sqrt(2 x 399) = 28; four of them.
        let statistic = chi_squared(&counts);
        assert!((statistic - 399.0).abs() < 4.0 * 28.3, "chi-squared {statistic}");
    }

    #[test]
    fn emitted_directions_are_uniform() {
        let mut counts = vec![0u32; 20 * 20];
        for ray in 0..200_000 {
            let [x, y, z] = direction(&mut generator(11, ray));
            let ring = ((z + 1.0) * 10.0) as usize;
            let sector = ((y.atan2(x) / TAU).rem_euclid(1.0) * 20.0) as usize;
            counts[ring.min(19) * 20 + sector.min(19)] += 1;
        }
        let statistic = chi_squared(&counts);
        assert!((statistic - 399.0).abs() < 4.0 * 28.3, "chi-squared {statistic}");
    }
}
