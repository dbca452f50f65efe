//! Sound from a file, block by block.

use super::byte_source::ByteSource;
use super::kind::{FileKind, LOOK};
use super::mix::Mixer;
use super::wav::WavDecoder;
use super::{AudioInfo, Channel};
use crate::error::Error;
use crate::out_of_range::OutOfRange;
use crate::regular_file::open_file;
use crate::signal::Signal;
use std::fmt;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest magnitude that is read, 200 dB above full scale: beyond the integers of 32 bits that some programs store as floats
/// lies no sound.
const GREATEST: f32 = 1e10;

/// Reads one channel of an audio file block by block: memory does not grow with the length of the file.
///
/// The formats are those of [`read_audio`](crate::read_audio).
///
/// ```
/// use sabine_acoustics::{AudioReader, Channel, SampleFormat, write_wav};
/// let path = std::env::temp_dir().join(format!("sabine_reader_{}.wav", std::process::id()));
/// write_wav(&path, &[0.25; 1000], 8000, SampleFormat::Int16)?;
/// let mut reader = AudioReader::open(&path, Channel::Mono)?;
/// let (mut block, mut sum) = (Vec::new(), 0.0);
/// while reader.read_block(&mut block, 300)? > 0 {
///     sum += block.iter().sum::<f32>();
/// }
/// assert_eq!((sum, reader.position()), (250.0, 1000));
/// # std::fs::remove_file(&path).ok();
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
pub struct AudioReader {
    path: PathBuf,
    decoder: Decoder,
    mixer: Mixer,
    sample_rate_hz: u32,
    channels: usize,
    frames: Option<u64>,
    interleaved: Vec<f32>,
    /// Samples of the channel that were decoded and not yet handed out, from `taken` on.
    mixed: Vec<f32>,
    taken: usize,
    position: u64,
}

enum Decoder {
    Wav(WavDecoder),
    #[cfg(feature = "symphonia")]
    Other(super::symphonia::PacketDecoder),
}

impl Decoder {
    fn decode(&mut self, interleaved: &mut Vec<f32>) -> Result<(), Error> {
        match self {
            Self::Wav(decoder) => decoder.decode(interleaved),
            #[cfg(feature = "symphonia")]
            Self::Other(decoder) => decoder.decode(interleaved),
        }
    }
}

impl fmt::Debug for AudioReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("AudioReader")
            .field("path", &self.path)
            .field("sample_rate_hz", &self.sample_rate_hz)
            .field("frames", &self.frames)
            .field("position", &self.position)
            .finish_non_exhaustive()
    }
}

impl AudioReader {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    /// As [`read_audio`](crate::read_audio), except for what only the samples can show.
    pub fn open(path: impl AsRef<Path>, channel: Channel) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::of_source(path, ByteSource::File(open_file(path)?), channel)
    }

    /// Reads the header of a file that is in memory already, as a browser hands it over; `name` stands in messages where a path would.
    ///
    /// ```
    /// use sabine_acoustics::{AudioReader, Channel, SampleFormat, Signal, encode_wav};
    /// let bytes = encode_wav(&Signal::new(vec![0.25; 1000], 8000)?, SampleFormat::Int16)?;
    /// let mut reader = AudioReader::of_bytes("dropped.wav", bytes, Channel::Mono)?;
    /// let mut block = Vec::new();
    /// assert_eq!((reader.read_block(&mut block, 2000)?, block[999]), (1000, 0.25));
    /// let message = AudioReader::of_bytes("photo.wav", *b"\x89PNG\r\n", Channel::Mono).unwrap_err().to_string();
    /// assert!(message.starts_with("photo.wav: this is PNG"), "{message}");
    /// # Ok::<(), sabine_acoustics::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`AudioReader::open`], without those of opening a file.
    pub fn of_bytes(
        name: impl AsRef<Path>,
        bytes: impl Into<Arc<[u8]>>,
        channel: Channel,
    ) -> Result<Self, Error> {
        Self::of_source(name.as_ref(), ByteSource::Memory(Cursor::new(bytes.into())), channel)
    }

    fn of_source(path: &Path, source: ByteSource, channel: Channel) -> Result<Self, Error> {
        let decoder = Decoder::open(path, source)?;
        let (sample_rate_hz, channels, frames) = match &decoder {
            Decoder::Wav(wav) => {
                let header = wav.header();
                (header.sample_rate_hz, header.channels, Some(header.frames))
            }
            #[cfg(feature = "symphonia")]
            Decoder::Other(other) => (other.sample_rate_hz(), other.channels(), other.frames()),
        };
        OutOfRange::check(
            "sample rate (Hz)",
            f64::from(sample_rate_hz),
            1e3,
            768e3,
            "between 1 kHz and 768 kHz",
        )
        .map_err(|error| Error::from(error).in_file(path, "header"))?;
        Ok(Self {
            mixer: Mixer::new(path, channel, channels)?,
            path: path.to_owned(),
            decoder,
            sample_rate_hz,
            channels,
            frames,
            interleaved: Vec::new(),
            mixed: Vec::new(),
            taken: 0,
            position: 0,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Samples per second.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// Number of channels in the file.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Samples in each channel, where the header says so: always in WAV. The samples of a WAV file are known to be there.
    pub fn frames(&self) -> Option<u64> {
        self.frames
    }

    /// Whether all samples that the header promises are known to be there.
    fn is_whole(&self) -> bool {
        matches!(self.decoder, Decoder::Wav(_))
    }

    /// Samples handed out so far.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Replaces `block` by the next samples of the channel, `most` or what is left of the file, and says how many there are: 0
    /// at the end.
    ///
    /// # Errors
    /// Each names the file: [`Error::Io`]; [`Error::AudioFormat`] for packets that cannot be decoded or are missing;
    /// [`Error::InFile`] with the cause [`Error::NotFinite`], [`Error::OutOfRange`] for a sample more than 200 dB beyond full
    /// scale, or [`Error::Empty`] for a file without samples.
    pub fn read_block(&mut self, block: &mut Vec<f32>, most: usize) -> Result<usize, Error> {
        block.clear();
        while block.len() < most {
            if self.taken == self.mixed.len() {
                self.decoder.decode(&mut self.interleaved)?;
                self.taken = 0;
                self.mixed.clear();
                self.mixer.mix(&self.interleaved, &mut self.mixed);
                if self.mixed.is_empty() {
                    break;
                }
                self.check()?;
            }
            let wanted = (most - block.len()).min(self.mixed.len() - self.taken);
            block.extend_from_slice(&self.mixed[self.taken..self.taken + wanted]);
            self.taken += wanted;
        }
        self.position += block.len() as u64;
        if self.position == 0 && most > 0 {
            return Err(Error::Empty { what: "audio" }.in_file(&self.path, "samples"));
        }
        Ok(block.len())
    }

    /// Leaves out samples; fewer if the file ends before.
    ///
    /// # Errors
    /// As [`AudioReader::read_block`].
    pub fn skip(&mut self, samples: u64) -> Result<(), Error> {
        let (mut block, end) = (Vec::new(), self.position + samples);
        while self.position < end {
            let most = usize::try_from(end - self.position).unwrap_or(usize::MAX).min(1 << 16);
            if self.read_block(&mut block, most)? == 0 {
                break;
            }
        }
        Ok(())
    }

    /// All that is left of the channel. Memory grows with it: where a file may be of any length, look at [`AudioReader::frames`] first.
    ///
    /// # Errors
    /// As [`AudioReader::read_block`]; [`Error::InFile`] with the cause [`Error::Empty`] where nothing is left.
    pub fn read_to_end(mut self) -> Result<Signal, Error> {
        // The header of a WAV file was held against the length of the file; others grow with what is decoded.
        let known = self.frames().filter(|_| self.is_whole()).unwrap_or(0).saturating_sub(self.position);
        let (mut samples, mut block) = (Vec::with_capacity(known as usize), Vec::new());
        while self.read_block(&mut block, 1 << 16)? > 0 {
            samples.extend_from_slice(&block);
        }
        Signal::new(samples, self.sample_rate_hz).map_err(|error| error.in_file(&self.path, "samples"))
    }

    /// That what was just decoded is sound.
    fn check(&self) -> Result<(), Error> {
        let Some(at) = self.mixed.iter().position(|s| s.is_nan() || s.abs() > GREATEST) else {
            return Ok(());
        };
        let (sample, index) = (self.mixed[at], self.position as usize + at);
        let error = if sample.is_finite() {
            let range = "within 200 dB of full scale (1)";
            Error::OutOfRange(OutOfRange { field: "a sample", value: f64::from(sample), range })
        } else {
            Error::NotFinite { what: "signal", index }
        };
        Err(error.in_file(&self.path, "samples"))
    }
}

impl Decoder {
    fn open(path: &Path, source: ByteSource) -> Result<Self, Error> {
        let failed = |source| Error::Io { path: path.to_owned(), source };
        let mut file = BufReader::new(source);
        let mut start = Vec::with_capacity(LOOK);
        file.by_ref()
            .take(LOOK as u64)
            .read_to_end(&mut start)
            .and_then(|_| file.rewind())
            .map_err(failed)?;
        if start.is_empty() {
            return Err(Error::Empty { what: "file" }.in_file(path, "header"));
        }
        match FileKind::of(&start) {
            FileKind::Wav { .. } => Ok(Self::Wav(WavDecoder::open(path, file)?)),
            #[cfg(feature = "symphonia")]
            FileKind::Flac | FileKind::Ogg | FileKind::Aiff => {
                Ok(Self::Other(super::symphonia::PacketDecoder::open(path, file.into_inner())?))
            }
            found => Err(Error::AudioKind { path: path.to_owned(), found }),
        }
    }
}

/// Reads the header of an audio file, and of WAV holds it against the length of the file, without reading the samples; formats
/// that do not say how long they are, are decoded for it.
///
/// # Errors
/// As [`read_audio`](crate::read_audio), except for what only the samples can show.
pub fn probe_audio(path: impl AsRef<Path>) -> Result<AudioInfo, Error> {
    let mut reader = AudioReader::open(path, Channel::Index(0))?;
    let frames = match reader.frames {
        Some(frames) => frames,
        None => {
            reader.skip(u64::MAX)?;
            reader.position()
        }
    };
    Ok(AudioInfo { sample_rate_hz: reader.sample_rate_hz, channels: reader.channels, frames })
}
