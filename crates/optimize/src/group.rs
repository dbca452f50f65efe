//! Bands that are fitted together, and the rounds in which their targets are met.

use crate::bounded::minimise;
use crate::decay_slope::DecaySlope;
use crate::history::History;
use crate::objective::SlopeModel;
use crate::single_paths::SinglePathSlope;
use crate::{Error, FitConfig};
use rayon::prelude::*;
use sabine_acoustics::Objective;

/// Everything about one band: its slopes, its target, and its materials' priors.
pub(crate) struct Band<'a> {
    /// The decay curve, from which T60 is read whatever is fitted.
    pub curve: DecaySlope<&'a History>,
    /// The slope that is fitted, where that is another.
    pub line: Option<SinglePathSlope>,
    pub target_s: f64,
    /// Prior of each material.
    pub mean: Vec<f64>,
    pub standard_deviation: Vec<f64>,
}

impl Band<'_> {
    /// Slope that is fitted, in dB/s.
    pub fn slope(&self, absorption: &[f64], gradient: &mut [f64]) -> Option<f64> {
        match &self.line {
            Some(line) => line.slope(absorption, gradient),
            None => self.curve.slope(absorption, gradient),
        }
    }

    /// m/m' - 1 and its gradient: zero where the target is met, linear in ln(1 - absorption) for an ideal decay, and of the
    /// same size for long and short targets.
    fn residual(&self, absorption: &[f64], gradient: &mut [f64]) -> Option<f64> {
        let wanted = -60.0 / self.target_s;
        let slope = self.slope(absorption, gradient)?;
        gradient.iter_mut().for_each(|g| *g /= wanted);
        Some(slope / wanted - 1.0)
    }
}

/// Where the fit of a group ended; absorption and residual by band.
pub(crate) struct Solution {
    pub absorption: Vec<Vec<f64>>,
    /// `None` in a band without energy.
    pub residual: Vec<Option<f64>>,
    pub iterations: usize,
    pub cost: f64,
}

/// The most probable materials that meet the targets: minimises half the squared deviations from the priors, in standard
/// deviations, subject to m/m' = 1, by the method of multipliers (Nocedal and Wright 2006, chapter 17).
pub(crate) struct Group<'a, 'b> {
    bands: &'b [Band<'a>],
    config: &'b FitConfig,
    /// Band and material of each variable; held materials have none.
    free: Vec<(usize, usize)>,
    /// Of each band: weight of the squared residual, and the shift that stands for the multiplier.
    weight: Vec<f64>,
    shift: Vec<f64>,
}

impl<'a, 'b> Group<'a, 'b> {
    pub fn new(bands: &'b [Band<'a>], config: &'b FitConfig) -> Self {
        let free = bands
            .iter()
            .enumerate()
            .flat_map(|(b, band)| (0..band.mean.len()).map(move |k| (b, k)))
            .filter(|&(b, k)| bands[b].standard_deviation[k] > 0.0)
            .collect();
        Self { bands, config, free, weight: vec![0.0; bands.len()], shift: vec![0.0; bands.len()] }
    }

    pub fn solve(&mut self) -> Result<Solution, Error> {
        let prior = self.solve_from(&vec![0.0; self.free.len()])?;
        if self.met(&prior) {
            return Ok(prior);
        }
        // Not met from the prior: try once more from the prior scaled so that the slope is right.
        let Some(start) = self.scaled_start(&prior) else { return Ok(prior) };
        let mut again = self.solve_from(&start)?;
        again.iterations += prior.iterations;
        let worst = |s: &Solution| s.residual.iter().flatten().fold(0.0, |w: f64, r| w.max(r.abs()));
        if worst(&again) < worst(&prior) {
            Ok(again)
        } else {
            Ok(Solution { iterations: again.iterations, ..prior })
        }
    }

    fn met(&self, solution: &Solution) -> bool {
        solution.residual.iter().flatten().all(|r| r.abs() <= self.config.target_tolerance)
    }

    fn solve_from(&mut self, start: &[f64]) -> Result<Solution, Error> {
        let (lower, upper): (Vec<f64>, Vec<f64>) = self
            .free
            .iter()
            .map(|&(b, k)| {
                let (mean, sd) = (self.bands[b].mean[k], self.bands[b].standard_deviation[k]);
                ((self.config.bounds.0 - mean) / sd, (self.config.bounds.1 - mean) / sd)
            })
            .unzip();
        let mut x: Vec<f64> =
            start.iter().zip(&lower).zip(&upper).map(|((x, l), u)| x.clamp(*l, *u)).collect();
        let first = self.residuals(&x);
        for (b, residual) in first.iter().enumerate() {
            let square = residual.as_ref().map_or(0.0, |(_, g)| g.iter().map(|g| g * g).sum());
            self.weight[b] = if square > 0.0 { 1.0 / (self.config.prior_weight * square) } else { 0.0 };
            self.shift[b] = 0.0;
        }
        // A fifth of the tolerance, so that a target is well met where it can be.
        let enough = 0.2 * self.config.target_tolerance;
        let mut before: Vec<f64> = vec![f64::INFINITY; self.bands.len()];
        let mut stuck = vec![0; self.bands.len()];
        let mut iterations = 0;
        let mut residual;
        let mut round = 0;
        loop {
            let minimum = minimise(&*self, &x, &lower, &upper, self.config.max_iterations)?;
            iterations += minimum.iterations;
            x = minimum.x;
            residual = self.residuals(&x).into_iter().map(|r| r.map(|(r, _)| r)).collect::<Vec<_>>();
            round += 1;
            let mut open = false;
            for b in 0..self.bands.len() {
                let Some(r) = residual[b].filter(|r| r.abs() > enough && self.weight[b] > 0.0) else {
                    continue;
                };
                if r.abs() > 0.9 * before[b] {
                    stuck[b] += 1;
                }
                open |= stuck[b] < 2;
                let grow = if r.abs() > 0.25 * before[b] { 10.0 } else { 1.0 };
                self.shift[b] = (self.shift[b] + r) / grow;
                self.weight[b] *= grow;
                before[b] = r.abs();
            }
            if !open || round >= self.config.max_rounds {
                break;
            }
        }
        let cost = self.prior_cost(&x, &mut vec![0.0; x.len()]);
        Ok(Solution { absorption: self.absorption(&x), residual, iterations, cost })
    }

    /// The prior's means, ln(1 - absorption) multiplied in each band by what gives the wanted slope; `None` if no factor does.
    fn scaled_start(&self, from: &Solution) -> Option<Vec<f64>> {
        let mut absorption = from.absorption.clone();
        let mut found = false;
        for (b, band) in self.bands.iter().enumerate() {
            if from.residual[b].is_none_or(|r| r.abs() <= self.config.target_tolerance) {
                continue;
            }
            let scaled = |log_factor: f64| -> Vec<f64> {
                let of = |(&mean, &sd): (&f64, &f64)| {
                    if sd == 0.0 {
                        return mean;
                    }
                    let (lower, upper) = self.config.bounds;
                    let exponent = log_factor.exp() * (-mean.clamp(lower, upper)).ln_1p();
                    (-exponent.exp_m1()).clamp(lower, upper)
                };
                band.mean.iter().zip(&band.standard_deviation).map(of).collect()
            };
            let scratch = &mut vec![0.0; band.mean.len()];
            let mut residual = |log_factor: f64| band.residual(&scaled(log_factor), scratch);
            let (mut low, mut high) = (-6.0, 6.0);
            if !(residual(low)? < 0.0 && residual(high)? > 0.0) {
                continue;
            }
            for _ in 0..12 {
                let middle = 0.5 * (low + high);
                if residual(middle)? < 0.0 { low = middle } else { high = middle }
            }
            absorption[b] = scaled(0.5 * (low + high));
            found = true;
        }
        let z = |&(b, k): &(usize, usize)| {
            (absorption[b][k] - self.bands[b].mean[k]) / self.bands[b].standard_deviation[k]
        };
        found.then(|| self.free.iter().map(z).collect())
    }

    /// Absorption by band and material.
    fn absorption(&self, x: &[f64]) -> Vec<Vec<f64>> {
        let mut absorption: Vec<Vec<f64>> = self.bands.iter().map(|b| b.mean.clone()).collect();
        let (lower, upper) = self.config.bounds;
        for (&(b, k), z) in self.free.iter().zip(x) {
            let band = &self.bands[b];
            // The bound may be missed by a rounding error.
            absorption[b][k] = (band.mean[k] + band.standard_deviation[k] * z).clamp(lower, upper);
        }
        absorption
    }

    /// Residual of each band and its gradient by the deviations of its materials, in standard deviations.
    fn residuals(&self, x: &[f64]) -> Vec<Option<(f64, Vec<f64>)>> {
        let absorption = self.absorption(x);
        self.bands
            .par_iter()
            .zip(&absorption)
            .map(|(band, absorption)| {
                let mut gradient = vec![0.0; absorption.len()];
                let residual = band.residual(absorption, &mut gradient)?;
                gradient.iter_mut().zip(&band.standard_deviation).for_each(|(g, sd)| *g *= sd);
                Some((residual, gradient))
            })
            .collect()
    }

    fn prior_cost(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let mut cost = 0.0;
        for (g, z) in gradient.iter_mut().zip(x) {
            cost += 0.5 * z * z;
            *g = *z;
        }
        for (low, high) in self.neighbours() {
            let step = x[high] - x[low];
            cost += 0.5 * self.config.smoothness * step * step;
            gradient[high] += self.config.smoothness * step;
            gradient[low] -= self.config.smoothness * step;
        }
        cost
    }

    /// Variables of the same material in neighbouring bands, where smoothness is asked for.
    pub fn neighbours(&self) -> Vec<(usize, usize)> {
        if self.config.smoothness == 0.0 {
            return Vec::new();
        }
        let at = |b: usize, k: usize| self.free.iter().position(|&f| f == (b, k));
        let pairs = self.free.iter().enumerate();
        pairs.filter_map(|(low, &(b, k))| at(b + 1, k).map(|high| (low, high))).collect()
    }

    /// See [`FitConfig::smoothness`].
    pub fn smoothness(&self) -> f64 {
        self.config.smoothness
    }

    /// Band and material of each variable.
    pub fn free(&self) -> &[(usize, usize)] {
        &self.free
    }
}

impl Objective for Group<'_, '_> {
    fn dimension(&self) -> usize {
        self.free.len()
    }

    fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let mut cost = self.prior_cost(x, gradient);
        let residuals = self.residuals(x);
        for (b, residual) in residuals.iter().enumerate() {
            if let Some((r, _)) = residual {
                cost += 0.5 * self.weight[b] * (r + self.shift[b]).powi(2);
            }
        }
        for (g, &(b, k)) in gradient.iter_mut().zip(&self.free) {
            if let Some((r, by)) = &residuals[b] {
                *g += self.weight[b] * (r + self.shift[b]) * by[k];
            }
        }
        cost
    }
}
