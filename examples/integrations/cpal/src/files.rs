//! Files at the rate of the device.

use crate::Error;
use sabine_acoustics::{AudioReader, Channel, ImpulseResponse, read_audio, resample, resample_response};
use std::path::Path;

/// Responses to the left and to the right from a file of one channel (for both ears), of two, or of four: ambisonics of first
/// order as `sabine trace` writes them, of which two cardioids are made, to the left and to the right.
///
/// # Errors
/// [`Error::File`], [`Error::RoomChannels`].
pub fn read_room(path: &Path, sample_rate_hz: u32) -> Result<[ImpulseResponse; 2], Error> {
    let channel =
        |index| -> Result<ImpulseResponse, Error> { Ok(read_audio(path, Channel::Index(index))?.into()) };
    let [left, right] = match AudioReader::open(path, Channel::Index(0))?.channels() {
        1 => [channel(0)?, channel(0)?],
        2 => [channel(0)?, channel(1)?],
        4 => {
            // Half of W and Y, the first two channels.
            let (w, y) = (channel(0)?, channel(1)?);
            let cardioid = |side: f32| {
                let samples = w.samples().iter().zip(y.samples()).map(|(w, y)| 0.5 * (w + side * y));
                ImpulseResponse::new(samples.collect(), w.sample_rate_hz())
            };
            [cardioid(1.0)?, cardioid(-1.0)?]
        }
        found => return Err(Error::RoomChannels { path: path.to_owned(), found }),
    };
    Ok([resample_response(&left, sample_rate_hz)?, resample_response(&right, sample_rate_hz)?])
}

/// A recording, the mean of its channels.
///
/// # Errors
/// [`Error::File`].
pub fn read_voice(path: &Path, sample_rate_hz: u32) -> Result<Vec<f32>, Error> {
    Ok(resample(&read_audio(path, Channel::Mean)?, sample_rate_hz)?.into_samples())
}
