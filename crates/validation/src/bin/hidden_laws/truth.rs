//! What a hidden law does to a level, in closed form: written once more, apart from the laboratory.

use sabine_testkit::Hidden;
use std::f64::consts::{LN_10, PI, TAU};

/// Speed of sound in m/s at which lengths are times.
const SPEED_M_S: f64 = 343.2;
/// Time of the direct sound in a room of usual size, in seconds.
const DIRECT_S: f64 = 0.01;
/// Frequencies at which a mean over an octave is taken.
const IN_OCTAVE: i32 = 32;

/// Values of what laws go with, at random or chosen.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub frequency_hz: f64,
    /// At a meeting with the surface.
    pub cos_incidence: f64,
    /// Of a path.
    pub length_m: f64,
    pub arrival_cos: f64,
    pub departure_elevation_deg: f64,
    /// Of a response.
    pub recording_order: f64,
}

impl Point {
    /// Value of a variable of a formula; none for one that the hidden laws do not go with.
    pub fn variable(&self, name: &str) -> Option<f64> {
        let time_s = self.length_m / SPEED_M_S;
        Some(match name {
            "frequency_hz" => self.frequency_hz,
            "cos_incidence" => self.cos_incidence,
            "length_m" => self.length_m,
            "time_s" | "file_time_s" => time_s,
            "time_after_direct_s" => time_s - DIRECT_S,
            "arrival_cos" => self.arrival_cos,
            "departure_elevation_deg" => self.departure_elevation_deg,
            "recording_order" => self.recording_order,
            _ => return None,
        })
    }
}

fn db(energy: f64) -> f64 {
    10.0 * energy.log10()
}

/// Mean over an octave about a frequency, by its logarithm.
fn mean_of_octave(centre_hz: f64, value: impl Fn(f64) -> f64) -> f64 {
    let at = |i: i32| value(centre_hz * 2f64.powf((f64::from(i) + 0.5) / f64::from(IN_OCTAVE) - 0.5));
    (0..IN_OCTAVE).map(at).sum::<f64>() / f64::from(IN_OCTAVE)
}

/// What a law does in dB at a point; `band` is the number of its octave. None for a law of no level.
pub fn level_db(hidden: &Hidden, at: &Point, band: usize) -> Option<f64> {
    let (hz, cosine) = (at.frequency_hz, at.cos_incidence);
    let grazing = (1.0 - cosine).powi(2);
    Some(match hidden {
        Hidden::GrazingAbsorption { db, from_hz, .. } if hz < 0.99 * from_hz => 0.0 * db,
        Hidden::GrazingAbsorption { db, .. } => -db * grazing,
        Hidden::SeatDip { db, f0_hz, q, .. } => {
            -db * grazing / (1.0 + (q * (hz / f0_hz - f0_hz / hz)).powi(2))
        }
        Hidden::HelmholtzAbsorber { share, f0_hz, q, resistance, .. } => {
            let absorbed = |hz: f64| {
                let [real, imaginary] = [resistance * cosine, q * cosine * (hz / f0_hz - f0_hz / hz)];
                1.0 - ((real - 1.0).powi(2) + imaginary.powi(2)) / ((real + 1.0).powi(2) + imaginary.powi(2))
            };
            db(1.0 - share * mean_of_octave(hz, absorbed))
        }
        Hidden::LimpWall { kg_m2, .. } => {
            let kept = |hz: f64| 1.0 - 1.0 / (1.0 + (PI * hz * kg_m2 * cosine / 413.3).powi(2));
            db(mean_of_octave(hz, kept).max(1e-3))
        }
        Hidden::Fog { water_g_m3, radius_um } => {
            let square_m2 = (1e-6 * radius_um).powi(2);
            let mass = water_g_m3 / 1204.0;
            let lags = [
                (mass, 2.0 * 998.0 * square_m2 / (9.0 * 1.81e-5)),
                (mass * 0.4 * 4184.0 / 1005.0, 998.0 * 4184.0 * square_m2 / (3.0 * 0.0257)),
            ];
            let lag =
                |(load, tau_s): (f64, f64)| load * TAU * hz * tau_s / (1.0 + (TAU * hz * tau_s).powi(2));
            let per_m = TAU * hz / SPEED_M_S * lags.into_iter().map(lag).sum::<f64>();
            -10.0 / LN_10 * per_m * at.length_m
        }
        Hidden::ReceiverDirectivity { omni_share, .. } => {
            let q = *omni_share.get(band)?;
            db((q + (1.0 - q) * at.arrival_cos).powi(2).max(1e-6))
        }
        Hidden::WarmingLoudspeaker { final_db, time_constant } => {
            let hot = 10f64.powf(final_db / 20.0) - 1.0;
            -2.0 * db(1.0 + hot * (1.0 - (-at.recording_order / time_constant).exp()))
        }
        Hidden::GainDrift { depth_db, period_s, phase_rad } => {
            depth_db * (TAU * at.length_m / SPEED_M_S / period_s + phase_rad).sin()
        }
        Hidden::ColumnLoudspeaker { length_m } => {
            let sine = at.departure_elevation_deg.to_radians().sin();
            let energy = |hz: f64| {
                let x = PI * length_m * sine * hz / SPEED_M_S;
                if x.abs() < 1e-6 { 1.0 } else { (x.sin() / x).powi(2) }
            };
            db(mean_of_octave(hz, energy))
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine::acoustics::Bands;
    use sabine_testkit::{LabConfig, Laboratory};

    /// The point in which all is plain.
    fn point(frequency_hz: f64) -> Point {
        Point {
            frequency_hz,
            cos_incidence: 1.0,
            length_m: 0.0,
            arrival_cos: 1.0,
            departure_elevation_deg: 0.0,
            recording_order: 0.0,
        }
    }

    #[test]
    fn the_laboratory_records_what_the_formula_says_of_a_warming_loudspeaker() {
        let config = LabConfig {
            seed: 5,
            receivers: 2,
            bands: Bands::octaves(1000.0, 1000.0).unwrap(),
            recording_order: true,
            ..LabConfig::default()
        };
        let lab = Laboratory::new(config).unwrap();
        let hidden = Hidden::WarmingLoudspeaker { final_db: 6.0, time_constant: 1.0 };
        let (before, after) =
            (lab.responses(&[]).unwrap(), lab.responses(std::slice::from_ref(&hidden)).unwrap());
        let order = lab.truth(&[]).unwrap().recorded_at;
        for (r, recorded_at) in order.into_iter().enumerate() {
            let off_db = 20.0 * (f64::from(after[r].peak()) / f64::from(before[r].peak())).log10();
            let at = Point { recording_order: recorded_at, ..point(1000.0) };
            assert!((off_db - level_db(&hidden, &at, 0).unwrap()).abs() < 0.05, "{r}: {off_db}");
        }
    }

    #[test]
    fn levels_are_those_of_known_cases() {
        let level = |hidden: &Hidden, at: Point| level_db(hidden, &at, 0).unwrap();
        let dip = Hidden::SeatDip { material: 0, db: 10.0, f0_hz: 500.0, q: 1.0 };
        assert!((level(&dip, Point { cos_incidence: 0.0, ..point(500.0) }) + 10.0).abs() < 1e-9);
        let column = Hidden::ColumnLoudspeaker { length_m: 0.5 };
        assert!(level(&column, point(4000.0)).abs() < 1e-9);
        assert!(level(&column, Point { departure_elevation_deg: 60.0, ..point(4000.0) }) < -10.0);
        let wall = Hidden::LimpWall { material: 0, kg_m2: 1.0 };
        assert!(level(&wall, point(125.0)) < level(&wall, point(1000.0)));
        let gradient = Hidden::TemperatureGradient { k_per_m: 1.0, stated_at_m: 1.0 };
        assert!(level_db(&gradient, &point(1000.0), 3).is_none());
    }
}
