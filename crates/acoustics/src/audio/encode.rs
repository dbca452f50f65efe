//! Writing sound.

use super::SampleFormat;
use crate::atomic_file::write_atomically;
use crate::error::Error;
use crate::out_of_range::OutOfRange;
use crate::signal::Signal;
use std::io;
use std::path::Path;

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
    sample_rate_hz: u32,
    format: SampleFormat,
) -> io::Result<()> {
    let spec = spec(channels.len(), sample_rate_hz, format);
    let mut writer = hound::WavWriter::new(file, spec).map_err(into_io)?;
    let interleaved =
        (0..channels[0].len()).flat_map(|frame| channels.iter().map(move |samples| samples[frame]));
    write_samples(&mut writer, interleaved, format)?;
    writer.finalize().map_err(into_io)
}

/// The header of a file.
pub(super) fn spec(channels: usize, sample_rate: u32, format: SampleFormat) -> hound::WavSpec {
    let (bits_per_sample, sample_format) = match format {
        SampleFormat::Int16 => (16, hound::SampleFormat::Int),
        SampleFormat::Int24 => (24, hound::SampleFormat::Int),
        SampleFormat::Float32 => (32, hound::SampleFormat::Float),
    };
    hound::WavSpec { channels: channels as u16, sample_rate, bits_per_sample, sample_format }
}

/// Appends samples, which were checked before.
pub(super) fn write_samples<W: io::Write + io::Seek>(
    writer: &mut hound::WavWriter<W>,
    mut interleaved: impl Iterator<Item = f32>,
    format: SampleFormat,
) -> io::Result<()> {
    let bits = match format {
        SampleFormat::Int16 => 16,
        SampleFormat::Int24 => 24,
        SampleFormat::Float32 => {
            return interleaved.try_for_each(|s| writer.write_sample(s)).map_err(into_io);
        }
    };
    let full = f32::from(bits - 1_u16).exp2();
    // A sample of exactly 1 has no code of its own: the largest one is a part in 2^15 below it.
    let code = |s: f32| (s * full).round().min(full - 1.0) as i32;
    interleaved.try_for_each(|s| writer.write_sample(code(s))).map_err(into_io)
}

fn check_writable(channels: &[&[f32]], sample_rate_hz: u32, format: SampleFormat) -> Result<(), Error> {
    check_channels(channels.len())?;
    for samples in channels {
        crate::signal::check_samples("signal", samples, sample_rate_hz)?;
        if samples.len() != channels[0].len() {
            return Err(Error::Length { expected: channels[0].len(), found: samples.len() });
        }
        check_full_scale(samples, format)?;
    }
    check_count((channels.len() * channels[0].len()) as u64)
}

pub(super) fn check_channels(channels: usize) -> Result<(), Error> {
    Ok(OutOfRange::check("number of channels", channels as f64, 1.0, 64.0, "between 1 and 64")?)
}

/// That an integer format can hold the samples.
pub(super) fn check_full_scale(samples: &[f32], format: SampleFormat) -> Result<(), Error> {
    if format != SampleFormat::Float32
        && let Some(&beyond) = samples.iter().find(|s| s.abs() > 1.0)
    {
        let range = "between -1 and 1 in an integer format";
        return Err(Error::OutOfRange(OutOfRange { field: "sample", value: f64::from(beyond), range }));
    }
    Ok(())
}

/// That the RIFF header, which counts bytes in 32 bits, can count so many samples.
pub(super) fn check_count(samples: u64) -> Result<(), Error> {
    Ok(OutOfRange::check("number of samples", samples as f64, 1.0, 1e9, "between 1 and 1e9 in a WAV file")?)
}

pub(super) fn into_io(error: hound::Error) -> io::Error {
    match error {
        hound::Error::IoError(error) => error,
        other => io::Error::other(other),
    }
}
