//! Samples of a WAV file.

use super::byte_source::ByteSource;
use super::wav_header::{Encoding, WavHeader, failed};
use crate::error::Error;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Bytes that are decoded at a time, about.
const BLOCK_BYTES: usize = 1 << 16;

/// Decodes a WAV file block by block.
pub(super) struct WavDecoder {
    path: PathBuf,
    file: BufReader<ByteSource>,
    header: WavHeader,
    frames_left: u64,
    bytes: Vec<u8>,
}

impl WavDecoder {
    /// Reads the header and holds it against the length of the file.
    pub(super) fn open(path: &Path, mut file: BufReader<ByteSource>) -> Result<Self, Error> {
        let header = WavHeader::read(path, &mut file)?;
        file.seek(SeekFrom::Start(header.data_start)).map_err(|error| failed(path, error))?;
        Ok(Self { path: path.to_owned(), file, header, frames_left: header.frames, bytes: Vec::new() })
    }

    pub(super) fn header(&self) -> &WavHeader {
        &self.header
    }

    /// Replaces `interleaved` by the next frames; leaves it empty at the end.
    pub(super) fn decode(&mut self, interleaved: &mut Vec<f32>) -> Result<(), Error> {
        interleaved.clear();
        let frame_bytes = self.header.frame_bytes();
        let frames = ((BLOCK_BYTES / frame_bytes).max(1) as u64).min(self.frames_left);
        self.bytes.resize(frames as usize * frame_bytes, 0);
        self.file.read_exact(&mut self.bytes).map_err(|error| failed(&self.path, error))?;
        self.frames_left -= frames;
        match self.header.encoding {
            Encoding::Float32 => interleaved.extend(words(&self.bytes).map(f32::from_le_bytes)),
            // What single precision cannot hold becomes infinite, and is refused as such.
            Encoding::Float64 => {
                interleaved.extend(words(&self.bytes).map(|word| f64::from_le_bytes(word) as f32));
            }
            Encoding::Int { bytes: 1 } => {
                interleaved.extend(self.bytes.iter().map(|&b| (f32::from(b) - 128.0) / 128.0));
            }
            Encoding::Int { bytes } => {
                // Fewer bits than the container stand at its upper end: full scale is that of the container.
                interleaved.extend(self.bytes.chunks_exact(bytes).map(|word| {
                    let mut wide = [0; 4];
                    wide[4 - bytes..].copy_from_slice(word);
                    (f64::from(i32::from_le_bytes(wide)) / 2_147_483_648.0) as f32
                }));
            }
        }
        Ok(())
    }
}

fn words<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> {
    bytes.as_chunks::<N>().0.iter().copied()
}
