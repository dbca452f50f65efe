//! What is known about diffraction by an edge without ends, from theories that share nothing with the integral over the edge.

use realfft::num_complex::Complex;
use std::f64::consts::{FRAC_PI_4, PI};

/// Distance from the edge, angle from one face (rad), position along the edge.
pub type Cylindrical = [f64; 3];

/// Energy of the total field of a point source and a rigid half plane (angles 0 and two pi), relative to a free path of the
/// length that goes over the edge: Macdonald 1915, in the form of Bowman, Senior and Uslenghi 1969, section 8.3 (time factor
/// exp(-j w t)): incident and reflected field each i k int_{-m}^inf H1(s2 + kR) / sqrt(s2 + 2kR) ds, with
/// m = +-sqrt(k (D - R)), where R is the distance from the source or its mirror image and D the way over the edge.
pub fn half_plane(wave_number_per_m: f64, source: Cylindrical, receiver: Cylindrical) -> f64 {
    let k = wave_number_per_m;
    let [r_s, t_s, z_s] = source;
    let [r_r, t_r, z_r] = receiver;
    let over_m = (r_s + r_r).hypot(z_s - z_r);
    let term = |angle: f64| {
        let square = r_s * r_s + r_r * r_r - 2.0 * r_s * r_r * angle.cos() + (z_s - z_r).powi(2);
        let distance = square.sqrt();
        let m = (0.5 * angle).cos().signum() * (k * (over_m - distance)).sqrt();
        let from = -m;
        let integrand = |s: f64| hankel_1(s * s + k * distance) / (s * s + 2.0 * k * distance).sqrt();
        // Cut at 80, what is left by its leading term f(s) j / 2s; at least eight points in each turn of exp(j s2).
        let steps = (((80.0 - from) / 0.004) as usize).div_ceil(2) * 2;
        let step = (80.0 - from) / steps as f64;
        let simpson = |i: usize| if i == 0 || i == steps { 1.0 } else { 2.0 + 2.0 * (i % 2) as f64 };
        let sum: Complex<f64> = (0..=steps).map(|i| integrand(from + i as f64 * step) * simpson(i)).sum();
        let rest = integrand(80.0) * Complex::new(0.0, 1.0 / 160.0);
        Complex::new(0.0, k) * (sum * (step / 3.0) + rest)
    };
    (term(t_r - t_s) + term(t_r + t_s)).norm_sqr() * over_m * over_m
}

/// Hankel function of the first kind and order one: Abramowitz and Stegun 1964, 9.4.4 to 9.4.6 (1e-7).
fn hankel_1(x: f64) -> Complex<f64> {
    let polynomial = |at: f64, c: [f64; 7]| c.iter().rev().fold(0.0, |sum, c| sum * at + c);
    if x < 3.0 {
        let t = (x / 3.0).powi(2);
        let c = [0.5, -0.56249985, 0.21093573, -0.03954289, 0.00443319, -0.00031761, 0.00001109];
        let j = x * polynomial(t, c);
        let c = [-2.0 / PI, 0.2212091, 2.1682709, -1.3164827, 0.3123951, -0.0400976, 0.0027873];
        Complex::new(j, 2.0 / PI * (0.5 * x).ln() * j + polynomial(t, c) / x)
    } else {
        let u = 3.0 / x;
        let c = [0.79788456, 0.00000156, 0.01659667, 0.00017105, -0.00249511, 0.00113653, -0.00020033];
        let modulus = polynomial(u, c) / x.sqrt();
        let c = [-2.35619449, 0.12499612, 0.00005650, -0.00637879, 0.00074348, 0.00079824, -0.00029166];
        Complex::from_polar(modulus, x + polynomial(u, c))
    }
}

/// The same for a rigid wedge whose air opens by n pi, at grazing distances well above the wavelength: uniform theory of
/// diffraction, Kouyoumjian and Pathak 1974, equations 25 to 33. The diffracted field alone: what there is in the shadow.
pub fn uniform_theory(wave_number_per_m: f64, n: f64, source: Cylindrical, receiver: Cylindrical) -> f64 {
    let k = wave_number_per_m;
    let along_m = source[2] - receiver[2];
    let over_m = (source[0] + receiver[0]).hypot(along_m);
    let sine = (source[0] + receiver[0]) / over_m;
    let (s_in, s_out) = (source[0] / sine, receiver[0] / sine);
    let distance = s_in * s_out / (s_in + s_out) * sine * sine;
    let term = |angle: f64, sign: f64| {
        let turns = ((angle + sign * PI) / (2.0 * PI * n)).round();
        let a = 2.0 * (0.5 * (2.0 * PI * n * turns - angle)).cos().powi(2);
        transition(k * distance * a) / ((PI + sign * angle) / (2.0 * n)).tan()
    };
    let (minus, plus) = (receiver[1] - source[1], receiver[1] + source[1]);
    let sum = term(minus, 1.0) + term(minus, -1.0) + term(plus, 1.0) + term(plus, -1.0);
    let coefficient = sum.norm() / (2.0 * n * (2.0 * PI * k).sqrt() * sine);
    coefficient * coefficient * (s_in + s_out) / (s_in * s_out)
}

/// Equation 30, the path of integration turned by -45 degrees, where the integrand falls as a Gaussian.
fn transition(x: f64) -> Complex<f64> {
    let turned = Complex::from_polar(1.0, -FRAC_PI_4);
    let (steps, step) = (6_000, 1e-3);
    let integrand = |t: f64| (-t * t - Complex::i() * 2.0 * x.sqrt() * t * turned).exp();
    let sum: Complex<f64> = (0..steps).map(|i| integrand((i as f64 + 0.5) * step)).sum();
    2.0 * Complex::i() * x.sqrt() * turned * sum * step
}

/// Attenuation of a screen relative to the free direct path, in dB: Kurze and Anderson 1971, fitted to Maekawa's chart (1968).
pub fn kurze_anderson_db(fresnel_number: f64) -> f64 {
    let x = (2.0 * PI * fresnel_number).sqrt();
    5.0 + 20.0 * (x / x.tanh()).log10()
}
