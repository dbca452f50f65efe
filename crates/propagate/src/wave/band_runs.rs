//! One run of the waves for each octave, and what their spectra say together.

use super::leapfrog::Leapfrog;
use super::point_weights::PointWeights;
use super::room::WaveRoom;
use super::source_pulse::SourcePulse;
use crate::spectrum::Spectrum;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use sabine_acoustics::{Error, Observer, report};
use std::f64::consts::{PI, TAU};

/// Steps between two reports.
const REPORTED_STEPS: usize = 64;

/// Sound of one run at the receivers, step by step.
pub(crate) struct BandRun {
    pub step_s: f64,
    /// `[receiver][step]`.
    pub pressure: Vec<Vec<f64>>,
}

/// Which sound, for how long, and how fast.
pub(crate) struct RunPlan<'a> {
    pub source: &'a PointWeights,
    pub receivers: &'a [PointWeights],
    pub pulse: SourcePulse,
    pub steps: usize,
    pub speed_m_s: f64,
    /// Steps of earlier runs, and of all.
    pub reported: [u64; 2],
}

impl BandRun {
    /// Runs the waves with one admittance for each material.
    pub fn run(
        room: &WaveRoom,
        admittances: &[f64],
        plan: &RunPlan,
        observer: &dyn Observer,
    ) -> Result<Self, Error> {
        let step_m = Leapfrog::step_m(room);
        let step_s = step_m / plan.speed_m_s;
        let mut waves = Leapfrog::new(room, admittances);
        let mut pressure = vec![Vec::with_capacity(plan.steps); plan.receivers.len()];
        for step in 0..plan.steps {
            if step.is_multiple_of(REPORTED_STEPS) {
                report(observer, "waves", plan.reported[0] + step as u64, plan.reported[1])?;
            }
            for (record, receiver) in pressure.iter_mut().zip(plan.receivers) {
                record.push(receiver.read(&waves.now));
            }
            waves.step();
            let emitted = plan.pulse.at(step as f64 * step_s);
            if emitted != 0.0 {
                for &(voxel, share) in &plan.source.0 {
                    waves.inject(voxel, 4.0 * PI * step_m * step_m * emitted * share);
                }
            }
        }
        Ok(Self { step_s, pressure })
    }

    /// The same run through air that takes a share of the pressure per second, its last `fading` steps fading away. Air takes
    /// as much of all waves of an octave: it may do so afterwards.
    pub fn through_air(&self, air_per_s: f64, fading: usize) -> Self {
        let steps = self.pressure.first().map_or(0, Vec::len);
        let left = |step: usize| {
            let turn = ((steps - step) as f64 - 0.5) / fading as f64;
            let fade = if turn < 1.0 { 0.5 - 0.5 * (PI * turn).cos() } else { 1.0 };
            fade * (-air_per_s * step as f64 * self.step_s).exp()
        };
        let record = |record: &Vec<f64>| record.iter().enumerate().map(|(i, p)| left(i) * p).collect();
        Self { step_s: self.step_s, pressure: self.pressure.iter().map(record).collect() }
    }

    /// Adds the transfer functions from source to receivers, times a gain, to the lines of spectra.
    pub fn add_to(
        &self,
        lines: &mut [Vec<Complex<f64>>],
        spectrum: &Spectrum,
        pulse: SourcePulse,
        gain: impl Fn(f64) -> Complex<f64> + Sync,
    ) {
        let emitted: Vec<f64> = (0..)
            .map(|step| f64::from(step) * self.step_s)
            .take_while(|&time_s| time_s <= pulse.end_s())
            .map(|time_s| pulse.at(time_s))
            .collect();
        for (lines, pressure) in lines.iter_mut().zip(&self.pressure) {
            lines.par_iter_mut().enumerate().for_each(|(i, line)| {
                let hz = spectrum.frequency_hz(i);
                let gain = gain(hz);
                if gain.norm_sqr() > 0.0 {
                    let turn = TAU * hz * self.step_s;
                    *line += gain * at_line(pressure, turn) / at_line(&emitted, turn);
                }
            });
        }
    }
}

/// The discrete Fourier transform at any one frequency (rad per step), by Horner's rule in blocks: within a block the phases follow
/// from each other, and rounding does not pile up.
fn at_line(samples: &[f64], turn: f64) -> Complex<f64> {
    const BLOCK: usize = 256;
    let back = Complex::from_polar(1.0, -turn);
    samples
        .chunks(BLOCK)
        .enumerate()
        .map(|(block, samples)| {
            let sum =
                samples.iter().rev().fold(Complex::<f64>::default(), |sum, &sample| sum * back + sample);
            sum * Complex::from_polar(1.0, -turn * (block * BLOCK) as f64)
        })
        .sum()
}
