//! A column loudspeaker: an upright line of sources.
//!
//! L. L. Beranek and T. J. Mellow, *Acoustics*, 2012, chapter 4: a line of length L radiates the pressure sin(x) / x at an angle e to its middle plane,
//! x = pi L sin(e) / wavelength. Energies are means over a band, and the radiated power stays.

use super::hidden::Hidden;
use super::octave_mean::octave_mean;
use super::truth::Truth;

/// Sines of the elevation at which energies are tabulated.
const SINES: usize = 400;
/// Speed of sound that the wavelength is taken at, in m/s.
const SPEED_M_S: f64 = 343.2;

/// Energy by band and by the sine of the elevation, its mean over the sphere 1.
pub(crate) struct ColumnLoudspeaker {
    tables: Vec<Vec<f64>>,
}

impl ColumnLoudspeaker {
    /// None unless the loudspeaker is a column; edges of the bands in Hz.
    pub(crate) fn of(truth: &Truth, edges_hz: &[(f64, f64)]) -> Option<Self> {
        truth.effects.iter().find_map(|effect| match effect {
            Hidden::ColumnLoudspeaker { length_m } => Some(Self::new(*length_m, edges_hz)),
            _ => None,
        })
    }

    fn new(length_m: f64, edges_hz: &[(f64, f64)]) -> Self {
        let table = |edges: &(f64, f64)| {
            let energy = |i: usize| {
                let sine = (i as f64 + 0.5) / SINES as f64;
                octave_mean(*edges, |hz| {
                    let x = std::f64::consts::PI * length_m * sine * hz / SPEED_M_S;
                    (x.sin() / x).powi(2)
                })
            };
            let all: Vec<f64> = (0..SINES).map(energy).collect();
            // Rings of the sphere are as large as their range of sines.
            let mean = all.iter().sum::<f64>() / SINES as f64;
            all.into_iter().map(|e| e / mean).collect()
        };
        Self { tables: edges_hz.iter().map(table).collect() }
    }

    /// Factor of the pressure in a band.
    pub(crate) fn gain(&self, band: usize, sine: f64) -> f64 {
        self.tables[band][((sine.abs() * SINES as f64) as usize).min(SINES - 1)].sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_has_the_directivity_factor_of_a_long_line() {
        // 2 L / wavelength, less by 1 / (pi^2 L / wavelength) of it (the mean of sin^2(a s) / (a s)^2 over s is pi / 2a - 1 / 2a^2).
        let (length_m, hz) = (2.0, 2000.0);
        let column = ColumnLoudspeaker::new(length_m, &[(hz * 0.999, hz * 1.001)]);
        let a = std::f64::consts::PI * length_m * hz / SPEED_M_S;
        let expected = 1.0 / (std::f64::consts::FRAC_PI_2 / a - 0.5 / (a * a));
        let found = column.gain(0, 0.0).powi(2);
        assert!((found / expected - 1.0).abs() < 0.02, "{found} for {expected}");
    }

    #[test]
    fn a_short_line_radiates_as_a_point() {
        let column = ColumnLoudspeaker::new(0.01, &[(88.0, 177.0)]);
        assert!([0.0, 0.5, 1.0].iter().all(|sine| (column.gain(0, *sine) - 1.0).abs() < 1e-4));
    }
}
