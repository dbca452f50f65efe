//! Means over an octave.

/// Intervals of Simpson's rule, even.
const INTERVALS: usize = 64;

/// Mean over the logarithm of the frequency, from `low_hz` to `high_hz`, by Simpson's rule.
pub(crate) fn octave_mean((low_hz, high_hz): (f64, f64), value: impl Fn(f64) -> f64) -> f64 {
    let span = (high_hz / low_hz).ln();
    let at = |i: usize| value(low_hz * (span * i as f64 / INTERVALS as f64).exp());
    let inner: f64 = (1..INTERVALS).map(|i| at(i) * if i % 2 == 1 { 4.0 } else { 2.0 }).sum();
    (at(0) + inner + at(INTERVALS)) / (3.0 * INTERVALS as f64)
}
