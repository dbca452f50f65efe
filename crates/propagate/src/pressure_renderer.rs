//! From paths to pressure.

use crate::Error;
use crate::error::check_range;
use crate::rendering::Rendering;
use sabine_acoustics::{Air, Conditions, ImpulseResponse, Material, Orientation, PathSet};

/// How the noise behaves whose course the sampled paths give.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Statistics {
    /// Gaussian noise: the fluctuations that a diffuse sound field has. In narrow bands they make every measured decay
    /// time a random number (Davy et al. 1979), several percent wide at 125 Hz.
    Gaussian,
    /// The same noise, its energy in each octave corrected over short windows (six independent values, at least 15 ms) to
    /// what the paths say, so that what is measured on the response is what was simulated.
    #[default]
    DecayMatched,
}

/// Settings of [`PressureRenderer`].
#[derive(Clone, Debug, PartialEq)]
pub struct RenderConfig {
    /// Sample rate, 8 to 96 kHz. Octaves that lie above half of it are left out.
    pub sample_rate_hz: u32,
    /// Length of the response, 1 ms to 60 s from emission; `None` for as long as paths were looked for.
    pub duration_s: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
    /// Behaviour of the noise.
    pub statistics: Statistics,
}

impl Default for RenderConfig {
    fn default() -> Self {
        Self { sample_rate_hz: 48_000, duration_s: None, seed: 0, statistics: Statistics::default() }
    }
}

impl RenderConfig {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let rate = f64::from(self.sample_rate_hz);
        check_range("sample_rate_hz", rate, 8e3, 96e3, "between 8 and 96 kHz")?;
        self.duration_s.map_or(Ok(()), |duration_s| {
            check_range("duration_s", duration_s, 1e-3, 60.0, "between 1 ms and 60 s")
        })
    }
}

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
/// use sabine_acoustics::{Air, Bands, Contribution, Material, PathSet};
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
/// let response = PressureRenderer::new(RenderConfig::default())?.render(&paths, &[wall], &air)?;
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

    /// The response between an omnidirectional source and receiver, with the materials and the air of the moment.
    ///
    /// # Errors
    /// [`Error::Acoustics`] for materials that do not fit the paths, [`Error::NoBand`] if all their bands lie above half
    /// the sample rate.
    pub fn render(
        &self,
        paths: &PathSet,
        materials: &[Material],
        air: &Air,
    ) -> Result<ImpulseResponse, Error> {
        self.render_under(paths, &Conditions::new(materials, air))
    }

    /// The response under any conditions: of a directional source, through a directional microphone.
    ///
    /// # Errors
    /// As [`PressureRenderer::render`]; [`Error::Acoustics`] for a directivity on other bands than the materials.
    pub fn render_under(&self, paths: &PathSet, conditions: &Conditions) -> Result<ImpulseResponse, Error> {
        let rendering = Rendering::new(&self.config, paths, conditions, 0, Orientation::default())?;
        let mut channels = rendering.response(&self.config);
        Ok(ImpulseResponse::new(channels.swap_remove(0), self.config.sample_rate_hz)?)
    }
}
