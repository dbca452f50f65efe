//! How the power at a frequency counts in an octave: the bands by which gain is measured.
//!
//! They are those of [`sabine_acoustics`]'s filter bank, written here once more so that a design needs no filtering: adjacent
//! bands cross over between their centres, sine against cosine of a smooth step, and the squares of their gains add up to one.

use sabine_acoustics::Bands;
use std::f64::consts::FRAC_PI_2;

/// Power gain at `hz` of an octave band, 0 to 1.
pub(crate) fn weight(bands: Bands, band: usize, hz: f64) -> f64 {
    let (low_hz, high_hz) = bands.edges_hz(band);
    let per_octave = 1.0 / (high_hz / low_hz).ln();
    let rise = step((hz / low_hz).ln() * per_octave + 0.5);
    let fall = step((hz / high_hz).ln() * per_octave + 0.5);
    ((FRAC_PI_2 * rise).sin() * (FRAC_PI_2 * fall).cos()).powi(2)
}

/// The range of frequencies in Hz outside which [`weight`] is zero: the centres of the adjacent octaves.
pub(crate) fn support_hz(bands: Bands, band: usize) -> (f64, f64) {
    let (low_hz, high_hz) = bands.edges_hz(band);
    let half = (high_hz / low_hz).sqrt();
    (low_hz / half, high_hz * half)
}

/// Number of bands whose centre lies below half the sample rate: those whose gain can be set and measured.
pub(crate) fn active_bands(bands: Bands, sample_rate_hz: u32) -> usize {
    (0..bands.len()).take_while(|&b| bands.exact_hz(b) < f64::from(sample_rate_hz) / 2.0).count()
}

/// Rises from 0 at 0 to 1 at 1 with two derivatives that vanish at both ends.
fn step(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u.powi(3) * (10.0 + u * (6.0 * u - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_adjacent_bands_add_up_to_one() {
        let bands = Bands::SIMULATION;
        for i in 0..=100 {
            let hz = bands.exact_hz(0) * (bands.exact_hz(7) / bands.exact_hz(0)).powf(f64::from(i) / 100.0);
            let sum: f64 = (0..bands.len()).map(|b| weight(bands, b, hz)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{hz} Hz: {sum}");
        }
        assert_eq!(weight(bands, 4, support_hz(bands, 4).0), 0.0);
    }
}
