//! A light wall that lets sound out.
//!
//! The mass law (H. Kuttruff, *Room Acoustics*, 6th ed., chapter 6; L. Cremer and H. A. Müller, *Principles and Applications of Room Acoustics*,
//! volume 2): a limp wall of mass m per area lets the share 1 / (1 + (pi f m cos / (rho c))^2) of the energy of a plane wave through.

use super::octave_mean::octave_mean;

/// Characteristic impedance of air at 20 C in kg/(m2 s).
const AIR_KG_M2_S: f64 = 413.3;
/// Something always comes back (energy), so that levels stay finite at grazing incidence.
const LEAST_REFLECTED: f64 = 1e-3;

/// Share of the energy that is left at a meeting, averaged over a band, by the cosine of the angle to the normal.
pub(crate) fn left(kg_m2: f64, cosine: f64, edges_hz: (f64, f64)) -> f64 {
    let through = |hz: f64| {
        let mass = std::f64::consts::PI * hz * kg_m2 * cosine / AIR_KG_M2_S;
        1.0 / (1.0 + mass * mass)
    };
    (1.0 - octave_mean(edges_hz, through)).max(LEAST_REFLECTED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_octave_comes_through_as_the_integral_says() {
        // The mean of 1 / (1 + a^2 f^2) over ln f is 1 - ln((1 + a^2 f2^2) / (1 + a^2 f1^2)) / (2 ln(f2 / f1)).
        for (kg_m2, cosine, low_hz) in [(1.5, 1.0, 88.0), (0.75, 0.3, 177.0), (3.0, 0.05, 710.0)] {
            let a = std::f64::consts::PI * kg_m2 * cosine / AIR_KG_M2_S;
            let square = |hz: f64| 1.0 + (a * hz).powi(2);
            let expected = (square(2.0 * low_hz) / square(low_hz)).ln() / (2.0 * 2f64.ln());
            let found = left(kg_m2, cosine, (low_hz, 2.0 * low_hz));
            assert!((found - expected).abs() < 1e-6, "{kg_m2} kg/m2: {found} for {expected}");
        }
        // Half of it comes back where pi f m = rho c.
        let hz = AIR_KG_M2_S / std::f64::consts::PI;
        assert!((left(1.0, 1.0, (hz * 0.9999, hz * 1.0001)) - 0.5).abs() < 1e-6);
    }
}
