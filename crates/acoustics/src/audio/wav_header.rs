//! The chunks of a WAV file: RIFF, and RF64 and BW64 beyond 4 GiB (EBU Tech 3306, ITU-R BS.2088).

use super::byte_source::ByteSource;
use super::kind::FileKind;
use crate::error::Error;
use crate::out_of_range::OutOfRange;
use std::fmt;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// A size that is not known: that of a stream, or one that stands in the `ds64` chunk.
const UNKNOWN: u64 = 0xffff_ffff;
/// The length that SoX writes into the header of a stream.
const SOX_STREAM: u64 = 0x7fff_f000;
/// Format tag whose real one stands further back.
const EXTENSIBLE: u16 = 0xfffe;
/// The last 14 bytes of a subformat that is a format tag (`KSDATAFORMAT_SUBTYPE`).
const SUBFORMAT_TAIL: [u8; 14] = *b"\x00\x00\x00\x00\x10\x00\x80\x00\x00\xaa\x00\x38\x9b\x71";

/// How a sample is stored, least significant byte first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Integers in containers of 1 to 4 bytes; those of one byte are unsigned.
    Int {
        bytes: usize,
    },
    Float32,
    Float64,
}

impl Encoding {
    fn bytes(self) -> usize {
        match self {
            Self::Int { bytes } => bytes,
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }
}

/// What the chunks before the samples say.
#[derive(Clone, Copy, Debug)]
pub(super) struct WavHeader {
    pub encoding: Encoding,
    pub channels: usize,
    pub sample_rate_hz: u32,
    /// Not zero, and all there.
    pub frames: u64,
    /// Offset of the first sample in the file.
    pub data_start: u64,
}

/// A WAV file that contradicts itself.
#[derive(Debug)]
enum Malformed {
    Ends,
    BeyondEnd { id: String, bytes: u64 },
    Missing { id: &'static str },
    Short { id: &'static str, bytes: u64 },
    Frame { frame: u16, channels: u16, bits: u16 },
    PartFrame { bytes: u64, frame: usize },
}

impl fmt::Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ends => f.write_str("malformed WAV: the file ends inside its header"),
            Self::BeyondEnd { id, bytes } => {
                write!(f, "malformed WAV: chunk `{id}` of {bytes} bytes reaches beyond the end of the file")
            }
            Self::Missing { id } => write!(f, "malformed WAV: there is no `{id}` chunk before the samples"),
            Self::Short { id, bytes } => write!(f, "malformed WAV: the `{id}` chunk has {bytes} bytes"),
            Self::Frame { frame, channels, bits } => {
                write!(f, "malformed WAV: frames of {frame} bytes for {channels} channels of {bits} bits")
            }
            Self::PartFrame { bytes, frame } => write!(
                f,
                "malformed WAV: {bytes} bytes of samples are no whole number of frames of {frame} bytes"
            ),
        }
    }
}

impl std::error::Error for Malformed {}

impl WavHeader {
    pub(super) fn frame_bytes(&self) -> usize {
        self.channels * self.encoding.bytes()
    }

    /// Walks the chunks up to the samples.
    pub(super) fn read(path: &Path, file: &mut BufReader<ByteSource>) -> Result<Self, Error> {
        let file_bytes = file.get_ref().length().map_err(|error| failed(path, error))?;
        Walk { path, file, file_bytes, at: 0 }.header()
    }
}

/// A place in the file, and what goes wrong there.
struct Walk<'a> {
    path: &'a Path,
    file: &'a mut BufReader<ByteSource>,
    file_bytes: u64,
    at: u64,
}

impl Walk<'_> {
    fn header(mut self) -> Result<WavHeader, Error> {
        let [riff] = self.take::<4, 1>()?;
        self.go_to(12)?;
        let (mut format, mut long_data) = (None, None);
        loop {
            if self.at == self.file_bytes {
                return Err(self.malformed(Malformed::Missing { id: "data" }));
            }
            let [id, size] = self.take::<4, 2>()?;
            let (bytes, body) = (u64::from(u32::from_le_bytes(size)), self.at);
            match &id {
                b"data" => {
                    let format: Format =
                        format.ok_or_else(|| self.malformed(Malformed::Missing { id: "fmt " }))?;
                    let bytes =
                        if bytes == UNKNOWN && &riff != b"RIFF" { long_data.unwrap_or(bytes) } else { bytes };
                    return self.samples(format, bytes);
                }
                b"fmt " => format = Some(self.format(bytes)?),
                b"ds64" if bytes >= 16 => {
                    let [_riff_bytes, data_bytes] = self.take::<8, 2>()?;
                    long_data = Some(u64::from_le_bytes(data_bytes));
                }
                _ => {}
            }
            self.skip(&id, body, bytes)?;
        }
    }

    /// Goes to the chunk after the one at `body`. Chunks of odd length are followed by a byte of zero, except by programs that
    /// forget it: the next name then begins at once, with a letter.
    fn skip(&mut self, id: &[u8], body: u64, bytes: u64) -> Result<(), Error> {
        let end = body + bytes;
        if end > self.file_bytes {
            let id = String::from_utf8_lossy(id).into_owned();
            return Err(self.malformed(Malformed::BeyondEnd { id, bytes }));
        }
        self.go_to(end)?;
        if bytes % 2 == 1 && end < self.file_bytes {
            let [[padding]] = self.take::<1, 1>()?;
            if padding != 0 {
                self.go_to(end)?;
            }
        }
        Ok(())
    }

    fn format(&mut self, bytes: u64) -> Result<Format, Error> {
        if bytes < 16 {
            return Err(self.malformed(Malformed::Short { id: "fmt ", bytes }));
        }
        let [tag, channels] = self.take::<2, 2>()?.map(u16::from_le_bytes);
        let [sample_rate_hz, _] = self.take::<4, 2>()?.map(u32::from_le_bytes);
        let [frame, bits] = self.take::<2, 2>()?.map(u16::from_le_bytes);
        let mut format = Format { tag, channels, sample_rate_hz, frame, bits };
        if tag == EXTENSIBLE && bytes >= 40 {
            // Size of the extension, valid bits, places of the loudspeakers.
            let [_extension] = self.take::<8, 1>()?;
            let [subformat] = self.take::<2, 1>()?;
            let [tail] = self.take::<14, 1>()?;
            if tail == SUBFORMAT_TAIL {
                format.tag = u16::from_le_bytes(subformat);
            }
        }
        Ok(format)
    }

    fn samples(&self, format: Format, promised_bytes: u64) -> Result<WavHeader, Error> {
        let (encoding, channels) = self.encoding(format)?;
        let header = |error: Error| error.in_file(self.path, "header");
        OutOfRange::check(
            "sample rate (Hz)",
            f64::from(format.sample_rate_hz),
            1e3,
            768e3,
            "between 1 kHz and 768 kHz",
        )
        .map_err(|error| header(error.into()))?;
        let left = self.file_bytes - self.at;
        let frame = channels * encoding.bytes();
        let is_stream = promised_bytes == UNKNOWN || promised_bytes == SOX_STREAM && left < SOX_STREAM;
        let bytes = if is_stream { left - left % frame as u64 } else { promised_bytes };
        if bytes > left {
            let (path, file_bytes) = (self.path.to_owned(), self.file_bytes);
            return Err(Error::Truncated { path, promised_bytes, file_bytes });
        }
        if bytes % frame as u64 != 0 {
            return Err(self.malformed(Malformed::PartFrame { bytes, frame }));
        }
        if bytes == 0 {
            return Err(Error::Empty { what: "audio" }.in_file(self.path, "samples"));
        }
        Ok(WavHeader {
            encoding,
            channels,
            sample_rate_hz: format.sample_rate_hz,
            frames: bytes / frame as u64,
            data_start: self.at,
        })
    }

    fn encoding(&self, format: Format) -> Result<(Encoding, usize), Error> {
        let Format { tag, channels, frame, bits, .. } = format;
        let encoding = match (tag, bits) {
            (1, bits) => {
                let range = "between 1 and 32";
                OutOfRange::check("bits per sample", f64::from(bits), 1.0, 32.0, range)
                    .map_err(|error| Error::from(error).in_file(self.path, "header"))?;
                Encoding::Int { bytes: usize::from(bits.div_ceil(8)) }
            }
            (3, 32) => Encoding::Float32,
            (3, 64) => Encoding::Float64,
            (3, _) => return Err(self.malformed(Malformed::Frame { frame, channels, bits })),
            (tag, _) => {
                return Err(Error::AudioKind { path: self.path.to_owned(), found: FileKind::Wav { tag } });
            }
        };
        let count = usize::from(channels);
        // A container wider than its bits need would leave it open at which end they stand.
        if count == 0 || usize::from(frame) != count * encoding.bytes() {
            return Err(self.malformed(Malformed::Frame { frame, channels, bits }));
        }
        Ok((encoding, count))
    }

    /// Reads `COUNT` fields of `N` bytes.
    fn take<const N: usize, const COUNT: usize>(&mut self) -> Result<[[u8; N]; COUNT], Error> {
        let mut fields = [[0; N]; COUNT];
        for field in &mut fields {
            self.file.read_exact(field).map_err(|error| failed(self.path, error))?;
            self.at += N as u64;
        }
        Ok(fields)
    }

    fn go_to(&mut self, at: u64) -> Result<(), Error> {
        self.at = at;
        self.file.seek(SeekFrom::Start(at)).map(|_| ()).map_err(|error| failed(self.path, error))
    }

    fn malformed(&self, fault: Malformed) -> Error {
        Error::AudioFormat { path: self.path.to_owned(), source: Box::new(fault) }
    }
}

/// The fields of the `fmt ` chunk.
#[derive(Clone, Copy)]
struct Format {
    tag: u16,
    channels: u16,
    sample_rate_hz: u32,
    frame: u16,
    bits: u16,
}

/// A file that ends where it must not is malformed; everything else is the disk's.
pub(super) fn failed(path: &Path, error: io::Error) -> Error {
    if error.kind() == io::ErrorKind::UnexpectedEof {
        return Error::AudioFormat { path: path.to_owned(), source: Box::new(Malformed::Ends) };
    }
    Error::Io { path: path.to_owned(), source: error }
}
