//! What can go wrong.

use std::path::PathBuf;
use std::time::Duration;

/// Why nothing is to be heard, or nothing any more.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read, or a rate that it cannot be brought to.
    #[error(transparent)]
    File(#[from] sabine_acoustics::Error),
    /// A response or a gain that the reverb refuses.
    #[error(transparent)]
    Reverb(#[from] sabine_eqfilter::Error),
    /// A file of responses that leads to no two ears.
    #[error("{}: {found} channels; a room has 1 (for both ears), 2 (left, right) or 4 (ambisonics of first order)", path.display())]
    RoomChannels {
        /// The file.
        path: PathBuf,
        /// Its channels.
        found: usize,
    },
    /// A device without channels, or with more than anybody has.
    #[error("a device with {found} channels; it must have 1 to 64")]
    DeviceChannels {
        /// Its channels.
        found: u16,
    },
    /// The microphone is heard through the same clock as the loudspeaker, or not at all.
    #[error(
        "the microphone runs at {microphone_hz} Hz, the output at {output_hz} Hz; set both to one rate, or give --rate"
    )]
    MicrophoneRate {
        /// Sample rate of the microphone in Hz.
        microphone_hz: u32,
        /// Sample rate of the output in Hz.
        output_hz: u32,
    },
    /// A time between microphone and loudspeaker that is none.
    #[error("a delay of {delay_s} s; it must be between 0.001 and 2 s")]
    Delay {
        /// The delay asked for.
        delay_s: f64,
    },
    /// The sound system says that the device is gone.
    #[error("the {device} has gone: {reason}")]
    Gone {
        /// Which device.
        device: &'static str,
        /// The sound system's words.
        reason: String,
    },
    /// The sound system says nothing, and asks for no sound.
    #[error("the output has asked for no sound for {:.1} s: the device has gone, or the sound system hangs ({fault})", since.as_secs_f64())]
    Silent {
        /// Time since the last callback.
        since: Duration,
        /// What it said last.
        fault: String,
    },
}
