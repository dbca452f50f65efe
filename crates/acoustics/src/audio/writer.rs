//! Sound to a file, block by block.

use super::SampleFormat;
use super::encode::{check_channels, check_count, check_full_scale, into_io, spec, write_samples};
use crate::atomic_file::UnfinishedFile;
use crate::error::Error;
use crate::signal::check_samples;
use std::fmt;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Writes a WAV file block by block, whole or not at all: until [`WavWriter::finish`] it has a temporary name, and dropped
/// before that it leaves nothing. Memory does not grow with the file.
///
/// ```
/// use sabine_acoustics::{Channel, SampleFormat, WavWriter, read_audio};
/// let path = std::env::temp_dir().join(format!("sabine_writer_{}.wav", std::process::id()));
/// let mut writer = WavWriter::create(&path, 1, 48_000, SampleFormat::Int24)?;
/// for _ in 0..10 {
///     writer.write(&[0.5; 4800])?;
/// }
/// assert!(!path.exists());
/// writer.finish()?;
/// assert_eq!(read_audio(&path, Channel::Mono)?.duration_s(), 1.0);
/// # std::fs::remove_file(&path).ok();
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
pub struct WavWriter {
    path: PathBuf,
    writer: hound::WavWriter<BufWriter<File>>,
    unfinished: UnfinishedFile,
    file: File,
    channels: usize,
    sample_rate_hz: u32,
    format: SampleFormat,
    samples: u64,
}

impl fmt::Debug for WavWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WavWriter")
            .field("path", &self.path)
            .field("samples", &self.samples)
            .finish_non_exhaustive()
    }
}

impl WavWriter {
    /// Creates the file under a temporary name.
    ///
    /// # Errors
    /// [`Error::InFile`] with the cause [`Error::OutOfRange`] for no channel or more than 64 or a sample rate outside 1 kHz to
    /// 768 kHz; [`Error::Io`].
    pub fn create(
        path: impl AsRef<Path>,
        channels: usize,
        sample_rate_hz: u32,
        format: SampleFormat,
    ) -> Result<Self, Error> {
        let path = path.as_ref();
        check_channels(channels)
            .and_then(|()| check_samples("signal", &[0.0], sample_rate_hz))
            .map_err(|error| error.in_file(path, "header"))?;
        let failed = |source| Error::Io { path: path.to_owned(), source };
        let (unfinished, file) = UnfinishedFile::create(path)?;
        let stream = BufWriter::new(file.try_clone().map_err(failed)?);
        let writer = hound::WavWriter::new(stream, spec(channels, sample_rate_hz, format))
            .map_err(|error| failed(into_io(error)))?;
        let path = path.to_owned();
        Ok(Self { path, writer, unfinished, file, channels, sample_rate_hz, format, samples: 0 })
    }

    /// Samples written so far, in all channels together.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Appends whole frames, the samples of the channels in turn; nothing where there are none.
    ///
    /// # Errors
    /// [`Error::InFile`] with the cause [`Error::Length`] for a part of a frame, [`Error::NotFinite`], or [`Error::OutOfRange`] for
    /// a sample beyond full scale in an integer format or more than 1e9 samples; [`Error::Io`].
    pub fn write(&mut self, interleaved: &[f32]) -> Result<(), Error> {
        if interleaved.is_empty() {
            return Ok(());
        }
        let samples = self.samples + interleaved.len() as u64;
        self.check(interleaved, samples).map_err(|error| error.in_file(&self.path, "samples"))?;
        write_samples(&mut self.writer, interleaved.iter().copied(), self.format)
            .map_err(|source| Error::Io { path: self.path.clone(), source })?;
        self.samples = samples;
        Ok(())
    }

    fn check(&self, interleaved: &[f32], samples: u64) -> Result<(), Error> {
        let part = interleaved.len() % self.channels;
        if part != 0 {
            let found = interleaved.len();
            return Err(Error::Length { expected: found - part + self.channels, found });
        }
        check_samples("signal", interleaved, self.sample_rate_hz)?;
        check_full_scale(interleaved, self.format)?;
        check_count(samples)
    }

    /// Completes the header and gives the file its name.
    ///
    /// # Errors
    /// [`Error::InFile`] with the cause [`Error::Empty`] where nothing was written; [`Error::Io`].
    pub fn finish(self) -> Result<(), Error> {
        if self.samples == 0 {
            return Err(Error::Empty { what: "audio" }.in_file(&self.path, "samples"));
        }
        let written = self.writer.finalize().map_err(into_io);
        self.unfinished.finish(written.map(|()| &self.file))
    }
}
