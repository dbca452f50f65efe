//! Sound in formats other than WAV, by symphonia.

use crate::audio::{Channel, Mixer, signal_of};
use crate::{Error, Signal};
use std::fs::File;
use std::path::Path;
use symphonia::core::codecs::audio::AudioDecoderOptions;
use symphonia::core::formats::probe::Hint;
use symphonia::core::formats::{FormatOptions, TrackType};
use symphonia::core::io::MediaSourceStream;
use symphonia::core::meta::MetadataOptions;

/// Decodes one channel of the default audio track. Memory grows with what is decoded, never with what a header promises.
pub(crate) fn decode(path: &Path, file: File, channel: Channel) -> Result<Signal, Error> {
    let malformed = |source: Box<dyn std::error::Error + Send + Sync>| Error::AudioFormat {
        path: path.to_owned(),
        source,
    };
    let stream = MediaSourceStream::new(Box::new(file), Default::default());
    let mut format = symphonia::default::get_probe()
        .probe(&Hint::new(), stream, FormatOptions::default(), MetadataOptions::default())
        .map_err(|error| malformed(error.into()))?;
    let empty = || Error::Empty { what: "audio" }.in_file(path, "samples");
    let track = format.default_track(TrackType::Audio).ok_or_else(empty)?;
    let (track_id, promised) = (track.id, track.num_frames);
    let parameters = track.codec_params.as_ref().and_then(|p| p.audio()).ok_or_else(empty)?;
    let mut decoder = symphonia::default::get_codecs()
        .make_audio_decoder(parameters, &AudioDecoderOptions::default())
        .map_err(|error| malformed(error.into()))?;
    let (mut frames, mut interleaved) = (Vec::new(), Vec::<f32>::new());
    let mut layout = None;
    while let Some(packet) = format.next_packet().map_err(|error| malformed(error.into()))? {
        if packet.track_id != track_id {
            continue;
        }
        let buffer = decoder.decode(&packet).map_err(|error| malformed(error.into()))?;
        let now = (buffer.spec().channels().count(), buffer.spec().rate());
        if *layout.get_or_insert(now) != now {
            // Chained streams may change both; to glue them together would be wrong.
            return Err(malformed(symphonia::core::errors::Error::ResetRequired.into()));
        }
        buffer.copy_to_vec_interleaved(&mut interleaved);
        let mixer = Mixer::new(path, channel, now.0)?;
        let Ok(()) =
            mixer.mix(interleaved.iter().map(|&s| Ok::<_, std::convert::Infallible>(s)), &mut frames);
    }
    let (_, sample_rate_hz) = layout.ok_or_else(empty)?;
    if promised.is_some_and(|promised| (frames.len() as u64) < promised) {
        return Err(malformed(std::io::Error::from(std::io::ErrorKind::UnexpectedEof).into()));
    }
    signal_of(path, frames, sample_rate_hz)
}
