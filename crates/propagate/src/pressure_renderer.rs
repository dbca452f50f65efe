//! From paths to pressure.

use crate::error::Error;
use crate::render_config::RenderConfig;
use crate::renderer::Omnidirectional;
use crate::rendering::Rendering;
use sabine_acoustics::{ImpulseResponse, Orientation};
use sabine_paths::{Conditions, PathSet};

/// Turns paths into a pressure response.
///
/// Exact paths become pulses at fractional delays, of amplitude square root of energy (1 / d for the direct sound), positive,
/// filtered without phase by their energies in the octaves; they ring before their time as far as their spectrum is uneven,
/// and by 32 samples of the interpolating pulse. Sampled paths shape noise, octave by octave, that never precedes the
/// first arrival. An energy of one in all bands is the energy of a unit impulse.
///
/// The lowest octave's gain extends down to 0 Hz, the highest one's up to half the sample rate.
///
/// ```
/// use sabine_acoustics::{Air, Bands, Material};
/// use sabine_paths::{Conditions, Contribution, PathSet};
/// use sabine_propagate::{PressureRenderer, RenderConfig};
/// let mut paths = PathSet::new(1, 34.0);
/// let ahead = [1.0, 0.0, 0.0];
/// let direct = Contribution {
///     length_m: 5.0, log_weight: -2.0 * 5f64.ln(), chain: PathSet::DIRECT, tail: PathSet::DIRECT,
///     departure: ahead, arrival: ahead, batch: None,
/// };
/// paths.push(direct);
/// let wall = Material::uniform(Bands::SIMULATION, 0.1, 0.1)?;
/// let air = Air::default();
/// let response = PressureRenderer::new(RenderConfig::default())?.render(&paths, &Conditions::new(&[wall], &air))?;
/// // The area of the pulse is 1/5, and it stands 5 m / 343.2 m/s after emission.
/// let area: f32 = response.samples().iter().sum();
/// assert!((area - 0.2).abs() < 1e-3);
/// let peak = response.samples().iter().position(|&s| s == response.peak()).unwrap();
/// assert_eq!(peak, (5.0 / air.speed_of_sound_m_s() * 48e3).round() as usize);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PressureRenderer {
    config: RenderConfig,
}

impl PressureRenderer {
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

    /// The response under these conditions: materials and air of the moment, directional source and microphone if they are.
    ///
    /// # Errors
    /// [`Error::Acoustics`] for materials that do not fit the paths or a directivity on other bands, [`Error::NoBand`] if all
    /// bands lie above half the sample rate.
    pub fn render(&self, paths: &PathSet, conditions: &Conditions) -> Result<ImpulseResponse, Error> {
        let rendering =
            Rendering::new(&self.config, paths, conditions, &Omnidirectional, Orientation::default())?;
        let mut channels = rendering.response(&self.config);
        Ok(ImpulseResponse::new(channels.swap_remove(0), self.config.sample_rate_hz)?)
    }
}
