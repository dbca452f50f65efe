//! A number with its uncertainty, or the reason why there is none.

use std::fmt;

/// A value and its standard error, in the same unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// One standard deviation of the estimator; zero for an exact value.
    pub standard_error: f64,
}

impl Estimate {
    /// A value known without error.
    pub const fn exact(value: f64) -> Self {
        Self { value, standard_error: 0.0 }
    }

    /// A value with its standard error.
    pub const fn new(value: f64, standard_error: f64) -> Self {
        Self { value, standard_error }
    }

    /// Central interval at a normal quantile (1.96 for 95 %).
    pub fn interval(&self, quantile: f64) -> (f64, f64) {
        (self.value - quantile * self.standard_error, self.value + quantile * self.standard_error)
    }

    /// Central interval at a normal quantile of a positive quantity whose logarithm is normally distributed, as a reverberation time heard
    /// in speech: the standard error is that of the logarithm times the value, and the interval lies further above the value than below.
    ///
    /// ```
    /// use sabine_acoustics::Estimate;
    /// let (low, high) = Estimate::new(1.0, 0.5).log_normal_interval(1.645);
    /// assert!((low - 0.439).abs() < 1e-3 && (high - 2.276).abs() < 1e-3);
    /// ```
    pub fn log_normal_interval(&self, quantile: f64) -> (f64, f64) {
        let factor = (quantile * self.standard_error / self.value).exp();
        (self.value / factor, self.value * factor)
    }
}

/// Rounded down, so that what is just too little is not printed as enough.
fn floor_to_tenth(value: f64) -> f64 {
    (10.0 * value).floor() / 10.0
}

/// A measured quantity: its estimate, or why it cannot be had.
pub type Reading = Result<Estimate, NoReading>;

/// Why a quantity cannot be read from a response.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum NoReading {
    /// The noise floor, or the end of the response, comes before the decay has fallen far enough (ISO 3382-2, 5.3).
    DynamicRange {
        /// Decay range that the quantity needs, in dB.
        needed_db: f64,
        /// Decay range that the response offers, in dB.
        available_db: f64,
    },
    /// No sample stands out of the noise.
    NoOnset,
    /// The band reaches beyond half the sample rate.
    AboveNyquist {
        /// The sample rate, in Hz.
        sample_rate_hz: u32,
    },
    /// A band that the quantity is made of is not among those that were measured.
    NoBand {
        /// Nominal centre of the first band needed, in Hz.
        first_hz: f64,
        /// Nominal centre of the last band needed, in Hz.
        last_hz: f64,
    },
    /// The response ends before the quantity is defined.
    TooShort {
        /// Length needed, in seconds.
        needed_s: f64,
        /// Length available, in seconds.
        available_s: f64,
    },
    /// The decay is as fast as the filter's own ringing (ISO 3382-2, 7.3: B T > 8).
    FilterRinging {
        /// Bandwidth times decay time found.
        bandwidth_time: f64,
        /// The least that is trusted.
        needed: f64,
    },
    /// The response leaves the quantity too uncertain to be of use.
    Uncertain {
        /// Standard error divided by the value.
        relative_error: f64,
        /// The most that is an answer.
        largest: f64,
    },
    /// The level does not fall.
    NoDecay,
    /// The fit of the decay has not converged.
    NotConverged,
}

impl fmt::Display for NoReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DynamicRange { needed_db, available_db } => write!(
                f,
                "needs {needed_db:.1} dB of decay range; {:.1} dB are available",
                floor_to_tenth(*available_db)
            ),
            Self::NoOnset => f.write_str("there is no onset: the response is silent or all noise"),
            Self::AboveNyquist { sample_rate_hz } => {
                write!(f, "the band reaches beyond half the sample rate of {sample_rate_hz} Hz")
            }
            Self::NoBand { first_hz, last_hz } => {
                write!(f, "needs the bands from {first_hz} to {last_hz} Hz")
            }
            Self::TooShort { needed_s, available_s } => {
                write!(f, "needs {needed_s:.3} s after the onset; there are {available_s:.3} s")
            }
            Self::FilterRinging { bandwidth_time, needed } => write!(
                f,
                "bandwidth times decay time is {bandwidth_time:.1}, below {needed:.0}: the filter's own ringing would be read"
            ),
            Self::Uncertain { relative_error, largest } => write!(
                f,
                "the standard error is {relative_error:.2} of the value; more than {largest:.2} is no answer"
            ),
            Self::NoDecay => f.write_str("the level does not decay"),
            Self::NotConverged => f.write_str("the fit of the decay has not converged"),
        }
    }
}

impl std::error::Error for NoReading {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_that_is_just_too_small_does_not_look_large_enough() {
        let reason = NoReading::DynamicRange { needed_db: 20.0, available_db: 19.98 };
        assert_eq!(reason.to_string(), "needs 20.0 dB of decay range; 19.9 dB are available");
    }
}
