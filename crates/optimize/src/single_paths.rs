//! Slopes through the decibels of single paths: the paper's and Li's.

use crate::decay::DB_PER_NEPER;
use crate::history::History;
use crate::slope_model::SlopeModel;
use std::borrow::Borrow;

/// A line through (t, 10 lg e) of every path, all counting alike. As 10 lg e is linear in ln(1 - absorption), so is the
/// slope, and two sums over the paths are all it takes: m = m0 + sum of rate * ln(1 - absorption).
/// Several source-receiver pairs: the mean of their slopes.
#[derive(Clone)]
pub(crate) struct SinglePathSlope {
    /// Slope in dB/s if nothing absorbed but the air; `None` without two paths at different times.
    rigid: Option<f64>,
    /// Change of the slope by ln(1 - absorption) of each material, in dB/s.
    rate: Vec<f64>,
}

impl SinglePathSlope {
    /// Unweighted least squares: m = (n sum ty - sum t sum y) / (n sum t2 - (sum t)2).
    pub fn through_mean<H: Borrow<History>>(pairs: &[(H, Vec<f32>)]) -> Self {
        Self::fit(pairs, |history, weights| {
            let audible = || (0..history.len()).filter(|&i| weights[i] > 0.0);
            let n = audible().count() as f64;
            (audible().map(|i| history.times_s[i]).sum::<f64>() / n, None)
        })
    }

    /// Through the first path: m = sum (t - t0)(y - y0) / sum (t - t0)2.
    pub fn through_first<H: Borrow<History>>(pairs: &[(H, Vec<f32>)]) -> Self {
        Self::fit(pairs, |history, weights| {
            let audible = (0..history.len()).filter(|&i| weights[i] > 0.0);
            let first = audible.min_by(|&a, &b| history.times_s[a].total_cmp(&history.times_s[b]));
            (first.map_or(f64::NAN, |i| history.times_s[i]), first)
        })
    }

    /// Regression on time from an origin; levels and hits count from those of `first`, if there is one.
    fn fit<H: Borrow<History>>(
        pairs: &[(H, Vec<f32>)],
        origin: impl Fn(&History, &[f32]) -> (f64, Option<usize>),
    ) -> Self {
        let materials = pairs.first().map_or(0, |(h, _)| h.borrow().materials);
        let (mut rigid, mut rate, mut used) = (0.0, vec![0.0; materials], 0.0);
        for (history, weights) in pairs {
            let history = history.borrow();
            let (origin_s, first) = origin(history, weights);
            let counts = |i: usize| &history.counts[i * materials..(i + 1) * materials];
            let level = |i: usize| DB_PER_NEPER * f64::from(weights[i]).ln();
            let (mut square, mut sum, mut hits) = (0.0, 0.0, vec![0.0; materials]);
            for i in (0..history.len()).filter(|&i| weights[i] > 0.0) {
                let t = history.times_s[i] - origin_s;
                square += t * t;
                sum += t * (level(i) - first.map_or(0.0, level));
                for (m, h) in hits.iter_mut().enumerate() {
                    let before = first.map_or(0.0, |f| f64::from(counts(f)[m]));
                    *h += t * (f64::from(counts(i)[m]) - before);
                }
            }
            if square > 0.0 {
                used += 1.0;
                rigid += sum / square;
                rate.iter_mut().zip(hits).for_each(|(r, h)| *r += DB_PER_NEPER * h / square);
            }
        }
        rate.iter_mut().for_each(|r| *r /= used);
        Self { rigid: (used > 0.0).then_some(rigid / used), rate }
    }
}

impl SlopeModel for SinglePathSlope {
    fn slope(&self, absorption: &[f64], gradient: &mut [f64]) -> Option<f64> {
        let mut slope = self.rigid?;
        for ((g, rate), a) in gradient.iter_mut().zip(&self.rate).zip(absorption) {
            slope += rate * (-a).ln_1p();
            *g = -rate / (1.0 - a);
        }
        Some(slope)
    }
}
