//! Walls that reflect by the angle at which sound meets them.
//!
//! Locally reacting ones: P. M. Morse and K. U. Ingard, *Theoretical Acoustics*, 1968, 6.3: a wall of the real specific impedance z reflects
//! the pressure (z cos - 1) / (z cos + 1) of a plane wave. Its random-incidence absorption is the mean over all directions, weighed by the
//! cosine.

use super::helmholtz;
use super::hidden::Hidden;
use super::limp_wall;
use super::truth::Truth;

/// Angles at which the mean over directions is taken, and at which reflection is tabulated.
const ANGLES: usize = 400;
/// Impedances from the one that absorbs most to the hardest, as a ratio.
const HARDEST: f64 = 1e5;
/// No wall swallows a plane wave whole (energy).
const LEAST_REFLECTED: f64 = 1e-3;

/// Logarithm of what each wall reflects over what it reflects of sound from everywhere, `[band][face][angle]`, angles evenly by cosine.
pub(crate) struct ReflectionByAngle {
    tables: Vec<[Vec<f64>; 6]>,
}

impl ReflectionByAngle {
    /// None unless an effect of this kind is at work.
    pub(crate) fn of(truth: &Truth) -> Option<Self> {
        let by_angle = |e: &&Hidden| {
            matches!(
                e,
                Hidden::AngleDependentAbsorption { .. }
                    | Hidden::GrazingAbsorption { .. }
                    | Hidden::SeatDip { .. }
                    | Hidden::HelmholtzAbsorber { .. }
                    | Hidden::LimpWall { .. }
            )
        };
        let effects: Vec<&Hidden> = truth.effects.iter().filter(by_angle).collect();
        let bands = truth.bands().ok()?;
        let face = |band: usize, face: usize| {
            let mut by_angle = vec![0.0; ANGLES];
            effects
                .iter()
                .for_each(|effect| add(truth, effect, (band, face, bands.edges_hz(band)), &mut by_angle));
            by_angle
        };
        let tables = (0..truth.bands_hz.len()).map(|b| std::array::from_fn(|f| face(b, f))).collect();
        (!effects.is_empty()).then_some(Self { tables })
    }

    /// Factor of an image's energy in a band, given how often it met each face, and the cosine along each axis.
    pub(crate) fn factor(&self, band: usize, met: [f64; 6], cosines: [f64; 3]) -> f64 {
        let angle = cosines.map(|c| ((c.abs() * ANGLES as f64) as usize).min(ANGLES - 1));
        (0..6).map(|f| met[f] * self.tables[band][f][angle[f / 2]]).sum::<f64>().exp()
    }
}

/// Adds what an effect does to the logarithm of what a face reflects in a band, at all angles.
fn add(
    truth: &Truth,
    effect: &Hidden,
    (band, face, edges_hz): (usize, usize, (f64, f64)),
    by_angle: &mut [f64],
) {
    let own = truth.faces[face];
    let cosines = (0..ANGLES).map(|angle| (angle as f64 + 0.5) / ANGLES as f64);
    match effect {
        Hidden::AngleDependentAbsorption { share } => {
            let absorption = truth.materials[own].absorption[band];
            let impedance = impedance(absorption);
            let off = |cosine: f64| share * (reflected(impedance, cosine).ln() - (1.0 - absorption).ln());
            by_angle.iter_mut().zip(cosines).for_each(|(sum, cosine)| *sum += off(cosine));
        }
        Hidden::GrazingAbsorption { material, db, from_hz }
            if *material == own && truth.bands_hz[band] >= *from_hz =>
        {
            let off = |cosine: f64| -db * (1.0 - cosine).powi(2) * std::f64::consts::LN_10 / 10.0;
            by_angle.iter_mut().zip(cosines).for_each(|(sum, cosine)| *sum += off(cosine));
        }
        Hidden::SeatDip { material, db, f0_hz, q } if *material == own => {
            // Power that a driven resonator takes: f^2 g^2 / (f^2 g^2 + (f^2 - f0^2)^2), its width g being f0 / q.
            let (f, width) = (truth.bands_hz[band], f0_hz / q);
            let taken = (f * width).powi(2) / ((f * width).powi(2) + (f * f - f0_hz * f0_hz).powi(2));
            let depth = db * taken * std::f64::consts::LN_10 / 10.0;
            by_angle.iter_mut().zip(cosines).for_each(|(sum, cosine)| {
                *sum -= depth * (1.0 - 2.0 * cosine + cosine * cosine);
            });
        }
        Hidden::HelmholtzAbsorber { material, share, f0_hz, q, resistance } if *material == own => {
            let left = |cosine: f64| helmholtz::left(*share, (*f0_hz, *q, *resistance), cosine, edges_hz);
            by_angle.iter_mut().zip(cosines).for_each(|(sum, cosine)| *sum += left(cosine).ln());
        }
        Hidden::LimpWall { material, kg_m2 } if *material == own => {
            let left = |cosine: f64| limp_wall::left(*kg_m2, cosine, edges_hz);
            by_angle.iter_mut().zip(cosines).for_each(|(sum, cosine)| *sum += left(cosine).ln());
        }
        _ => {}
    }
}

fn reflected(impedance: f64, cosine: f64) -> f64 {
    ((impedance * cosine - 1.0) / (impedance * cosine + 1.0)).powi(2).max(LEAST_REFLECTED)
}

/// Mean absorption over all directions of sound, weighed by the cosine, by Simpson's rule.
fn absorbed(impedance: f64) -> f64 {
    let value = |i: usize| {
        let cosine = i as f64 / ANGLES as f64;
        let r = (impedance * cosine - 1.0) / (impedance * cosine + 1.0);
        2.0 * cosine * (1.0 - r * r)
    };
    let inner: f64 = (1..ANGLES).map(|i| value(i) * if i % 2 == 1 { 4.0 } else { 2.0 }).sum();
    (value(0) + inner + value(ANGLES)) / (3.0 * ANGLES as f64)
}

/// The impedance of a wall that absorbs so much, on the side of hard walls, by halving its logarithm.
fn impedance(absorption: f64) -> f64 {
    // Absorption falls from its maximum, at an impedance of 1.6, to nothing.
    let (mut low, mut high) = (1.6f64, HARDEST);
    if absorption >= absorbed(low) {
        return low;
    }
    for _ in 0..80 {
        let middle = (low * high).sqrt();
        if absorbed(middle) > absorption { low = middle } else { high = middle }
    }
    (low * high).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_absorb_in_the_mean_what_they_are_said_to() {
        // Kuttruff, Room Acoustics, 2.5: an impedance of 1.57 absorbs 0.951, and 8 / z is the limit of hard walls.
        assert!((absorbed(1.57) - 0.951).abs() < 1e-3);
        assert!((absorbed(2000.0) * 2000.0 / 8.0 - 1.0).abs() < 0.02);
        for absorption in [0.02, 0.1, 0.5, 0.9] {
            assert!((absorbed(impedance(absorption)) - absorption).abs() < 1e-3);
        }
    }
}
