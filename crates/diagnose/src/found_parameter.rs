//! A fitted parameter with its 90 % interval.

use serde::{Deserialize, Serialize};

/// Half the width of a 90 % interval in standard deviations.
pub(crate) const HALF_90: f64 = 1.645;

/// A parameter of a named cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FoundParameter {
    /// Name.
    pub name: String,
    /// Most probable value.
    pub value: f64,
    /// Ends of the 90 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Unit.
    pub unit: String,
}

/// The 90 % interval of a normal distribution, no wider than its bounds.
pub(crate) fn interval_90(value: f64, sd: f64, bounds: (f64, f64)) -> [f64; 2] {
    [(value - HALF_90 * sd).max(bounds.0), (value + HALF_90 * sd).min(bounds.1)]
}
