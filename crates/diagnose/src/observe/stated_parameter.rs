//! A parameter that a table states, as it is compared.

use sabine_acoustics::ParameterKind;
use sabine_scene::ParameterEntry;
use std::f64::consts::LN_10;

/// A parameter that a table states of a pair in an octave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StatedParameter {
    pub kind: ParameterKind,
    /// Standard deviation of the logarithm of [`quantity`]: as stated, or one just-noticeable difference.
    pub ln_sd: f64,
}

/// What is compared of a parameter, by its logarithm: decay and centre times as they are, ratios of early to late energy as energies.
pub(crate) fn quantity(kind: ParameterKind, value: f64) -> f64 {
    match kind {
        ParameterKind::C50 | ParameterKind::C80 => 10f64.powf(value / 10.0),
        ParameterKind::D50 => value / (1.0 - value),
        _ => value,
    }
}

/// The value of a parameter of which that is compared.
pub(crate) fn value_of(kind: ParameterKind, quantity: f64) -> f64 {
    match kind {
        ParameterKind::C50 | ParameterKind::C80 => 10.0 * quantity.log10(),
        ParameterKind::D50 => quantity / (1.0 + quantity),
        _ => quantity,
    }
}

/// Change of the logarithm of the quantity with the value.
fn ln_slope(kind: ParameterKind, value: f64) -> f64 {
    match kind {
        ParameterKind::C50 | ParameterKind::C80 => LN_10 / 10.0,
        ParameterKind::D50 => 1.0 / (value * (1.0 - value)),
        _ => 1.0 / value,
    }
}

impl StatedParameter {
    pub fn of(entry: &ParameterEntry) -> Self {
        let sd = entry.standard_deviation.unwrap_or_else(|| entry.kind.jnd(entry.value));
        Self { kind: entry.kind, ln_sd: sd * ln_slope(entry.kind, entry.value) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_those_of_values_and_their_errors_go_along() {
        for (kind, value) in [
            (ParameterKind::T30, 1.4),
            (ParameterKind::Edt, 0.3),
            (ParameterKind::C80, -2.5),
            (ParameterKind::C50, 6.0),
            (ParameterKind::D50, 0.7),
            (ParameterKind::CentreTime, 0.08),
        ] {
            assert!((value_of(kind, quantity(kind, value)) - value).abs() < 1e-12, "{kind}");
            let step = 1e-6;
            let slope = (quantity(kind, value + step) / quantity(kind, value - step)).ln() / (2.0 * step);
            assert!((ln_slope(kind, value) / slope - 1.0).abs() < 1e-6, "{kind}");
        }
    }
}
