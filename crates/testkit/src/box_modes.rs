//! Standing waves in a box whose walls have an impedance: exact, one frequency at a time.

use crate::geometry::Vec3;
use realfft::num_complex::Complex;
use std::f64::consts::PI;

type Complex64 = Complex<f64>;

/// What is left of the slowest of the terms that are not summed.
const LEFT_OUT: f64 = 1e-10;
/// Change of k (beta_0 + beta_L) L in which an eigenvalue is followed from the rigid wall's, in radians.
const FOLLOWED: f64 = 0.5;
/// Rounds of Newton's method ...
const ROUNDS: usize = 50;
/// ... and the relative change at which it is done.
const DONE: f64 = 1e-13;
/// Steps of the midpoint rule in Paris' integral.
const PARIS_STEPS: usize = 4000;

/// The sound of a point source in a box with one corner at the origin, its walls locally reacting with a real specific admittance
/// each (air's rho c over the wall's impedance), in the order x = 0, x = length, y = 0, y = width, z = 0, z = height.
///
/// The wave equation separates: eigenfunctions cos(q x) + (j k beta / q) sin(q x) along two axes, with complex q from
/// (q^2 + k^2 beta_0 beta_L) sin(q L) = j k (beta_0 + beta_L) q cos(q L), and the closed Green's function along the third,
/// that on which source and receiver are farthest apart: the sum converges as exp(-q times that distance). Nothing is taken
/// to be small (Morse and Ingard, Theoretical Acoustics, section 9.4; Kuttruff, Room Acoustics, section 3.3).
#[derive(Clone, Copy, Debug)]
pub struct BoxModes {
    size_m: Vec3,
    admittances: [f64; 6],
    speed_m_s: f64,
    loss_per_m: f64,
    left_out: f64,
}

impl BoxModes {
    /// A box with sides, admittances (0 to 0.7) and speed of sound.
    ///
    /// # Panics
    /// If an admittance is outside its range.
    pub fn new(size_m: Vec3, admittances: [f64; 6], speed_m_s: f64) -> Self {
        assert!(admittances.iter().all(|b| (0.0..=0.7).contains(b)), "{admittances:?}");
        Self { size_m, admittances, speed_m_s, loss_per_m: 0.0, left_out: LEFT_OUT }
    }

    /// The same box with air in which the pressure falls as exp(-loss distance), in 1/m.
    #[must_use]
    pub fn with_air_loss(self, loss_per_m: f64) -> Self {
        Self { loss_per_m, ..self }
    }

    /// The same box, summed until the slowest of the terms left out has fallen to this share (1e-10 otherwise).
    #[must_use]
    pub fn summed_to(self, left_out: f64) -> Self {
        Self { left_out, ..self }
    }

    /// Random-incidence absorption of a locally reacting wall (Paris 1928), by the midpoint rule over the cosine of
    /// incidence.
    pub fn absorption(admittance: f64) -> f64 {
        let term = |i: usize| {
            let cosine = (i as f64 + 0.5) / PARIS_STEPS as f64;
            let reflected = (cosine - admittance) / (cosine + admittance);
            2.0 * cosine * (1.0 - reflected * reflected)
        };
        (0..PARIS_STEPS).map(term).sum::<f64>() / PARIS_STEPS as f64
    }

    /// The admittance with this random-incidence absorption (0 to 0.9), by the secant method.
    ///
    /// # Panics
    /// If the absorption is outside its range.
    pub fn admittance(absorption: f64) -> f64 {
        assert!((0.0..=0.9).contains(&absorption), "{absorption}");
        let (mut a, mut b) = (0.0, absorption / 8.0);
        let (mut at_a, mut at_b) = (-absorption, Self::absorption(b) - absorption);
        for _ in 0..ROUNDS {
            if (at_b - at_a).abs() < DONE {
                break;
            }
            let next = b - at_b * (b - a) / (at_b - at_a);
            (a, at_a) = (b, at_b);
            (b, at_b) = (next, Self::absorption(next) - absorption);
        }
        b
    }

    /// Frequencies of the rigid box up to a limit, with the numbers of half waves along its sides; rising.
    pub fn rigid_modes_hz(&self, limit_hz: f64) -> Vec<(f64, [u32; 3])> {
        let most = self.size_m.map(|side| (2.0 * limit_hz * side / self.speed_m_s) as u32);
        let mut modes = Vec::new();
        for x in 0..=most[0] {
            for y in 0..=most[1] {
                for z in 0..=most[2] {
                    let n = [x, y, z];
                    let square: f64 = (0..3).map(|a| (f64::from(n[a]) / self.size_m[a]).powi(2)).sum();
                    let hz = 0.5 * self.speed_m_s * square.sqrt();
                    if hz > 0.0 && hz <= limit_hz {
                        modes.push((hz, n));
                    }
                }
            }
        }
        modes.sort_by(|a, b| a.0.total_cmp(&b.0));
        modes
    }

    /// The complex frequency of a mode: oscillation in Hz, and decay of its amplitude in 1/s. The eigenvalues depend on the
    /// frequency, which is found in turn.
    pub fn mode(&self, n: [u32; 3]) -> (f64, f64) {
        let square: f64 = (0..3).map(|a| (f64::from(n[a]) / self.size_m[a]).powi(2)).sum();
        let mut k = Complex64::new(PI * square.sqrt(), 0.0);
        for _ in 0..ROUNDS {
            let sum: Complex64 = (0..3).map(|a| self.eigenvalue(a, n[a], k).powi(2)).sum();
            k = sum.sqrt();
        }
        // Time runs as exp(j k c t).
        (k.re * self.speed_m_s / (2.0 * PI), k.im * self.speed_m_s)
    }

    /// Pressure between two points at a frequency, 1 = direct sound at 1 m; time runs as exp(+ j omega t).
    ///
    /// # Panics
    /// If the points are less than 20 cm apart along every axis: too many terms.
    pub fn pressure(&self, source_m: Vec3, receiver_m: Vec3, hz: f64) -> (f64, f64) {
        let k = Complex64::new(2.0 * PI * hz / self.speed_m_s, -self.loss_per_m);
        let apart = |a: usize| (source_m[a] - receiver_m[a]).abs();
        let third = (0..3).max_by(|&a, &b| apart(a).total_cmp(&apart(b))).unwrap_or(0);
        self.pressure_along(third, source_m, receiver_m, k)
    }

    /// The same with the closed function along a given axis.
    fn pressure_along(&self, third: usize, source_m: Vec3, receiver_m: Vec3, k: Complex64) -> (f64, f64) {
        let apart = (source_m[third] - receiver_m[third]).abs();
        assert!(apart > 0.2, "{source_m:?} and {receiver_m:?} are too near");
        let (first, second) = ((third + 1) % 3, (third + 2) % 3);
        // exp(-sqrt(q^2 - k^2) distance) is the tail.
        let most_per_m = (k.norm_sqr() + (self.left_out.ln() / apart).powi(2)).sqrt();
        let along = |a: usize| self.terms(a, source_m[a], receiver_m[a], k, most_per_m);
        let (along_first, along_second) = (along(first), along(second));
        let mut sum = Complex64::default();
        for (q, f) in &along_first {
            for (r, g) in &along_second {
                if q.re.hypot(r.re) < most_per_m {
                    let rest = (k * k - q * q - r * r).sqrt();
                    sum += f * g * self.closed(third, source_m[third], receiver_m[third], k, rest);
                }
            }
        }
        (4.0 * PI * sum.re, 4.0 * PI * sum.im)
    }

    /// q, and the product of the eigenfunction at both points over its norm, up to q = `most_per_m`.
    fn terms(
        &self,
        axis: usize,
        x: f64,
        y: f64,
        k: Complex64,
        most_per_m: f64,
    ) -> Vec<(Complex64, Complex64)> {
        let side = self.size_m[axis];
        let count = (most_per_m * side / PI) as u32 + 1;
        (0..count)
            .map(|n| {
                let q = self.eigenvalue(axis, n, k);
                let at_wall = Complex64::i() * k * self.admittances[2 * axis];
                if q.norm() < 1e-9 {
                    return (q, Complex64::new(1.0 / side, 0.0));
                }
                let a = at_wall / q;
                let value = |x: f64| (q * x).cos() + a * (q * x).sin();
                let norm = 0.5 * side * (1.0 + a * a)
                    + (2.0 * q * side).sin() / (4.0 * q) * (1.0 - a * a)
                    + a * (q * side).sin().powi(2) / q;
                (q, value(x) * value(y) / norm)
            })
            .collect()
    }

    /// Eigenvalue n along an axis, by Newton's method: followed from that of rigid walls while the admittances grow, so that no two
    /// of them end in the same place.
    fn eigenvalue(&self, axis: usize, n: u32, k: Complex64) -> Complex64 {
        let side = self.size_m[axis];
        let [b0, b1] = [self.admittances[2 * axis], self.admittances[2 * axis + 1]];
        let rigid = PI * f64::from(n) / side;
        if b0 + b1 == 0.0 {
            return rigid.into();
        }
        let size = (k * (b0 + b1) * side).norm() / f64::from(n.max(1));
        let steps = (size / FOLLOWED).ceil().max(1.0) as u32;
        let mut q = Complex64::from(rigid);
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            let sum = Complex64::i() * k * (b0 + b1) * share;
            let product = k * k * b0 * b1 * share * share;
            if step == 1 {
                q = (rigid * rigid + if n == 0 { 1.0 } else { 2.0 } * sum / side).sqrt();
            }
            for _ in 0..ROUNDS {
                let (sine, cosine) = ((q * side).sin(), (q * side).cos());
                // Divided by q, which is a root of no interest.
                let value = (q + product / q) * sine - sum * cosine;
                let slope =
                    (1.0 - product / (q * q)) * sine + (q + product / q) * side * cosine + sum * side * sine;
                let change = value / slope;
                q -= change;
                if change.norm() < DONE * q.norm() {
                    break;
                }
            }
        }
        // Soft walls would have it one place higher.
        assert!((q.re - rigid).abs() < 1.1 * PI / side, "eigenvalue {n} went to {q} from {rigid}");
        q
    }

    /// The Green's function of g'' + r^2 g = -delta with the walls of an axis.
    fn closed(&self, axis: usize, x: f64, y: f64, k: Complex64, r: Complex64) -> Complex64 {
        let side = self.size_m[axis];
        let wall = |end: usize| Complex64::i() * k * self.admittances[2 * axis + end];
        let from_wall = |end: usize, at: f64| (r * at).cos() + wall(end) * (r * at).sin() / r;
        let (low, high) = (x.min(y), x.max(y));
        let slope = r * (r * side).sin() - wall(1) * (r * side).cos();
        let wronskian = slope - wall(0) * from_wall(1, side);
        -from_wall(0, low) * from_wall(1, side - high) / wronskian
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whichever axis is not expanded, the sum is the same: an eigenvalue that is missing or counted twice would show.
    #[test]
    fn all_axes_give_the_same_pressure_between_soft_walls() {
        let walls = BoxModes::new([7.3, 4.9, 2.9], [0.12, 0.03, 0.3, 0.02, 0.2, 0.05], 343.2);
        let (source, receiver) = ([1.1, 1.3, 0.7], [5.2, 3.4, 1.9]);
        for hz in [35.0, 110.0, 190.0, 260.0, 390.0] {
            let k = Complex64::new(2.0 * PI * hz / walls.speed_m_s, -0.002);
            let all = [0, 1, 2].map(|axis| walls.pressure_along(axis, source, receiver, k));
            let size = all[0].0.hypot(all[0].1);
            for other in &all[1..] {
                let off = (other.0 - all[0].0).hypot(other.1 - all[0].1);
                assert!(off < 1e-6 * size, "{hz} Hz: {all:?}");
            }
        }
    }
}
