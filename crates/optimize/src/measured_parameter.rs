//! A measured room-acoustic parameter, as a table lists it.

use sabine_acoustics::{OutOfRange, ParameterKind};
use sabine_paths::PathSet;
use sabine_scene::ParameterEntry;

/// A parameter of ISO 3382-1 of one source-receiver pair in one octave.
///
/// ```
/// use sabine_acoustics::ParameterKind;
/// use sabine_optimize::MeasuredParameter;
/// let t30 = MeasuredParameter { band_hz: 1000.0, kind: ParameterKind::T30, value: 2.0, standard_deviation: None };
/// assert!((t30.sd() - 0.1).abs() < 1e-12); // no error is stated: 5 %, which is just noticeable
/// let sure = MeasuredParameter { standard_deviation: Some(0.02), ..t30 };
/// assert_eq!(sure.sd(), 0.02);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredParameter {
    /// Nominal centre of the octave, in Hz.
    pub band_hz: f64,
    /// What was measured.
    pub kind: ParameterKind,
    /// Its value, in the unit of [`ParameterKind`].
    pub value: f64,
    /// Standard deviation of the measurement in the same unit, where it is stated: what repeating it would change, the room and the places
    /// being the same.
    pub standard_deviation: Option<f64>,
}

impl MeasuredParameter {
    /// The stated standard deviation, or one just-noticeable difference ([`ParameterKind::jnd`]).
    pub fn sd(&self) -> f64 {
        self.standard_deviation.unwrap_or_else(|| self.kind.jnd(self.value))
    }

    pub(crate) fn check(&self) -> Result<(), OutOfRange> {
        self.kind.check(self.value)?;
        OutOfRange::check("standard deviation of a parameter", self.sd(), 1e-6, 60.0, "above 0, at most 60")
    }
}

impl From<&ParameterEntry> for MeasuredParameter {
    fn from(entry: &ParameterEntry) -> Self {
        let &ParameterEntry { band_hz, kind, value, standard_deviation, .. } = entry;
        Self { band_hz, kind, value, standard_deviation }
    }
}

/// The table of one pair, and the paths between its source and its receiver.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredTable<'a> {
    /// What was measured, in any order; octaves in which the materials have no band are not used.
    pub values: &'a [MeasuredParameter],
    /// The paths.
    pub paths: &'a PathSet,
}
