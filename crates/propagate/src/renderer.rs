//! From paths to the channels of any encoder.

use crate::error::Error;
use crate::render_config::RenderConfig;
use crate::rendering::Rendering;
use crate::spherical_harmonics::{MAX_ORDER, harmonics};
use sabine_acoustics::{Orientation, OutOfRange};
use sabine_paths::{Conditions, Encoder, PathSet};
use std::ops::Range;

/// One channel that hears all directions with gain 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Omnidirectional;

impl Encoder for Omnidirectional {
    fn channels(&self) -> usize {
        1
    }

    fn gains(&self, _direction: [f64; 3], gains: &mut [f64]) {
        gains[0] = 1.0;
    }

    fn order(&self) -> usize {
        0
    }

    fn omnidirectional(&self) -> Option<usize> {
        Some(0)
    }
}

/// Ambisonics in the channel order ACN with the normalisation SN3D ([`ambisonic_gains`](crate::ambisonic_gains)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ambisonics {
    order: usize,
}

impl Ambisonics {
    /// Checks the order, 1 to 3.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for another order.
    pub fn new(order: usize) -> Result<Self, Error> {
        OutOfRange::check("ambisonic order", order as f64, 1.0, MAX_ORDER as f64, "1, 2 or 3")?;
        Ok(Self { order })
    }
}

impl Encoder for Ambisonics {
    fn channels(&self) -> usize {
        (self.order + 1) * (self.order + 1)
    }

    fn gains(&self, direction: [f64; 3], gains: &mut [f64]) {
        let count = gains.len();
        gains.copy_from_slice(&harmonics(direction)[..count]);
    }

    fn order(&self) -> usize {
        self.order
    }

    fn omnidirectional(&self) -> Option<usize> {
        Some(0)
    }

    fn power_groups(&self) -> Vec<Range<usize>> {
        (0..=self.order).map(|degree| degree * degree..(degree + 1) * (degree + 1)).collect()
    }
}

/// Turns paths into the channels of any [`Encoder`]: loudspeaker feeds, microphone arrays, ambisonics.
///
/// Exact paths enter each channel with the gain of their own direction. The energy of sampled paths is gathered in cells of the
/// sphere ([`Encoder::order`]), each of which sends its own independent noise from the mean direction of its energy.
///
/// ```
/// use sabine_acoustics::{Air, Bands, Material, Orientation};
/// use sabine_paths::{Conditions, Contribution, Encoder, PathSet};
/// use sabine_propagate::{RenderConfig, Renderer};
///
/// /// Two loudspeakers, 30 degrees to either side, panned by the law of sines with constant power.
/// struct Stereo;
/// impl Encoder for Stereo {
///     fn channels(&self) -> usize {
///         2
///     }
///     fn gains(&self, direction: [f64; 3], gains: &mut [f64]) {
///         let across = (direction[1] / 30f64.to_radians().sin()).clamp(-1.0, 1.0);
///         gains.copy_from_slice(&[((1.0 + across) / 2.0).sqrt(), ((1.0 - across) / 2.0).sqrt()]);
///     }
///     fn power_groups(&self) -> Vec<std::ops::Range<usize>> {
///         vec![0..2]
///     }
/// }
///
/// let mut paths = PathSet::new(1, 34.0);
/// let left = [0.0, 1.0, 0.0];
/// paths.push(Contribution {
///     length_m: 3.432, log_weight: 0.0, chain: PathSet::DIRECT, tail: PathSet::DIRECT,
///     departure: left, arrival: left, batch: None,
/// });
/// let (walls, air) = ([Material::uniform(Bands::octaves(62.5, 125.0)?, 0.1, 0.1)?], Air::default());
/// let channels = Renderer::new(RenderConfig::default())?.render(
///     &paths, &Conditions::new(&walls, &air), &Stereo, Orientation::default())?;
/// assert!((channels[0][480] - 1.0).abs() < 0.01 && channels[1][480].abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Renderer {
    config: RenderConfig,
}

impl Renderer {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting outside its range.
    pub fn new(config: RenderConfig) -> Result<Self, Error> {
        config.check()?;
        Ok(Self { config })
    }

    /// The settings.
    pub fn config(&self) -> &RenderConfig {
        &self.config
    }

    /// The channels of the encoder for a listener who faces so, each of the same length. A directivity of the receiver, if the
    /// conditions hold one, weighs the arrivals.
    ///
    /// # Errors
    /// As [`PressureRenderer::render`](crate::PressureRenderer::render); [`Error::OutOfRange`] for an encoder without channels, or of
    /// an order beyond 3.
    pub fn render(
        &self,
        paths: &PathSet,
        conditions: &Conditions,
        encoder: &dyn Encoder,
        facing: Orientation,
    ) -> Result<Vec<Vec<f32>>, Error> {
        let (channels, order) = (encoder.channels() as f64, encoder.order() as f64);
        OutOfRange::check("number of channels", channels, 1.0, 1024.0, "between 1 and 1024")?;
        OutOfRange::check("order of the encoder", order, 0.0, MAX_ORDER as f64, "between 0 and 3")?;
        Ok(Rendering::new(&self.config, paths, conditions, encoder, facing)?.response(&self.config))
    }
}
