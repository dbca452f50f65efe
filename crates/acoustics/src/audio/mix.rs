//! One channel out of several.

use super::Channel;
use crate::error::Error;
use std::path::Path;

/// Turns interleaved samples into one channel.
#[derive(Clone, Debug)]
pub(super) struct Mixer {
    channels: usize,
    picked: Option<usize>,
}

impl Mixer {
    pub(super) fn new(path: &Path, channel: Channel, channels: usize) -> Result<Self, Error> {
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

    /// Appends one sample for each whole frame.
    pub(super) fn mix(&self, interleaved: &[f32], mixed: &mut Vec<f32>) {
        let frames = interleaved.chunks_exact(self.channels);
        match self.picked {
            Some(picked) => mixed.extend(frames.map(|frame| frame[picked])),
            None => mixed.extend(frames.map(|frame| frame.iter().sum::<f32>() / self.channels as f32)),
        }
    }
}
