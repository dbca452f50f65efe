//! Why there is no plan.

use sabine_acoustics::OutOfRange;
use std::path::PathBuf;

/// Errors of a [`Planner`](crate::Planner).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The room cannot be simulated or its responses cannot be fitted.
    #[error(transparent)]
    Diagnose(#[from] crate::error::Error),
    /// A setting is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// The room file has no source: nothing can be heard.
    #[error("room.toml: sources: there is none, and a plan needs at least one")]
    NoSource,
    /// No place of the grid has room about it.
    #[error(
        "no place at a height of {height_m:.2} m is {clearance_m} m away from all surfaces, sources and receivers: ask for less clearance"
    )]
    NoPlace {
        /// Height of the grid above the lowest point of the mesh, in metres.
        height_m: f64,
        /// Distance that was asked for.
        clearance_m: f64,
    },
    /// More places are asked for than there are.
    #[error("{asked} {what} are asked for, but only {found} places have enough clearance")]
    FewPlaces {
        /// Microphones or source places.
        what: &'static str,
        /// Number asked for.
        asked: usize,
        /// Number of candidates.
        found: usize,
    },
    /// Source places are judged by the microphones that hear them.
    #[error("a place for a source is asked for, but room.toml has no receivers: place microphones first")]
    NoReceiver,
    /// A hypothesis is none of this room's: the diagnosis is of another room or version, or of a law that is not given here.
    #[error("{} in this room: is the diagnosis of another one, or of a law that is not given here?", match subject {
        Some(subject) => format!("no effect has a case {effect} of {subject:?}"),
        None => format!("there is no effect {effect:?}"),
    })]
    UnknownHypothesis {
        /// Identifier of the effect.
        effect: String,
        /// Its subject.
        subject: Option<String>,
    },
    /// There is nothing to decide between.
    #[error("a plan after a diagnosis needs two hypotheses, and there is only {found}")]
    OneHypothesis {
        /// How many there are.
        found: usize,
    },
    /// Only one of the hypotheses can be planned in this room.
    #[error("{names} cannot be weighed for a plan of this room, and nothing is left to decide between")]
    NotPlanned {
        /// Those that cannot.
        names: String,
    },
    /// None of the hypotheses shows in what a plan predicts.
    #[error(
        "{names} show in single channels or before the direct sound: no other place or air decides between them"
    )]
    NotPredicted {
        /// Their names.
        names: String,
    },
    /// A cost table cannot be read.
    #[error("{}: {source}", path.display())]
    CostFile {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A cost table is no table of costs.
    #[error("{}: {source}", path.display())]
    CostTable {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: Box<toml::de::Error>,
    },
    /// A cost is out of range.
    #[error("{}: {source}", path.display())]
    Cost {
        /// The file.
        path: PathBuf,
        /// The field and its range.
        #[source]
        source: OutOfRange,
    },
}

impl From<sabine_acoustics::Error> for PlanError {
    fn from(error: sabine_acoustics::Error) -> Self {
        Self::Diagnose(error.into())
    }
}

impl From<sabine_scene::Error> for PlanError {
    fn from(error: sabine_scene::Error) -> Self {
        Self::Diagnose(error.into())
    }
}

impl From<sabine_propagate::Error> for PlanError {
    fn from(error: sabine_propagate::Error) -> Self {
        Self::Diagnose(error.into())
    }
}
