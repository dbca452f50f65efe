//! Cross-correlation of two sounds over short lags, between samples too.

use std::ops::Range;

/// Samples on each side from which a value between two lags is interpolated.
const SINC_HALF_WIDTH: i64 = 16;
/// Points of the interpolated correlation in a sample.
const POINTS_PER_SAMPLE: i64 = 8;

/// Sum of one(t) other(t + lag) over a range of t, for lags up to a reach on both sides.
#[derive(Clone, Debug)]
pub(crate) struct Correlation {
    /// At whole lags from `-outer` on.
    lags: Vec<f64>,
    outer: i64,
    /// Largest lag, in samples.
    reach: f64,
}

impl Correlation {
    pub(crate) fn new(one: &[f64], other: &[f64], range: Range<usize>, reach: f64) -> Self {
        let outer = reach.floor() as i64 + SINC_HALF_WIDTH;
        let at_lag = |lag: i64| -> f64 {
            range
                .clone()
                .filter_map(|i| {
                    let shifted = usize::try_from(i as i64 + lag).ok()?;
                    Some(one[i] * other.get(shifted)?)
                })
                .sum()
        };
        Self { lags: (-outer..=outer).map(at_lag).collect(), outer, reach }
    }

    /// Lag in samples and value, eight to a sample.
    pub(crate) fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let points = (self.reach * POINTS_PER_SAMPLE as f64).floor() as i64;
        (-points..=points).map(|point| {
            let lag = point as f64 / POINTS_PER_SAMPLE as f64;
            (lag, self.at(lag))
        })
    }

    /// The value at a lag, by a windowed sinc: the sounds are sampled often enough, hence so is their correlation.
    fn at(&self, lag: f64) -> f64 {
        let nearest = lag.round() as i64;
        (nearest - SINC_HALF_WIDTH + 1..nearest + SINC_HALF_WIDTH)
            .filter_map(|k| {
                let known = self.lags.get(usize::try_from(k + self.outer).ok()?)?;
                let distance = std::f64::consts::PI * (lag - k as f64);
                let sinc = if distance.abs() < 1e-12 { 1.0 } else { distance.sin() / distance };
                let window = 0.5 + 0.5 * (distance / SINC_HALF_WIDTH as f64).cos();
                Some(known * sinc * window)
            })
            .sum()
    }
}
