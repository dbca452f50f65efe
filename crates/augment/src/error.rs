//! What can go wrong with augmentation and data sets.

use std::path::PathBuf;

/// Errors of this crate; each names the offending field, and the file where there is one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting outside its range.
    #[error("{field} is {value}; it must be {range}")]
    Setting {
        /// Name of the setting, with its unit.
        field: &'static str,
        /// The value given.
        value: f64,
        /// The range in words.
        range: &'static str,
    },
    /// No sample stands out: the response is silent or all noise.
    #[error("the response has no direct sound: its peak is only {peak_db:.1} dB above its mean level")]
    NoDirectSound {
        /// Peak over root mean square, in dB.
        peak_db: f64,
    },
    /// Samples at full scale follow one another.
    #[error("the response is clipped: {samples} consecutive samples at its peak")]
    Clipped {
        /// Length of the longest run at the peak.
        samples: usize,
    },
    /// Nothing follows the direct sound.
    #[error("the response has no late part: it ends {late_s:.3} s after the direct sound")]
    NoLatePart {
        /// Length of what follows, in seconds.
        late_s: f64,
    },
    /// A second arrival as strong as the direct sound: which one is it?
    #[error("the response has two direct peaks: {second_db:.1} dB re the first, {delay_s:.3} s later")]
    TwoDirectPeaks {
        /// Level of the second peak relative to the first, in dB.
        second_db: f64,
        /// Delay of the second peak, in seconds.
        delay_s: f64,
    },
    /// The scaled direct sound would fall below the reverberation, or no scaling reaches the target.
    #[error(
        "a direct-to-reverberant ratio of {target_db:.1} dB would bury the direct peak under the late part"
    )]
    DrrUnreachable {
        /// The ratio asked for, in dB.
        target_db: f64,
    },
    /// No decay can be fitted in a band.
    #[error("no decay can be read at {centre_hz} Hz: {reason}")]
    NoDecay {
        /// Nominal centre, in Hz.
        centre_hz: f64,
        /// Why.
        reason: sabine_acoustics::NoReading,
    },
    /// A band's equalisation cannot be measured.
    #[error("no equalisation can be read at {centre_hz} Hz: {reason}")]
    NoEqualisation {
        /// Nominal centre, in Hz.
        centre_hz: f64,
        /// Why.
        reason: sabine_acoustics::NoReading,
    },
    /// A decay too long for the response that may be made, or too short for any octave.
    #[error(
        "a reverberation time of {octave_s:.2} s at {centre_hz} Hz does not fit: {least_s} to {most_s} s do"
    )]
    T60Unreachable {
        /// Nominal centre, in Hz.
        centre_hz: f64,
        /// What the octave would get, in seconds.
        octave_s: f64,
        /// The least that is made, in seconds.
        least_s: f64,
        /// The most, in seconds.
        most_s: f64,
    },
    /// A filter of this length cannot part an octave from its neighbours that far.
    #[error("the equalisation at {centre_hz} Hz stays {off_db:.1} dB off its target")]
    EqUnreachable {
        /// Nominal centre, in Hz.
        centre_hz: f64,
        /// Target less what was reached, in dB.
        off_db: f64,
    },
    /// Sound at a rate for which this was not set up.
    #[error("the sample rate is {found_hz} Hz; {expected_hz} Hz was set up")]
    SampleRate {
        /// Rate set up, in Hz.
        expected_hz: u32,
        /// Rate of the input, in Hz.
        found_hz: u32,
    },
    /// Too few files, rooms or speakers for what is asked.
    #[error("{purpose}: at least {needed} {what} needed, {found} found")]
    TooFew {
        /// What there is too little of, in the plural.
        what: &'static str,
        /// For what.
        purpose: &'static str,
        /// How many are needed.
        needed: usize,
        /// How many there are.
        found: usize,
    },
    /// Rooms were drawn in which a source and a receiver found no place clear of walls and furniture.
    #[error("none of {rooms} rooms drawn has a place for a source and a receiver")]
    NoPlace {
        /// Rooms drawn.
        rooms: u64,
    },
    /// A room or speaker (or the same sound under another name) in two partitions.
    #[error("leak: {what} {name:?} is both in {first} and in {second}")]
    Leak {
        /// `room` or `speaker`.
        what: &'static str,
        /// Which one.
        name: String,
        /// One partition.
        first: crate::Partition,
        /// The other.
        second: crate::Partition,
    },
    /// A partition names a room or speaker that is not there.
    #[error("{what} {name:?} was assigned to {partition}, but there is no such {what}")]
    Unknown {
        /// `room` or `speaker`.
        what: &'static str,
        /// The name.
        name: String,
        /// Partition it was assigned to.
        partition: crate::Partition,
    },
    /// The output folder already holds something and resuming was not asked for.
    #[error("{}: holds a data set already; resume it or choose another folder", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// The output folder holds another data set than the one to resume.
    #[error("{}: was begun with other settings or sources; it cannot be resumed with these", path.display())]
    OtherPlan {
        /// The plan found.
        path: PathBuf,
    },
    /// A file that is not what its name promises.
    #[error("{}: {source}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: serde_json::Error,
    },
    /// A shard that cannot be encoded or decoded.
    #[error("{}: {source}", path.display())]
    Shard {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: safetensors::SafeTensorError,
    },
    /// A file or folder that cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// A transform refused its buffers.
    #[error("fast Fourier transform: {0}")]
    Transform(#[from] realfft::FftError),
    /// An error of the measures.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
}

impl From<Error> for sabine_acoustics::Error {
    fn from(error: Error) -> Self {
        match error {
            Error::Acoustics(inner) => inner,
            other => Self::implementation("augmentation", other),
        }
    }
}

/// Checks that a setting is finite and within `low..=high`.
pub(crate) fn check(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
    range: &'static str,
) -> Result<(), Error> {
    // Written so that NaN fails.
    if value >= low && value <= high { Ok(()) } else { Err(Error::Setting { field, value, range }) }
}

/// Checks a range to draw from: both ends within `low..=high`, in order.
pub(crate) fn check_span(
    field: &'static str,
    span: (f64, f64),
    low: f64,
    high: f64,
    range: &'static str,
) -> Result<(), Error> {
    check(field, span.0, low, high, range)?;
    check(field, span.1, span.0, high, range)
}
