//! The slope that ISO 3382 reads: that of the decay curve.

use crate::decay::slope_with_sensitivity;
use crate::expansion::{Bins, Expansion};
use crate::history::History;
use crate::objective::SlopeModel;
use sabine_acoustics::{EnergyDecayCurve, Estimate, Reading};
use std::borrow::Borrow;

/// Slope of the decay curves of several source-receiver pairs: -60 over the mean of their reverberation times
/// (ISO 3382-1, 8.1: arithmetic mean over positions).
pub(crate) struct DecaySlope<H> {
    pairs: Vec<(H, Vec<f32>)>,
    range_db: (f64, f64),
}

impl<H: Borrow<History>> DecaySlope<H> {
    /// Pairs of a history and the weights of its paths in this band.
    pub fn new(pairs: Vec<(H, Vec<f32>)>, range_db: (f64, f64)) -> Self {
        Self { pairs, range_db }
    }

    /// The curves near an absorption: one pass over all paths.
    pub fn expand(&self, absorption: &[f64]) -> Expansion {
        let expand = |(history, weights): &(H, Vec<f32>)| {
            let history = history.borrow();
            let mut energy = vec![0.0; history.bins()];
            let mut hits = vec![0.0; history.bins() * history.materials];
            history.accumulate(weights, absorption, &mut energy, &mut hits);
            for (row, e) in hits.chunks_exact_mut(history.materials).zip(&energy).filter(|(_, e)| **e > 0.0) {
                row.iter_mut().for_each(|h| *h /= e);
            }
            Bins { bin_s: history.bin_s, energy, hits }
        };
        Expansion {
            pairs: self.pairs.iter().map(expand).collect(),
            about: absorption.to_vec(),
            range_db: self.range_db,
        }
    }

    /// Reverberation time in seconds, with its Monte-Carlo standard error; why there is none, if none of the curves gives one.
    pub fn reading(&self, absorption: &[f64]) -> Reading {
        let mut why = sabine_acoustics::NoReading::NoOnset;
        let readable = self.pairs.iter().any(|(history, weights)| {
            let history = history.borrow();
            let mut energy = vec![0.0; history.bins()];
            history.accumulate(weights, absorption, &mut energy, &mut []);
            let sampled = EnergyDecayCurve::from_energy(&energy, history.bin_s)
                .decay_time_s(self.range_db.0, self.range_db.1);
            sampled.map_err(|reason| why = reason).is_ok()
        });
        match self.slope_and_variance(absorption).filter(|_| readable) {
            Some((slope, variance)) => {
                Ok(Estimate::new(-60.0 / slope, 60.0 / (slope * slope) * variance.sqrt()))
            }
            None => Err(why),
        }
    }

    /// Slope as in [`SlopeModel::slope`], and its variance from the scatter between batches of rays, in (dB/s)2.
    pub fn slope_and_variance(&self, absorption: &[f64]) -> Option<(f64, f64)> {
        let (mut t60_s, mut variance, mut count) = (0.0, 0.0, 0.0);
        for (history, weights) in &self.pairs {
            let history = history.borrow();
            let mut energy = vec![0.0; history.bins()];
            let mut sensitivity = vec![0.0; history.bins()];
            history.accumulate(weights, absorption, &mut energy, &mut []);
            let Some(slope) = slope_with_sensitivity(&energy, history.bin_s, self.range_db, &mut sensitivity)
            else {
                continue;
            };
            count += 1.0;
            t60_s += -60.0 / slope;
            variance +=
                history.variance(weights, absorption, &sensitivity) * (60.0 / (slope * slope)).powi(2);
        }
        if count == 0.0 {
            return None;
        }
        let mean_s = t60_s / count;
        let by_t60 = 60.0 / (mean_s * mean_s);
        Some((-60.0 / mean_s, by_t60 * by_t60 * variance / (count * count)))
    }
}

impl<H: Borrow<History> + Send + Sync> SlopeModel for DecaySlope<H> {
    fn slope(&self, absorption: &[f64], gradient: &mut [f64]) -> Option<f64> {
        // An expansion is exact where it is made.
        self.expand(absorption).slope(absorption, gradient)
    }
}
