//! The slope that ISO 3382 reads: that of the decay curve.

use crate::decay::slope_with_sensitivity;
use crate::expansion::{Bins, Expansion};
use crate::history::{History, Traces};
use crate::slope_model::SlopeModel;
use sabine_acoustics::{EnergyDecayCurve, Estimate, NoReading, Reading};
use std::borrow::Borrow;

/// Slope of the decay curves of several source-receiver pairs: -60 over the mean of their reverberation times
/// (ISO 3382-1, 8.1: arithmetic mean over positions).
pub(crate) struct DecaySlope<H> {
    pairs: Vec<Traces<H>>,
    range_db: (f64, f64),
}

impl<H: Borrow<History>> DecaySlope<H> {
    pub fn new(pairs: Vec<Traces<H>>, range_db: (f64, f64)) -> Self {
        Self { pairs, range_db }
    }

    /// The curves near an absorption: one pass over all paths.
    pub fn expand(&self, absorption: &[f64]) -> Expansion {
        Expansion {
            pairs: self.pairs.iter().map(|traces| Bins::of(traces, absorption)).collect(),
            about: absorption.to_vec(),
            range_db: self.range_db,
        }
    }

    /// Reverberation time in seconds where an expansion was made, with its Monte-Carlo standard error from the scatter between
    /// batches of rays; why there is none, if none of the curves gives one.
    pub fn reading(&self, expansion: &Expansion) -> Reading {
        let mut why = NoReading::NoOnset;
        let (mut t60_s, mut variance, mut count) = (0.0, 0.0, 0.0);
        for (traces, bins) in self.pairs.iter().zip(&expansion.pairs) {
            let sampled = EnergyDecayCurve::from_energy(&bins.energy, bins.bin_s)
                .decay_time_s(self.range_db.0, self.range_db.1);
            if let Err(reason) = sampled {
                why = reason;
                continue;
            }
            let mut sensitivity = vec![0.0; bins.energy.len()];
            let slope = slope_with_sensitivity(&bins.energy, bins.bin_s, self.range_db, &mut sensitivity);
            let Some(slope) = slope else { continue };
            count += 1.0;
            t60_s += -60.0 / slope;
            let by_slope = 60.0 / (slope * slope);
            let spread = |(history, weights): &(H, Vec<f32>)| {
                history.borrow().variance(weights, &expansion.about, &sensitivity)
            };
            variance += by_slope * by_slope * traces.iter().map(spread).sum::<f64>();
        }
        if count == 0.0 {
            return Err(why);
        }
        Ok(Estimate::new(t60_s / count, f64::sqrt(variance) / count))
    }
}

impl<H: Borrow<History> + Send + Sync> SlopeModel for DecaySlope<H> {
    fn slope(&self, absorption: &[f64], gradient: &mut [f64]) -> Option<f64> {
        // An expansion is exact where it is made.
        self.expand(absorption).slope(absorption, gradient)
    }
}
