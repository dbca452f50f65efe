//! Air that is warmer the higher it is.
//!
//! The temperature rises evenly from floor to ceiling; a path takes the integral of one over the speed along its straight, unfolded line. That
//! rays bend changes a travel time by the square of the gradient only (Fermat), and the attenuation stays that of the stated temperature.

use super::hidden::Hidden;
use super::truth::Truth;
use sabine_acoustics::{Air, Error, OutOfRange};

/// Speed of sound at 20 C in m/s, and that temperature in K.
const SPEED_M_S: f64 = 343.2;
const AT_K: f64 = 293.15;
const ZERO_K: f64 = 273.15;

/// Temperatures of a room by height.
pub(crate) struct LayeredAir {
    /// At the floor, in K.
    floor_k: f64,
    k_per_m: f64,
    height_m: f64,
}

impl LayeredAir {
    /// None unless the air is layered.
    pub(crate) fn of(truth: &Truth) -> Option<Self> {
        let mut floor_k = truth.temperature_c + ZERO_K;
        let mut sum = 0.0;
        for effect in &truth.effects {
            if let Hidden::TemperatureGradient { k_per_m, stated_at_m } = effect {
                floor_k -= k_per_m * stated_at_m;
                sum += k_per_m;
            }
        }
        (sum != 0.0).then(|| Self { floor_k, k_per_m: sum, height_m: truth.size_m[2] })
    }

    /// Seconds that sound needs for a vertical metre of a path, from the floor to a height, all summed: the integral of one over the speed.
    fn summed_s(&self, height_m: f64) -> f64 {
        let root = |kelvin: f64| kelvin.sqrt();
        let rise = root(self.floor_k + self.k_per_m * height_m) - root(self.floor_k);
        2.0 * AT_K.sqrt() * rise / (SPEED_M_S * self.k_per_m)
    }

    /// The same beyond floor and ceiling, in the mirrored rooms.
    fn unfolded_s(&self, height_m: f64) -> f64 {
        let storey = (height_m / self.height_m).floor();
        let within_m = height_m - storey * self.height_m;
        let whole_s = self.summed_s(self.height_m);
        // Every second room stands on its head.
        let part_s = if storey.rem_euclid(2.0) == 0.0 {
            self.summed_s(within_m)
        } else {
            whole_s - self.summed_s(self.height_m - within_m)
        };
        storey * whole_s + part_s
    }

    /// How long a path takes in seconds: its length, the height at which it is heard, and how much higher its image is, all in metres.
    pub(crate) fn time_s(&self, length_m: f64, heard_m: f64, rise_m: f64) -> f64 {
        // A level path: the difference of the integral has no digits left.
        if rise_m.abs() < 1e-6 {
            return length_m * (AT_K / (self.floor_k + self.k_per_m * heard_m)).sqrt() / SPEED_M_S;
        }
        length_m * (self.unfolded_s(heard_m + rise_m) - self.unfolded_s(heard_m)) / rise_m
    }
}

/// Refuses what is no air.
pub(crate) fn check(truth: &Truth, k_per_m: f64, stated_at_m: f64) -> Result<(), Error> {
    OutOfRange::check("temperature gradient (K/m)", k_per_m, -10.0, 10.0, "within 10 K/m")?;
    OutOfRange::check("height of the thermometer (m)", stated_at_m, 0.0, truth.size_m[2], "within the room")?;
    for height_m in [0.0, truth.size_m[2]] {
        let celsius = truth.temperature_c + k_per_m * (height_m - stated_at_m);
        Air::new(celsius, truth.relative_humidity_percent, truth.pressure_kpa)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_takes_the_sum_of_its_steps() {
        let air = LayeredAir { floor_k: 290.0, k_per_m: 4.0, height_m: 3.0 };
        for (length_m, heard_m, rise_m) in
            [(5.0, 1.2, 0.7), (9.0, 2.0, -3.1), (30.0, 0.8, 17.0), (4.0, 1.5, 0.0)]
        {
            let steps = 20_000;
            let step_s = |i: i32| {
                let mut height = heard_m + rise_m * (f64::from(i) + 0.5) / f64::from(steps);
                // Reflected at floor and ceiling until it is inside.
                while !(0.0..=3.0).contains(&height) {
                    height = if height < 0.0 { -height } else { 6.0 - height };
                }
                length_m / f64::from(steps) / (20.0449 * (290.0 + 4.0 * height).sqrt())
            };
            let expected: f64 = (0..steps).map(step_s).sum();
            let found = air.time_s(length_m, heard_m, rise_m);
            assert!((found / expected - 1.0).abs() < 1e-5, "{length_m} m: {found} for {expected}");
        }
    }

    #[test]
    fn a_level_path_takes_as_long_as_in_even_air() {
        let air = LayeredAir { floor_k: 289.15, k_per_m: 2.0, height_m: 3.0 };
        // At 2 m it has 20 C.
        assert!((air.time_s(3.432, 2.0, 0.0) - 0.01).abs() < 1e-12);
        assert!((air.time_s(3.432, 2.0, 1e-3) - 0.01).abs() < 1e-7);
    }
}
