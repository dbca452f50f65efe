//! From random-incidence absorption to the admittance of a wall, and back.

/// The specific impedance at which a locally reacting wall with a real impedance absorbs most sound from all directions:
/// 95.1 % (Kuttruff, Room Acoustics, section 2.5).
const BEST_IMPEDANCE: f64 = 1.567;
/// Steps of bisection: double precision is used up after 53.
const STEPS: usize = 60;

/// Random-incidence absorption of a locally reacting wall with the real specific admittance `admittance` (air's rho c over
/// the wall's impedance; 0 and above), by Paris' formula (Paris 1928; Kuttruff, Room Acoustics, equation 2.42):
///
/// ```text
/// alpha = int_0^(pi/2) alpha(theta) sin(2 theta) d theta,   alpha(theta) = 4 zeta cos theta / (zeta cos theta + 1)^2
///       = 8 / zeta^2 (1 + zeta - 1 / (1 + zeta) - 2 ln(1 + zeta)),   zeta = 1 / admittance
/// ```
///
/// It rises as 8 times the admittance at first, reaches 0.951 at 0.638 and falls thereafter.
///
/// ```
/// use sabine_acoustics::absorption_of_admittance;
/// assert!((absorption_of_admittance(1.0) - 8.0 * (1.5 - 2.0 * 2f64.ln())).abs() < 1e-12);
/// ```
pub fn absorption_of_admittance(admittance: f64) -> f64 {
    if admittance <= 0.0 {
        return 0.0;
    }
    // The same in terms of the admittance: no digits are lost where it is small.
    let g = admittance;
    8.0 * g * (1.0 + g - g * g / (1.0 + g) + 2.0 * g * (g / (1.0 + g)).ln())
}

/// The real specific admittance (0 to 0.638) of a locally reacting wall with this random-incidence absorption (0 to 1): the
/// inverse of [`absorption_of_admittance`] on the side of hard walls.
///
/// No such wall absorbs more than 0.951 of the sound from all directions: what is said to absorb more absorbs that.
///
/// ```
/// use sabine_acoustics::{absorption_of_admittance, admittance_of_absorption};
/// let admittance = admittance_of_absorption(0.1);
/// assert!((absorption_of_admittance(admittance) - 0.1).abs() < 1e-12);
/// ```
pub fn admittance_of_absorption(absorption: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0 / BEST_IMPEDANCE);
    if absorption >= absorption_of_admittance(high) {
        return high;
    }
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if absorption_of_admittance(middle) < absorption {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Paris' integral by the midpoint rule over the cosine.
    fn integrated(admittance: f64) -> f64 {
        let (zeta, steps) = (1.0 / admittance, 200_000);
        let term = |i: usize| {
            let mu = (i as f64 + 0.5) / f64::from(steps);
            2.0 * mu * 4.0 * zeta * mu / (zeta * mu + 1.0).powi(2)
        };
        (0..steps as usize).map(term).sum::<f64>() / f64::from(steps)
    }

    #[test]
    fn the_closed_form_is_the_integral() {
        for admittance in [1e-4, 9.99e-4, 1.001e-3, 0.01, 0.1, 0.638, 1.0, 3.0] {
            let (found, expected) = (absorption_of_admittance(admittance), integrated(admittance));
            assert!((found / expected - 1.0).abs() < 2e-5, "{admittance}: {found} != {expected}");
        }
    }

    #[test]
    fn the_inverse_leads_back_and_stops_at_the_most_that_can_be_absorbed() {
        for percent in 0..95 {
            let absorption = 0.01 * f64::from(percent);
            let back = absorption_of_admittance(admittance_of_absorption(absorption));
            assert!((back - absorption).abs() < 1e-12, "{absorption}: {back}");
        }
        let most = absorption_of_admittance(admittance_of_absorption(1.0));
        assert!((most - 0.951).abs() < 5e-4, "{most}");
    }
}
