//! One rendering under way: exact paths as pulses, sampled ones as shaped noise, in the channels of an encoder.

use crate::Error;
use crate::band_masks::{BandMasks, Transition};
use crate::direction_cells::DirectionCells;
use crate::energy_envelope::{EnergyEnvelope, STEP_S, moving_mean};
use crate::pulse::{PULSE_REACH, Pulse};
use crate::random::generator;
use crate::render_config::{RenderConfig, Statistics};
use crate::spectrum::Spectrum;
use crate::vector::{Vec3, along, norm, unit};
use rand::Rng;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use sabine_acoustics::Orientation;
use sabine_paths::{Conditions, Encoder, PathSet};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

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

/// What the parts of one rendering share.
pub(crate) struct Rendering<'a> {
    spectrum: Spectrum,
    masks: BandMasks,
    paths: &'a PathSet,
    /// `[band][path]`.
    energies: Vec<Vec<f32>>,
    /// What laws add to the arrival of each path, in samples.
    delays: Option<Vec<f64>>,
    /// What laws add to the energy in each step, `[band][step]`: a diffuse field.
    added: Option<Vec<Vec<f64>>>,
    encoder: &'a dyn Encoder,
    /// The omnidirectional channel: one of the encoder's, or one of our own after them.
    omni: usize,
    facing: Orientation,
    samples_per_m: f64,
    rate: f64,
    samples: usize,
    /// Room for ringing before and after, so that nothing wraps around.
    margin: usize,
    /// Sample of the first arrival.
    earliest: f64,
}

/// The noise of one band before it is corrected.
struct BandNoise {
    /// Energy that the paths give it, over all directions.
    envelope: EnergyEnvelope,
    channels: Vec<Vec<f32>>,
}

/// Steps of the envelope of so many samples.
fn steps_in(samples: usize, rate: f64) -> usize {
    (samples as f64 / rate / STEP_S).ceil() as usize + 1
}

impl<'a> Rendering<'a> {
    pub fn new(
        config: &RenderConfig,
        paths: &'a PathSet,
        conditions: &Conditions,
        encoder: &'a dyn Encoder,
        facing: Orientation,
    ) -> Result<Self, Error> {
        let energies = paths.energies(conditions)?;
        let sample_rate_hz = config.sample_rate_hz;
        // The paths accepted the materials: there is at least one.
        let bands = conditions.materials[0].bands();
        let masks = BandMasks::new(bands, sample_rate_hz);
        if masks.len() == 0 {
            return Err(Error::NoBand { sample_rate_hz });
        }
        let speed_m_s = conditions.air.speed_of_sound_m_s();
        let duration_s = config.duration_s.unwrap_or(paths.max_length_m() / speed_m_s);
        let rate = f64::from(sample_rate_hz);
        // A millionth of a sample is rounding.
        let samples = ((duration_s * rate - 1e-6).ceil() as usize).max(1);
        let margin = (RINGING_PERIODS / bands.exact_hz(0) * rate) as usize + PULSE_REACH as usize;
        let samples_per_m = rate / speed_m_s;
        let steps = steps_in(samples, rate);
        let delays = paths.delays_s(conditions)?;
        let delays = delays.map(|delays_s| delays_s.into_iter().map(|s| s * rate).collect::<Vec<f64>>());
        let first_m = paths.lengths_m().iter().copied().fold(f32::INFINITY, f32::min);
        let arrival = |(&length_m, delay): (&f32, &f64)| f64::from(length_m) * samples_per_m + delay;
        let earliest = delays.as_ref().map_or(f64::from(first_m) * samples_per_m, |delays| {
            paths.lengths_m().iter().zip(delays).map(arrival).fold(f64::INFINITY, f64::min)
        });
        Ok(Self {
            spectrum: Spectrum::new(samples + 2 * margin, sample_rate_hz),
            masks,
            paths,
            energies,
            delays,
            added: paths.added_energy(conditions, STEP_S, steps)?,
            omni: encoder.omnidirectional().unwrap_or(encoder.channels()),
            encoder,
            facing,
            samples_per_m,
            rate,
            samples,
            margin,
            earliest,
        })
    }

    /// The response, channel by channel.
    pub fn response(&self, config: &RenderConfig) -> Vec<Vec<f32>> {
        let mut response = self.pulses();
        if let Some(noise) = self.noise(config) {
            for (channel, noise) in response.iter_mut().zip(noise) {
                channel.iter_mut().zip(noise).for_each(|(sum, n)| *sum += n);
            }
        }
        response.into_iter().map(|channel| channel.into_iter().map(|s| s as f32).collect()).collect()
    }

    /// Channels that noise is made for: those of the encoder, and the omnidirectional one that its energy is measured in.
    fn channels(&self) -> usize {
        self.encoder.channels().max(self.omni + 1)
    }

    /// Gain of each channel for sound from a direction.
    fn gains(&self, direction: Vec3) -> Vec<f64> {
        let mut gains = vec![1.0; self.channels()];
        self.encoder.gains(unit(direction), &mut gains[..self.encoder.channels()]);
        gains
    }

    fn position(&self, path: usize) -> f64 {
        let delay = self.delays.as_ref().map_or(0.0, |delays| delays[path]);
        f64::from(self.paths.lengths_m()[path]) * self.samples_per_m + delay
    }

    fn arrival(&self, path: usize) -> Vec3 {
        self.facing.to_local(self.paths.arrival(path))
    }

    /// The exact paths.
    fn pulses(&self) -> Vec<Vec<f64>> {
        let pulses: Vec<(usize, Pulse, Vec<f64>)> = (0..self.paths.len())
            .filter(|&i| self.paths.is_exact(i) && self.position(i) < self.samples as f64)
            .map(|i| (i, Pulse::at(self.margin as f64 + self.position(i)), self.gains(self.arrival(i))))
            .collect();
        (0..self.encoder.channels())
            .into_par_iter()
            .map(|channel| {
                let mut sum = vec![Complex::default(); self.spectrum.length() / 2 + 1];
                for band in 0..self.masks.len() {
                    let mut train = vec![0.0; self.spectrum.length()];
                    for (path, pulse, gains) in &pulses {
                        let amplitude = f64::from(self.energies[band][*path]).sqrt();
                        pulse.add_to(&mut train, gains[channel] * amplitude);
                    }
                    for (i, (sum, line)) in sum.iter_mut().zip(self.spectrum.lines(train)).enumerate() {
                        let hz = self.spectrum.frequency_hz(i);
                        *sum += line * self.masks.share(band, hz, Transition::Gliding);
                    }
                }
                let mut response = self.spectrum.signal(sum);
                response.drain(..self.margin);
                response.truncate(self.samples);
                response
            })
            .collect()
    }

    /// The sampled paths; `None` if there are none.
    fn noise(&self, config: &RenderConfig) -> Option<Vec<Vec<f64>>> {
        let bands = self.band_noises(config.seed)?;
        let steps = bands[0].envelope.steps.len();
        let mut corrections = vec![EnergyEnvelope { steps: vec![1.0; steps] }; bands.len()];
        if config.statistics == Statistics::DecayMatched {
            for round in 0..WINDOW_ROUNDS + WHOLE_ROUNDS {
                let noise = self.corrected(&bands, &corrections, self.omni);
                self.correct(&noise, &bands, &mut corrections, round < WINDOW_ROUNDS);
            }
        }
        let groups = self.encoder.power_groups();
        let balanced: Vec<Vec<EnergyEnvelope>> = groups
            .iter()
            .map(|group| {
                let of_band = |(band, correction)| self.balanced(band, correction, group);
                bands.iter().zip(&corrections).map(of_band).collect()
            })
            .collect();
        let channel = |channel: usize| {
            let own = groups.iter().position(|group| group.contains(&channel));
            self.corrected(&bands, own.map_or(&corrections, |group| &balanced[group]), channel)
        };
        Some((0..self.encoder.channels()).into_par_iter().map(channel).collect())
    }

    /// Independent noise from each cell of directions, with the energy that comes from there.
    fn band_noises(&self, seed: u64) -> Option<Vec<BandNoise>> {
        let steps = steps_in(self.samples, self.rate);
        let per_sample = 1.0 / (self.rate * STEP_S);
        let step_of = |path: usize| (self.position(path) * per_sample) as usize;
        let first = (self.earliest * per_sample) as usize;
        let cells = DirectionCells::for_order(self.encoder.order());
        // Step, cell and direction of each sampled path within the response.
        let sampled: Vec<(usize, usize, usize, Vec3)> = (0..self.paths.len())
            .filter(|&i| !self.paths.is_exact(i) && step_of(i) < steps)
            .map(|i| {
                let arrival = self.arrival(i);
                (i, step_of(i), cells.of(arrival), arrival)
            })
            .collect();
        if sampled.is_empty() && self.added.is_none() {
            return None;
        }
        let carriers: Vec<Vec<Complex<f64>>> = (0..cells.len() as u64)
            .into_par_iter()
            .map(|cell| {
                let mut random = generator(seed, 0x4015E + cell);
                self.spectrum.lines((0..self.spectrum.length()).map(|_| gaussian(&mut random)).collect())
            })
            .collect();
        let band = |band: usize| {
            let mut collected = vec![vec![0.0; steps]; cells.len()];
            let mut directions = vec![[0.0; 3]; cells.len()];
            for &(path, step, cell, arrival) in &sampled {
                let energy = f64::from(self.energies[band][path]);
                collected[cell][step] += energy;
                directions[cell] = along(directions[cell], arrival, energy);
            }
            if let Some(added) = &self.added {
                let share = 1.0 / cells.len() as f64;
                for ((collected, mean), &centre) in
                    collected.iter_mut().zip(&mut directions).zip(cells.centres())
                {
                    collected.iter_mut().zip(&added[band]).for_each(|(sum, energy)| *sum += share * energy);
                    *mean = along(*mean, centre, share * added[band].iter().sum::<f64>());
                }
            }
            let mut noise = BandNoise {
                envelope: EnergyEnvelope { steps: vec![0.0; steps] },
                channels: vec![vec![0.0; self.samples]; self.channels()],
            };
            for (cell, collected) in collected.iter().enumerate() {
                // The cell's sound comes from where its energy comes from on average.
                let mean = directions[cell];
                if norm(mean) == 0.0 {
                    continue;
                }
                let gains = self.gains(mean);
                let envelope = EnergyEnvelope::smoothed(collected, first);
                noise.envelope.steps.iter_mut().zip(&envelope.steps).for_each(|(sum, e)| *sum += e);
                // Stationary noise of the band, shaped afterwards: filtering what is shaped would ring before its time.
                let share = |hz| self.masks.share(band, hz, Transition::Steep);
                let carrier = self.spectrum.filtered(&carriers[cell], share);
                // Nothing before the first arrival.
                let first_sample = (self.earliest.ceil() as usize).min(self.samples);
                let shaped: Vec<f32> = (first_sample..self.samples)
                    .map(|i| {
                        let energy = envelope.at(i as f64 * per_sample) * per_sample;
                        (energy.sqrt() * carrier[i]) as f32
                    })
                    .collect();
                for (channel, gain) in noise.channels.iter_mut().zip(gains) {
                    let gain = gain as f32;
                    channel[first_sample..].iter_mut().zip(&shaped).for_each(|(sum, s)| *sum += gain * s);
                }
            }
            noise
        };
        Some((0..self.masks.len()).into_par_iter().map(band).collect())
    }

    /// The correction of a band for channels whose energies add up to that of the omnidirectional one, whatever the direction: a
    /// correction made for the omnidirectional channel, where it happens to be weak, would make the others stronger.
    fn balanced(
        &self,
        band: &BandNoise,
        correction: &EnergyEnvelope,
        group: &Range<usize>,
    ) -> EnergyEnvelope {
        let energy = |channels: &[Vec<f32>]| -> f64 {
            let corrected = |(i, &s): (usize, &f32)| {
                f64::from(s).powi(2) * correction.at(i as f64 / (self.rate * STEP_S))
            };
            channels.iter().map(|samples| samples.iter().enumerate().map(corrected).sum::<f64>()).sum()
        };
        let found = energy(&band.channels[group.clone()]);
        let gain = if found > 0.0 { energy(&band.channels[self.omni..=self.omni]) / found } else { 1.0 };
        EnergyEnvelope { steps: correction.steps.iter().map(|c| c * gain).collect() }
    }

    /// A channel of all bands, each with its correction.
    fn corrected(&self, bands: &[BandNoise], corrections: &[EnergyEnvelope], channel: usize) -> Vec<f64> {
        let steps_per_sample = 1.0 / (self.rate * STEP_S);
        let fade = (FADE_S * self.rate).min(0.1 * self.samples as f64);
        (0..self.samples)
            .map(|i| {
                let time = i as f64 * steps_per_sample;
                let sum: f64 = bands
                    .iter()
                    .zip(corrections)
                    .map(|(band, correction)| {
                        correction.at(time).sqrt() * f64::from(band.channels[channel][i])
                    })
                    .sum();
                let left = (self.samples - 1 - i) as f64;
                let faded = if left < fade { 0.5 - 0.5 * (PI * left / fade).cos() } else { 1.0 };
                sum * faded
            })
            .collect()
    }

    /// Measures the noise of the omnidirectional channel with octave filters and corrects the energy of each band: window by
    /// window, or as a whole.
    fn correct(
        &self,
        noise: &[f64],
        bands: &[BandNoise],
        corrections: &mut [EnergyEnvelope],
        by_window: bool,
    ) {
        let mut padded = vec![0.0; self.margin];
        padded.extend_from_slice(noise);
        let lines = self.spectrum.lines(padded);
        let samples_per_step = self.rate * STEP_S;
        corrections.par_iter_mut().enumerate().for_each(|(band, correction)| {
            let envelope = &bands[band].envelope;
            let measured = self.spectrum.filtered(&lines, |hz| self.masks.measuring(band, hz));
            let mut found = vec![0.0; correction.steps.len()];
            for (i, value) in measured[self.margin..][..self.samples].iter().enumerate() {
                found[(i as f64 / samples_per_step) as usize] += value * value;
            }
            // Share of white noise that the filter passes.
            let passed: f64 = (0..=self.spectrum.length() / 2)
                .map(|line| self.masks.measuring(band, self.spectrum.frequency_hz(line)).powi(2))
                .sum::<f64>()
                / (self.spectrum.length() / 2) as f64;
            if !by_window {
                let (wanted, found): (f64, f64) = (envelope.steps.iter().sum(), found.iter().sum());
                if wanted > 0.0 && found > 0.0 {
                    let gain = (wanted * passed / found).clamp(1.0 / MOST_CORRECTION, MOST_CORRECTION);
                    correction.steps.iter_mut().for_each(|g| *g *= gain);
                }
                return;
            }
            let window_s = (WINDOW_VALUES / self.masks.width_hz(band)).max(LEAST_WINDOW_S);
            let reach = (window_s / STEP_S).round() as usize;
            let wanted = moving_mean(&envelope.steps, reach);
            let found = moving_mean(&found, reach);
            for ((gain, wanted), found) in correction.steps.iter_mut().zip(wanted).zip(found) {
                if wanted > 0.0 && found > 0.0 {
                    *gain = (*gain * wanted * passed / found).clamp(1.0 / MOST_CORRECTION, MOST_CORRECTION);
                }
            }
        });
    }
}

/// A normal deviate (Box and Muller 1958).
fn gaussian(random: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (TAU * random.random::<f64>()).cos()
}
