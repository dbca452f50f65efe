//! A wall that reacts locally absorbs by the angle at which sound meets it.

use crate::admittance::admittance_of_absorption;

/// A wall of impedance cos(theta) absorbs everything; no real one does (energy).
const MIN_REFLECTED: f64 = 1e-3;

/// A locally reacting wall of a real impedance, by its absorption at random incidence: what it reflects of sound that meets it at an angle.
///
/// ```
/// use sabine_acoustics::LocalReaction;
/// let wall = LocalReaction::new(0.2);
/// // It reflects more than 80 % of what meets it squarely, and less of what meets it at 80 degrees.
/// assert!(wall.log_change(1.0) > 0.0);
/// assert!(wall.log_change(80f64.to_radians().cos()) < 0.0);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct LocalReaction {
    impedance: f64,
    /// Natural logarithm of what is reflected on average over all angles.
    ln_reflected: f64,
}

impl LocalReaction {
    /// The wall that absorbs so much of sound from all directions, 0 to 1; from 1e-4 to 0.99, and as an impedance no more than 0.951 (see
    /// [`admittance_of_absorption`](crate::admittance_of_absorption)), are kept.
    pub fn new(absorption: f64) -> Self {
        let absorption = absorption.clamp(1e-4, 0.99);
        Self { impedance: 1.0 / admittance_of_absorption(absorption), ln_reflected: (1.0 - absorption).ln() }
    }

    /// Natural logarithm of the energy that it reflects at an angle, given by the cosine to its normal (0 to 1), over its average over all
    /// (Kuttruff, Room Acoustics, 6th ed., 2.3: R = (z cos - 1) / (z cos + 1)). It reflects 0.001 at least.
    pub fn log_change(self, cosine: f64) -> f64 {
        let x = self.impedance * cosine;
        ((x - 1.0) / (x + 1.0)).powi(2).max(MIN_REFLECTED).ln() - self.ln_reflected
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_over_all_angles_is_the_absorption() {
        for absorption in [0.05, 0.3, 0.8] {
            let wall = LocalReaction::new(absorption);
            let steps = 20_000;
            let absorbed = |i: usize| {
                let cosine = (i as f64 + 0.5) / steps as f64;
                let reflected = (1.0 - absorption) * wall.log_change(cosine).exp();
                2.0 * cosine * (1.0 - reflected) / steps as f64
            };
            let mean: f64 = (0..steps).map(absorbed).sum();
            assert!((mean - absorption).abs() < 2e-3, "{mean} {absorption}");
        }
    }
}
