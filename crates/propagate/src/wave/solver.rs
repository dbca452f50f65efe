//! Pressure responses at low frequencies, from the wave equation.

use super::band_runs::{BandRun, RunPlan};
use super::error::WaveError;
use super::leapfrog::Leapfrog;
use super::point_weights::PointWeights;
use super::response::WaveResponse;
use super::room::WaveRoom;
use super::source_pulse::SourcePulse;
use crate::Error;
use crate::band_masks::{BandMasks, Transition};
use crate::placement::check_placement;
use crate::spectrum::Spectrum;
use realfft::num_complex::Complex;
use sabine_acoustics::{Air, Bands, Material, Observer, OutOfRange, admittance_of_absorption};
use sabine_scene::{Receiver, Scene, Source};
use std::f64::consts::{PI, SQRT_2};

/// Periods of the lowest mode that a response must hold.
const LEAST_PERIODS: f64 = 4.0;
/// Periods of the lowest mode over which the end of a response fades away.
const FADE_PERIODS: f64 = 2.0;
/// Where the response is gone, over its limit: a wide slope, so that it rings little.
const GONE_ABOVE: f64 = 1.6;
/// Corner of the low cut, over the lowest mode.
const LOW_CUT: f64 = 0.25;
/// Periods of the limit for which the fading at the limit may ring before an arrival.
const LEAD_PERIODS: f64 = 10.0;
/// Periods of the low cut's corner after which it has died down by more than 150 dB.
const LOW_CUT_PERIODS: f64 = 4.0;

/// Settings of [`WaveSolver`].
#[derive(Clone, Debug, PartialEq)]
pub struct WaveConfig {
    /// Highest frequency up to which the response is right, in Hz, 20 to 5,000. Time grows with its fourth power, memory with its
    /// third.
    pub limit_hz: f64,
    /// Voxels per wave length at the limit, 6 to 100. A wave along an axis is too slow by (2 pi / n)^2 / 36 at n of them, and
    /// its modes too low by as much: 0.43 % at 16, and a quarter of that an octave below the limit.
    pub points_per_wavelength: f64,
    /// Length of the responses in seconds, 0.01 to 60.
    pub duration_s: f64,
    /// Sample rate of the responses in Hz, 1,000 to 768,000; at least 3.2 times the limit.
    pub sample_rate_hz: u32,
    /// Memory that the grid may take, in bytes, 1 MiB to 1 TiB.
    pub memory_bytes: u64,
}

impl Default for WaveConfig {
    /// Up to 300 Hz with 16 voxels per wave length, for 1 s, at 48 kHz, within 1 GiB.
    fn default() -> Self {
        Self {
            limit_hz: 300.0,
            points_per_wavelength: 16.0,
            duration_s: 1.0,
            sample_rate_hz: 48_000,
            memory_bytes: 1 << 30,
        }
    }
}

impl WaveConfig {
    fn check(&self) -> Result<(), Error> {
        OutOfRange::check("limit_hz", self.limit_hz, 20.0, 5000.0, "between 20 and 5,000 Hz")?;
        OutOfRange::check(
            "points_per_wavelength",
            self.points_per_wavelength,
            6.0,
            100.0,
            "between 6 and 100",
        )?;
        OutOfRange::check("duration_s", self.duration_s, 0.01, 60.0, "between 10 ms and 60 s")?;
        let rate = f64::from(self.sample_rate_hz);
        OutOfRange::check("sample_rate_hz", rate, 1e3, 768e3, "between 1 and 768 kHz")?;
        let most_hz = rate / (2.0 * GONE_ABOVE);
        OutOfRange::check("limit_hz", self.limit_hz, 20.0, most_hz, "at most 0.31 times the sample rate")?;
        let budget = self.memory_bytes as f64;
        Ok(OutOfRange::check("memory_bytes", budget, 1_048_576.0, 1.1e12, "between 1 MiB and 1 TiB")?)
    }
}

/// Solves the wave equation in a room: standing waves, bending around edges, interference, all that rays leave out.
///
/// # Method
/// Finite differences in time and space on voxels ([`WaveRoom`]): the leapfrog scheme with seven points at a Courant number
/// of 1 / sqrt 3 (Botteldooren 1995), with walls in the form of finite volumes (Bilbao, Hamilton, Botts and Savioja 2016;
/// on cubes the boundary of Kowalczyk and van Walstijn 2011). Its energy never grows, whatever the mesh.
///
/// Walls react locally, with a real admittance that follows from the random-incidence absorption by Paris' formula
/// ([`admittance_of_absorption`]); one run for each octave below the limit (octaves of the same walls share one), joined along raised cosines from centre to centre.
/// Absorption above 0.951 counts as 0.951. Scattering does not count: the mesh scatters by its shape.
///
/// # Responses
/// Pressure, 1 = direct sound at 1 m, time zero at the emission, as [`PressureRenderer`](crate::PressureRenderer)'s. Up to the limit
/// they are right; up to 1.6 times the limit they fade out, without a phase. A source whose direct sound is an impulse pumps air
/// into the room, whose pressure then stays, so there is a low cut, as of a loudspeaker in a closed box: s^2 / (s^2 + sqrt 2 s + 1)
/// with s = j f / f_0 and f_0 at a quarter of the lowest mode, c / (2 longest side). It takes 0.02 dB at that mode and
/// turns its phase by 21 degrees.
///
/// The same on any number of threads, bit for bit.
///
/// # What it leaves out
/// Phase and angle of real walls (porous layers, panels that resonate), transmission through walls, directivity, and air
/// attenuation within an octave (each octave has that of its centre).
///
/// ```
/// use sabine_acoustics::*;
/// use sabine_paths::*;
/// use sabine_scene::*;
/// use sabine_propagate::wave::{WaveConfig, WaveSolver};
/// // A rigid box of 3.43 m x 2.5 m x 2 m resounds at c / 2L = 50 Hz, here heard 2 m apart along its length.
/// let rigid = Material::uniform(Bands::SIMULATION, 0.01, 0.0)?;
/// let scene = Scene::shoebox([3.432, 2.5, 2.0], std::array::from_fn(|_| rigid.clone()))?;
/// let config = WaveConfig { limit_hz: 80.0, duration_s: 0.5, sample_rate_hz: 1000, ..Default::default() };
/// let (source, receiver) = (Source::omni("s", [0.4, 0.4, 0.4])?, Receiver::omni("r", [3.0, 0.5, 0.5])?);
/// let responses = WaveSolver::new(config)?.respond(&scene, &source, &[receiver], &Air::default(), &())?;
/// let response = responses[0].response()?;
/// let level = |hz: f64| {
///     let turn = |i: usize| std::f64::consts::TAU * hz * i as f64 / 1000.0;
///     let samples = response.samples().iter().enumerate();
///     let sum = samples.fold((0.0, 0.0), |(re, im), (i, &s)| {
///         (re + f64::from(s) * turn(i).cos(), im + f64::from(s) * turn(i).sin())
///     });
///     sum.0.hypot(sum.1)
/// };
/// assert!(level(50.0) > 3.0 * level(40.0) && level(50.0) > 3.0 * level(60.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct WaveSolver {
    config: WaveConfig,
}

impl WaveSolver {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting outside its range.
    pub fn new(config: WaveConfig) -> Result<Self, Error> {
        config.check()?;
        Ok(Self { config })
    }

    /// The settings.
    pub fn config(&self) -> &WaveConfig {
        &self.config
    }

    /// Cuts what surrounds a source into voxels, small enough for the limit in this air.
    ///
    /// # Errors
    /// [`Error::NoSurface`] for a mesh without area, [`WaveError::ThinRoom`] for one that is thinner than four voxels,
    /// [`WaveError::GridTooLarge`] (it says what would fit), [`WaveError::WavesLeak`] for a mesh that is not closed,
    /// [`WaveError::BetweenVoxels`] for a source with no voxel in sight.
    pub fn prepare(&self, scene: &Scene, source: &Source, air: &Air) -> Result<WaveRoom, Error> {
        let WaveConfig { limit_hz, points_per_wavelength, memory_bytes, .. } = self.config;
        let spacing_m = air.speed_of_sound_m_s() / (limit_hz * points_per_wavelength);
        WaveRoom::new(scene, source, spacing_m, limit_hz, memory_bytes)
    }

    /// Responses at any number of receivers, in a room that was prepared for the same source or another one in it, with
    /// materials in the order of the scene's.
    ///
    /// # Errors
    /// As [`check_placement`](crate::check_placement) for each receiver; [`WaveError::BetweenVoxels`] for a source or receiver that voxels do
    /// not resolve or join to the room; [`WaveError::TooShortForModes`] for a duration below four periods of the lowest mode;
    /// [`Error::OutOfRange`] for a limit below the lowest mode; [`Error::Acoustics`] for materials that do not fit the
    /// scene, and `Cancelled`.
    pub fn solve(
        &self,
        room: &WaveRoom,
        materials: &[Material],
        source: &Source,
        receivers: &[Receiver],
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<Vec<WaveResponse>, Error> {
        let bands = self.bands(room, materials)?;
        for receiver in receivers {
            check_placement(&room.mesh, source, receiver)?;
        }
        let speed_m_s = air.speed_of_sound_m_s();
        let lowest_hz = self.lowest_hz(room, speed_m_s)?;
        let emitter = PointWeights::new(room, "source", &source.id, source.position_m)?;
        let hearers: Vec<PointWeights> = receivers
            .iter()
            .map(|receiver| PointWeights::new(room, "receiver", &receiver.id, receiver.position_m))
            .collect::<Result<_, _>>()?;

        let WaveConfig { limit_hz, duration_s, sample_rate_hz, .. } = self.config;
        let rate = f64::from(sample_rate_hz);
        let pulse = SourcePulse::new(limit_hz);
        let fade_s = FADE_PERIODS / lowest_hz;
        let step_s = Leapfrog::step_m(room) / speed_m_s;
        let steps = ((duration_s + pulse.end_s() + fade_s) / step_s).ceil() as usize;
        let samples = ((duration_s * rate).round() as usize).max(1);
        let low_cut_hz = LOW_CUT * lowest_hz;
        let lead = (LEAD_PERIODS / limit_hz * rate).ceil() as usize;
        let least = lead + ((duration_s + fade_s + LOW_CUT_PERIODS / low_cut_hz) * rate).ceil() as usize;
        let spectrum = Spectrum::new(least, sample_rate_hz);
        let mut lines = vec![vec![Complex::default(); spectrum.length() / 2 + 1]; receivers.len()];
        let masks = BandMasks::new(bands, sample_rate_hz);
        // Octaves of the same walls share a run.
        let admittances: Vec<Vec<f64>> = (0..masks.len())
            .map(|band| {
                let of = |m: &Material| m.absorption().resampled(bands).values()[band];
                materials.iter().map(|m| admittance_of_absorption(of(m))).collect()
            })
            .collect();
        let is_new = |band: usize| band == 0 || admittances[band] != admittances[band - 1];
        let runs = (0..masks.len()).filter(|&band| is_new(band)).count();
        let exponents = air.energy_exponent_per_m(bands);
        let mut last: Option<BandRun> = None;
        let mut behind = 0;
        for (band, admittances) in admittances.iter().enumerate() {
            let run = match last.take() {
                Some(run) if !is_new(band) => run,
                _ => {
                    let reported = [(behind * steps) as u64, (runs * steps) as u64];
                    behind += 1;
                    let (source, receivers) = (&emitter, &hearers[..]);
                    let plan = RunPlan { source, receivers, pulse, steps, speed_m_s, reported };
                    BandRun::run(room, admittances, &plan, observer)?
                }
            };
            let air_per_s = 0.5 * exponents.values()[band] * speed_m_s;
            let heard = run.through_air(air_per_s, (fade_s / step_s) as usize);
            last = Some(run);
            let gain = |hz: f64| {
                let turn = ((hz / limit_hz - 1.0) / (GONE_ABOVE - 1.0)).clamp(0.0, 1.0);
                let above = 0.5 + 0.5 * (PI * turn).cos();
                low_cut(hz / low_cut_hz) * above * masks.share(band, hz, Transition::Gliding)
            };
            heard.add_to(&mut lines, &spectrum, pulse, gain);
        }
        let response = |lines| {
            let mut response = spectrum.signal(lines);
            // What comes before time zero stands at the end.
            response.rotate_right(lead);
            response.truncate(lead + samples);
            WaveResponse { samples: response, lead, sample_rate_hz, limit_hz }
        };
        Ok(lines.into_iter().map(response).collect())
    }

    /// [`WaveSolver::prepare`] and [`WaveSolver::solve`] with the scene's own materials.
    ///
    /// # Errors
    /// As these two.
    pub fn respond(
        &self,
        scene: &Scene,
        source: &Source,
        receivers: &[Receiver],
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<Vec<WaveResponse>, Error> {
        let materials: Vec<Material> = scene.materials().iter().map(|named| named.material.clone()).collect();
        self.solve(&self.prepare(scene, source, air)?, &materials, source, receivers, air, observer)
    }

    /// The bands whose absorption counts below the limit.
    fn bands(&self, room: &WaveRoom, materials: &[Material]) -> Result<Bands, Error> {
        let expected = room.material_areas_m2().len();
        let (Some(first), true) = (materials.first(), materials.len() == expected) else {
            return Err(sabine_acoustics::Error::MaterialCount { expected, found: materials.len() }.into());
        };
        let bands = first.bands();
        if let Some(other) = materials.iter().find(|m| m.bands() != bands) {
            return Err(sabine_acoustics::Error::BandMismatch { left: bands, right: other.bands() }.into());
        }
        let used = (0..bands.len()).rfind(|&i| bands.edges_hz(i).0 < self.config.limit_hz).unwrap_or(0);
        Ok(bands.part(0..used + 1))
    }

    /// About the lowest mode of the room: half a wave along its longest side.
    fn lowest_hz(&self, room: &WaveRoom, speed_m_s: f64) -> Result<f64, Error> {
        let lowest_hz = speed_m_s / (2.0 * room.longest_side_m());
        let needed_s = LEAST_PERIODS / lowest_hz;
        let duration_s = self.config.duration_s;
        if duration_s < needed_s {
            return Err(WaveError::TooShortForModes { duration_s, needed_s, lowest_hz }.into());
        }
        let range = "at least the lowest mode of the room, c / (2 longest side)";
        OutOfRange::check("limit_hz", self.config.limit_hz, lowest_hz, f64::INFINITY, range)?;
        Ok(lowest_hz)
    }
}

/// A Butterworth high pass of second order, at a frequency over that of its corner.
fn low_cut(ratio: f64) -> Complex<f64> {
    let square = ratio * ratio;
    Complex::from(-square) / Complex::new(1.0 - square, SQRT_2 * ratio)
}
