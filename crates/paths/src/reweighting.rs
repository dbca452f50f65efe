//! What the surfaces leave of many paths, four octaves at a time.

/// Octaves that are worked on together: what a vector register holds, so that loops over four become single instructions.
pub(crate) const LANES: usize = 4;

/// One value for each of four octaves.
pub(crate) type Lanes = [f32; LANES];

/// Sum of the steps along each chain: `steps[events[chain]]` added to what its parent has, the first chain having none.
pub(crate) fn sums_along(parents: &[u32], events: &[u16], steps: &[Lanes]) -> Vec<Lanes> {
    let mut sums: Vec<Lanes> = Vec::with_capacity(parents.len());
    sums.push([0.0; LANES]);
    // Most chains continue the one before them: it need not be fetched again.
    let (mut last, mut last_sum) = (0u32, [0.0; LANES]);
    for (&parent, &event) in parents.iter().zip(events).skip(1) {
        let before = if parent == last { last_sum } else { sums[parent as usize] };
        last_sum = add(before, steps[usize::from(event)]);
        last = sums.len() as u32;
        sums.push(last_sum);
    }
    sums
}

/// As [`sums_along`], the steps depending on the angle of each event too: `steps[events[chain] * 256 + angles[chain]]`.
pub(crate) fn sums_along_angles(
    parents: &[u32],
    events: &[u16],
    angles: &[u8],
    steps: &[Lanes],
) -> Vec<Lanes> {
    let mut sums: Vec<Lanes> = Vec::with_capacity(parents.len());
    sums.push([0.0; LANES]);
    let (mut last, mut last_sum) = (0u32, [0.0; LANES]);
    for ((&parent, &event), &angle) in parents.iter().zip(events).zip(angles).skip(1) {
        let before = if parent == last { last_sum } else { sums[parent as usize] };
        last_sum = add(before, steps[usize::from(event) << 8 | usize::from(angle)]);
        last = sums.len() as u32;
        sums.push(last_sum);
    }
    sums
}

fn add(a: Lanes, b: Lanes) -> Lanes {
    std::array::from_fn(|i| a[i] + b[i])
}

/// Lower than this, the exponential is taken for zero: 1e-38 of the energy at 1 m.
const LOWEST: f32 = -87.0;
/// Added to a small number and subtracted again it leaves the nearest integer, and that integer's bits before.
const ROUNDER: f32 = 12_582_912.0;
/// Natural logarithm of 2 in two parts, the first exact in few bits.
const LN2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
/// exp(r) = 1 + r + r^2 p(r) for |r| < ln(2) / 2 (Moshier, Cephes `expf`), highest power first.
const POLYNOMIAL: [f32; 6] =
    [1.987_569_1e-4, 1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 0.166_666_65, 0.5];

/// Exponential function, to 2e-7 of its value, of numbers below 88; zero below -87.
#[inline]
pub(crate) fn exp(x: Lanes) -> Lanes {
    std::array::from_fn(|i| {
        let x = x[i];
        let bounded = x.max(LOWEST);
        let shifted = bounded * std::f32::consts::LOG2_E + ROUNDER;
        let whole = shifted - ROUNDER;
        let r = (bounded - whole * LN2[0]) - whole * LN2[1];
        let p = POLYNOMIAL[1..].iter().fold(POLYNOMIAL[0], |p, c| p * r + c);
        let mantissa = p * r * r + r + 1.0;
        let power = (shifted.to_bits().wrapping_sub(ROUNDER.to_bits()).wrapping_add(127)) << 23;
        if x < LOWEST { 0.0 } else { mantissa * f32::from_bits(power) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_that_of_double_precision() {
        let mut worst = 0.0f64;
        for i in -86_999..80_000 {
            let x = i as f32 * 1e-3;
            let expected = f64::from(x).exp();
            let found = exp([x, -x.abs(), 0.0, x]);
            worst = worst.max((f64::from(found[0]) / expected - 1.0).abs());
            assert_eq!(found[0], found[3]);
            assert_eq!(found[2], 1.0);
        }
        assert!(worst < 2e-7, "{worst}");
        assert_eq!(exp([f32::NEG_INFINITY, -87.5, -1e30, -200.0]), [0.0; 4]);
    }

    #[test]
    fn chains_add_up_their_steps() {
        // 0 <- 1 <- 2, 0 <- 3, 1 <- 4
        let steps = [[1.0, 2.0, 3.0, 4.0], [10.0, 20.0, 30.0, f32::NEG_INFINITY]];
        let sums = sums_along(&[0, 0, 1, 0, 1], &[0, 0, 1, 1, 0], &steps);
        assert_eq!(sums[0], [0.0; 4]);
        assert_eq!(sums[2], [11.0, 22.0, 33.0, f32::NEG_INFINITY]);
        assert_eq!(sums[3], steps[1]);
        assert_eq!(sums[4], [2.0, 4.0, 6.0, 8.0]);
    }
}
