//! Numbers as messages print them.

use std::fmt;

/// A number in plain digits from 0.001 to a million, and else in engineering form: six significant digits and an exponent
/// that is a multiple of three.
///
/// ```
/// use sabine_acoustics::Engineering;
/// assert_eq!(Engineering(1.25).to_string(), "1.25");
/// assert_eq!(Engineering(145_724_000_000.0).to_string(), "145.724e9");
/// assert_eq!(Engineering(-1e-10).to_string(), "-100e-12");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Engineering(pub f64);

impl fmt::Display for Engineering {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0;
        let plain = value == 0.0 || !value.is_finite() || (1e-3..=1e6).contains(&value.abs());
        // Rounded once, so that 999,999.9 does not become 1000e3.
        let rounded = format!("{:.5e}", value.abs());
        let parts = rounded.split_once('e').and_then(|(m, e)| Some((m, e.parse::<i32>().ok()?)));
        let (false, Some((mantissa, exponent))) = (plain, parts) else {
            return write!(f, "{value}");
        };
        let digits: String = mantissa.chars().filter(char::is_ascii_digit).collect();
        let whole = 1 + exponent.rem_euclid(3) as usize;
        let (whole_digits, rest) = digits.split_at(whole.min(digits.len()));
        let rest = rest.trim_end_matches('0');
        let (sign, point) = (if value < 0.0 { "-" } else { "" }, if rest.is_empty() { "" } else { "." });
        write!(f, "{sign}{whole_digits}{point}{rest}e{}", exponent - exponent.rem_euclid(3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_mean_the_same() {
        for (value, text) in [
            (0.0, "0"),
            (-0.01, "-0.01"),
            (240.0, "240"),
            (1e6, "1000000"),
            (1e308, "100e306"),
            (1.457_240_000_000_000_2e-10, "145.724e-12"),
            (7.588_008_597_817_113e31, "75.8801e30"),
            (-9_999_999.9, "-10e6"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(Engineering(value).to_string(), text);
        }
        for exponent in (-300..-3).chain(6..300) {
            let value = 1.234_56 * 10f64.powi(exponent);
            let text = Engineering(value).to_string();
            let read: f64 = text.parse().unwrap();
            assert!((read / value - 1.0).abs() < 1e-5 && text.len() < 14, "{value:e} gave {text}");
        }
    }
}
