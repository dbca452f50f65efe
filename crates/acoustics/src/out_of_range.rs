//! A number outside the range in which it means something.

use crate::engineering::Engineering;
use std::fmt;

/// A number outside its range, or not finite: the error of every setting and physical value of the workspace.
///
/// ```
/// use sabine_acoustics::OutOfRange;
/// assert!(OutOfRange::check("absorption", 0.3, 0.0, 1.0, "between 0 and 1").is_ok());
/// let error = OutOfRange::check("absorption", 1.2, 0.0, 1.0, "between 0 and 1").unwrap_err();
/// assert_eq!(error.to_string(), "absorption is 1.2; it must be between 0 and 1");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// What the number stands for, with its unit.
    pub field: &'static str,
    /// The number.
    pub value: f64,
    /// The range in words.
    pub range: &'static str,
}

impl OutOfRange {
    /// Checks that a number is finite and within `low..=high`, which `range` says in words.
    ///
    /// # Errors
    /// This error, where it is not.
    pub fn check(
        field: &'static str,
        value: f64,
        low: f64,
        high: f64,
        range: &'static str,
    ) -> Result<(), Self> {
        // Written so that NaN fails.
        if value >= low && value <= high { Ok(()) } else { Err(Self { field, value, range }) }
    }
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is {}; it must be {}", self.field, Engineering(self.value), self.range)
    }
}

impl std::error::Error for OutOfRange {}
