//! Real spherical harmonics as ambisonics uses them.

use crate::vector::{Vec3, norm};

/// Highest ambisonic order of this crate.
pub(crate) const MAX_ORDER: usize = 3;
/// Channels of the highest order.
pub(crate) const MAX_CHANNELS: usize = (MAX_ORDER + 1) * (MAX_ORDER + 1);

/// Gains with which sound from a direction enters the channels of ambisonics of an order of 0 to 3: real spherical harmonics
/// without Condon-Shortley phase in the channel order ACN, n = l (l + 1) + m, and the normalisation SN3D, in which no
/// channel exceeds the first one, 1 (AmbiX: Nachbar, Zotter, Deleflie and Sontacchi 2011). x is forward, y to the left, z up; the
/// direction may have any length.
///
/// ```
/// use sabine_propagate::ambisonic_gains;
/// // From the left: the omnidirectional channel and Y.
/// assert_eq!(ambisonic_gains(1, [0.0, 2.0, 0.0]), [1.0, 1.0, 0.0, 0.0]);
/// ```
///
/// # Panics
/// If the order is above 3.
pub fn ambisonic_gains(order: usize, direction: [f64; 3]) -> Vec<f64> {
    assert!(order <= MAX_ORDER, "order {order} of at most {MAX_ORDER}");
    harmonics(direction)[..(order + 1) * (order + 1)].to_vec()
}

/// All channels of the highest order.
pub(crate) fn harmonics(direction: Vec3) -> [f64; MAX_CHANNELS] {
    let length = norm(direction);
    let [x, y, z] = direction.map(|c| c / length);
    let (root3, root15) = (3f64.sqrt(), 15f64.sqrt());
    let (root58, root38) = ((5.0f64 / 8.0).sqrt(), (3.0f64 / 8.0).sqrt());
    [
        1.0,
        y,
        z,
        x,
        root3 * x * y,
        root3 * y * z,
        0.5 * (3.0 * z * z - 1.0),
        root3 * x * z,
        0.5 * root3 * (x * x - y * y),
        root58 * y * (3.0 * x * x - y * y),
        root15 * x * y * z,
        root38 * y * (5.0 * z * z - 1.0),
        0.5 * z * (5.0 * z * z - 3.0),
        root38 * x * (5.0 * z * z - 1.0),
        0.5 * root15 * z * (x * x - y * y),
        root58 * x * (x * x - 3.0 * y * y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction_cells::DirectionCells;
    use proptest::prelude::*;

    fn factorial(n: i32) -> f64 {
        (1..=n).map(f64::from).product()
    }

    /// Associated Legendre function without Condon-Shortley phase, by its sum (Abramowitz and Stegun 8.6.6 and Rodrigues).
    fn legendre(l: i32, m: i32, x: f64) -> f64 {
        let mut sum = 0.0;
        for k in 0..=l / 2 {
            let power = l - 2 * k - m;
            if power >= 0 {
                let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                sum += sign * factorial(2 * l - 2 * k) / (factorial(k) * factorial(l - k) * factorial(power))
                    * x.powi(power);
            }
        }
        (1.0 - x * x).powf(0.5 * f64::from(m)) * sum / 2f64.powi(l)
    }

    proptest! {
        #[test]
        fn the_table_is_the_closed_form(sine in -0.999f64..0.999, azimuth in -4.0f64..4.0) {
            let cosine = (1.0 - sine * sine).sqrt();
            let found = ambisonic_gains(3, [cosine * azimuth.cos(), cosine * azimuth.sin(), sine]);
            for l in 0..=3i32 {
                for m in -l..=l {
                    let doubled = if m == 0 { 1.0 } else { 2.0 };
                    let sn3d = (doubled * factorial(l - m.abs()) / factorial(l + m.abs())).sqrt();
                    let angle = f64::from(m.abs()) * azimuth;
                    let around = if m < 0 { angle.sin() } else { angle.cos() };
                    let expected = sn3d * legendre(l, m.abs(), sine) * around;
                    let channel = (l * (l + 1) + m) as usize;
                    prop_assert!((found[channel] - expected).abs() < 1e-12, "l {l}, m {m}");
                }
            }
        }
    }

    /// Mean products over the sphere are 1 / (2l + 1) on the diagonal: exact sums over the design of degree 7.
    #[test]
    fn channels_are_orthogonal_with_sn3d_norms() {
        let cells = DirectionCells::for_order(3);
        let points = cells.centres();
        for a in 0..MAX_CHANNELS {
            for b in 0..MAX_CHANNELS {
                let mean = points.iter().map(|&p| harmonics(p)[a] * harmonics(p)[b]).sum::<f64>()
                    / points.len() as f64;
                let degree = (0..=3).rev().find(|l| l * l <= a).unwrap();
                let expected = if a == b { 1.0 / (2 * degree + 1) as f64 } else { 0.0 };
                assert!((mean - expected).abs() < 1e-12, "channels {a}, {b}: {mean}");
            }
        }
    }
}
