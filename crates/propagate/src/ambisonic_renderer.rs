//! From paths to ambisonics.

use crate::ambisonic_response::AmbisonicResponse;
use crate::error::Error;
use crate::render_config::RenderConfig;
use crate::renderer::Ambisonics;
use crate::rendering::Rendering;
use crate::spherical_harmonics::MAX_ORDER;
use sabine_acoustics::{Orientation, OutOfRange};
use sabine_paths::{Conditions, PathSet};

/// Turns paths into an ambisonic response of first to third order (ACN, SN3D).
///
/// Exact paths are encoded in their own directions. The energy of sampled paths is gathered in cells of the sphere, 12 of them
/// up to second order and 24 at third, whose centres make the channel energies of a diffuse field exact; each cell sends its own
/// independent noise from the mean direction of its energy, octave by octave. The first channel has the energy decay that
/// [`PressureRenderer`](crate::PressureRenderer) gives, to the same accuracy.
///
/// ```
/// use sabine_acoustics::{Air, Bands, Material, Orientation};
/// use sabine_paths::{Conditions, Contribution, PathSet};
/// use sabine_propagate::{AmbisonicRenderer, RenderConfig};
/// let mut paths = PathSet::new(1, 34.0);
/// paths.push(Contribution {
///     length_m: 3.432, log_weight: 0.0, chain: PathSet::DIRECT, tail: PathSet::DIRECT,
///     departure: [0.0, -1.0, 0.0], arrival: [0.0, 1.0, 0.0], batch: None,
/// });
/// let wall = [Material::uniform(Bands::octaves(62.5, 125.0)?, 0.1, 0.1)?];
/// let air = Air::default();
/// let conditions = Conditions::new(&wall, &air);
/// let renderer = AmbisonicRenderer::new(1, RenderConfig::default())?;
/// // The listener looks along +y, towards the sound: W and X alone hear it.
/// let facing = Orientation::towards([0.0, 1.0, 0.0])?;
/// let response = renderer.render(&paths, &conditions, facing)?;
/// let at = |channel: usize| response.channel(channel)[480];
/// assert!((at(0) - 1.0).abs() < 0.01 && (at(3) - 1.0).abs() < 0.01);
/// assert!(at(1).abs() < 1e-3 && at(2).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct AmbisonicRenderer {
    order: usize,
    config: RenderConfig,
}

impl AmbisonicRenderer {
    /// Checks the order, 1 to 3, and the settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an order or a setting outside its range.
    pub fn new(order: usize, config: RenderConfig) -> Result<Self, Error> {
        OutOfRange::check("ambisonic order", order as f64, 1.0, MAX_ORDER as f64, "1, 2 or 3")?;
        config.check()?;
        Ok(Self { order, config })
    }

    /// The ambisonic order.
    pub fn order(&self) -> usize {
        self.order
    }

    /// The settings.
    pub fn config(&self) -> &RenderConfig {
        &self.config
    }

    /// The response for a listener who faces so. A directivity of the receiver, if the conditions hold one, weighs the arrivals.
    ///
    /// # Errors
    /// As [`PressureRenderer::render`](crate::PressureRenderer::render).
    pub fn render(
        &self,
        paths: &PathSet,
        conditions: &Conditions,
        facing: Orientation,
    ) -> Result<AmbisonicResponse, Error> {
        let encoder = Ambisonics::new(self.order)?;
        let rendering = Rendering::new(&self.config, paths, conditions, &encoder, facing)?;
        AmbisonicResponse::new(rendering.response(&self.config), self.config.sample_rate_hz)
    }
}
