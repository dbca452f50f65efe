//! From paths to pressure.

use crate::Error;
use crate::band_masks::{BandMasks, Transition};
use crate::energy_envelope::{EnergyEnvelope, STEP_S, moving_mean};
use crate::error::check_range;
use crate::random::generator;
use crate::spectrum::Spectrum;
use rand::Rng;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use sabine_acoustics::{Air, ImpulseResponse, Material, PathSet};
use std::f64::consts::{PI, TAU};

/// Samples to either side of a fractional-delay pulse.
const PULSE_REACH: isize = 32;
/// Longest time by which a zero-phase band filter rings before and after, in periods of the lowest band centre.
const RINGING_PERIODS: f64 = 8.0;
/// Fade of the noise at the end of the response, in seconds.
const FADE_S: f64 = 5e-3;
/// Rounds of measuring the noise and correcting it window by window ...
const WINDOW_ROUNDS: usize = 3;
/// ... and then as a whole.
const WHOLE_ROUNDS: usize = 2;
/// Bandwidth times window: about as many independent values as the window holds.
const WINDOW_VALUES: f64 = 6.0;
/// Shortest window in which noise is matched, in seconds.
const LEAST_WINDOW_S: f64 = 15e-3;
/// No correction beyond this (energy): where a neighbour's noise dominates a band, matching cannot help.
const MOST_CORRECTION: f64 = 10.0;

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
/// use sabine_acoustics::{Air, Contribution, Material, OctaveBands, PathSet};
/// use sabine_propagate::{PressureRenderer, RenderConfig};
/// let mut paths = PathSet::new(1, 34.0);
/// let ahead = [1.0, 0.0, 0.0];
/// let direct = Contribution {
///     length_m: 5.0, log_weight: -2.0 * 5f64.ln(), chain: PathSet::DIRECT, tail: PathSet::DIRECT,
///     departure: ahead, arrival: ahead, batch: None,
/// };
/// paths.push(direct);
/// let wall = Material::uniform(OctaveBands::SIMULATION, 0.1, 0.1)?;
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
        let rate = f64::from(config.sample_rate_hz);
        check_range("sample_rate_hz", rate, 8e3, 96e3, "between 8 and 96 kHz")?;
        if let Some(duration_s) = config.duration_s {
            check_range("duration_s", duration_s, 1e-3, 60.0, "between 1 ms and 60 s")?;
        }
        Ok(Self { config })
    }

    /// The settings.
    pub fn config(&self) -> &RenderConfig {
        &self.config
    }

    /// The response, with the materials and the air of the moment.
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
        let energies = paths.energies(materials, air)?;
        let sample_rate_hz = self.config.sample_rate_hz;
        let masks = BandMasks::new(materials[0].bands(), sample_rate_hz);
        if masks.len() == 0 {
            return Err(Error::NoBand { sample_rate_hz });
        }
        let speed_m_s = air.speed_of_sound_m_s();
        let duration_s = self.config.duration_s.unwrap_or(paths.max_length_m() / speed_m_s);
        let rate = f64::from(sample_rate_hz);
        // A millionth of a sample is rounding.
        let samples = ((duration_s * rate - 1e-6).ceil() as usize).max(1);
        let lowest_hz = materials[0].bands().exact_hz(0);
        let margin = (RINGING_PERIODS / lowest_hz * rate) as usize + PULSE_REACH as usize;
        let stage = Rendering {
            spectrum: Spectrum::new(samples + 2 * margin, sample_rate_hz),
            masks,
            paths,
            energies: &energies,
            samples_per_m: rate / speed_m_s,
            rate,
            samples,
            margin,
        };
        let mut response = stage.pulses();
        if let Some(noise) = stage.noise(&self.config) {
            response.iter_mut().zip(noise).for_each(|(sum, n)| *sum += n);
        }
        let samples = response.into_iter().map(|s| s as f32).collect();
        Ok(ImpulseResponse::new(samples, sample_rate_hz)?)
    }
}

/// What the parts of one rendering share.
struct Rendering<'a> {
    spectrum: Spectrum,
    masks: BandMasks,
    paths: &'a PathSet,
    energies: &'a [Vec<f32>],
    samples_per_m: f64,
    rate: f64,
    samples: usize,
    /// Room for ringing before and after, so that nothing wraps around.
    margin: usize,
}

impl Rendering<'_> {
    fn position(&self, path: usize) -> f64 {
        f64::from(self.paths.lengths_m()[path]) * self.samples_per_m
    }

    /// The exact paths.
    fn pulses(&self) -> Vec<f64> {
        let lines: Vec<Vec<Complex<f64>>> = (0..self.masks.len())
            .into_par_iter()
            .map(|band| {
                let mut train = vec![0.0; self.spectrum.length()];
                for path in (0..self.paths.len()).filter(|&i| self.paths.is_exact(i)) {
                    let position = self.position(path);
                    if position < self.samples as f64 {
                        let amplitude = f64::from(self.energies[band][path]).sqrt();
                        add_pulse(&mut train, self.margin as f64 + position, amplitude);
                    }
                }
                let mut lines = self.spectrum.lines(train);
                for (i, line) in lines.iter_mut().enumerate() {
                    *line *= self.masks.share(band, self.spectrum.frequency_hz(i), Transition::Gliding);
                }
                lines
            })
            .collect();
        let mut sum = vec![Complex::default(); self.spectrum.length() / 2 + 1];
        for band in &lines {
            sum.iter_mut().zip(band).for_each(|(s, l)| *s += l);
        }
        let mut response = self.spectrum.signal(sum);
        response.drain(..self.margin);
        response.truncate(self.samples);
        response
    }

    /// Sampled energy of each band in steps of [`STEP_S`], or `None` if there is none.
    fn envelopes(&self) -> Option<Vec<EnergyEnvelope>> {
        let steps = (self.samples as f64 / self.rate / STEP_S).ceil() as usize + 1;
        let per_sample = 1.0 / (self.rate * STEP_S);
        let step_of = |path: usize| (self.position(path) * per_sample) as usize;
        let first = (0..self.paths.len()).map(step_of).min()?;
        let any = (0..self.paths.len()).any(|i| !self.paths.is_exact(i) && step_of(i) < steps);
        let envelope = |band: usize| {
            let mut collected = vec![0.0; steps];
            for path in (0..self.paths.len()).filter(|&i| !self.paths.is_exact(i)) {
                if let Some(step) = collected.get_mut(step_of(path)) {
                    *step += f64::from(self.energies[band][path]);
                }
            }
            EnergyEnvelope::smoothed(&collected, first)
        };
        any.then(|| (0..self.masks.len()).into_par_iter().map(envelope).collect())
    }

    /// The sampled paths.
    fn noise(&self, config: &RenderConfig) -> Option<Vec<f64>> {
        let envelopes = self.envelopes()?;
        let mut random = generator(config.seed, 0x4015E);
        let white: Vec<f64> = (0..self.spectrum.length()).map(|_| gaussian(&mut random)).collect();
        let lines = self.spectrum.lines(white);
        // Stationary noise of each band, shaped afterwards: filtering what is shaped would ring before its time.
        let carriers: Vec<Vec<f64>> = (0..self.masks.len())
            .into_par_iter()
            .map(|band| self.spectrum.filtered(&lines, |hz| self.masks.share(band, hz, Transition::Steep)))
            .collect();
        let steps = envelopes[0].steps.len();
        let mut corrections = vec![vec![1.0; steps]; self.masks.len()];
        let mut noise = self.shaped(&carriers, &envelopes, &corrections);
        if config.statistics == Statistics::DecayMatched {
            for round in 0..WINDOW_ROUNDS + WHOLE_ROUNDS {
                self.correct(&noise, &envelopes, &mut corrections, round < WINDOW_ROUNDS);
                noise = self.shaped(&carriers, &envelopes, &corrections);
            }
        }
        Some(noise)
    }

    /// The carriers, each with the amplitude that its envelope gives.
    fn shaped(
        &self,
        carriers: &[Vec<f64>],
        envelopes: &[EnergyEnvelope],
        corrections: &[Vec<f64>],
    ) -> Vec<f64> {
        let steps_per_sample = 1.0 / (self.rate * STEP_S);
        let bands: Vec<EnergyEnvelope> = envelopes
            .iter()
            .zip(corrections)
            .map(|(envelope, gains)| {
                let steps = envelope.steps.iter().zip(gains).map(|(e, g)| e * g).collect();
                EnergyEnvelope { steps }
            })
            .collect();
        let earliest = (0..self.paths.len()).map(|i| self.position(i)).fold(f64::INFINITY, f64::min);
        let fade = (FADE_S * self.rate).min(0.1 * self.samples as f64);
        (0..self.samples)
            .map(|i| {
                if (i as f64) < earliest {
                    return 0.0;
                }
                let time = i as f64 * steps_per_sample;
                let sum: f64 = bands
                    .iter()
                    .zip(carriers)
                    .map(|(envelope, carrier)| (envelope.at(time) * steps_per_sample).sqrt() * carrier[i])
                    .sum();
                let left = (self.samples - 1 - i) as f64;
                let faded = if left < fade { 0.5 - 0.5 * (PI * left / fade).cos() } else { 1.0 };
                sum * faded
            })
            .collect()
    }

    /// Measures the noise with octave filters and corrects the energy of each band's carrier: window by window, or as a
    /// whole.
    fn correct(
        &self,
        noise: &[f64],
        envelopes: &[EnergyEnvelope],
        corrections: &mut [Vec<f64>],
        by_window: bool,
    ) {
        let mut padded = vec![0.0; self.margin];
        padded.extend_from_slice(noise);
        let lines = self.spectrum.lines(padded);
        let samples_per_step = self.rate * STEP_S;
        corrections.par_iter_mut().enumerate().for_each(|(band, correction)| {
            let measured = self.spectrum.filtered(&lines, |hz| self.masks.measuring(band, hz));
            let mut found = vec![0.0; correction.len()];
            for (i, value) in measured[self.margin..][..self.samples].iter().enumerate() {
                found[(i as f64 / samples_per_step) as usize] += value * value;
            }
            // Share of white noise that the filter passes.
            let passed: f64 = (0..=self.spectrum.length() / 2)
                .map(|line| self.masks.measuring(band, self.spectrum.frequency_hz(line)).powi(2))
                .sum::<f64>()
                / (self.spectrum.length() / 2) as f64;
            if !by_window {
                let (wanted, found): (f64, f64) = (envelopes[band].steps.iter().sum(), found.iter().sum());
                if wanted > 0.0 && found > 0.0 {
                    let gain = (wanted * passed / found).clamp(1.0 / MOST_CORRECTION, MOST_CORRECTION);
                    correction.iter_mut().for_each(|g| *g *= gain);
                }
                return;
            }
            let window_s = (WINDOW_VALUES / self.masks.width_hz(band)).max(LEAST_WINDOW_S);
            let reach = (window_s / STEP_S).round() as usize;
            let wanted = moving_mean(&envelopes[band].steps, reach);
            let found = moving_mean(&found, reach);
            for ((gain, wanted), found) in correction.iter_mut().zip(wanted).zip(found) {
                if wanted > 0.0 && found > 0.0 {
                    *gain = (*gain * wanted * passed / found).clamp(1.0 / MOST_CORRECTION, MOST_CORRECTION);
                }
            }
        });
    }
}

/// Adds a pulse of area `amplitude` at a fractional position: a sinc under a raised-cosine window.
fn add_pulse(train: &mut [f64], position: f64, amplitude: f64) {
    let nearest = position.round();
    let offset = position - nearest;
    let reach = PULSE_REACH as f64 + 1.0;
    let tap = |k: isize| {
        let x = k as f64 - offset;
        let sinc = if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
        sinc * (0.5 + 0.5 * (PI * x / reach).cos())
    };
    let taps: Vec<f64> = (-PULSE_REACH..=PULSE_REACH).map(tap).collect();
    let area: f64 = taps.iter().sum();
    for (k, value) in (-PULSE_REACH..=PULSE_REACH).zip(taps) {
        if let Some(sample) = (nearest as isize).checked_add(k).and_then(|i| train.get_mut(i as usize)) {
            *sample += amplitude * value / area;
        }
    }
}

/// A normal deviate (Box and Muller 1958).
fn gaussian(random: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (TAU * random.random::<f64>()).cos()
}
