//! Attenuation by droplets.
//!
//! S. Temkin and R. A. Dobbins, JASA 40 (1966) 317: droplets lag behind the air and behind its temperature, each with a relaxation time of its
//! own. To the first order in their mass, the attenuation per wavelength is pi m (x / (1 + x^2) + (gamma - 1) (c' / c_p) y / (1 + y^2)), x and y
//! being the angular frequency times the two relaxation times. Evaporation is left out.

use super::hidden::Hidden;
use super::truth::Truth;
use sabine_acoustics::{Error, OutOfRange};
use std::f64::consts::TAU;

/// Of air at 20 C: density in kg/m3, viscosity in Pa s, heat conductivity in W/(m K), heat capacity in J/(kg K), ratio of heat capacities.
const AIR_KG_M3: f64 = 1.204;
const VISCOSITY_PA_S: f64 = 1.81e-5;
const CONDUCTIVITY_W_M_K: f64 = 0.0257;
const AIR_J_KG_K: f64 = 1005.0;
const GAMMA: f64 = 1.4;
/// Of water: density in kg/m3, heat capacity in J/(kg K).
const WATER_KG_M3: f64 = 998.0;
const WATER_J_KG_K: f64 = 4184.0;

/// Relaxation times of velocity and of temperature, in seconds.
fn relaxation_s(radius_um: f64) -> [f64; 2] {
    let square_m2 = (1e-6 * radius_um).powi(2);
    [
        2.0 * WATER_KG_M3 * square_m2 / (9.0 * VISCOSITY_PA_S),
        WATER_KG_M3 * WATER_J_KG_K * square_m2 / (3.0 * CONDUCTIVITY_W_M_K),
    ]
}

/// Mass of the water over that of the air, and the same weighed by how much more heat water holds.
fn loads(water_g_m3: f64) -> [f64; 2] {
    let mass = 1e-3 * water_g_m3 / AIR_KG_M3;
    [mass, mass * (GAMMA - 1.0) * WATER_J_KG_K / AIR_J_KG_K]
}

/// What all fog in the room adds to the energy attenuation exponent, in 1/m.
pub(crate) fn energy_exponent_per_m(truth: &Truth, speed_m_s: f64, hz: f64) -> f64 {
    let of_one = |effect: &Hidden| match effect {
        Hidden::Fog { water_g_m3, radius_um } => exponent_per_m((*water_g_m3, *radius_um), speed_m_s, hz),
        _ => 0.0,
    };
    truth.effects.iter().map(of_one).sum()
}

fn exponent_per_m((water_g_m3, radius_um): (f64, f64), speed_m_s: f64, hz: f64) -> f64 {
    let lag = |(load, relaxation_s): (f64, f64)| {
        let x = TAU * hz * relaxation_s;
        load * x / (1.0 + x * x)
    };
    // Of the pressure: half an angular wavenumber times the lags; of the energy twice that.
    let lags: f64 = loads(water_g_m3).into_iter().zip(relaxation_s(radius_um)).map(lag).sum();
    TAU * hz / speed_m_s * lags
}

/// Refuses fog that no air holds.
pub(crate) fn check(water_g_m3: f64, radius_um: f64) -> Result<(), Error> {
    OutOfRange::check("water of the fog (g/m3)", water_g_m3, 0.0, 20.0, "between 0 and 20 g/m3")?;
    Ok(OutOfRange::check("radius of droplets (um)", radius_um, 0.5, 100.0, "between 0.5 and 100 um")?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Imaginary part of the root of `re + i im`, the root's real part positive.
    fn imaginary_of_root(re: f64, im: f64) -> f64 {
        im.signum() * (0.5 * (re.hypot(im) - re)).sqrt()
    }

    #[test]
    fn attenuation_is_that_of_the_complex_wavenumber() {
        // (k c / omega)^2 = 1 + load / (1 - i x) + ... from the motion and the heat of the droplets, thin fog.
        let (water, radius, speed) = (0.01, 5.0, 343.0);
        let ([mass, heat], [tau_v, tau_t]) = (loads(water), relaxation_s(radius));
        for hz in [60.0, 500.0, 4000.0] {
            let (x, y) = (TAU * hz * tau_v, TAU * hz * tau_t);
            let re = 1.0 + mass / (1.0 + x * x) + heat / (1.0 + y * y);
            let im = mass * x / (1.0 + x * x) + heat * y / (1.0 + y * y);
            let expected = 2.0 * TAU * hz / speed * imaginary_of_root(re, im);
            let found = exponent_per_m((water, radius), speed, hz);
            assert!((found / expected - 1.0).abs() < 1e-4, "{hz} Hz: {found} for {expected}");
        }
    }

    #[test]
    fn it_rises_as_the_square_and_then_stays() {
        let at = |hz: f64| exponent_per_m((1.0, 5.0), 343.0, hz);
        assert!((at(2.0) / at(1.0) - 4.0).abs() < 1e-3);
        // Far above both relaxations: (load / tau + ...) / c.
        let limit: f64 = loads(1.0).into_iter().zip(relaxation_s(5.0)).map(|(load, tau)| load / tau).sum();
        assert!((at(1e6) * 343.0 / limit - 1.0).abs() < 1e-4);
    }
}
