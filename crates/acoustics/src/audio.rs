//! Reading and writing sound.

use crate::error::check_range;
use crate::{Error, Signal, write_atomically};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek};
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

/// Reads one channel of a WAV file (8, 16, 24 or 32-bit integers, 32-bit floating point; full scale becomes 1), or, with the
/// feature `symphonia`, of a FLAC, Ogg Vorbis or AIFF file.
///
/// # Errors
/// Each names the file: [`Error::Io`] if it cannot be opened, [`Error::NotWav`], [`Error::AudioFormat`] for a kind of WAV that
/// cannot be decoded, [`Error::Truncated`], [`Error::ManyChannels`]; [`Error::InFile`] with the cause [`Error::Empty`],
/// [`Error::NotFinite`], [`Error::Index`] for a channel that is not there, or [`Error::OutOfRange`] for the sample rate.
pub fn read_audio(path: impl AsRef<Path>, channel: Channel) -> Result<Signal, Error> {
    let path = path.as_ref();
    let mut file = open(path)?;
    if !is_wav(&mut file, path)? {
        #[cfg(feature = "symphonia")]
        return crate::audio_symphonia::decode(path, file.into_inner(), channel);
        #[cfg(not(feature = "symphonia"))]
        return Err(Error::NotWav { path: path.to_owned() });
    }
    let (mut reader, info) = wav_reader(path, file)?;
    let mixer = Mixer::new(path, channel, info.channels)?;
    let spec = reader.spec();
    // The header was held against the length of the file: this cannot ask for more memory than the file is long.
    let mut frames = Vec::with_capacity(info.frames as usize);
    let result = match spec.sample_format {
        hound::SampleFormat::Float => mixer.mix(reader.samples::<f32>(), &mut frames),
        hound::SampleFormat::Int => {
            let scale = (f64::from(spec.bits_per_sample) - 1.0).exp2().recip() as f32;
            mixer.mix(reader.samples::<i32>().map(|s| s.map(|s| s as f32 * scale)), &mut frames)
        }
    };
    result.map_err(|error| decode_error(path, error))?;
    signal_of(path, frames, info.sample_rate_hz)
}

/// Reads the header of a WAV file and holds it against the length of the file, without reading the samples.
///
/// # Errors
/// As [`read_audio`], except for what only the samples can show.
pub fn probe_wav(path: impl AsRef<Path>) -> Result<AudioInfo, Error> {
    let path = path.as_ref();
    let mut file = open(path)?;
    if !is_wav(&mut file, path)? {
        return Err(Error::NotWav { path: path.to_owned() });
    }
    Ok(wav_reader(path, file)?.1)
}

/// Writes a mono WAV file, whole or not at all ([`write_atomically`]).
///
/// # Errors
/// [`Error::InFile`] with the cause [`Error::Empty`], [`Error::NotFinite`], or [`Error::OutOfRange`] for a sample beyond full
/// scale in an integer format, a sample rate outside 1 kHz to 768 kHz or more than 4 GiB of samples; [`Error::Io`] if the file cannot be written.
/// ```
/// use sabine_acoustics::{Channel, SampleFormat, read_audio, write_wav};
/// let path = std::env::temp_dir().join(format!("sabine_write_wav_{}.wav", std::process::id()));
/// write_wav(&path, &[0.5, -0.5, 0.25], 16_000, SampleFormat::Int16)?;
/// let read = read_audio(&path, Channel::Mono)?;
/// assert_eq!((read.samples(), read.sample_rate_hz()), (&[0.5, -0.5, 0.25][..], 16_000));
/// // Beyond full scale an integer would wrap: refused, and the file stays as it was.
/// assert!(write_wav(&path, &[1.5], 16_000, SampleFormat::Int16).is_err());
/// assert_eq!(read_audio(&path, Channel::Mono)?, read);
/// # std::fs::remove_file(&path).ok();
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
pub fn write_wav(
    path: impl AsRef<Path>,
    samples: &[f32],
    sample_rate_hz: u32,
    format: SampleFormat,
) -> Result<(), Error> {
    write_wav_channels(path, &[samples], sample_rate_hz, format)
}

/// Writes a WAV file of several channels of equal length (2 for ears, 16 for third-order ambisonics), whole or not at all
/// ([`write_atomically`]).
///
/// # Errors
/// As [`write_wav`]; also [`Error::InFile`] with the cause [`Error::OutOfRange`] for no channel or more than 64, or
/// [`Error::Length`] for channels of unequal length.
pub fn write_wav_channels(
    path: impl AsRef<Path>,
    channels: &[&[f32]],
    sample_rate_hz: u32,
    format: SampleFormat,
) -> Result<(), Error> {
    let path = path.as_ref();
    check_writable(channels, sample_rate_hz, format).map_err(|error| error.in_file(path, "samples"))?;
    write_atomically(path, |file| encode(file, channels, sample_rate_hz, format))
}

/// The bytes of a mono WAV file, for whoever does not want a file of its own.
///
/// # Errors
/// [`Error::OutOfRange`] for a sample beyond full scale in an integer format.
pub fn encode_wav(signal: &Signal, format: SampleFormat) -> Result<Vec<u8>, Error> {
    encode_wav_channels(&[signal.samples()], signal.sample_rate_hz(), format)
}

/// The bytes of a WAV file of several channels.
///
/// # Errors
/// As [`write_wav_channels`], without a file to name.
pub fn encode_wav_channels(
    channels: &[&[f32]],
    sample_rate_hz: u32,
    format: SampleFormat,
) -> Result<Vec<u8>, Error> {
    check_writable(channels, sample_rate_hz, format)?;
    let mut bytes = std::io::Cursor::new(Vec::new());
    encode(&mut bytes, channels, sample_rate_hz, format)
        .map_err(|source| Error::implementation("WAV encoder", source))?;
    Ok(bytes.into_inner())
}

fn encode(
    file: impl std::io::Write + std::io::Seek,
    channels: &[&[f32]],
    sample_rate: u32,
    format: SampleFormat,
) -> std::io::Result<()> {
    let (bits_per_sample, sample_format) = match format {
        SampleFormat::Int16 => (16, hound::SampleFormat::Int),
        SampleFormat::Int24 => (24, hound::SampleFormat::Int),
        SampleFormat::Float32 => (32, hound::SampleFormat::Float),
    };
    let spec =
        hound::WavSpec { channels: channels.len() as u16, sample_rate, bits_per_sample, sample_format };
    let mut writer = hound::WavWriter::new(file, spec).map_err(into_io)?;
    let mut interleaved =
        (0..channels[0].len()).flat_map(|frame| channels.iter().map(move |samples| samples[frame]));
    match sample_format {
        hound::SampleFormat::Float => interleaved.try_for_each(|s| writer.write_sample(s)),
        hound::SampleFormat::Int => {
            let full = f32::from(bits_per_sample - 1).exp2();
            // A sample of exactly 1 has no code of its own: the largest one is a part in 2^15 below it.
            let code = |s: f32| (s * full).round().min(full - 1.0) as i32;
            interleaved.try_for_each(|s| writer.write_sample(code(s)))
        }
    }
    .map_err(into_io)?;
    writer.finalize().map_err(into_io)
}

fn check_writable(channels: &[&[f32]], sample_rate_hz: u32, format: SampleFormat) -> Result<(), Error> {
    check_range("number of channels", channels.len() as f64, 1.0, 64.0, "between 1 and 64")?;
    for samples in channels {
        crate::signal::check_samples("signal", samples, sample_rate_hz)?;
        if samples.len() != channels[0].len() {
            return Err(Error::Length { expected: channels[0].len(), found: samples.len() });
        }
        if format != SampleFormat::Float32
            && let Some(&beyond) = samples.iter().find(|s| s.abs() > 1.0)
        {
            let range = "between -1 and 1 in an integer format";
            return Err(Error::OutOfRange { field: "sample", value: f64::from(beyond), range });
        }
    }
    // The RIFF header counts bytes in 32 bits.
    let count = channels.len() * channels[0].len();
    check_range("number of samples", count as f64, 1.0, 1e9, "at most 1e9 in a WAV file")
}

fn open(path: &Path) -> Result<BufReader<File>, Error> {
    File::open(path).map(BufReader::new).map_err(|source| Error::Io { path: path.to_owned(), source })
}

/// Looks at the first twelve bytes and goes back to the first.
fn is_wav(file: &mut BufReader<File>, path: &Path) -> Result<bool, Error> {
    let mut start = Vec::with_capacity(12);
    let read = file.by_ref().take(12).read_to_end(&mut start).and_then(|_| file.rewind());
    read.map_err(|source| Error::Io { path: path.to_owned(), source })?;
    if start.is_empty() {
        return Err(Error::Empty { what: "file" }.in_file(path, "header"));
    }
    Ok(start.len() == 12 && start.starts_with(b"RIFF") && start.ends_with(b"WAVE"))
}

type WavReader = hound::WavReader<BufReader<File>>;

fn wav_reader(path: &Path, file: BufReader<File>) -> Result<(WavReader, AudioInfo), Error> {
    let metadata = file.get_ref().metadata();
    let file_bytes = metadata.map_err(|source| Error::Io { path: path.to_owned(), source })?.len();
    let reader = hound::WavReader::new(file).map_err(|error| decode_error(path, error))?;
    let spec = reader.spec();
    // A valid-bits field of the extensible header may hold anything; it scales the samples.
    check_range("bits per sample", f64::from(spec.bits_per_sample), 1.0, 32.0, "between 1 and 32")
        .map_err(|error| error.in_file(path, "header"))?;
    let promised_bytes = u64::from(reader.len()) * u64::from(spec.bits_per_sample.div_ceil(8));
    /// RIFF, `fmt ` and `data` headers at their shortest.
    const HEADERS: u64 = 44;
    if promised_bytes + HEADERS > file_bytes {
        return Err(Error::Truncated { path: path.to_owned(), promised_bytes, file_bytes });
    }
    if reader.duration() == 0 {
        return Err(Error::Empty { what: "audio" }.in_file(path, "samples"));
    }
    let info = AudioInfo {
        sample_rate_hz: spec.sample_rate,
        channels: usize::from(spec.channels),
        frames: u64::from(reader.duration()),
    };
    Ok((reader, info))
}

fn decode_error(path: &Path, error: hound::Error) -> Error {
    match error {
        // A header that breaks off is no failure of the disk: hound reports it without a code of the system's.
        hound::Error::IoError(source) if source.raw_os_error().is_some() => {
            Error::Io { path: path.to_owned(), source }
        }
        other => Error::AudioFormat { path: path.to_owned(), source: Box::new(other) },
    }
}

fn into_io(error: hound::Error) -> io::Error {
    match error {
        hound::Error::IoError(error) => error,
        other => io::Error::other(other),
    }
}

/// Makes a signal of samples from a file, and names the file where they are none.
pub(crate) fn signal_of(path: &Path, samples: Vec<f32>, sample_rate_hz: u32) -> Result<Signal, Error> {
    Signal::new(samples, sample_rate_hz).map_err(|error| {
        let field = if matches!(error, Error::OutOfRange { .. }) { "header" } else { "samples" };
        error.in_file(path, field)
    })
}

/// Turns interleaved samples into one channel.
pub(crate) struct Mixer {
    channels: usize,
    picked: Option<usize>,
}

impl Mixer {
    pub(crate) fn new(path: &Path, channel: Channel, channels: usize) -> Result<Self, Error> {
        let picked = match channel {
            Channel::Mono if channels != 1 => {
                return Err(Error::ManyChannels { path: path.to_owned(), channels });
            }
            Channel::Index(index) if index >= channels => {
                let error = Error::Index { what: "channel", index, count: channels };
                return Err(error.in_file(path, "channels"));
            }
            Channel::Mono => Some(0),
            Channel::Index(index) => Some(index),
            Channel::Mean => None,
        };
        Ok(Self { channels, picked })
    }

    pub(crate) fn mix<E>(
        &self,
        interleaved: impl Iterator<Item = Result<f32, E>>,
        frames: &mut Vec<f32>,
    ) -> Result<(), E> {
        let mut sum = 0.0;
        for (i, sample) in interleaved.enumerate() {
            let (sample, place) = (sample?, i % self.channels);
            match self.picked {
                Some(picked) if place == picked => frames.push(sample),
                Some(_) => {}
                None => {
                    sum += sample;
                    if place + 1 == self.channels {
                        frames.push(sum / self.channels as f32);
                        sum = 0.0;
                    }
                }
            }
        }
        Ok(())
    }
}
