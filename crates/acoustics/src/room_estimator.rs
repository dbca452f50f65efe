//! The seam between speech and what it says about a room.

use crate::error::Error;
use crate::signal::Signal;
use crate::targets::RoomTargets;

/// Tells from speech what the room sounds like.
pub trait RoomEstimator: Send + Sync {
    /// Reverberation time and equalisation of the room in which `speech` was recorded.
    ///
    /// # Errors
    /// Where the recording cannot be judged: too short, silent, ...
    fn estimate(&self, speech: &Signal) -> Result<RoomTargets, Error>;
}
