//! The seam of every change to a response.

use sabine_acoustics::{Error, ImpulseResponse};

/// Makes another plausible response out of a measured one.
pub trait Augment: Send + Sync {
    /// A changed response, the same for the same seed. Its labels are for the caller to measure.
    ///
    /// # Errors
    /// Where the response does not permit the change (too noisy, no direct sound, ...).
    fn augment(&self, response: &ImpulseResponse, seed: u64) -> Result<ImpulseResponse, Error>;
}
