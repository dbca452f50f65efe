//! What a user should know before trusting a match.

use sabine_optimize::Unreachable;

/// Something that does not stop the match but limits what it is worth; `Display` says it in words.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Warning {
    /// Some peaks of the recording are cut off.
    #[error("{percent:.2} % of the recording's samples are clipped: the estimates may be off")]
    SlightlyClipped {
        /// Share of samples in flat tops, in percent.
        percent: f64,
    },
    /// What the estimator says of the recording.
    #[error("recording: {0}")]
    Speech(sabine_estimator::Warning),
    /// What should be known of the room before numbers are believed: materials without a table, doubtful units.
    #[error("{0}")]
    Room(sabine_scene::RoomNote),
    /// The room file says nothing about the air.
    #[error("the room file has no [air]: 20 C, 50 % and 101.325 kPa are assumed")]
    AirAssumed,
    /// The dry sound was brought to another sample rate.
    #[error("the dry sound was resampled from {from_hz} to {to_hz} Hz, so that the 8 kHz octave exists")]
    DryResampled {
        /// Its sample rate in Hz.
        from_hz: u32,
        /// Sample rate of the result in Hz.
        to_hz: u32,
    },
    /// The recording was brought to the estimator's sample rate.
    #[error("the recording was resampled from {from_hz} to {to_hz} Hz for the estimator")]
    SpeechResampled {
        /// Its sample rate in Hz.
        from_hz: u32,
        /// Sample rate of the estimator in Hz.
        to_hz: u32,
    },
    /// To meet the targets, a material left what the room file says of it.
    #[error(
        "{material}: the fitted absorption is up to {deviations:.0} standard deviations away from the room file's table (at {})",
        in_hz(bands_hz)
    )]
    FarFromTable {
        /// Name of the material.
        material: String,
        /// Nominal octave centres in Hz.
        bands_hz: Vec<f64>,
        /// Largest distance, in standard deviations of the table.
        deviations: f64,
    },
    /// What the fit says of the paths.
    #[error("fit: {0}")]
    Fit(sabine_optimize::Warning),
    /// A reverberation time that no absorption gives.
    #[error("{0}")]
    Unreachable(Unreachable),
    /// A reverberation time that could not be read from the rendered response.
    #[error("{band_hz} Hz: the reverberation time of the rendered response cannot be read: {reason}")]
    NotRead {
        /// Nominal octave centre in Hz.
        band_hz: f64,
        /// Why.
        reason: sabine_acoustics::NoReading,
    },
    /// The rendered response misses a target that should be within reach.
    #[error("{band_hz} Hz: the rendered response decays in {reached_s:.2} s; the target is {target_s:.2} s")]
    Missed {
        /// Nominal octave centre in Hz.
        band_hz: f64,
        /// Target in seconds.
        target_s: f64,
        /// Reverberation time read from the rendered response, in seconds.
        reached_s: f64,
    },
    /// An equalisation too large to be believed.
    #[error("{band_hz} Hz: an equalisation of {wanted_db:.0} dB is asked for; {limit_db:.0} dB are applied")]
    EqLimited {
        /// Nominal octave centre in Hz.
        band_hz: f64,
        /// Gain asked for, in dB.
        wanted_db: f64,
        /// Greatest gain that is applied, in dB.
        limit_db: f64,
    },
    /// An equalisation that the filter does not meet.
    #[error("{band_hz} Hz: the filter gives {realised_db:.1} dB; {wanted_db:.1} dB are wanted")]
    EqMissed {
        /// Nominal octave centre in Hz.
        band_hz: f64,
        /// Gain that was asked for, in dB.
        wanted_db: f64,
        /// Gain of the filter, in dB.
        realised_db: f64,
    },
    /// An equalisation that is hardly heard: what is applied is close to the average of the rooms trained on.
    #[error(
        "the equalisation at {} is heard with a standard error of {least_db:.0} dB or more: it is mostly the average of the rooms that the network was trained on",
        in_hz(bands_hz)
    )]
    EqUncertain {
        /// Nominal octave centres in Hz.
        bands_hz: Vec<f64>,
        /// Least standard error among them, in dB.
        least_db: f64,
    },
    /// The mesh is not quite closed, or not quite clean.
    #[error("room model: {0}")]
    Mesh(String),
}

fn in_hz(bands_hz: &[f64]) -> String {
    let names: Vec<String> = bands_hz.iter().map(|hz| format!("{hz}")).collect();
    format!("{} Hz", names.join(", "))
}
