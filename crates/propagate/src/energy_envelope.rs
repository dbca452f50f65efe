//! The course of the sampled energy, smooth enough to shape noise with.

/// Time step of the envelope in seconds.
pub(crate) const STEP_S: f64 = 0.5e-3;
/// Each arrival is spread by this share of its time of arrival to either side: less than what changes the slope of any
/// decay, enough to turn single rays into a course ...
const SPREAD: f64 = 0.03;
/// ... but at least by this (s) ...
const LEAST_SPREAD_S: f64 = 1e-3;
/// ... and at most by this (s).
const MOST_SPREAD_S: f64 = 20e-3;

/// Energy per step of one band.
#[derive(Clone, Debug)]
pub(crate) struct EnergyEnvelope {
    pub steps: Vec<f64>,
}

impl EnergyEnvelope {
    /// Spreads energies, each collected in its step, over neighbouring steps not before `first`. The sum stays.
    pub fn smoothed(collected: &[f64], first: usize) -> Self {
        let mut steps = vec![0.0; collected.len()];
        for (i, &energy) in collected.iter().enumerate().filter(|(_, e)| **e > 0.0) {
            let spread_s = (SPREAD * i as f64 * STEP_S).clamp(LEAST_SPREAD_S, MOST_SPREAD_S);
            let reach = (spread_s / STEP_S).round() as usize;
            let range = i.saturating_sub(reach).max(first.min(i))..(i + reach + 1).min(steps.len());
            let weight = |j: usize| (reach + 1 - i.abs_diff(j)) as f64;
            let total: f64 = range.clone().map(weight).sum();
            for j in range {
                steps[j] += energy * weight(j) / total;
            }
        }
        Self { steps }
    }

    /// Energy per step at a time in steps, between step centres along a line.
    pub fn at(&self, time_steps: f64) -> f64 {
        let position = (time_steps - 0.5).max(0.0);
        let lower = position as usize;
        let value = |i: usize| self.steps.get(i).copied().unwrap_or(0.0);
        let fraction = position - lower as f64;
        value(lower) * (1.0 - fraction) + value(lower + 1) * fraction
    }
}

/// Moving mean, twice: a triangle of `reach` steps to either side, cut at the ends.
pub(crate) fn moving_mean(values: &[f64], reach: usize) -> Vec<f64> {
    let once = |values: &[f64]| -> Vec<f64> {
        let half = reach.div_ceil(2);
        let mut sums = Vec::with_capacity(values.len() + 1);
        let mut sum = 0.0;
        sums.push(0.0);
        for v in values {
            sum += v;
            sums.push(sum);
        }
        (0..values.len())
            .map(|i| {
                let (from, to) = (i.saturating_sub(half), (i + half + 1).min(values.len()));
                (sums[to] - sums[from]).max(0.0) / (to - from) as f64
            })
            .collect()
    };
    once(&once(values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreading_keeps_the_energy_and_never_anticipates() {
        let mut collected = vec![0.0; 400];
        (collected[20], collected[21], collected[300], collected[399]) = (1.0, 2.0, 3.0, 4.0);
        let envelope = EnergyEnvelope::smoothed(&collected, 20);
        assert!((envelope.steps.iter().sum::<f64>() - 10.0).abs() < 1e-12);
        assert!(envelope.steps[..20].iter().all(|&e| e == 0.0));
        assert!(envelope.at(300.5) > envelope.at(303.0));
    }
}
