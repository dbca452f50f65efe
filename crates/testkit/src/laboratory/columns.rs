//! Pulses of one response, band by band, before the bands are joined.

use crate::filter::pulse;

/// Where the pulses of one response go: a column of samples for each band.
pub(crate) struct Columns {
    pub samples: Vec<Vec<f64>>,
    /// Samples in a second of true time.
    pub rate_hz: f64,
    /// True time at the first sample.
    pub start_s: f64,
}

impl Columns {
    pub(crate) fn position(&self, time_s: f64) -> f64 {
        (time_s - self.start_s) * self.rate_hz
    }

    pub(crate) fn add_exactly(&mut self, time_s: f64, amplitudes: &[f64]) {
        let (first, values) = pulse(self.position(time_s));
        let count = self.samples[0].len() as i64;
        // The part of the pulse that falls inside.
        let from = first.clamp(0, count);
        let to = (first + values.len() as i64).clamp(from, count);
        let values = &values[(from - first).min(values.len() as i64) as usize..];
        for (column, amplitude) in self.samples.iter_mut().zip(amplitudes) {
            let inside = &mut column[from as usize..to as usize];
            inside.iter_mut().zip(values).for_each(|(sample, value)| *sample += amplitude * value);
        }
    }

    pub(crate) fn add_nearby(&mut self, time_s: f64, amplitudes: &[f64]) {
        let at = self.position(time_s).round();
        if at < 0.0 || at >= self.samples[0].len() as f64 {
            return;
        }
        for (column, amplitude) in self.samples.iter_mut().zip(amplitudes) {
            column[at as usize] += amplitude;
        }
    }
}
