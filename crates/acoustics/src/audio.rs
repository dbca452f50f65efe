//! Reading and writing sound.

mod byte_source;
mod encode;
pub(crate) mod kind;
mod mix;
mod reader;
#[cfg(feature = "symphonia")]
mod symphonia;
mod wav;
mod wav_header;
mod writer;

pub use encode::{encode_wav, encode_wav_channels, write_wav, write_wav_channels};
pub use kind::FileKind;
pub use reader::{AudioReader, probe_audio};
pub use writer::WavWriter;

use crate::error::Error;
use crate::signal::Signal;
use std::path::Path;

/// Which channel of a file to take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Channel {
    /// The only one: a file of several channels is refused.
    #[default]
    Mono,
    /// The one of this index, counted from 0.
    Index(usize),
    /// The mean of all. Sound that reaches the microphones at different times is coloured by it.
    Mean,
}

/// How [`write_wav`] stores samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleFormat {
    /// 16-bit integers.
    Int16,
    /// 24-bit integers.
    Int24,
    /// 32-bit floating point: the only one that holds samples beyond full scale.
    #[default]
    Float32,
}

/// What the header of an audio file says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AudioInfo {
    /// Samples per second.
    pub sample_rate_hz: u32,
    /// Number of channels.
    pub channels: usize,
    /// Samples in each channel; not zero.
    pub frames: u64,
}

/// Reads one channel of a WAV file, or, with the feature `symphonia`, of a FLAC, Ogg Vorbis or AIFF file.
///
/// WAV may be RIFF, RF64 or BW64, a stream without a length in its header included, of PCM with up to 32 bits or floats with
/// 32 or 64 bits. Full scale becomes 1. For long files there is [`AudioReader`], whose memory does not grow with the file.
///
/// # Errors
/// Each names the file: [`Error::Io`] if it cannot be opened, [`Error::NotAFile`] for a folder, a named pipe or a device,
/// [`Error::AudioKind`] for a format that is not read, [`Error::AudioFormat`] for a file that contradicts itself,
/// [`Error::Truncated`], [`Error::ManyChannels`]; [`Error::InFile`] with the cause [`Error::Empty`], [`Error::NotFinite`],
/// [`Error::Index`] for a channel that is not there, or [`Error::OutOfRange`] for the sample rate or a sample more than 200 dB
/// beyond full scale.
pub fn read_audio(path: impl AsRef<Path>, channel: Channel) -> Result<Signal, Error> {
    AudioReader::open(path, channel)?.read_to_end()
}
