//! What can go wrong in a diagnosis.

use crate::extend::moved_mesh::DisplacementError;
use sabine_acoustics::OutOfRange;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The vocabulary refused a value, or long work was cancelled.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
    /// A room, a response of it or its mesh cannot be read.
    #[error(transparent)]
    Scene(#[from] sabine_scene::Error),
    /// The tracer refused its settings or a place.
    #[error(transparent)]
    Propagate(#[from] sabine_propagate::Error),
    /// A setting is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// The room has no measured responses, and no tables of parameters.
    #[error(
        "the room has no measured responses, nor tables of parameters: there is nothing to compare the simulation with"
    )]
    NoResponses,
    /// No response can be compared in any band.
    #[error(
        "none of the {responses} responses, or tables, can be compared with the simulation in any octave"
    )]
    NothingToCompare {
        /// Responses looked at.
        responses: usize,
    },
    /// A receiver to be held out does not exist or has no response.
    #[error("no response was measured at the receiver {id:?}, so that it cannot be held out")]
    UnknownHoldOut {
        /// The name asked for.
        id: String,
    },
    /// Everything is held out.
    #[error("all responses are held out: none is left to fit")]
    AllHeldOut,
    /// An effect that the catalogue does not have.
    #[error("the catalogue has no effect {id:?}")]
    UnknownEffect {
        /// The name asked for.
        id: String,
    },
    /// A cause of an extended model that has no case in the room.
    #[error(
        "the model's cause {cause} cannot be at work in this room: no effect, or none about that subject, has a case here; leave it out to go on"
    )]
    UnknownCause {
        /// The cause, with its subject.
        cause: String,
    },
    /// A law that cannot be weighed as a cause.
    #[error("law `{id}`: {reason}")]
    LawNotWeighed {
        /// Its identifier.
        id: String,
        /// Why.
        reason: String,
    },
    /// The data and their priors leave a combination of parameters free: a prior of infinite width.
    #[error("the parameters of {what} are not determined")]
    Singular {
        /// The model.
        what: &'static str,
    },
    /// An extended model cannot be read.
    #[error("{path}: {source}", path = path.display())]
    Model {
        /// The file.
        path: std::path::PathBuf,
        /// Why.
        #[source]
        source: Box<toml::de::Error>,
    },
    /// Two extended models cannot be joined.
    #[error("the models cannot be joined: they disagree in, or both have, {field}")]
    ModelsDisagree {
        /// The field, or the cause that both have.
        field: String,
    },
    /// Displaced surfaces cannot stand where an extended model has them.
    #[error("extended model: surfaces: {0}")]
    Displacement(#[from] DisplacementError),
    /// An extended model does not fit the room, or holds a value out of range.
    #[error("extended model: {field}: {source}")]
    InModel {
        /// The field, as it stands in the file: `absorption.carpet`.
        field: String,
        /// What is wrong with it.
        #[source]
        source: Box<sabine_acoustics::Error>,
    },
}
