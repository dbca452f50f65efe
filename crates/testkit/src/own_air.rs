//! Attenuation in air, written a second time.

use sabine_acoustics::Air;

/// Energy attenuation exponent in 1/m, after Bass et al. 1995 (JASA 97, 680), which ISO 9613-1 follows.
pub(crate) fn energy_exponent_per_m(air: &Air, frequency_hz: f64) -> f64 {
    let t = air.temperature_c() + 273.15;
    let ratio = t / 293.15;
    let atmospheres = air.pressure_kpa() / 101.325;
    // Saturation pressure over water, in atmospheres.
    let saturation = 10f64.powf(4.6151 - 6.8346 * (273.16 / t).powf(1.261));
    let h = air.relative_humidity_percent() * saturation / atmospheres;
    let oxygen = atmospheres * (24.0 + 40_400.0 * h * (0.02 + h) / (0.391 + h));
    let nitrogen =
        atmospheres / ratio.sqrt() * (9.0 + 280.0 * h * (4.17 * (1.0 - ratio.cbrt().recip())).exp());
    // Each relaxation is strongest, per wavelength, where the frequency meets it.
    let relaxation = |strength: f64, vibration_k: f64, f_r: f64| {
        strength * (-vibration_k / t).exp() * f_r / (f_r * f_r + frequency_hz * frequency_hz)
    };
    let sum = relaxation(0.01275, 2239.1, oxygen) + relaxation(0.1068, 3352.0, nitrogen);
    let nepers = frequency_hz
        * frequency_hz
        * (1.84e-11 * ratio.sqrt() / atmospheres + sum / (ratio * ratio * ratio.sqrt()));
    2.0 * nepers
}

/// Speed of sound in m/s: dry air, ideal gas.
pub(crate) fn speed_of_sound_m_s(air: &Air) -> f64 {
    343.2 * ((air.temperature_c() + 273.15) / 293.15).sqrt()
}
