//! A response in the channels of ambisonics.

use crate::Error;
use crate::direction_cells::DirectionCells;
use crate::spherical_harmonics::{MAX_CHANNELS, MAX_ORDER, harmonics};
use sabine_acoustics::{
    ImpulseResponse, Orientation, OutOfRange, SampleFormat, encode_wav_channels, write_wav_channels,
};
use std::path::Path;

/// Pressure and its directional parts at a listener: ambisonics of order 1 to 3 in the channel order ACN with the
/// normalisation SN3D ("AmbiX"), x forward, y to the left, z up. Channel 0 is the pressure itself, scaled as an
/// [`ImpulseResponse`].
#[derive(Clone, Debug, PartialEq)]
pub struct AmbisonicResponse {
    channels: Vec<Vec<f32>>,
    sample_rate_hz: u32,
}

impl AmbisonicResponse {
    /// Takes 4, 9 or 16 channels of equal length.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for another number of channels, [`Error::Acoustics`] for channels that are empty, of unequal length
    /// or hold samples that are not finite, or for a sample rate outside 1 kHz to 768 kHz.
    pub fn new(channels: Vec<Vec<f32>>, sample_rate_hz: u32) -> Result<Self, Error> {
        let count = channels.len();
        let known = (1..=MAX_ORDER).any(|order| (order + 1) * (order + 1) == count);
        let value = if known { count as f64 } else { f64::NAN };
        OutOfRange::check("number of channels", value, 4.0, MAX_CHANNELS as f64, "4, 9 or 16")?;
        let expected = channels[0].len();
        for channel in &channels {
            if channel.len() != expected {
                return Err(sabine_acoustics::Error::Length { expected, found: channel.len() }.into());
            }
            ImpulseResponse::new(channel.clone(), sample_rate_hz)?;
        }
        Ok(Self { channels, sample_rate_hz })
    }

    /// Ambisonic order, 1 to 3.
    pub fn order(&self) -> usize {
        self.channels.len().isqrt() - 1
    }

    /// Samples per second.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// The channels, in the order ACN.
    pub fn channels(&self) -> &[Vec<f32>] {
        &self.channels
    }

    /// Samples of a channel, numbered by ACN.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn channel(&self, acn: usize) -> &[f32] {
        &self.channels[acn]
    }

    /// The sound field as a listener hears it who is turned so from the listener of this response.
    #[must_use]
    pub fn rotated(&self, facing: &Orientation) -> Self {
        let design = DirectionCells::for_order(MAX_ORDER);
        let pairs: Vec<_> = design
            .centres()
            .iter()
            .map(|&direction| (harmonics(direction), harmonics(facing.to_local(direction))))
            .collect();
        let mut channels = vec![vec![0.0f32; self.channels[0].len()]; self.channels.len()];
        for degree in 0..=self.order() {
            let run = degree * degree..(degree + 1) * (degree + 1);
            for to in run.clone() {
                for from in run.clone() {
                    // Projection on harmonics of this degree, whose mean square is 1 / (2l + 1); the design makes it exact.
                    let sum: f64 = pairs.iter().map(|(old, new)| old[from] * new[to]).sum();
                    let gain = (sum * (2 * degree + 1) as f64 / pairs.len() as f64) as f32;
                    for (sum, sample) in channels[to].iter_mut().zip(&self.channels[from]) {
                        *sum += gain * sample;
                    }
                }
            }
        }
        Self { channels, sample_rate_hz: self.sample_rate_hz }
    }

    /// Writes all channels as one WAV file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Acoustics`], naming the file, if it cannot be written, or if a sample is beyond full scale in an integer format.
    pub fn write_wav(&self, path: impl AsRef<Path>, format: SampleFormat) -> Result<(), Error> {
        Ok(write_wav_channels(path, &self.slices(), self.sample_rate_hz, format)?)
    }

    /// The bytes of such a file.
    ///
    /// # Errors
    /// [`Error::Acoustics`] for a sample beyond full scale in an integer format.
    pub fn encode_wav(&self, format: SampleFormat) -> Result<Vec<u8>, Error> {
        Ok(encode_wav_channels(&self.slices(), self.sample_rate_hz, format)?)
    }

    fn slices(&self) -> Vec<&[f32]> {
        self.channels.iter().map(Vec::as_slice).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A plane wave, encoded and turned, is the wave encoded in the turned frame.
        #[test]
        fn turning_the_field_is_turning_the_listener(
            wave in proptest::array::uniform3(-1.0f64..1.0),
            forward in proptest::array::uniform3(-1.0f64..1.0),
            up in proptest::array::uniform3(-1.0f64..1.0),
        ) {
            prop_assume!(wave.iter().any(|c| c.abs() > 0.1));
            let Ok(facing) = Orientation::new(forward, up) else { return Ok(()) };
            let encoded = |direction| harmonics(direction).map(|g| vec![g as f32]).to_vec();
            let turned = AmbisonicResponse::new(encoded(wave), 48_000).unwrap().rotated(&facing);
            let expected = encoded(facing.to_local(wave));
            for (found, wanted) in turned.channels().iter().zip(&expected) {
                prop_assert!((found[0] - wanted[0]).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn channels_that_make_no_order_are_refused() {
        let of = |lengths: &[usize]| {
            AmbisonicResponse::new(lengths.iter().map(|&n| vec![0.0; n]).collect(), 48_000)
        };
        assert_eq!(of(&[5; 9]).unwrap().order(), 2);
        assert!(matches!(of(&[5; 5]), Err(Error::OutOfRange(_))));
        assert!(matches!(of(&[]), Err(Error::OutOfRange(_))));
        assert!(matches!(of(&[5, 5, 4, 5]), Err(Error::Acoustics(_))));
        assert!(matches!(of(&[0; 4]), Err(Error::Acoustics(_))));
    }
}
