//! A decay curve near given materials: one energy and one mean number of hits for each time bin, instead of all paths.

use crate::decay::slope_with_sensitivity;
use crate::history::{History, Traces};
use crate::slope_model::SlopeModel;
use std::borrow::Borrow;

/// Energies of the time bins about a point: E(a) = E0 product of ((1 - a)/(1 - a0))^h, h being the mean number of hits of the
/// bin's paths weighted by their energy at a0. Value and gradient are exact at a0, and the error grows with the square of
/// the distance; whoever uses it must come back to the paths until nothing moves.
pub(crate) struct Expansion {
    pub pairs: Vec<Bins>,
    /// Absorption a0 about which it is made.
    pub about: Vec<f64>,
    pub range_db: (f64, f64),
}

/// Bins of one source-receiver pair.
pub(crate) struct Bins {
    pub bin_s: f64,
    /// Energy at a0.
    pub energy: Vec<f64>,
    /// `hits[bin * materials + material]`.
    pub hits: Vec<f64>,
}

impl Bins {
    /// Sums the paths of all traces of a pair.
    pub fn of<H: Borrow<History>>(traces: &Traces<H>, absorption: &[f64]) -> Self {
        // Traces of one pair are made to the same length; the shortest counts.
        let bins = traces.iter().map(|(history, _)| history.borrow().bins()).min().unwrap_or(0);
        let materials = absorption.len();
        let mut sum = Self { bin_s: 1.0, energy: vec![0.0; bins], hits: vec![0.0; bins * materials] };
        for (history, weights) in traces {
            let history = history.borrow();
            let mut energy = vec![0.0; history.bins()];
            let mut hits = vec![0.0; history.bins() * materials];
            history.accumulate(weights, absorption, &mut energy, &mut hits);
            sum.bin_s = history.bin_s;
            sum.energy.iter_mut().zip(energy).for_each(|(s, e)| *s += e);
            sum.hits.iter_mut().zip(hits).for_each(|(s, h)| *s += h);
        }
        for (row, e) in sum.hits.chunks_exact_mut(materials).zip(&sum.energy).filter(|(_, e)| **e > 0.0) {
            row.iter_mut().for_each(|h| *h /= e);
        }
        sum
    }
}

impl Expansion {
    /// Energy of each bin of a pair at an absorption near a0.
    fn energy(&self, pair: &Bins, absorption: &[f64]) -> Vec<f64> {
        let ratio = |(a, a0): (&f64, &f64)| (-a).ln_1p() - (-a0).ln_1p();
        let change: Vec<f64> = absorption.iter().zip(&self.about).map(ratio).collect();
        let rows = pair.hits.chunks_exact(change.len());
        let of = |(e, hits): (&f64, &[f64])| {
            if *e == 0.0 {
                return 0.0;
            }
            e * hits.iter().zip(&change).map(|(h, c)| h * c).sum::<f64>().exp()
        };
        pair.energy.iter().zip(rows).map(of).collect()
    }
}

impl SlopeModel for Expansion {
    fn slope(&self, absorption: &[f64], gradient: &mut [f64]) -> Option<f64> {
        gradient.fill(0.0);
        let (mut t60_s, mut count) = (0.0, 0.0);
        for pair in &self.pairs {
            let energy = self.energy(pair, absorption);
            let mut sensitivity = vec![0.0; energy.len()];
            let Some(slope) = slope_with_sensitivity(&energy, pair.bin_s, self.range_db, &mut sensitivity)
            else {
                continue;
            };
            count += 1.0;
            t60_s += -60.0 / slope;
            let by_slope = 60.0 / (slope * slope);
            let rows = pair.hits.chunks_exact(absorption.len());
            for ((e, s), row) in energy.iter().zip(&sensitivity).zip(rows) {
                let by = by_slope * s * e;
                gradient.iter_mut().zip(row).for_each(|(g, h)| *g -= by * h);
            }
        }
        if count == 0.0 {
            return None;
        }
        let mean_s: f64 = t60_s / count;
        for (g, a) in gradient.iter_mut().zip(absorption) {
            *g *= 60.0 / (mean_s * mean_s) / count / (1.0 - a);
        }
        Some(-60.0 / mean_s)
    }
}
