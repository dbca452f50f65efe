//! What can go wrong with a fit.

use sabine_acoustics::OutOfRange;

/// Errors of this crate; each names the offending field, and the band or material where there is one.
///
/// A target that cannot be reached is no error but part of the result: see [`Unreachable`](crate::Unreachable).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting outside its range, or not finite.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// A reverberation time that no room has, or one that is not a number.
    #[error("target at {band_hz} Hz: T60 of {value_s} s; it must lie between {low_s} and {high_s} s")]
    Target {
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
        /// The target, in seconds.
        value_s: f64,
        /// Shortest target that is accepted, in seconds.
        low_s: f64,
        /// Longest target that is accepted, in seconds.
        high_s: f64,
    },
    /// Conditions that are not one for each pair.
    #[error("{found} conditions for {pairs} pairs; there must be one for each, or none")]
    ConditionCount {
        /// Pairs of source and receiver.
        pairs: usize,
        /// Conditions.
        found: usize,
    },
    /// A law under which materials are to be fitted adds sound that no surface reflects.
    #[error(
        "materials cannot be fitted under a law that adds sound: nothing says how its energy depends on absorption"
    )]
    AddedSound,
    /// A standard error that is negative or not a number.
    #[error("target at {band_hz} Hz: standard error of {value_s} s; it must be finite and not negative")]
    TargetError {
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
        /// The standard error, in seconds.
        value_s: f64,
    },
    /// A prior whose mean is no absorption, or whose standard deviation is negative or not a number.
    #[error("prior of material {material} at {band_hz} Hz: {field} is {value}; it must be {range}")]
    Prior {
        /// Index of the material.
        material: usize,
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
        /// `mean` or `standard_deviation`.
        field: &'static str,
        /// What it is.
        value: f64,
        /// The range in words.
        range: &'static str,
    },
    /// A material that is held (standard deviation zero) at an absorption that the bounds forbid.
    #[error(
        "prior of material {material} at {band_hz} Hz holds it at {mean}, outside the bounds {lower} to {upper}"
    )]
    ContradictoryPrior {
        /// Index of the material.
        material: usize,
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
        /// Mean of the prior.
        mean: f64,
        /// Lower bound of absorption.
        lower: f64,
        /// Upper bound of absorption.
        upper: f64,
    },
    /// Lists that should run in parallel do not.
    #[error("{what}: {found} given where {expected} are needed")]
    Count {
        /// What is counted.
        what: &'static str,
        /// How many are needed.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// There is no path to fit to: no path set, or none of them reaches its receiver.
    #[error("path set {index} of {count} holds no paths")]
    NoPaths {
        /// Index of the empty set; zero if there is no set at all.
        index: usize,
        /// Number of sets.
        count: usize,
    },
    /// The paths end before the target decay has passed through the range that is fitted.
    #[error(
        "target at {band_hz} Hz: a T60 of {target_s} s needs paths of {needed_s:.3} s; they are traced for {traced_s:.3} s"
    )]
    PathsTooShort {
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
        /// The target, in seconds.
        target_s: f64,
        /// Duration needed, in seconds.
        needed_s: f64,
        /// Duration traced, in seconds.
        traced_s: f64,
    },
    /// A measured response in which no direct sound stands out.
    #[error("the response has no direct sound: {source}")]
    NoOnset {
        /// Why.
        source: sabine_acoustics::NoReading,
    },
    /// No response and no table of parameters can be read in any band.
    #[error("none of {responses} responses and tables has a decay that can be read in any of {bands} bands")]
    NoDecay {
        /// Number of responses and tables.
        responses: usize,
        /// Number of bands.
        bands: usize,
    },
    /// The fit converged in none of the bands, so that there is no result at all.
    #[error("the fit has converged in none of {bands} bands: {reason}")]
    NotConverged {
        /// Number of bands.
        bands: usize,
        /// Why, in the first of them.
        reason: crate::Unconverged,
    },
    /// The cost of a minimisation is not finite at its start.
    #[error("the cost at the start is {cost}; it must be finite")]
    NotFinite {
        /// The cost.
        cost: f64,
    },
    /// A vocabulary value was refused, or the observer stopped the fit.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
    /// The solver refused the problem.
    #[error("the solver refused the problem: {source}")]
    Solver {
        /// Its reason.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}
