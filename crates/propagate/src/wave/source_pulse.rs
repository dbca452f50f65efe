//! What the source of a wave solution emits.

use std::f64::consts::PI;

/// A pulse of Ricker's form, with its largest spectral line at `peak_hz`: (1 - 2 a) exp(-a), a = (pi f (t - delay))^2. It has
/// neither a mean nor a slope, so that no constant pressure is pumped into a closed room.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SourcePulse {
    peak_hz: f64,
    delay_s: f64,
}

/// Beyond this many 1 / (pi f) from its middle the pulse is 0 to double precision.
const REACH: f64 = 6.5;

impl SourcePulse {
    pub fn new(peak_hz: f64) -> Self {
        Self { peak_hz, delay_s: REACH / (PI * peak_hz) }
    }

    /// When it is over, in seconds.
    pub fn end_s(&self) -> f64 {
        2.0 * self.delay_s
    }

    pub fn at(&self, time_s: f64) -> f64 {
        let a = (PI * self.peak_hz * (time_s - self.delay_s)).powi(2);
        if time_s > self.end_s() { 0.0 } else { (1.0 - 2.0 * a) * (-a).exp() }
    }
}
