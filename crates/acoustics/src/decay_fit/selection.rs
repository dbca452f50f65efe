//! How many slopes the data ask for.

use super::bins::Bin;
use super::model::{LN_MILLION, Model, mean_decay};
use super::numerics::solve;

/// Most slopes that are looked for.
const MOST_SLOPES: usize = 3;
/// Twice the gain in log-likelihood that one more slope (two parameters) must bring. By chance a single slope reaches 16
/// with a probability below 0.1 %, which leaves room for what the bins idealise.
const SLOPE_EVIDENCE: f64 = 16.0;
/// Least ratio of the decay times of two slopes.
const LEAST_RATIO: f64 = 1.3;
/// Least fall that shows of the slowest of several slopes, in dB: less might be a floor that drifts.
const LEAST_VISIBLE_FALL_DB: f64 = 12.0;

/// What limits the slopes that may be added.
pub(super) struct Limits {
    pub(super) bandwidth_hz: f64,
    pub(super) longest_s: f64,
}

impl Model {
    /// The likeliest model of as many slopes as the data ask for.
    pub(super) fn best(self, bins: &[Bin], limits: &Limits) -> Self {
        let mut best = self.maximise(bins);
        while best.slopes() < MOST_SLOPES {
            let Some(next) = best.with_one_more_slope(bins, limits) else { break };
            best = next;
        }
        best
    }

    /// True if the data speak for a decay against noise alone.
    pub(super) fn is_needed(&self, bins: &[Bin]) -> bool {
        let shape: f64 = bins.iter().map(|bin| bin.shape).sum();
        let mean = bins.iter().map(|bin| bin.shape * bin.power).sum::<f64>() / shape;
        let alone: f64 = bins.iter().map(|bin| 2.0 * bin.shape * (bin.power / mean + mean.ln())).sum();
        (alone - self.deviance) / self.dispersion(bins).max(1.0) > SLOPE_EVIDENCE
    }

    /// The model with one more slope, if the data ask for it.
    fn with_one_more_slope(&self, bins: &[Bin], limits: &Limits) -> Option<Self> {
        let end_s = bins.last()?.to_s;
        let dispersion = self.dispersion(bins).max(1.0);
        let needed = SLOPE_EVIDENCE.max(2.0 * (limits.bandwidth_hz * end_s).ln());
        let (evidence, start) = self.most_wanted_slope(bins)?;
        // The score test anticipates the gain; only a promising slope is worth a fit.
        if evidence < 0.25 * needed {
            return None;
        }
        let tried = self.moved(start, bins).maximise(bins);
        let dispersion = dispersion.min(tried.dispersion(bins).max(1.0));
        ((self.deviance - tried.deviance) / dispersion > needed
            && tried.converged
            && tried.is_physical(end_s, limits))
        .then_some(tried)
    }

    /// Rao's score test of one more slope of a given rate, over a range of rates: the largest statistic (chi-squared with
    /// one degree of freedom if there is no such slope) and where a fit should start.
    fn most_wanted_slope(&self, bins: &[Bin]) -> Option<(f64, Vec<f64>)> {
        let n = self.parameters.len();
        let (_, mut information) = self.score(bins);
        for i in 0..n {
            information[i * n + i] *= 1.0 + 1e-9;
            information[i * n + i] += 1e-9;
        }
        let rates = self.parameters[1..n - 1].iter().step_by(2).map(|rate| rate.exp());
        let (slowest, fastest) =
            rates.fold((f64::MAX, 0.0_f64), |(low, high), rate| (low.min(rate), high.max(rate)));
        let (low, high) = (slowest / 10.0, fastest * 10.0);
        let mut best: Option<(f64, Vec<f64>)> = None;
        for i in 0..16 {
            let rate = low * (high / low).powf(f64::from(i) / 15.0);
            let (mut score, mut own) = (0.0, 0.0);
            let mut shared = vec![0.0; n];
            mean_decay(bins, rate, |i, mean, _| {
                let by_power = mean / self.expected[i];
                let weight = bins[i].shape * by_power;
                score += weight * (bins[i].power / self.expected[i] - 1.0);
                own += weight * by_power;
                for (sum, derivative) in shared.iter_mut().zip(&self.derivatives[i * n..(i + 1) * n]) {
                    *sum += weight * derivative;
                }
            });
            let explained: f64 = solve(&information, &shared)?.iter().zip(&shared).map(|(a, b)| a * b).sum();
            let free = own - explained;
            if score <= 0.0 || free <= 1e-9 * own {
                continue;
            }
            let statistic = score * score / free;
            if best.as_ref().is_none_or(|(most, _)| statistic > *most) {
                let mut start = self.parameters[..n - 1].to_vec();
                start.extend([(score / free).ln(), rate.ln(), self.parameters[n - 1]]);
                best = Some((statistic, start));
            }
        }
        best
    }

    /// Slopes far enough apart, each long enough to be seen, the slowest distinct from a drifting floor.
    fn is_physical(&self, end_s: f64, limits: &Limits) -> bool {
        let n = self.parameters.len();
        let mut slopes: Vec<(f64, f64)> =
            self.parameters[..n - 1].chunks_exact(2).map(|pair| (pair[0], pair[1].exp())).collect();
        slopes.sort_by(|a, b| b.1.total_cmp(&a.1));
        let apart = slopes.windows(2).all(|pair| pair[0].1 > LEAST_RATIO * pair[1].1);
        let times_s = slopes.iter().map(|(_, rate)| LN_MILLION / rate);
        let unsmeared =
            times_s.clone().all(|t60_s| limits.bandwidth_hz * t60_s > 8.0 && t60_s < limits.longest_s);
        let [.., (fast_log, fast), (slow_log, slow)] = slopes[..] else { return apart && unsmeared };
        // From where the last two cross to where the slowest meets the noise, or the end.
        let crossing_s = ((fast_log - slow_log) / (fast - slow)).max(0.0);
        let knee_s = ((slow_log - self.parameters[n - 1]) / slow).min(end_s);
        let fall_db = 60.0 * slow / LN_MILLION * (knee_s - crossing_s);
        apart && unsmeared && fall_db > LEAST_VISIBLE_FALL_DB
    }
}
