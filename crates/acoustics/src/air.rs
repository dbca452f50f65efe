//! The air between the walls.

use crate::bands::Bands;
use crate::error::Error;
use crate::out_of_range::OutOfRange;
use crate::per_band::PerBand;

/// Triple-point temperature of water, K (ISO 9613-1, 6.2 and Annex B).
const TRIPLE_POINT_K: f64 = 273.16;
/// Reference temperature, K (ISO 9613-1, 6.2).
const REFERENCE_K: f64 = 293.15;
/// Reference pressure, kPa (ISO 9613-1, 6.2).
const REFERENCE_KPA: f64 = 101.325;

/// State of the air: it sets the speed of sound and the attenuation over distance.
///
/// ```
/// use sabine_acoustics::Air;
/// let air = Air::new(20.0, 50.0, 101.325)?;
/// assert!((air.speed_of_sound_m_s() - 343.2).abs() < 0.1);
/// // ISO 9613-1: 4.66 dB/km at 1 kHz.
/// assert!((1e3 * air.attenuation_db_per_m(1000.0) - 4.66).abs() < 0.02);
/// // Air alone caps the reverberation time at 8 kHz at 1.66 s.
/// assert!((air.t60_limit_s(8000.0) - 1.66).abs() < 0.01);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    temperature_c: f64,
    relative_humidity_percent: f64,
    pressure_kpa: f64,
}

impl Default for Air {
    /// 20 C, 50 %, 101.325 kPa.
    fn default() -> Self {
        Self { temperature_c: 20.0, relative_humidity_percent: 50.0, pressure_kpa: REFERENCE_KPA }
    }
}

impl Air {
    /// Air at a temperature (-20..=50 C), relative humidity (0..=100 %) and pressure (50..=200 kPa): the range in which
    /// ISO 9613-1 states its accuracy for the temperature, and rooms for the rest.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] outside these ranges.
    pub fn new(temperature_c: f64, relative_humidity_percent: f64, pressure_kpa: f64) -> Result<Self, Error> {
        OutOfRange::check("temperature_c", temperature_c, -20.0, 50.0, "between -20 and 50 C")?;
        OutOfRange::check(
            "relative_humidity_percent",
            relative_humidity_percent,
            0.0,
            100.0,
            "between 0 and 100 %",
        )?;
        OutOfRange::check("pressure_kpa", pressure_kpa, 50.0, 200.0, "between 50 and 200 kPa")?;
        Ok(Self { temperature_c, relative_humidity_percent, pressure_kpa })
    }

    /// Temperature in degrees Celsius.
    pub fn temperature_c(&self) -> f64 {
        self.temperature_c
    }

    /// Relative humidity in percent.
    pub fn relative_humidity_percent(&self) -> f64 {
        self.relative_humidity_percent
    }

    /// Static pressure in kilopascal.
    pub fn pressure_kpa(&self) -> f64 {
        self.pressure_kpa
    }

    /// Speed of sound in m/s (ISO 9613-1, Annex A).
    pub fn speed_of_sound_m_s(&self) -> f64 {
        343.2 * (self.kelvin() / REFERENCE_K).sqrt()
    }

    /// Pure-tone attenuation in dB/m (ISO 9613-1, equations 3 to 5, B.1 to B.3).
    pub fn attenuation_db_per_m(&self, frequency_hz: f64) -> f64 {
        let kelvin = self.kelvin();
        let warmth = kelvin / REFERENCE_K;
        let pressure = self.pressure_kpa / REFERENCE_KPA;
        let saturation = 10f64.powf(-6.8346 * (TRIPLE_POINT_K / kelvin).powf(1.261) + 4.6151);
        let molar_percent = self.relative_humidity_percent * saturation / pressure;
        let oxygen_hz =
            pressure * (24.0 + 4.04e4 * molar_percent * (0.02 + molar_percent) / (0.391 + molar_percent));
        let nitrogen_hz = pressure
            * warmth.powf(-0.5)
            * (9.0 + 280.0 * molar_percent * (-4.170 * (warmth.powf(-1.0 / 3.0) - 1.0)).exp());
        let f2 = frequency_hz * frequency_hz;
        let classical = 1.84e-11 / pressure * warmth.sqrt();
        let oxygen = 0.01275 * (-2239.1 / kelvin).exp() / (oxygen_hz + f2 / oxygen_hz);
        let nitrogen = 0.1068 * (-3352.0 / kelvin).exp() / (nitrogen_hz + f2 / nitrogen_hz);
        8.686 * f2 * (classical + warmth.powf(-2.5) * (oxygen + nitrogen))
    }

    /// Energy attenuation exponent m in 1/m at the exact centre of each band: energy falls as exp(-m distance).
    pub fn energy_exponent_per_m(&self, bands: Bands) -> PerBand<f64> {
        PerBand::from_fn(bands, |i| {
            self.attenuation_db_per_m(bands.exact_hz(i)) * std::f64::consts::LN_10 / 10.0
        })
    }

    /// The longest reverberation time that the air permits at a frequency, in seconds: walls that absorb nothing.
    pub fn t60_limit_s(&self, frequency_hz: f64) -> f64 {
        60.0 / (self.attenuation_db_per_m(frequency_hz) * self.speed_of_sound_m_s())
    }

    fn kelvin(&self) -> f64 {
        self.temperature_c + 273.15
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pure tones at the nominal frequencies 125 Hz to 16 kHz, in dB/km, as widely reprinted. The tables of ISO 9613-1 itself
    /// hold for the exact mid-band frequencies, where 8 and 16 kHz come out 1.3 and 1.6 % lower: `tests/it/air_reference.rs`.
    #[test]
    fn attenuation_meets_the_reprinted_table() {
        let table = [
            (20.0, 50.0, [0.44, 1.31, 2.73, 4.66, 9.89, 29.7, 105.0, 365.0]),
            (20.0, 20.0, [0.71, 1.39, 2.59, 6.53, 21.6, 74.7, 217.0, 435.0]),
            (10.0, 50.0, [0.48, 1.05, 1.89, 4.26, 13.3, 47.1, 157.0, 397.0]),
        ];
        let bands = Bands::octaves(125.0, 16000.0).unwrap();
        for (temperature, humidity, row) in table {
            let air = Air::new(temperature, humidity, 101.325).unwrap();
            for (i, &expected) in row.iter().enumerate() {
                let found = 1e3 * air.attenuation_db_per_m(bands.nominal_hz(i));
                let printed = 0.0051_f64.max(0.005 * expected); // half a unit of the last printed digit
                assert!(
                    (found - expected).abs() < printed,
                    "{temperature} C {humidity} %: {found} != {expected}"
                );
            }
        }
    }

    #[test]
    fn absurd_air_is_refused() {
        assert!(Air::new(f64::NAN, 50.0, 101.325).is_err());
        assert!(Air::new(20.0, 101.0, 101.325).is_err());
        assert!(Air::new(20.0, 50.0, 0.0).is_err());
    }
}
