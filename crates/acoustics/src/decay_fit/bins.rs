//! The data of a fit: mean power in bins that grow towards the noise.

/// Width of the first and of the widest bin as shares of the time to the knee, and how much each is wider than the last:
/// narrow ones where a steep first slope may hide, about sixty in all.
const FIRST_BIN: f64 = 0.005;
const WIDEST_BIN: f64 = 0.04;
const BIN_GROWTH: f64 = 1.035;
/// Bins after the knee, where only noise is left.
const FLOOR_BINS: usize = 24;

/// What is fitted: mean power in a bin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bin {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) power: f64,
    pub(super) shape: f64,
}

/// Growing bins up to a little beyond the knee, wide ones after it.
pub(super) fn bins(samples: &[f64], step_s: f64, bandwidth_hz: f64, knee_s: f64) -> Vec<Bin> {
    let knee = ((1.2 * knee_s / step_s) as usize).clamp(1, samples.len());
    let least = (1.0 / (bandwidth_hz * step_s)).max(1.0);
    let floor = ((samples.len() - knee) as f64 / FLOOR_BINS as f64).max(WIDEST_BIN * knee as f64);
    let mut width = FIRST_BIN * knee as f64;
    let mut bins = Vec::with_capacity(128);
    let mut from = 0;
    while from < samples.len() {
        let wanted = if from < knee { width.min(WIDEST_BIN * knee as f64) } else { floor };
        let to = (from + wanted.max(least).ceil() as usize).min(samples.len());
        let power = samples[from..to].iter().sum::<f64>() / (to - from) as f64;
        let (from_s, to_s) = (from as f64 * step_s, to as f64 * step_s);
        bins.push(Bin { from_s, to_s, power, shape: bandwidth_hz * (to_s - from_s) });
        width *= BIN_GROWTH;
        from = to;
    }
    bins
}
