//! Units of what stands in a formula.

use std::fmt;

/// Base units: decibel, metre, second, degree, degree Celsius, percent.
const BASES: [&str; 6] = ["dB", "m", "s", "deg", "C", "%"];
/// Powers are kept in twelfths: square and cube roots of a unit are exact.
const WHOLE: i32 = 12;
/// Highest power of a base unit, in twelfths.
const MAX_POWER: i32 = 12 * WHOLE;

/// Powers of the base units, in twelfths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Dimension([i32; BASES.len()]);

impl Dimension {
    pub const PURE: Self = Self([0; BASES.len()]);

    const fn base(index: usize) -> Self {
        let mut powers = [0; BASES.len()];
        powers[index] = WHOLE;
        Self(powers)
    }

    /// That of a product, or of a quotient.
    pub fn times(self, other: Self, sign: i32) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + sign * other.0[i]))
    }

    /// That of a power; `None` where it cannot be said in twelfths or is beyond the twelfth power.
    pub fn power(self, exponent: f64) -> Option<Self> {
        let mut powers = [0; BASES.len()];
        for (power, &own) in powers.iter_mut().zip(&self.0) {
            let exact = f64::from(own) * exponent;
            let whole = exact.round();
            if (exact - whole).abs() > 1e-9 || whole.abs() > f64::from(MAX_POWER) {
                return None;
            }
            *power = whole as i32;
        }
        Some(Self(powers))
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::PURE {
            return f.write_str("a pure number");
        }
        let factors =
            BASES.iter().zip(self.0).filter(|(_, power)| *power != 0).map(|(base, power)| match power {
                WHOLE => (*base).to_owned(),
                power if power % WHOLE == 0 => format!("{base}^{}", power / WHOLE),
                power => format!("{base}^({power}/{WHOLE})"),
            });
        f.write_str(&factors.collect::<Vec<_>>().join(" "))
    }
}

/// The unit of a parameter, as it is written: `dB`, `dB/m`, `1/ms`, `dB/(m kHz)`, `s^2`.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    text: String,
    pub(crate) dimension: Dimension,
    /// How many base units it is.
    pub(crate) scale: f64,
}

impl Unit {
    pub(crate) const DECIBEL: Dimension = Dimension::base(0);
    pub(crate) const METRE: Dimension = Dimension::base(1);
    pub(crate) const SECOND: Dimension = Dimension::base(2);
    pub(crate) const DEGREE: Dimension = Dimension::base(3);
    pub(crate) const CELSIUS: Dimension = Dimension::base(4);
    pub(crate) const PERCENT: Dimension = Dimension::base(5);
    pub(crate) const HERTZ: Dimension = {
        let mut powers = [0; BASES.len()];
        powers[2] = -WHOLE;
        Dimension(powers)
    };

    /// Longest text of a unit.
    pub const MAX_LENGTH: usize = 64;

    /// Reads a unit; `None` for what is none.
    pub fn parse(text: &str) -> Option<Self> {
        if text.len() > Self::MAX_LENGTH {
            return None;
        }
        let mut rest = text;
        let (dimension, scale) = product(&mut rest, 0)?;
        (rest.trim().is_empty() && scale.is_finite() && scale > 0.0).then(|| Self {
            text: text.to_owned(),
            dimension,
            scale,
        })
    }

    /// How many of the base units dB, m, s, deg, C and % (and their powers) it is: 1000 for `kHz`, 0.01 for `cm`.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// The unit as it was written.
    pub fn text(&self) -> &str {
        &self.text
    }
}

/// Factors until the end or a closing bracket: a blank or `*` multiplies, `/` divides by the next factor.
fn product(rest: &mut &str, depth: usize) -> Option<(Dimension, f64)> {
    let (mut dimension, mut scale) = factor(rest, depth)?;
    loop {
        let before = *rest;
        *rest = rest.trim_start();
        let sign = match rest.chars().next() {
            None | Some(')') => return Some((dimension, scale)),
            Some('/') => -1,
            Some('*') => 1,
            Some(_) if before.len() > rest.len() => 0,
            Some(_) => return None,
        };
        if sign != 0 {
            *rest = &rest[1..];
        }
        let (of_factor, times) = factor(rest, depth)?;
        dimension = dimension.times(of_factor, if sign < 0 { -1 } else { 1 });
        scale *= if sign < 0 { 1.0 / times } else { times };
    }
}

fn factor(rest: &mut &str, depth: usize) -> Option<(Dimension, f64)> {
    *rest = rest.trim_start();
    let (mut dimension, mut scale) = if let Some(inner) = rest.strip_prefix('(') {
        if depth > 4 {
            return None;
        }
        *rest = inner;
        let inside = product(rest, depth + 1)?;
        *rest = rest.strip_prefix(')')?;
        inside
    } else {
        let end =
            rest.find(|c: char| !(c.is_ascii_alphabetic() || c == '%' || c == '1')).unwrap_or(rest.len());
        let (name, after) = rest.split_at(end);
        *rest = after;
        named(name)?
    };
    if let Some(power) = rest.strip_prefix('^') {
        let end = power.find(|c: char| !(c.is_ascii_digit() || c == '-')).unwrap_or(power.len());
        let exponent: i32 = power[..end].parse().ok()?;
        *rest = &power[end..];
        dimension = dimension.power(f64::from(exponent))?;
        scale = scale.powi(exponent);
    }
    Some((dimension, scale))
}

fn named(name: &str) -> Option<(Dimension, f64)> {
    Some(match name {
        "1" => (Dimension::PURE, 1.0),
        "rad" => (Dimension::PURE, 1.0),
        "ppm" => (Dimension::PURE, 1e-6),
        "dB" => (Unit::DECIBEL, 1.0),
        "m" => (Unit::METRE, 1.0),
        "cm" => (Unit::METRE, 1e-2),
        "mm" => (Unit::METRE, 1e-3),
        "km" => (Unit::METRE, 1e3),
        "s" => (Unit::SECOND, 1.0),
        "ms" => (Unit::SECOND, 1e-3),
        "us" => (Unit::SECOND, 1e-6),
        "Hz" => (Unit::HERTZ, 1.0),
        "kHz" => (Unit::HERTZ, 1e3),
        "deg" => (Unit::DEGREE, 1.0),
        "C" => (Unit::CELSIUS, 1.0),
        "%" => (Unit::PERCENT, 1.0),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_scale_and_dimension() {
        for (text, scale, shown) in [
            ("1", 1.0, "a pure number"),
            ("dB", 1.0, "dB"),
            ("dB/km", 1e-3, "dB m^-1"),
            ("1/ms", 1e3, "s^-1"),
            ("kHz", 1e3, "s^-1"),
            ("dB/(m kHz)", 1e-3, "dB m^-1 s"),
            ("dB m^-1 kHz^-2", 1e-6, "dB m^-1 s^2"),
            ("Hz*s", 1.0, "a pure number"),
            ("rad", 1.0, "a pure number"),
            ("ppm", 1e-6, "a pure number"),
        ] {
            let unit = Unit::parse(text).unwrap_or_else(|| panic!("{text}"));
            assert!((unit.scale / scale - 1.0).abs() < 1e-12, "{text}: {}", unit.scale);
            assert_eq!(unit.dimension.to_string(), shown, "{text}");
        }
        for text in ["", "db", "dB/", "m^", "(m", "m)", "mkg", "m^99", "1.5", "((((((m))))))", "m^-", "/m"] {
            assert!(Unit::parse(text).is_none(), "{text}");
        }
        assert!(Unit::parse(&"m ".repeat(1000)).is_none());
    }

    #[test]
    fn roots_of_units_are_exact_or_refused() {
        assert_eq!(Unit::METRE.power(0.5).unwrap().power(2.0).unwrap(), Unit::METRE);
        assert_eq!(Unit::METRE.power(1.0 / 3.0).unwrap().power(3.0).unwrap(), Unit::METRE);
        assert!(Unit::METRE.power(0.3).is_none() && Unit::METRE.power(1e9).is_none());
    }
}
