//! The time bins in which energies are compared.

use sabine_acoustics::Bands;

/// Shortest bin, in seconds.
const MIN_BIN_S: f64 = 0.01;
/// Length of a bin in units of one over the bandwidth: shorter ones would be copies of their neighbours.
const BANDWIDTH_TIMES: f64 = 2.0;
/// The first bin begins so long before the direct sound, in units of one over the bandwidth: the filter rings both ways.
const LEAD_BANDWIDTH_TIMES: f64 = 1.5;

/// Bins of one band, in seconds after the direct sound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bins {
    pub start_s: f64,
    pub width_s: f64,
}

impl Bins {
    pub fn new(bands: Bands, band: usize) -> Self {
        let (low, high) = bands.edges_hz(band);
        let width_s = MIN_BIN_S.max(BANDWIDTH_TIMES / (high - low));
        // The direct sound stays clear of the first bin's end, lest a small error of its time move it into the next.
        let start_s = -(LEAD_BANDWIDTH_TIMES / (high - low)).min(0.75 * width_s);
        Self { start_s, width_s }
    }

    /// Where bin `index` begins.
    pub fn edge_s(&self, index: usize) -> f64 {
        self.start_s + index as f64 * self.width_s
    }

    pub fn centre_s(&self, index: usize) -> f64 {
        self.edge_s(index) + 0.5 * self.width_s
    }

    /// Whole bins before `end_s`.
    pub fn count(&self, end_s: f64) -> usize {
        ((end_s - self.start_s) / self.width_s).floor().max(0.0) as usize
    }
}
