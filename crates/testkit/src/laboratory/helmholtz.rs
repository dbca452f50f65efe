//! A Helmholtz absorber on a share of a material's area.
//!
//! H. Kuttruff, *Room Acoustics*, 6th ed., chapters 2 and 6: a resonator in a wall has the specific impedance z = r + i q (f / f0 - f0 / f); a
//! locally reacting wall reflects the pressure (z cos - 1) / (z cos + 1) of a plane wave.

use super::octave_mean::octave_mean;

/// Share of the energy of a plane wave that a resonator absorbs, by the cosine of the angle to the normal.
fn absorbed((f0_hz, q, resistance): (f64, f64, f64), cosine: f64, hz: f64) -> f64 {
    let reactance = q * (hz / f0_hz - f0_hz / hz);
    let (real, imaginary) = (resistance * cosine, reactance * cosine);
    4.0 * real / ((1.0 + real).powi(2) + imaginary * imaginary)
}

/// Share of the energy that is left at a meeting, averaged over a band; `share` of the area are resonators.
pub(crate) fn left(share: f64, resonator: (f64, f64, f64), cosine: f64, edges_hz: (f64, f64)) -> f64 {
    1.0 - share * octave_mean(edges_hz, |hz| absorbed(resonator, cosine, hz))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_octave_about_the_resonance_absorbs_what_the_integral_says() {
        // With f = f0 e^u the reactance is 2 q sinh u, and the mean of 4 r / ((1 + r)^2 + 4 q^2 sinh^2 u) over |u| < h is
        // 4 r atan(s tanh(h) / (1 + r)) / ((1 + r) s h), s^2 = 4 q^2 - (1 + r)^2.
        for (q, r) in [(3.0f64, 1.0f64), (2.0, 0.5), (5.0, 2.0)] {
            let half = 0.5 * 2f64.ln();
            let slope = f64::sqrt(4.0 * q * q - (1.0 + r) * (1.0 + r));
            let expected = 4.0 * r * (slope / (1.0 + r) * half.tanh()).atan() / ((1.0 + r) * slope * half);
            let edges_hz = (400.0 / half.exp(), 400.0 * half.exp());
            let found = 1.0 - left(1.0, (400.0, q, r), 1.0, edges_hz);
            assert!((found - expected).abs() < 1e-4, "q {q}, r {r}: {found} for {expected}");
        }
    }

    #[test]
    fn a_matched_resonator_swallows_its_own_frequency_and_no_other() {
        let at = |hz: f64| left(0.5, (500.0, 4.0, 1.0), 1.0, (hz * 0.9999, hz * 1.0001));
        assert!((at(500.0) - 0.5).abs() < 1e-6);
        assert!(at(8000.0) > 0.999 && at(60.0) > 0.998);
    }
}
