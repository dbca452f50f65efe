//! Parameters of ISO 3382-1 of predicted bins, and their derivatives.

use crate::observe::stated_parameter::StatedParameter;
use crate::observe::time_bins::Bins;
use sabine_acoustics::ParameterKind;
use std::f64::consts::LN_10;

/// Early sound ends so long after the direct sound, in seconds (ISO 3382-1:2009, A.2.3).
const C50_S: f64 = 0.050;
const C80_S: f64 = 0.080;
/// Points of a decay curve through which a line is laid.
const POINTS: usize = 40;
/// Fewest bins of a decay.
const LEAST_BINS: usize = 4;
/// The last of so many parts of the bins says how the decay goes on behind them.
const PARTS: usize = 3;
/// The slowest decay that ends, in nepers a bin; ...
const SLOWEST: f64 = 1e-3;
/// ... and so many times more slowly than the whole does none end: what falls less is held up by single bins.
const SLOWER: f64 = 4.0;
/// A decay that is read must not go on for longer than this behind the bins, as a share of their time.
const MOST_BEHIND: f64 = 0.5;
/// Share of the energy below which early or late sound is none.
const LEAST_SHARE: f64 = 1e-9;
/// Bins so far below the strongest, in nepers (56 dB), and all behind them, are those of no paths.
const DEPTH: f64 = 13.0;
/// Step of differences of the ends of a range, as a share of it.
const RANGE_STEP: f64 = 1e-4;

/// Where the predicted bins of a band lie in time.
#[derive(Clone, Copy)]
pub(crate) struct TimeAxis<'a> {
    pub bins: Bins,
    /// Energy-weighted mean time of each bin after the direct sound.
    pub time_s: &'a [f64],
}

/// The energy that is still to come, over that of the whole response.
struct DecayCurve<'a> {
    time_s: &'a [f64],
    width_s: f64,
    /// Beginnings of the bins and the end of the last, the first being that of the direct sound.
    edges_s: Vec<f64>,
    /// Energies of the bins over that of the strongest.
    energies: Vec<f64>,
    behind: Behind,
    /// Energy from each edge on, and its logarithm over the whole.
    left: Vec<f64>,
    ln_left: Vec<f64>,
}

/// How a decay goes on behind its bins: as the line of least squares through the logarithms of the last of them.
struct Behind {
    energy: f64,
    /// Nepers a bin; negative.
    slope: f64,
    /// Whether the bins fall so; else they are taken to fall as slowly as any do.
    is_seen: bool,
    /// Change of the slope, and of the logarithm of the energy, with the logarithm of each of the last bins.
    slopes: Vec<[f64; 2]>,
    /// The first of these.
    first: usize,
}

/// The change of a reading with the logarithm of the energy left at each edge, and with the slope behind.
struct ByEdges {
    edges: Vec<f64>,
    slope_behind: f64,
}

impl Behind {
    /// Of the logarithms of at least [`LEAST_BINS`] energies, over that of the strongest.
    fn of(ln_energy: &[f64]) -> Self {
        let count = ln_energy.len();
        let first = count.saturating_sub((count / PARTS).max(LEAST_BINS));
        let last = &ln_energy[first..];
        let number = last.len() as f64;
        let middle = 0.5 * (number - 1.0);
        let x = |k: usize| k as f64 - middle;
        let squares: f64 = (0..last.len()).map(|k| x(k) * x(k)).sum();
        let found: f64 = last.iter().enumerate().map(|(k, ln)| x(k) * ln).sum::<f64>() / squares;
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        let before = &ln_energy[..first.max(1)];
        let whole = (mean(last) - mean(before)) / (0.5 * count as f64);
        let slowest = (whole / SLOWER).min(-SLOWEST);
        let is_seen = found < slowest;
        let slope = found.min(slowest);
        let at_end = mean(last) + found * middle;
        let rest = 1.0 - slope.exp();
        let by_slope = if is_seen { rest.recip() } else { 0.0 };
        let of_bin = |k: usize| {
            let of_slope = x(k) / squares;
            [if is_seen { of_slope } else { 0.0 }, number.recip() + of_slope * (middle + by_slope)]
        };
        let slopes = (0..last.len()).map(of_bin).collect();
        Self { energy: (at_end + slope).exp() / rest, slope, is_seen, slopes, first }
    }

    /// Mean time of what comes there after the end of the bins, in widths of a bin, and its change with the slope.
    fn mean_bins(&self) -> [f64; 2] {
        let ratio = self.slope.exp();
        [0.5 + ratio / (1.0 - ratio), ratio / (1.0 - ratio).powi(2)]
    }
}

impl<'a> DecayCurve<'a> {
    /// Of bins down to [`DEPTH`] below the strongest; there must be [`LEAST_BINS`] of them.
    fn of(axis: TimeAxis<'a>, ln_energy: &[f64]) -> Self {
        let top = ln_energy.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let deep = ln_energy.iter().rposition(|ln| *ln > top - DEPTH).unwrap_or(0);
        let count = (deep + 1).max(LEAST_BINS).min(ln_energy.len());
        let ln_energy: Vec<f64> = ln_energy[..count].iter().map(|ln| ln - top).collect();
        let behind = Behind::of(&ln_energy);
        let energies: Vec<f64> = ln_energy.iter().map(|ln| ln.exp()).collect();
        let mut left = vec![behind.energy; count + 1];
        for bin in (0..count).rev() {
            left[bin] = left[bin + 1] + energies[bin];
        }
        let mut edges_s: Vec<f64> = (0..=count).map(|bin| axis.bins.edge_s(bin)).collect();
        // The filter rings before the direct sound, which begins the decay.
        edges_s[0] = 0.0;
        let ln_left = left.iter().map(|l| (l / left[0]).ln()).collect();
        Self { time_s: axis.time_s, width_s: axis.bins.width_s, edges_s, energies, behind, left, ln_left }
    }

    /// The same energies where the time of each is known better than where its bin begins: half of it comes before its mean time.
    fn through_means(self) -> Self {
        let count = self.bins();
        let mean = |bin: usize| self.time_s[bin].clamp(self.edges_s[bin], self.edges_s[bin + 1]);
        let half = |bin: usize| 0.5 * (self.left[bin] + self.left[bin + 1]);
        let within = |first: f64, of: &dyn Fn(usize) -> f64, last: f64| -> Vec<f64> {
            std::iter::once(first).chain((0..count).map(of)).chain([last]).collect()
        };
        let left = within(self.left[0], &half, self.left[count]);
        Self {
            edges_s: within(0.0, &mean, self.edges_s[count]),
            ln_left: left.iter().map(|l| (l / left[0]).ln()).collect(),
            left,
            ..self
        }
    }

    fn bins(&self) -> usize {
        self.energies.len()
    }

    /// Number of the last edge.
    fn end(&self) -> usize {
        self.edges_s.len() - 1
    }

    /// The edge before a time, and how far it lies from it to the next; none behind the bins.
    fn about(&self, time_s: f64) -> Option<(usize, f64)> {
        let after = self.edges_s.partition_point(|edge| *edge <= time_s);
        (after <= self.end()).then(|| {
            let before = after.saturating_sub(1);
            let width_s = (self.edges_s[before + 1] - self.edges_s[before]).max(f64::MIN_POSITIVE);
            (before, ((time_s - self.edges_s[before]) / width_s).clamp(0.0, 1.0))
        })
    }

    /// Logarithm of the energy from a time on.
    fn at(&self, time_s: f64) -> f64 {
        let end = self.end();
        self.about(time_s).map_or_else(
            || self.ln_left[end] + self.behind.slope * (time_s - self.edges_s[end]) / self.width_s,
            |(before, share)| {
                self.ln_left[before] + share * (self.ln_left[before + 1] - self.ln_left[before])
            },
        )
    }

    /// Its change with time.
    fn slope_at(&self, time_s: f64) -> f64 {
        self.about(time_s).map_or(self.behind.slope / self.width_s, |(before, _)| {
            (self.ln_left[before + 1] - self.ln_left[before])
                / (self.edges_s[before + 1] - self.edges_s[before])
        })
    }

    /// When it falls below a level (a logarithm).
    fn crossing_s(&self, level: f64) -> f64 {
        if level >= 0.0 {
            return 0.0;
        }
        let end = self.end();
        let after = self.ln_left.partition_point(|ln_left| *ln_left > level);
        if after > end {
            return self.edges_s[end] + (level - self.ln_left[end]) * self.width_s / self.behind.slope;
        }
        let (from, to) = (self.ln_left[after - 1], self.ln_left[after]);
        let share = (level - from) / (to - from);
        self.edges_s[after - 1] + share * (self.edges_s[after] - self.edges_s[after - 1])
    }

    /// When it passes the levels between which a decay time is read.
    fn range_s(&self, range_db: [f64; 2]) -> [f64; 2] {
        range_db.map(|db| self.crossing_s(db * LN_10 / 10.0))
    }

    /// Slope of the line of least squares between two times, in nepers per second, and time and weight of each point.
    fn line(&self, [from_s, to_s]: [f64; 2]) -> (f64, Vec<(f64, f64)>) {
        let step_s = (to_s - from_s) / POINTS as f64;
        let x = |point: usize| (point as f64 + 0.5 - 0.5 * POINTS as f64) * step_s;
        let squares: f64 = (0..POINTS).map(|point| x(point) * x(point)).sum();
        let points: Vec<(f64, f64)> =
            (0..POINTS).map(|point| (0.5 * (from_s + to_s) + x(point), x(point) / squares)).collect();
        (points.iter().map(|(time_s, weight)| weight * self.at(*time_s)).sum(), points)
    }

    /// Logarithm of the decay time by that line (ISO 3382-1:2009, 3.7).
    fn ln_decay_time(&self, range_db: [f64; 2], by: Option<&mut ByEdges>) -> f64 {
        let range_s = self.range_s(range_db);
        let (slope, points) = self.line(range_s);
        if let Some(by) = by {
            let unit = -slope.recip();
            points.iter().for_each(|(time_s, weight)| by.add(self, *time_s, unit * weight));
            let step_s = RANGE_STEP * (range_s[1] - range_s[0]);
            for (end, &end_s) in range_s.iter().enumerate().filter(|(_, end_s)| **end_s > 0.0) {
                let at = |by_s: f64| {
                    let mut moved = range_s;
                    moved[end] += by_s;
                    self.line(moved).0
                };
                let with_end = (at(step_s) - at(-step_s)) / (2.0 * step_s);
                // Where the curve rises, its crossing comes later.
                by.add(self, end_s, -unit * with_end / self.slope_at(end_s));
            }
        }
        (-6.0 * LN_10 / slope).ln()
    }

    /// Logarithm of early over late energy.
    fn ln_early_to_late(&self, limit_s: f64, by: Option<&mut ByEdges>) -> f64 {
        let late = self.at(limit_s).exp().clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
        if let Some(by) = by {
            by.add(self, limit_s, -(1.0 - late).recip());
        }
        ((1.0 - late) / late).ln()
    }

    /// Mean time of what comes behind the bins.
    fn behind_s(&self) -> f64 {
        self.edges_s[self.end()] + self.width_s * self.behind.mean_bins()[0]
    }

    fn centre_s(&self) -> f64 {
        let moments = self.energies.iter().zip(self.time_s).map(|(e, t)| e * t.max(0.0));
        (moments.sum::<f64>() + self.behind.energy * self.behind_s()) / self.left[0]
    }

    /// Change of the logarithm of the centre time with that of each energy.
    fn centre_time_slopes(&self) -> Vec<f64> {
        let centre_s = self.centre_s();
        let unit = (centre_s * self.left[0]).recip();
        let of_bin = |(e, t): (&f64, &f64)| unit * e * (t.max(0.0) - centre_s);
        let mut slopes: Vec<f64> = self.energies.iter().zip(self.time_s).map(of_bin).collect();
        let behind = unit * self.behind.energy;
        let with_slope = behind * self.width_s * self.behind.mean_bins()[1];
        self.add_behind(&mut slopes, behind * (self.behind_s() - centre_s), with_slope);
        slopes
    }

    /// Adds what goes by way of what comes behind the bins: with the logarithm of its energy, and with its slope.
    fn add_behind(&self, slopes: &mut [f64], with_energy: f64, with_slope: f64) {
        for (slope, [of_slope, of_energy]) in slopes[self.behind.first..].iter_mut().zip(&self.behind.slopes)
        {
            *slope += with_energy * of_energy + with_slope * of_slope;
        }
    }

    fn ln(&self, kind: ParameterKind) -> f64 {
        match of_kind(kind) {
            Some(Read::DecayTime(range_db)) => self.ln_decay_time(range_db, None),
            Some(Read::EarlyToLate(limit_s)) => self.ln_early_to_late(limit_s, None),
            _ => self.centre_s().ln(),
        }
    }

    /// Its change with the logarithm of each energy.
    fn slopes(&self, kind: ParameterKind) -> Vec<f64> {
        let mut by = ByEdges { edges: vec![0.0; self.left.len()], slope_behind: 0.0 };
        match of_kind(kind) {
            Some(Read::DecayTime(range_db)) => _ = self.ln_decay_time(range_db, Some(&mut by)),
            Some(Read::EarlyToLate(limit_s)) => _ = self.ln_early_to_late(limit_s, Some(&mut by)),
            _ => return self.centre_time_slopes(),
        }
        by.by_energies(self)
    }

    /// Whether a parameter can be read: the decay falls, hardly farther than it is known, and sound is early and late.
    fn holds(&self, kind: ParameterKind) -> bool {
        let known_s = (1.0 + MOST_BEHIND) * self.edges_s[self.end()];
        let holds = match of_kind(kind) {
            Some(Read::DecayTime(range_db)) => self.range_s(range_db)[1] < known_s,
            Some(Read::EarlyToLate(limit_s)) => {
                (2.0 * LEAST_SHARE..1.0 - 2.0 * LEAST_SHARE).contains(&self.at(limit_s).exp())
            }
            Some(Read::CentreTime) => true,
            None => false,
        };
        holds && self.behind.is_seen && self.ln(kind).is_finite()
    }
}

impl ByEdges {
    /// Adds the change with the logarithm of the energy from a time on.
    fn add(&mut self, curve: &DecayCurve<'_>, time_s: f64, weight: f64) {
        if let Some((before, share)) = curve.about(time_s) {
            self.edges[before] += (1.0 - share) * weight;
            self.edges[before + 1] += share * weight;
        } else {
            let count = curve.bins();
            self.edges[count] += weight;
            self.slope_behind += weight * (time_s - curve.edges_s[count]) / curve.width_s;
        }
    }

    /// The same with the logarithm of each energy.
    fn by_energies(&self, curve: &DecayCurve<'_>) -> Vec<f64> {
        let whole = self.edges.iter().sum::<f64>() / curve.left[0];
        let mut until = 0.0;
        let mut slopes = Vec::with_capacity(curve.bins());
        for ((edge, left), energy) in self.edges.iter().zip(&curve.left).zip(&curve.energies) {
            until += edge / left;
            slopes.push(energy * (until - whole));
        }
        until += self.edges[curve.bins()] / curve.left[curve.bins()];
        curve.add_behind(&mut slopes, curve.behind.energy * (until - whole), self.slope_behind);
        slopes
    }
}

/// How a parameter is read.
enum Read {
    /// Between two levels in dB.
    DecayTime([f64; 2]),
    /// Until a time in seconds.
    EarlyToLate(f64),
    CentreTime,
}

/// `None` of a parameter that a later version may add: it cannot be predicted here.
fn of_kind(kind: ParameterKind) -> Option<Read> {
    match kind {
        ParameterKind::Edt => Some(Read::DecayTime([0.0, -10.0])),
        ParameterKind::T20 => Some(Read::DecayTime([-5.0, -25.0])),
        ParameterKind::T30 => Some(Read::DecayTime([-5.0, -35.0])),
        ParameterKind::C50 | ParameterKind::D50 => Some(Read::EarlyToLate(C50_S)),
        ParameterKind::C80 => Some(Read::EarlyToLate(C80_S)),
        ParameterKind::CentreTime => Some(Read::CentreTime),
        _ => None,
    }
}

/// Logarithms of the quantities of which a table states values, of a prediction that has them all ([`readable`]).
pub(crate) fn read(stated: &[StatedParameter], axis: TimeAxis<'_>, ln_energy: &[f64]) -> Vec<f64> {
    let curve = DecayCurve::of(axis, ln_energy);
    stated.iter().map(|parameter| curve.ln(parameter.kind)).collect()
}

/// By how much they depend on where energy comes within its bin: where it is spread evenly less where it comes about its mean time.
pub(crate) fn by_width_of_bins(
    stated: &[StatedParameter],
    axis: TimeAxis<'_>,
    ln_energy: &[f64],
) -> Vec<f64> {
    let spread = DecayCurve::of(axis, ln_energy);
    let known = DecayCurve::of(axis, ln_energy).through_means();
    stated.iter().map(|parameter| spread.ln(parameter.kind) - known.ln(parameter.kind)).collect()
}

/// Their change with the logarithm of each energy, `[value][bin]`: bins beyond the last of a row change nothing.
pub(crate) fn slopes(stated: &[StatedParameter], axis: TimeAxis<'_>, ln_energy: &[f64]) -> Vec<Vec<f64>> {
    let curve = DecayCurve::of(axis, ln_energy);
    stated.iter().map(|parameter| curve.slopes(parameter.kind)).collect()
}

/// For which parameters a prediction has values.
pub(crate) fn readable(stated: &[StatedParameter], axis: TimeAxis<'_>, ln_energy: &[f64]) -> Vec<bool> {
    if ln_energy.len() < LEAST_BINS {
        return vec![false; stated.len()];
    }
    let curve = DecayCurve::of(axis, ln_energy);
    stated.iter().map(|parameter| curve.holds(parameter.kind)).collect()
}

#[cfg(test)]
pub(super) mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine_acoustics::Bands;

    pub(in super::super) const ALL: [ParameterKind; 6] = [
        ParameterKind::Edt,
        ParameterKind::T20,
        ParameterKind::T30,
        ParameterKind::C50,
        ParameterKind::C80,
        ParameterKind::CentreTime,
    ];

    pub(in super::super) fn stated() -> Vec<StatedParameter> {
        ALL.map(|kind| StatedParameter { kind, ln_sd: 0.05 }).to_vec()
    }

    /// Bins of an octave and the energy of an exponential decay in them, the first holding all of it that has come before its end.
    pub(in super::super) fn exponential(t60_s: f64, hz: f64, end_s: f64) -> (Bins, Vec<f64>, Vec<f64>) {
        let bins = Bins::new(Bands::octaves(hz, hz).unwrap(), 0);
        let tau_s = t60_s / (6.0 * LN_10);
        let left = |time_s: f64| (-time_s.max(0.0) / tau_s).exp();
        let edges = |bin: usize| (bins.edge_s(bin), bins.edge_s(bin + 1));
        let count = bins.count(end_s);
        let energy = |bin: usize| (left(edges(bin).0) - left(edges(bin).1)).ln();
        // Mean time of what comes between two times.
        let mean_s = |bin: usize| {
            let (from, to) = (edges(bin).0.max(0.0), edges(bin).1);
            let moment = |t: f64| (t + tau_s) * left(t);
            (moment(from) - moment(to)) / (left(from) - left(to))
        };
        (bins, (0..count).map(energy).collect(), (0..count).map(mean_s).collect())
    }

    #[test]
    fn an_exponential_decay_has_the_closed_forms_in_wide_and_narrow_bins_and_where_it_is_cut() {
        for (t60_s, hz, end_s) in [(1.2, 1000.0, 1.2), (0.6, 125.0, 0.6), (2.0, 500.0, 1.1)] {
            let (bins, ln_energy, time_s) = exponential(t60_s, hz, end_s);
            let axis = TimeAxis { bins, time_s: &time_s };
            assert!(!readable(&stated(), axis, &ln_energy).contains(&false));
            let found = read(&stated(), axis, &ln_energy);
            let tau_s = t60_s / (6.0 * LN_10);
            for (k, kind) in ALL.iter().enumerate().take(3) {
                assert!((found[k] - t60_s.ln()).abs() < 2e-3, "{kind} {t60_s} {hz}: {}", found[k].exp());
            }
            for (k, limit_s) in [(3, 0.05f64), (4, 0.08)] {
                let expected = ((limit_s / tau_s).exp() - 1.0).ln();
                assert!((found[k] - expected).abs() < 2e-3, "{limit_s} {hz}: {} {expected}", found[k]);
            }
            assert!((found[5] - tau_s.ln()).abs() < 2e-3, "{} {tau_s}", found[5].exp());
        }
    }

    #[test]
    fn slopes_are_central_differences() {
        let (bins, mut ln_energy, time_s) = exponential(0.9, 500.0, 0.5);
        // A curve with bends and peaks: no reading has a special value. A part of T30 lies behind the bins.
        ln_energy.iter_mut().enumerate().for_each(|(bin, ln)| {
            *ln += 0.3 * (1.7 * bin as f64).sin() + 0.02 * bin as f64;
        });
        let axis = TimeAxis { bins, time_s: &time_s };
        assert!(!readable(&stated(), axis, &ln_energy).contains(&false));
        let found = slopes(&stated(), axis, &ln_energy);
        for bin in 0..ln_energy.len() {
            let step = 1e-6;
            let at = |step: f64| {
                let mut moved = ln_energy.clone();
                moved[bin] += step;
                read(&stated(), axis, &moved)
            };
            let (up, down) = (at(step), at(-step));
            for (k, kind) in ALL.iter().enumerate() {
                let difference = (up[k] - down[k]) / (2.0 * step);
                let slope = found[k][bin];
                let near = 2e-3 * difference.abs() + 1e-4;
                assert!((slope - difference).abs() < near, "{kind} {bin}: {slope} {difference}");
            }
        }
    }

    #[test]
    fn what_does_not_decay_far_enough_is_not_read() {
        let (bins, ln_energy, time_s) = exponential(1.2, 1000.0, 0.3);
        let axis = TimeAxis { bins, time_s: &time_s };
        let of = |axis, ln_energy: &[f64]| readable(&stated(), axis, ln_energy);
        // 15 dB are there, and half as many more are believed.
        assert_eq!(of(axis, &ln_energy), [true, false, false, true, true, true]);
        let rising: Vec<f64> = (0..ln_energy.len()).map(|bin| 0.01 * bin as f64).collect();
        assert_eq!(of(axis, &rising), [false; 6]);
        assert_eq!(of(TimeAxis { bins, time_s: &time_s[..3] }, &ln_energy[..3]), [false; 6]);
    }
}
