//! The measured responses of one band, and which paths fall into which of their time bins.

use crate::AbsorptionPrior;
use crate::history::{History, Traces};
use crate::measured_decay::BinnedDecay;
use crate::pulse::Pulse;
use crate::table_band::TableBand;
use crate::unknowns::BandPrior;
use sabine_paths::PathSet;
use sabine_scene::Levels;

/// Points at which a bin of the paths is held against the edges of the measured ones.
const POINTS: usize = 8;
/// A path counts in a measured bin if at least this share of its energy falls into it.
const LEAST_SHARE: f64 = 1e-4;
/// Errors of arrival are summed over so many quarters of a standard deviation to either side.
const QUARTERS: i32 = 12;
/// Least width of a bin, in standard deviations of an arrival: errors of neighbouring bins, in truth of opposite signs, are taken for
/// independent, which may not be all that there is in a bin.
const WIDTH: f64 = 2.0;
/// Most exact paths of a response that are taken one by one, the earliest: all reflections up to the third in most rooms. Where a tracer
/// knows more (closed forms of cuboids hold a hundred thousand), those that follow are as dense as a diffuse field.
const MAX_EXACT: usize = 512;
/// Pairs that interfere less are left out.
const LEAST_OVERLAP: f64 = 1e-7;

/// One band: its priors and the responses that can be read in it.
pub(crate) struct ResponseBand<'a> {
    pub prior: BandPrior,
    pub levels: Levels,
    pub responses: Vec<BandResponse<'a>>,
    /// Parameters of pairs that were measured as tables.
    pub tables: Vec<TableBand<'a>>,
}

/// A response in a band, its bins counted from the emission.
pub(crate) struct BandResponse<'a> {
    pub index: usize,
    /// The sampled paths.
    pub traces: Traces<&'a History>,
    /// The exact ones: where they stand in the history, and their energy if nothing absorbed.
    pub exact: Vec<(usize, f64)>,
    /// Empty where the response cannot be read in this band: then it only leaks into those beside it.
    pub windows: Vec<Window>,
    /// How many of them are fitted, from the first on.
    pub fitted: usize,
    /// What the filter passes of other bands ([`BinnedDecay::leaks`]).
    pub leaks: Vec<(usize, f64)>,
}

/// A measured bin and what falls into it.
pub(crate) struct Window {
    pub energy: f64,
    /// Level of the measured decay curve at its start, re that at the first, in dB.
    pub level_db: f64,
    /// Independent values of the band that it holds.
    pub values: f64,
    /// Relative variance of its energy by the noise that was measured with it.
    pub noise: f64,
    /// First bin of the paths, and the share of each from there on.
    pub from: usize,
    pub shares: Vec<f64>,
    pub exact: Vec<Arrival>,
    /// Pairs of these, by their place in this list, and how much they interfere ([`Pulse::overlap`]).
    pub overlaps: Vec<(usize, usize, f64)>,
    /// Energy of other bands that the filter passes, in the units of the paths of this band.
    pub leak: f64,
}

/// An exact path in a measured bin.
pub(crate) struct Arrival {
    /// Its place in [`BandResponse::exact`].
    pub place: usize,
    /// Expected share of its energy that falls into the bin.
    pub share: f64,
    /// Variance of this share by the error of its arrival.
    pub variance: f64,
}

impl<'a> ResponseBand<'a> {
    pub fn new(priors: &[AbsorptionPrior], band: usize, levels: Levels) -> Self {
        Self { prior: BandPrior::new(priors, band), levels, responses: Vec::new(), tables: Vec::new() }
    }

    /// Adds a response as far as the paths reach; whether anything is left of it.
    pub fn add(
        &mut self,
        index: usize,
        history: &'a History,
        weights: Vec<f32>,
        decay: &BinnedDecay,
        latency_s: f64,
        arrival_error_s: f64,
    ) -> bool {
        let decay = &decay.widened(WIDTH * arrival_error_s);
        let end_s = history.bins() as f64 * history.bin_s;
        let edges_s: Vec<f64> =
            decay.edges_s.iter().map(|t| t - latency_s).take_while(|t| *t <= end_s).collect();
        self.add_unread(index, history, weights);
        let Some(response) = self.responses.last_mut().filter(|_| edges_s.len() >= 3) else { return false };
        let exact = &response.exact;
        let pulse = &decay.pulse;
        let level_db = decay.level_db();
        let window = |(j, edges): (usize, &[f64])| {
            let (from, shares) = shares(edges, history, pulse);
            let paths = exact.iter().enumerate().map(|(place, &(i, _))| {
                let (share, variance) = arrival(edges, history.times_s[i], arrival_error_s, pulse);
                Arrival { place, share, variance }
            });
            let exact_here: Vec<Arrival> = paths.filter(|a| a.share > LEAST_SHARE).collect();
            let time_s = |n: usize| history.times_s[exact[exact_here[n].place].0];
            let pairs = (0..exact_here.len()).flat_map(|n| (0..n).map(move |m| (n, m)));
            let overlaps = pairs.map(|(n, m)| (n, m, pulse.overlap(edges, time_s(n), time_s(m))));
            let overlaps = overlaps.filter(|(_, _, overlap)| *overlap > LEAST_OVERLAP).collect();
            let signal = decay.signal[j];
            Window {
                energy: decay.energy[j],
                level_db: level_db[j],
                values: decay.values[j],
                noise: (1.0 / (signal * signal) - 1.0) / decay.values[j],
                from,
                shares,
                exact: exact_here,
                overlaps,
                leak: 0.0,
            }
        };
        response.windows = edges_s.windows(2).enumerate().map(window).collect();
        response.fitted = response.windows.len();
        response.leaks.clone_from(&decay.leaks);
        true
    }

    /// Adds a response that cannot be read in this band, for what its paths leak into others.
    pub fn add_unread(&mut self, index: usize, history: &'a History, mut weights: Vec<f32>) {
        let mut exact = Vec::new();
        for (i, weight) in weights.iter_mut().enumerate() {
            // Those without energy too: bands have the same list.
            if history.batches[i] == PathSet::BATCHES && exact.len() < MAX_EXACT {
                exact.push((i, f64::from(*weight)));
                *weight = 0.0;
            }
        }
        let traces = vec![(history, weights)];
        let (windows, leaks) = (Vec::new(), Vec::new());
        self.responses.push(BandResponse { index, traces, exact, windows, fitted: 0, leaks });
    }

    /// Leaves out what begins below a level of the decay curve; whether that is anything.
    pub fn leave_below(&mut self, level_db: f64) -> bool {
        let mut any = false;
        for response in &mut self.responses {
            response.fitted = response.windows.iter().take_while(|w| w.level_db >= level_db).count();
            any |= response.fitted < response.windows.len();
        }
        any
    }

    /// Takes everything in again.
    pub fn take_all(&mut self) {
        self.responses.iter_mut().for_each(|response| response.fitted = response.windows.len());
    }

    /// Whether no response can be read, and no table has a value.
    pub fn is_empty(&self) -> bool {
        self.responses.iter().all(|response| response.windows.is_empty())
            && self.tables.iter().all(|table| table.values.is_empty())
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

/// Mean and variance of the share of a pulse between two edges, its arrival being normally distributed about a time.
fn arrival(edges_s: &[f64], time_s: f64, error_s: f64, pulse: &Pulse) -> (f64, f64) {
    let reach_s = 0.25 * f64::from(QUARTERS) * error_s + pulse.half_s();
    if time_s + reach_s < edges_s[0] || time_s - reach_s > edges_s[1] {
        return (0.0, 0.0);
    }
    let quarters = if error_s > 0.0 { QUARTERS } else { 0 };
    let (mut weight, mut mean, mut square) = (0.0, 0.0, 0.0);
    for i in -quarters..=quarters {
        let z = 0.25 * f64::from(i);
        let at_s = time_s + z * error_s;
        let share = pulse.before(edges_s[1] - at_s) - pulse.before(edges_s[0] - at_s);
        let w = (-0.5 * z * z).exp();
        weight += w;
        mean += w * share;
        square += w * share * share;
    }
    mean /= weight;
    (mean, (square / weight - mean * mean).max(0.0))
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn shares_of_uncertain_arrivals_are_what_drawing_them_gives() {
        // A pulse of three samples at 10 kHz.
        let pulse = Pulse::new(&[0.0, 0.3, 1.0, -0.5, 0.0], 2, 10_000.0);
        let mut random = rand_pcg::Pcg64::seed_from_u64(5);
        for (edges, time_s) in [([0.01, 0.011], 0.0103), ([0.01, 0.0107], 0.0115), ([0.01, 0.03], 0.0102)] {
            let error_s = 0.25e-3;
            let (mut sum, mut square) = (0.0, 0.0);
            let draws = 100_000;
            for _ in 0..draws {
                let (u, v): (f64, f64) = (random.random(), random.random());
                let z = (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos();
                let at_s = time_s + error_s * z;
                let share = pulse.before(edges[1] - at_s) - pulse.before(edges[0] - at_s);
                sum += share;
                square += share * share;
            }
            let mean = sum / f64::from(draws);
            let variance = square / f64::from(draws) - mean * mean;
            let found = arrival(&edges, time_s, error_s, &pulse);
            assert!((found.0 - mean).abs() < 0.01, "{edges:?}: {found:?} {mean}");
            assert!((found.1 - variance).abs() < 0.01, "{edges:?}: {found:?} {variance}");
        }
        let (share, variance) = arrival(&[0.01, 0.011], 0.0103, 0.0, &pulse);
        assert!(variance == 0.0 && share > 0.99, "{share} {variance}");
        assert_eq!(arrival(&[0.01, 0.011], 0.02, 1e-3, &pulse), (0.0, 0.0));
    }
}
