//! Smooth octave bands on a frequency grid: what the design shapes, and how a band's gain is weighed.

use sabine_acoustics::OctaveBands;

/// Half the width, in octaves, of the cross-over between adjacent bands by which gain is weighed.
const WEIGHT_OVERLAP: f64 = 0.25;

/// Share of the upper of two bands that meet at `edge_hz`: 0 below the cross-over, 1 above, half a sine between, even in the
/// logarithm of frequency.
pub(crate) fn upper_share(hz: f64, edge_hz: f64, half_width_octaves: f64) -> f64 {
    let u = (hz / edge_hz).log2() / half_width_octaves;
    if u <= -1.0 {
        0.0
    } else if u >= 1.0 {
        1.0
    } else {
        0.5 + 0.5 * (std::f64::consts::FRAC_PI_2 * u).sin()
    }
}

/// How much the power at `hz` counts in an octave band; adjacent bands sum to one.
pub(crate) fn weight(bands: OctaveBands, band: usize, hz: f64) -> f64 {
    let (low, high) = bands.edges_hz(band);
    upper_share(hz, low, WEIGHT_OVERLAP) * (1.0 - upper_share(hz, high, WEIGHT_OVERLAP))
}

/// The range of frequencies in Hz outside which [`weight`] is zero.
pub(crate) fn support_hz(bands: OctaveBands, band: usize) -> (f64, f64) {
    let (low, high) = bands.edges_hz(band);
    (low * (-WEIGHT_OVERLAP).exp2(), high * WEIGHT_OVERLAP.exp2())
}
