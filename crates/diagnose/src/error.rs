//! What can go wrong in a comparison.

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The vocabulary refused a value.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
    /// Measured and predicted energies have different bands or bins.
    #[error("measured and predicted energies differ in {what}")]
    Layout {
        /// What differs: the bands or the bin width.
        what: &'static str,
    },
    /// No time bin of any band can be compared.
    #[error("no time bin holds both measured and predicted energy within {range_db} dB of the maximum")]
    NothingToCompare {
        /// The range looked at, in dB.
        range_db: f64,
    },
    /// Nothing to fit to, or nothing left to test on.
    #[error("{what}: at least one pair of responses is needed")]
    NoPairs {
        /// Which set is empty.
        what: &'static str,
    },
    /// The data leave a parameter free even with its prior.
    #[error("the data do not determine the parameters of {effect}")]
    Singular {
        /// Catalogue identifier of the effect.
        effect: &'static str,
    },
}
