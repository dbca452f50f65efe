//! Sound in formats other than WAV, by symphonia.

use super::byte_source::ByteSource;
use crate::error::Error;
use std::path::{Path, PathBuf};
use symphonia::core::codecs::audio::{AudioDecoder, AudioDecoderOptions};
use symphonia::core::formats::probe::Hint;
use symphonia::core::formats::{FormatOptions, FormatReader, TrackType};
use symphonia::core::io::MediaSourceStream;
use symphonia::core::meta::MetadataOptions;

/// Decodes the default audio track packet by packet. Memory grows with what is decoded, never with what a header promises.
pub(super) struct PacketDecoder {
    path: PathBuf,
    format: Box<dyn FormatReader>,
    decoder: Box<dyn AudioDecoder>,
    track_id: u32,
    promised: Option<u64>,
    channels: usize,
    sample_rate_hz: u32,
    frames: u64,
    /// The first packet, which had to be decoded to know the layout.
    first: Option<Vec<f32>>,
}

impl PacketDecoder {
    pub(super) fn open(path: &Path, file: ByteSource) -> Result<Self, Error> {
        let stream = MediaSourceStream::new(Box::new(file), Default::default());
        let format = symphonia::default::get_probe()
            .probe(&Hint::new(), stream, FormatOptions::default(), MetadataOptions::default())
            .map_err(|error| malformed(path, error))?;
        let empty = || Error::Empty { what: "audio" }.in_file(path, "samples");
        let track = format.default_track(TrackType::Audio).ok_or_else(empty)?;
        let (track_id, promised) = (track.id, track.num_frames);
        let parameters = track.codec_params.as_ref().and_then(|p| p.audio()).ok_or_else(empty)?;
        let decoder = symphonia::default::get_codecs()
            .make_audio_decoder(parameters, &AudioDecoderOptions::default())
            .map_err(|error| malformed(path, error))?;
        let path = path.to_owned();
        let (channels, sample_rate_hz, frames) = (0, 0, 0);
        let mut new =
            Self { path, format, decoder, track_id, promised, channels, sample_rate_hz, frames, first: None };
        let mut first = Vec::new();
        new.packet(&mut first)?;
        if first.is_empty() {
            return Err(Error::Empty { what: "audio" }.in_file(&new.path, "samples"));
        }
        new.first = Some(first);
        Ok(new)
    }

    pub(super) fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    /// What the container promises, if it does.
    pub(super) fn frames(&self) -> Option<u64> {
        self.promised
    }

    /// Replaces `interleaved` by the next frames; leaves it empty at the end.
    pub(super) fn decode(&mut self, interleaved: &mut Vec<f32>) -> Result<(), Error> {
        if let Some(first) = self.first.take() {
            *interleaved = first;
            return Ok(());
        }
        self.packet(interleaved)
    }

    /// Decodes packets until one holds sound.
    fn packet(&mut self, interleaved: &mut Vec<f32>) -> Result<(), Error> {
        interleaved.clear();
        while let Some(packet) = self.format.next_packet().map_err(|error| malformed(&self.path, error))? {
            if packet.track_id != self.track_id {
                continue;
            }
            let buffer = self.decoder.decode(&packet).map_err(|error| malformed(&self.path, error))?;
            let now = (buffer.spec().channels().count(), buffer.spec().rate());
            if self.channels == 0 {
                (self.channels, self.sample_rate_hz) = now;
            } else if (self.channels, self.sample_rate_hz) != now {
                // Chained streams may change both; to glue them together would be wrong.
                return Err(malformed(&self.path, symphonia::core::errors::Error::ResetRequired));
            }
            buffer.copy_to_vec_interleaved(interleaved);
            if !interleaved.is_empty() {
                self.frames += (interleaved.len() / self.channels.max(1)) as u64;
                return Ok(());
            }
        }
        if self.promised.is_some_and(|promised| self.frames < promised) {
            return Err(malformed(&self.path, std::io::Error::from(std::io::ErrorKind::UnexpectedEof)));
        }
        Ok(())
    }
}

fn malformed(path: &Path, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::AudioFormat { path: path.to_owned(), source: source.into() }
}
