//! The parameters that hosts show and automate.

use clack_plugin::prelude::ClapId;
use std::fmt::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};

/// A parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Gain of the reverberation in dB; the least is none at all.
    Wet,
    /// Gain of the sound as it came in, in dB; the least is none at all.
    Dry,
    /// Which room: 0 the built-in one, 1 that of the project's state, from 2 on those in the folder of rooms.
    Room,
}

impl Parameter {
    /// All, in the order in which hosts see them.
    pub const ALL: [Self; 3] = [Self::Wet, Self::Dry, Self::Room];
    /// The least gain in dB, which means none.
    pub const LEAST_DB: f64 = -60.0;
    /// The greatest gain in dB.
    pub const MOST_DB: f64 = 12.0;

    /// Identifier that hosts keep in their projects.
    pub const fn id(self) -> ClapId {
        ClapId::new(self as u32 + 1)
    }

    /// Name that hosts show.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Wet => "Wet",
            Self::Dry => "Dry",
            Self::Room => "Room",
        }
    }

    /// Value of a new instance.
    pub const fn default(self) -> f64 {
        match self {
            Self::Wet | Self::Dry | Self::Room => 0.0,
        }
    }

    pub(crate) fn of_id(id: ClapId) -> Option<Self> {
        Self::ALL.into_iter().find(|parameter| parameter.id() == id)
    }
}

/// The factor of amplitude of a gain in dB.
pub(crate) fn factor(gain_db: f64) -> f32 {
    if gain_db <= Parameter::LEAST_DB { 0.0 } else { 10_f64.powf(gain_db / 20.0) as f32 }
}

/// Writes a gain as hosts show it.
///
/// # Errors
/// Those of `text`.
pub(crate) fn write_db(gain_db: f64, text: &mut impl Write) -> fmt::Result {
    if gain_db <= Parameter::LEAST_DB { text.write_str("off") } else { write!(text, "{gain_db:.2} dB") }
}

/// Reads a gain as users type it, with or without the unit; None if it is no number.
pub(crate) fn read_db(text: &str) -> Option<f64> {
    let text = text.trim().to_lowercase();
    if text == "off" {
        return Some(Parameter::LEAST_DB);
    }
    let number = text.strip_suffix("db").unwrap_or(&text).trim_end();
    let gain_db: f64 = number.parse().ok()?;
    (!gain_db.is_nan()).then(|| gain_db.clamp(Parameter::LEAST_DB, Parameter::MOST_DB))
}

/// Values of all parameters, for any thread.
pub(crate) struct Parameters([AtomicU64; 3]);

impl Default for Parameters {
    fn default() -> Self {
        Self(Parameter::ALL.map(|parameter| AtomicU64::new(parameter.default().to_bits())))
    }
}

impl Parameters {
    pub fn get(&self, parameter: Parameter) -> f64 {
        f64::from_bits(self.0[parameter as usize].load(Ordering::Relaxed))
    }

    /// Takes a value from the host, brought into the range; none that is not a number. True if it is another than before.
    pub fn set(&self, parameter: Parameter, value: f64, rooms: u32) -> bool {
        if value.is_nan() {
            return false;
        }
        let value = match parameter {
            Parameter::Wet | Parameter::Dry => value.clamp(Parameter::LEAST_DB, Parameter::MOST_DB),
            Parameter::Room => value.round().clamp(0.0, f64::from(rooms.saturating_sub(1))),
        };
        self.0[parameter as usize].swap(value.to_bits(), Ordering::Relaxed) != value.to_bits()
    }

    /// Factor of amplitude of a gain.
    pub fn factor(&self, parameter: Parameter) -> f32 {
        factor(self.get(parameter))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_are_read_as_they_are_written() {
        for (gain_db, written) in
            [(-60.0, "off"), (-12.345, "-12.35 dB"), (0.0, "0.00 dB"), (12.0, "12.00 dB")]
        {
            let mut text = String::new();
            write_db(gain_db, &mut text).unwrap();
            assert_eq!(text, written);
            assert!((read_db(&text).unwrap() - gain_db).abs() <= 0.005 + 1e-9, "{text}");
        }
        assert_eq!(read_db(" -6DB "), Some(-6.0));
        assert_eq!((read_db("99"), read_db("-inf")), (Some(12.0), Some(-60.0)));
        assert_eq!((read_db("loud"), read_db("NaN"), read_db("")), (None, None, None));
    }

    #[test]
    fn values_of_hosts_are_kept_in_range() {
        let values = Parameters::default();
        assert!(values.set(Parameter::Wet, 1e9, 2) && !values.set(Parameter::Wet, 12.0, 2));
        assert!(!values.set(Parameter::Dry, f64::NAN, 2));
        assert!(values.set(Parameter::Room, 7.6, 4));
        let all = Parameter::ALL.map(|parameter| values.get(parameter));
        assert_eq!(all, [12.0, 0.0, 3.0]);
        assert_eq!((factor(-60.0), factor(0.0)), (0.0, 1.0));
        assert!((factor(-20.0) - 0.1).abs() < 1e-7);
    }
}
