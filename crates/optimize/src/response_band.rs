//! The measured responses of one band, and which paths fall into which of their time bins.

use crate::AbsorptionPrior;
use crate::decay_slope::Traces;
use crate::history::History;
use crate::measured_decay::BinnedDecay;
use crate::pulse::Pulse;
use crate::unknowns::BandPrior;
use sabine_acoustics::{Levels, PathSet};

/// Points at which a bin of the paths is held against the edges of the measured ones.
const POINTS: usize = 8;
/// A path counts in a measured bin if at least this share of its energy falls into it.
const LEAST_SHARE: f64 = 1e-4;
/// Pairs that interfere less are left out.
const LEAST_OVERLAP: f64 = 1e-7;

/// One band: its priors and the responses that can be read in it.
pub(crate) struct ResponseBand<'a> {
    pub prior: BandPrior,
    pub levels: Levels,
    pub responses: Vec<BandResponse<'a>>,
}

/// A response in a band, its bins counted from the emission.
pub(crate) struct BandResponse<'a> {
    pub index: usize,
    /// The sampled paths.
    pub traces: Traces<&'a History>,
    /// The exact ones: where they stand in the history, and their energy if nothing absorbed.
    pub exact: Vec<(usize, f64)>,
    pub windows: Vec<Window>,
}

/// A measured bin and what falls into it.
pub(crate) struct Window {
    pub energy: f64,
    /// Independent values of the band that it holds.
    pub values: f64,
    /// Relative variance of its energy by the noise that was measured with it.
    pub noise: f64,
    /// First bin of the paths, and the share of each from there on.
    pub from: usize,
    pub shares: Vec<f64>,
    /// Exact paths, by their place in [`BandResponse::exact`], and the share of each.
    pub exact: Vec<(usize, f64)>,
    /// Pairs of these, by their place in this list, and how much they interfere ([`Pulse::overlap`]).
    pub overlaps: Vec<(usize, usize, f64)>,
}

impl<'a> ResponseBand<'a> {
    pub fn new(priors: &[AbsorptionPrior], band: usize, levels: Levels) -> Self {
        Self { prior: BandPrior::new(priors, band), levels, responses: Vec::new() }
    }

    /// Adds a response as far as the paths reach; whether anything is left of it.
    pub fn add(
        &mut self,
        index: usize,
        history: &'a History,
        mut weights: Vec<f32>,
        decay: &BinnedDecay,
        latency_s: f64,
    ) -> bool {
        let end_s = history.bins() as f64 * history.bin_s;
        let edges_s: Vec<f64> =
            decay.edges_s.iter().map(|t| t - latency_s).take_while(|t| *t <= end_s).collect();
        if edges_s.len() < 3 {
            return false;
        }
        let mut exact = Vec::new();
        for (i, weight) in weights.iter_mut().enumerate() {
            if history.batches[i] == PathSet::BATCHES && *weight > 0.0 {
                exact.push((i, f64::from(*weight)));
                *weight = 0.0;
            }
        }
        let pulse = &decay.pulse;
        let window = |(j, edges): (usize, &[f64])| {
            let (from, shares) = shares(edges, history, pulse);
            let paths = exact.iter().enumerate().map(|(place, &(i, _))| {
                let after = |edge: f64| pulse.before(edge - history.times_s[i]);
                (place, after(edges[1]) - after(edges[0]))
            });
            let exact_here: Vec<(usize, f64)> = paths.filter(|(_, share)| *share > LEAST_SHARE).collect();
            let time_s = |n: usize| history.times_s[exact[exact_here[n].0].0];
            let pairs = (0..exact_here.len()).flat_map(|n| (0..n).map(move |m| (n, m)));
            let overlaps = pairs.map(|(n, m)| (n, m, pulse.overlap(edges, time_s(n), time_s(m))));
            let overlaps = overlaps.filter(|(_, _, overlap)| *overlap > LEAST_OVERLAP).collect();
            let signal = decay.signal[j];
            Window {
                energy: decay.energy[j],
                values: decay.values[j],
                noise: (1.0 / (signal * signal) - 1.0) / decay.values[j],
                from,
                shares,
                exact: exact_here,
                overlaps,
            }
        };
        let windows = edges_s.windows(2).enumerate().map(window).collect();
        let traces = vec![(history, weights)];
        self.responses.push(BandResponse { index, traces, exact, windows });
        true
    }

    pub fn is_empty(&self) -> bool {
        self.responses.is_empty()
    }

    /// Whether a response has a gain of its own, shares it with the band, or has none.
    pub fn gain_group(&self, response: usize) -> Option<usize> {
        match self.levels {
            Levels::Absolute => None,
            Levels::Common => Some(0),
            _ => Some(response),
        }
    }
}

/// Which share of each bin of the paths falls between two edges once it has passed the filter.
fn shares(edges_s: &[f64], history: &History, pulse: &Pulse) -> (usize, Vec<f64>) {
    let bin_s = history.bin_s;
    let from = ((edges_s[0] - pulse.half_s()).max(0.0) / bin_s) as usize;
    let to = ((edges_s[1] + pulse.half_s()).max(0.0) / bin_s).ceil() as usize;
    let share = |i: usize| {
        let at = |p: usize| (i as f64 + (p as f64 + 0.5) / POINTS as f64) * bin_s;
        let of = |p: usize| pulse.before(edges_s[1] - at(p)) - pulse.before(edges_s[0] - at(p));
        (0..POINTS).map(of).sum::<f64>() / POINTS as f64
    };
    let from = from.min(history.bins());
    (from, (from..to.clamp(from, history.bins())).map(share).collect())
}
