//! The maximum of the likelihood, by Fisher scoring.

use super::bins::Bin;
use super::model::Model;
use super::numerics::{leave_out, solve};

/// Most iterations of Fisher scoring.
const ITERATIONS: usize = 60;
/// Gain in deviance below which the fit has converged.
const NEGLIGIBLE_GAIN: f64 = 1e-4;

impl Model {
    /// Fisher scoring with Levenberg's damping.
    pub(super) fn maximise(mut self, bins: &[Bin]) -> Self {
        let n = self.parameters.len();
        let mut damping = 1e-4;
        let (mut score, mut information) = self.score(bins);
        for _ in 0..ITERATIONS {
            let mut damped = information.clone();
            for i in 0..n {
                damped[i * n + i] += damping * information[i * n + i] + 1e-9;
            }
            // What a bound holds stays where it is; the others must not make up for a step that it cannot take.
            let mut free = score.clone();
            for i in (0..n).filter(|&i| self.is_held_by_bound(i, score[i])) {
                free[i] = 0.0;
                leave_out(&mut damped, n, i);
            }
            let Some(step) = solve(&damped, &free) else { break };
            let parameters = self.parameters.iter().zip(&step).map(|(p, s)| p + s.clamp(-1.0, 1.0)).collect();
            let tried = self.moved(parameters, bins);
            if tried.deviance <= self.deviance {
                let gain = self.deviance - tried.deviance;
                self = tried;
                if gain < NEGLIGIBLE_GAIN {
                    self.converged = true;
                    break;
                }
                (score, information) = self.score(bins);
                damping = (damping * 0.2).max(1e-9);
            } else {
                damping = (8.0 * damping).max(1e-3);
                if damping > 1e8 {
                    // Rounding hides a gain that is small; a large one that cannot be had is a failure.
                    let promised: f64 = step.iter().zip(&score).map(|(s, g)| s * g).sum();
                    self.converged = promised * damping < NEGLIGIBLE_GAIN;
                    break;
                }
            }
        }
        self
    }

    /// Whether a parameter is at its bound and wants to leave it: the noise of a response that has none.
    fn is_held_by_bound(&self, i: usize, score: f64) -> bool {
        let (noise, value) = (self.parameters.len() - 1, self.parameters[i]);
        let is_power = i.is_multiple_of(2) && i < noise;
        (i == noise && value <= self.bounds.least_noise && score < 0.0)
            || (is_power && value >= self.bounds.most_power && score > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decay_fit::model::{Bounds, LN_MILLION};

    #[test]
    fn a_maximum_out_of_reach_does_not_count_as_found() {
        // 60 dB in 0.5 s over a floor, in bins of 5 ms.
        let (step_s, rate_per_s) = (5e-3, LN_MILLION / 0.5);
        let power = |i: usize| (-rate_per_s * (i as f64 + 0.5) * step_s).exp() + 1e-4;
        let bin = |i: usize| Bin {
            from_s: i as f64 * step_s,
            to_s: (i + 1) as f64 * step_s,
            power: power(i),
            shape: 20.0,
        };
        let bins: Vec<Bin> = (0..100).map(bin).collect();
        let bounds = Bounds { least_noise: -40.0, most_power: 10.0 };
        let from = |log_rate: f64, log_noise: f64| {
            Model::at(vec![0.0, log_rate, log_noise], &bins, bounds).maximise(&bins)
        };
        let near = from(rate_per_s.ln() + 0.5, 1e-4f64.ln());
        assert!(
            near.converged && (near.parameters[1] - rate_per_s.ln()).abs() < 0.01,
            "{:?}",
            near.parameters
        );
        // No step is longer than 1, and there are 60 of them.
        let far = from(rate_per_s.ln(), 100.0);
        assert!(!far.converged, "{:?}", far.parameters);
    }
}
