//! Pulses at fractional delays.

use std::f64::consts::PI;

/// Samples to either side of a fractional-delay pulse.
pub(crate) const PULSE_REACH: isize = 32;
const TAPS: usize = 2 * PULSE_REACH as usize + 1;

/// A pulse of area one at a fractional position: a sinc under a raised-cosine window.
pub(crate) struct Pulse {
    first: isize,
    taps: [f64; TAPS],
}

impl Pulse {
    pub fn at(position: f64) -> Self {
        let nearest = position.round();
        let offset = position - nearest;
        let reach = PULSE_REACH as f64 + 1.0;
        let mut taps: [f64; TAPS] = std::array::from_fn(|k| {
            let x = k as f64 - PULSE_REACH as f64 - offset;
            let sinc = if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
            sinc * (0.5 + 0.5 * (PI * x / reach).cos())
        });
        let area: f64 = taps.iter().sum();
        taps.iter_mut().for_each(|tap| *tap /= area);
        Self { first: nearest as isize - PULSE_REACH, taps }
    }

    /// Adds the pulse, as far as it lies within the train.
    pub fn add_to(&self, train: &mut [f64], amplitude: f64) {
        for (at, tap) in (self.first..).zip(self.taps) {
            if let Some(sample) = usize::try_from(at).ok().and_then(|at| train.get_mut(at)) {
                *sample += amplitude * tap;
            }
        }
    }
}
