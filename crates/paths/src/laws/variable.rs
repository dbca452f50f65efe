//! What a formula may speak of.

use crate::laws::target::LawTarget;
use crate::laws::unit::{Dimension, Unit};

/// What the value of a part of a formula depends on, as bits.
pub(crate) mod scope {
    /// The band.
    pub const BAND: u8 = 1;
    /// The path.
    pub const PATH: u8 = 2;
    /// The meeting with a surface.
    pub const HIT: u8 = 4;
    /// The time in a response.
    pub const TIME: u8 = 8;
}

macro_rules! variables {
    ($($name:ident $text:literal $unit:ident $scope:expr;)*) => {
        /// A variable without an argument.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Variable { $($name),* }

        impl Variable {
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// Its name in a formula.
            pub fn name(self) -> &'static str {
                match self { $(Self::$name => $text),* }
            }

            /// Its unit.
            pub fn dimension(self) -> Dimension {
                match self { $(Self::$name => $unit),* }
            }

            /// What it depends on.
            pub fn scope(self) -> u8 {
                match self { $(Self::$name => $scope),* }
            }
        }
    };
}

const PURE: Dimension = Dimension::PURE;
const M: Dimension = Unit::METRE;
const S: Dimension = Unit::SECOND;
const DEG: Dimension = Unit::DEGREE;
const DB: Dimension = Unit::DECIBEL;
const HZ: Dimension = Unit::HERTZ;
const C: Dimension = Unit::CELSIUS;
const PERCENT: Dimension = Unit::PERCENT;

variables! {
    Length "length_m" M scope::PATH;
    Time "time_s" S scope::PATH;
    Reflections "reflections" PURE scope::PATH;
    Scatterings "scatterings" PURE scope::PATH;
    DepartureAzimuth "departure_azimuth_deg" DEG scope::PATH;
    DepartureElevation "departure_elevation_deg" DEG scope::PATH;
    DepartureCos "departure_cos" PURE scope::PATH;
    ArrivalAzimuth "arrival_azimuth_deg" DEG scope::PATH;
    ArrivalElevation "arrival_elevation_deg" DEG scope::PATH;
    ArrivalCos "arrival_cos" PURE scope::PATH;
    MeanHeight "mean_height_m" M scope::PATH;
    LeastHeight "least_height_m" M scope::PATH;
    CosIncidence "cos_incidence" PURE scope::HIT;
    IncidenceAzimuth "incidence_azimuth_deg" DEG scope::HIT;
    Side "side" PURE scope::HIT;
    TimeAfterDirect "time_after_direct_s" S scope::TIME;
    FileTime "file_time_s" S scope::TIME;
    Level "level_db" DB scope::TIME;
    Distance "distance_m" M 0;
    SourceX "source_x_m" M 0;
    SourceY "source_y_m" M 0;
    SourceZ "source_z_m" M 0;
    ReceiverX "receiver_x_m" M 0;
    ReceiverY "receiver_y_m" M 0;
    ReceiverZ "receiver_z_m" M 0;
    Temperature "temperature_c" C 0;
    Humidity "relative_humidity_percent" PERCENT 0;
    RecordingOrder "recording_order" PURE 0;
    Frequency "frequency_hz" HZ scope::BAND;
}

/// A variable that takes a name: `hits(carpet)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Named {
    /// Meetings with the material of this name.
    Hits,
    /// One in responses of the source of this name, zero in others.
    Source,
    /// One in responses of the receiver of this name, zero in others.
    Receiver,
}

impl Named {
    pub const ALL: [Self; 3] = [Self::Hits, Self::Source, Self::Receiver];

    /// What stands before the bracket.
    pub fn word(self) -> &'static str {
        match self {
            Self::Hits => "hits",
            Self::Source => "source",
            Self::Receiver => "receiver",
        }
    }

    /// What it depends on.
    pub fn scope(self) -> u8 {
        if self == Self::Hits { scope::PATH } else { 0 }
    }

    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|named| named.word() == word)
    }
}

impl Variable {
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|variable| variable.name() == name)
    }
}

/// Whether a target has what depends on this. A delay is the same in all bands: paths are rendered as one pulse each.
pub(crate) fn has(target: LawTarget, variable: Option<Variable>, depends_on: u8) -> bool {
    let allowed = match target {
        LawTarget::Path => scope::PATH | scope::BAND,
        LawTarget::Reflection => scope::HIT | scope::BAND,
        LawTarget::Delay => scope::PATH,
        LawTarget::Added | LawTarget::Recorder => scope::TIME | scope::BAND,
    };
    let of_recorder = matches!(variable, Some(Variable::FileTime | Variable::Level));
    depends_on & !allowed == 0 && !(of_recorder && target == LawTarget::Added)
}
