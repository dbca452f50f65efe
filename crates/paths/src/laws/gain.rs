//! Limits of what laws may add.

use crate::laws::error::{LawError, LawFault, Place};
use crate::laws::law::Law;

/// Most that one law, and all laws together, may add, in dB. What they take has no limit.
pub(crate) const MAX_GAIN_DB: f64 = 200.0;
/// Natural logarithm of the energy per decibel.
pub(crate) const NEPERS_PER_DB: f64 = std::f64::consts::LN_10 / 10.0;
/// Below this, the energy is zero whatever else adds to it; kept finite, so that no difference of two such is undefined.
const LOWEST_NEPERS: f64 = -1e4;

/// That a law adds no more than it may.
pub(crate) fn check_gain(law: &Law, found_db: f64, place: Place) -> Result<(), LawError> {
    if found_db <= MAX_GAIN_DB {
        return Ok(());
    }
    Err(law.error(None, LawFault::TooLoud { found_db, max_db: MAX_GAIN_DB, place }))
}

/// A level as the natural logarithm of the energy.
#[inline]
pub(crate) fn nepers(db: f64) -> f64 {
    (db * NEPERS_PER_DB).max(LOWEST_NEPERS)
}
