//! The parameters of ISO 3382-1 by name: what a table of measurements may hold.

use crate::estimate::Reading;
use crate::out_of_range::OutOfRange;
use crate::parameters::RoomParameters;
use crate::per_band::PerBand;
use std::fmt;

/// A parameter of ISO 3382-1:2009, annex A, that is read from one impulse response.
///
/// ```
/// use sabine_acoustics::ParameterKind;
/// // 5 % of a reverberation time of 2 s, and 10 ms of centre time.
/// assert!((ParameterKind::T30.jnd(2.0) - 0.1).abs() < 1e-12);
/// assert_eq!(ParameterKind::CentreTime.jnd(0.13), 0.01);
/// assert_eq!(ParameterKind::C80.to_string(), "C80");
/// // 126 s of centre time are milliseconds.
/// assert!(ParameterKind::CentreTime.check(126.0).is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum ParameterKind {
    /// Early decay time: 0 to -10 dB of the decay curve, in seconds.
    Edt,
    /// Reverberation time from -5 to -25 dB, in seconds.
    T20,
    /// Reverberation time from -5 to -35 dB, in seconds.
    T30,
    /// Early-to-late energy ratio at 50 ms, in dB.
    C50,
    /// Early-to-late energy ratio at 80 ms, in dB.
    C80,
    /// Definition: share of the energy within 50 ms, 0 to 1.
    D50,
    /// Centre time, in seconds after the direct sound.
    CentreTime,
}

impl ParameterKind {
    /// All of them, in the order of the columns of a report.
    pub const ALL: [Self; 7] =
        [Self::Edt, Self::T20, Self::T30, Self::C50, Self::C80, Self::D50, Self::CentreTime];

    /// The symbol: `T30`, `C80`, `Ts`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Edt => "EDT",
            Self::T20 => "T20",
            Self::T30 => "T30",
            Self::C50 => "C50",
            Self::C80 => "C80",
            Self::D50 => "D50",
            Self::CentreTime => "Ts",
        }
    }

    /// The symbol with its unit as the name of a column: `t30_s`, `c80_db`, `d50`, `ts_s`.
    pub fn column(self) -> &'static str {
        match self {
            Self::Edt => "edt_s",
            Self::T20 => "t20_s",
            Self::T30 => "t30_s",
            Self::C50 => "c50_db",
            Self::C80 => "c80_db",
            Self::D50 => "d50",
            Self::CentreTime => "ts_s",
        }
    }

    /// Whether it is a decay time, whose differences are heard as shares of it.
    pub fn is_decay_time(self) -> bool {
        matches!(self, Self::Edt | Self::T20 | Self::T30)
    }

    /// The just-noticeable difference at a value, in the parameter's unit: 5 % of EDT, 1 dB of C80, 0.05 of D50, 10 ms of the centre time
    /// (ISO 3382-1:2009, table A.1). The table does not list the others: T20 and T30 get the 5 % of EDT, C50 the 1 dB of
    /// C80 (1.1 dB in Bradley, Reich, Norcross, JASA 106 (1999) 1820).
    pub fn jnd(self, value: f64) -> f64 {
        match self {
            Self::Edt | Self::T20 | Self::T30 => 0.05 * value.abs(),
            Self::C50 | Self::C80 => 1.0,
            Self::D50 => 0.05,
            Self::CentreTime => 0.010,
        }
    }

    /// How far a value lies from another one, `from`, in just-noticeable differences at the latter; positive where it is greater.
    pub fn in_jnd(self, value: f64, from: f64) -> f64 {
        (value - from) / self.jnd(from)
    }

    /// Whether a room can have this value: decay times 0.02 to 30 s, ratios within 60 dB, D50 0 to 1, centre time 0.1 ms to 5 s.
    ///
    /// # Errors
    /// [`OutOfRange`] if it cannot, or is not finite.
    pub fn check(self, value: f64) -> Result<(), OutOfRange> {
        match self {
            Self::Edt | Self::T20 | Self::T30 => {
                OutOfRange::check("decay time (s)", value, 0.02, 30.0, "between 0.02 and 30 s")
            }
            Self::C50 | Self::C80 => {
                OutOfRange::check("early-to-late ratio (dB)", value, -60.0, 60.0, "within 60 dB")
            }
            Self::D50 => {
                OutOfRange::check("definition", value, 0.0, 1.0, "a share between 0 and 1 (or d50_percent)")
            }
            Self::CentreTime => {
                OutOfRange::check("centre time (s)", value, 1e-4, 5.0, "between 0.1 ms and 5 s (or ts_ms)")
            }
        }
    }

    /// This parameter of a measured response.
    pub fn of(self, measured: &RoomParameters) -> &PerBand<Reading> {
        match self {
            Self::Edt => &measured.edt_s,
            Self::T20 => &measured.t20_s,
            Self::T30 => &measured.t30_s,
            Self::C50 => &measured.c50_db,
            Self::C80 => &measured.c80_db,
            Self::D50 => &measured.d50,
            Self::CentreTime => &measured.centre_time_s,
        }
    }
}

impl fmt::Display for ParameterKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.symbol())
    }
}
