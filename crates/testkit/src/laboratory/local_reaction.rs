//! Walls that react locally: what they reflect follows from their impedance and the angle.
//!
//! P. M. Morse and K. U. Ingard, *Theoretical Acoustics*, 1968, 6.3: a wall of the real specific impedance z reflects the pressure
//! (z cos - 1) / (z cos + 1) of a plane wave. Its random-incidence absorption is the mean over all directions, weighed by the cosine.

use super::hidden::Hidden;
use super::truth::Truth;

/// Angles at which the mean over directions is taken, and at which reflection is tabulated.
const ANGLES: usize = 400;
/// Impedances from the one that absorbs most to the hardest, as a ratio.
const HARDEST: f64 = 1e5;
/// No wall swallows a plane wave whole (energy).
const LEAST_REFLECTED: f64 = 1e-3;

/// Logarithm of what each wall reflects over what it reflects of sound from everywhere, `[band][face][angle]`, angles evenly by cosine.
pub(crate) struct LocalReaction {
    tables: Vec<[Vec<f64>; 6]>,
}

impl LocalReaction {
    /// None unless the effect is at work.
    pub(crate) fn of(truth: &Truth) -> Option<Self> {
        let share = truth.effects.iter().find_map(|e| match e {
            Hidden::AngleDependentAbsorption { share } => Some(*share),
            _ => None,
        })?;
        let face = |band: usize, face: usize| {
            let absorption = truth.materials[truth.faces[face]].absorption[band];
            let impedance = impedance(absorption);
            let off = |angle: usize| {
                let cosine = (angle as f64 + 0.5) / ANGLES as f64;
                share * (reflected(impedance, cosine).ln() - (1.0 - absorption).ln())
            };
            (0..ANGLES).map(off).collect()
        };
        let tables = (0..truth.bands_hz.len()).map(|b| std::array::from_fn(|f| face(b, f))).collect();
        Some(Self { tables })
    }

    /// Factor of an image's energy in a band, given how often it met each face, and the cosine along each axis.
    pub(crate) fn factor(&self, band: usize, met: [f64; 6], cosines: [f64; 3]) -> f64 {
        let angle = cosines.map(|c| ((c.abs() * ANGLES as f64) as usize).min(ANGLES - 1));
        (0..6).map(|f| met[f] * self.tables[band][f][angle[f / 2]]).sum::<f64>().exp()
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
