//! What a room should sound like.

use crate::bands::Bands;
use crate::error::Error;
use crate::estimate::Estimate;
use crate::per_band::PerBand;

/// Reverberation time and equalisation per octave: what the estimator hears and the fit aims at.
/// ```
/// use sabine_acoustics::{Bands, Estimate, PerBand, RoomTargets};
/// let targets = RoomTargets::new(
///     PerBand::uniform(Bands::T60, Estimate::new(0.6, 0.05)),
///     PerBand::uniform(Bands::EQ, Estimate::exact(0.0)),
/// )?;
/// let (low, high) = targets.t60_s().at_hz(1000.0).unwrap().interval(2.0);
/// assert!((low - 0.5).abs() < 1e-9 && (high - 0.7).abs() < 1e-9);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct RoomTargets {
    t60_s: PerBand<Estimate>,
    eq_db: PerBand<Estimate>,
}

impl RoomTargets {
    /// Reverberation times in seconds at 125 Hz to 8 kHz ([`Bands::T60`]) and levels in dB at 62.5 Hz to 4 kHz
    /// ([`Bands::EQ`]), the latter relative to 1 kHz, where it is 0.
    ///
    /// # Errors
    /// [`Error::BandMismatch`] for other bands, [`Error::OutOfRange`] for a time that is not positive or a level that is not
    /// finite.
    pub fn new(t60_s: PerBand<Estimate>, eq_db: PerBand<Estimate>) -> Result<Self, Error> {
        for (found, expected) in [(t60_s.bands(), Bands::T60), (eq_db.bands(), Bands::EQ)] {
            if found != expected {
                return Err(Error::BandMismatch { left: expected, right: found });
            }
        }
        for estimate in t60_s.values() {
            crate::out_of_range::OutOfRange::check(
                "T60 (s)",
                estimate.value,
                1e-3,
                100.0,
                "between 1 ms and 100 s",
            )?;
        }
        for estimate in eq_db.values() {
            crate::out_of_range::OutOfRange::check(
                "EQ (dB)",
                estimate.value,
                -200.0,
                200.0,
                "within 200 dB of the 1 kHz band",
            )?;
        }
        Ok(Self { t60_s, eq_db })
    }

    /// Time in which the level falls by 60 dB, in seconds, at 125 Hz to 8 kHz.
    pub fn t60_s(&self) -> &PerBand<Estimate> {
        &self.t60_s
    }

    /// Mean power relative to the 1 kHz octave, in dB, at 62.5 Hz to 4 kHz; 0 at 1 kHz.
    pub fn eq_db(&self) -> &PerBand<Estimate> {
        &self.eq_db
    }
}
