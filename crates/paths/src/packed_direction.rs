//! Directions in four bytes.

/// Octahedral map to two 16-bit integers (Cigolle et al. 2014, JCGT 3(2)): four bytes for a direction.
pub(crate) fn pack_direction(direction: [f64; 3]) -> u32 {
    let [x, y, z] = direction;
    let sum = x.abs() + y.abs() + z.abs();
    let (mut u, mut v) = (x / sum, y / sum);
    if z < 0.0 {
        (u, v) = ((1.0 - v.abs()) * u.signum(), (1.0 - u.abs()) * v.signum());
    }
    let quantise = |c: f64| ((c * 32767.0).round() as i16) as u16;
    u32::from(quantise(u)) << 16 | u32::from(quantise(v))
}

/// The unit vector that was packed, to about 0.005 degrees.
pub(crate) fn unpack_direction(packed: u32) -> [f64; 3] {
    let restore = |bits: u16| f64::from(bits as i16) / 32767.0;
    let (mut x, mut y) = (restore((packed >> 16) as u16), restore(packed as u16));
    let z = 1.0 - x.abs() - y.abs();
    if z < 0.0 {
        (x, y) = ((1.0 - y.abs()) * x.signum(), (1.0 - x.abs()) * y.signum());
    }
    let norm = (x * x + y * y + z * z).sqrt();
    [x / norm, y / norm, z / norm]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn packed_directions_keep_their_angle(z in -1.0f64..1.0, azimuth in 0.0f64..std::f64::consts::TAU) {
            let r = (1.0 - z * z).sqrt();
            let d = [r * azimuth.cos(), r * azimuth.sin(), z];
            let back = unpack_direction(pack_direction(d));
            let cross = [d[1] * back[2] - d[2] * back[1], d[2] * back[0] - d[0] * back[2], d[0] * back[1] - d[1] * back[0]];
            let sine = cross.iter().map(|c| c * c).sum::<f64>().sqrt();
            prop_assert!(sine.asin().to_degrees() < 0.005, "{d:?} became {back:?}");
        }
    }
}
