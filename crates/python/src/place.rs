//! Where sound comes from and where it is heard: a name of the room, or a position.

use crate::failure::{Failure, refused};
use pyo3::prelude::*;
use sabine::scene::{Receiver, Source};

/// A place as Python's users give it.
#[derive(Clone, Debug, FromPyObject)]
pub enum Place {
    /// Its name in the room.
    Named(String),
    /// Its position in metres.
    At([f64; 3]),
}

impl Place {
    /// The source that is meant; at a position, an omnidirectional one.
    ///
    /// # Errors
    /// The room has none of that name, or the position is refused.
    pub fn source(&self, sources: &[Source]) -> Result<Source, Failure> {
        match self {
            Self::At(position_m) => Ok(Source::omni("source", *position_m)?),
            Self::Named(id) => {
                let found = sources.iter().find(|source| source.id == *id);
                found.cloned().ok_or_else(|| unknown("source", id, sources.iter().map(|s| s.id.as_str())))
            }
        }
    }

    /// The receiver that is meant; at a position, an omnidirectional one.
    ///
    /// # Errors
    /// The room has none of that name, or the position is refused.
    pub fn receiver(&self, receivers: &[Receiver]) -> Result<Receiver, Failure> {
        match self {
            Self::At(position_m) => Ok(Receiver::omni("receiver", *position_m)?),
            Self::Named(id) => {
                let found = receivers.iter().find(|receiver| receiver.id == *id);
                let names = receivers.iter().map(|r| r.id.as_str());
                found.cloned().ok_or_else(|| unknown("receiver", id, names))
            }
        }
    }
}

fn unknown<'a>(what: &str, id: &str, names: impl Iterator<Item = &'a str>) -> Failure {
    let names: Vec<&str> = names.collect();
    refused(match names.as_slice() {
        [] => format!(
            "{what}: {id:?} is not known: the room names none; give a position of 3 coordinates in metres"
        ),
        names => format!("{what}: {id:?} is not known; the room has {}", names.join(", ")),
    })
}
