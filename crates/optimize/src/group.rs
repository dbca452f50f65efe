//! Bands that are fitted together, and the rounds in which their targets are met.

use crate::bounded::{Minimum, minimise};
use crate::decay_slope::DecaySlope;
use crate::expansion::Expansion;
use crate::history::History;
use crate::objective::SlopeModel;
use crate::single_paths::SinglePathSlope;
use crate::{Error, FitConfig};
use rayon::prelude::*;
use sabine_acoustics::{Objective, Reading};

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
    /// The fitted slope near an absorption, fast to evaluate: exact there, and everywhere for lines through single paths.
    fn expand(&self, absorption: &[f64]) -> Model<'_> {
        match &self.line {
            Some(line) => Model::Line(line),
            None => Model::Curve(self.curve.expand(absorption)),
        }
    }

    /// The fitted slope, all paths being asked each time.
    fn paths(&self) -> Model<'_> {
        self.line.as_ref().map_or(Model::Paths(&self.curve), Model::Line)
    }

    /// m/m' - 1 and its gradient: zero where the target is met, linear in ln(1 - absorption) for an ideal decay, and of the
    /// same size for long and short targets.
    fn residual(&self, model: &Model<'_>, absorption: &[f64], gradient: &mut [f64]) -> Option<f64> {
        let wanted = -60.0 / self.target_s;
        let slope = model.slope(absorption, gradient)?;
        gradient.iter_mut().for_each(|g| *g /= wanted);
        Some(slope / wanted - 1.0)
    }
}

/// What stands for the slope of a band while the solver works.
enum Model<'b> {
    Curve(Expansion),
    Line(&'b SinglePathSlope),
    /// All paths, in every step.
    Paths(&'b dyn SlopeModel),
}

impl SlopeModel for Model<'_> {
    fn slope(&self, absorption: &[f64], gradient: &mut [f64]) -> Option<f64> {
        match self {
            Self::Curve(expansion) => expansion.slope(absorption, gradient),
            Self::Line(line) => line.slope(absorption, gradient),
            Self::Paths(curve) => curve.slope(absorption, gradient),
        }
    }
}

/// Where the fit of a group ended.
pub(crate) struct Solution {
    pub bands: Vec<Fitted>,
    pub iterations: usize,
    pub cost: f64,
}

/// Where the fit of a band ended.
pub(crate) struct Fitted {
    pub absorption: Vec<f64>,
    /// m/m' - 1; `None` in a band without energy.
    pub residual: Option<f64>,
    /// Its derivative by each absorption.
    pub gradient: Vec<f64>,
    /// What the decay curves read.
    pub t60_s: Reading,
}

/// Passes over the paths before the fit falls back on evaluating all of them in every step.
const PASSES: usize = 12;
/// Change of any material, in standard deviations of its prior, below which another pass would bring nothing: the error
/// left is of the order of its square.
const SETTLED: f64 = 0.03;

/// The most probable materials that meet the targets: minimises half the squared deviations from the priors, in standard
/// deviations, subject to m/m' = 1, by the method of multipliers (Nocedal and Wright 2006, chapter 17).
///
/// The decay curves are expanded about the present materials, the problem is solved on the expansion, and expanded again,
/// until the materials settle. Four passes over the paths are usual, instead of one for each of some thirty evaluations.
pub(crate) struct Group<'a, 'b> {
    bands: &'b [Band<'a>],
    config: &'b FitConfig,
    /// Band and material of each variable; held materials have none.
    free: Vec<(usize, usize)>,
    /// Variables of the same material in neighbouring bands.
    neighbours: Vec<(usize, usize)>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<'a, 'b> Group<'a, 'b> {
    pub fn new(bands: &'b [Band<'a>], config: &'b FitConfig) -> Self {
        let free: Vec<(usize, usize)> = bands
            .iter()
            .enumerate()
            .flat_map(|(b, band)| (0..band.mean.len()).map(move |k| (b, k)))
            .filter(|&(b, k)| bands[b].standard_deviation[k] > 0.0)
            .collect();
        let bounds = |&(b, k): &(usize, usize)| {
            let (mean, sd) = (bands[b].mean[k], bands[b].standard_deviation[k]);
            ((config.bounds.0 - mean) / sd, (config.bounds.1 - mean) / sd)
        };
        let (lower, upper) = free.iter().map(bounds).unzip();
        let at = |b: usize, k: usize| free.iter().position(|&f| f == (b, k));
        let pairs = free.iter().enumerate();
        let neighbours = pairs.filter_map(|(low, &(b, k))| at(b + 1, k).map(|high| (low, high))).collect();
        Self { bands, config, free, neighbours, lower, upper }
    }

    pub fn solve(&self) -> Result<Solution, Error> {
        let prior = self.solve_from(&vec![0.0; self.free.len()])?;
        if self.met(&prior) {
            return Ok(prior);
        }
        // Not met from the prior: try once more from the prior scaled so that the slope is right.
        let Some(start) = self.scaled_start(&prior) else { return Ok(prior) };
        let again = self.solve_from(&start)?;
        let worst =
            |s: &Solution| s.bands.iter().filter_map(|b| b.residual).fold(0.0, |w: f64, r| w.max(r.abs()));
        let iterations = prior.iterations + again.iterations;
        let best = if worst(&again) < worst(&prior) { again } else { prior };
        Ok(Solution { iterations, ..best })
    }

    fn met(&self, solution: &Solution) -> bool {
        solution.bands.iter().filter_map(|b| b.residual).all(|r| r.abs() <= self.config.target_tolerance)
    }

    fn solve_from(&self, start: &[f64]) -> Result<Solution, Error> {
        let bounds = self.lower.iter().zip(&self.upper);
        let mut x: Vec<f64> = start.iter().zip(bounds).map(|(x, (l, u))| x.clamp(*l, *u)).collect();
        let mut iterations = 0;
        let mut rounds = Rounds::new(self, self.expand(&x), &x);
        for _ in 0..PASSES {
            let minimum = rounds.solve(&x)?;
            iterations += minimum.iterations;
            let moved = x.iter().zip(&minimum.x).fold(0.0, |w: f64, (a, b)| w.max((a - b).abs()));
            let expected = rounds.residual(&minimum.x);
            x = minimum.x;
            rounds.models = self.expand(&x);
            let found = rounds.residual(&x);
            let surprise = expected.iter().zip(&found).fold(0.0, |w: f64, (e, f)| match (e, f) {
                (Some(e), Some(f)) => w.max((e - f).abs()),
                _ => w,
            });
            if moved < SETTLED && surprise < 0.1 * self.config.target_tolerance {
                return Ok(self.solution(&x, rounds.models, iterations));
            }
        }
        // The expansion does not settle, where bins hold few paths of very different histories: use the paths themselves.
        rounds.models = self.bands.iter().map(Band::paths).collect();
        let minimum = rounds.solve(&x)?;
        rounds.models = self.expand(&minimum.x);
        Ok(self.solution(&minimum.x, rounds.models, iterations + minimum.iterations))
    }

    fn solution(&self, x: &[f64], models: Vec<Model<'b>>, iterations: usize) -> Solution {
        let absorption = self.absorption(x);
        let at = |((band, model), absorption): ((&Band<'_>, Model<'_>), &Vec<f64>)| {
            let mut gradient = vec![0.0; absorption.len()];
            let residual = band.residual(&model, absorption, &mut gradient);
            let curve = match model {
                Model::Curve(expansion) => expansion,
                _ => band.curve.expand(absorption),
            };
            Fitted { absorption: absorption.clone(), residual, gradient, t60_s: band.curve.reading(&curve) }
        };
        let bands = self.bands.par_iter().zip(models).zip(&absorption).map(at).collect();
        let cost = self.prior_cost(x, &mut vec![0.0; x.len()]);
        Solution { bands, iterations, cost }
    }

    fn expand(&self, x: &[f64]) -> Vec<Model<'b>> {
        self.bands.par_iter().zip(self.absorption(x)).map(|(band, a)| band.expand(&a)).collect()
    }

    /// The prior's means, ln(1 - absorption) multiplied in each band by what gives the wanted slope; `None` if no factor does.
    fn scaled_start(&self, from: &Solution) -> Option<Vec<f64>> {
        let mut absorption: Vec<Vec<f64>> = from.bands.iter().map(|b| b.absorption.clone()).collect();
        let mut found = false;
        for (b, band) in self.bands.iter().enumerate() {
            if from.bands[b].residual.is_none_or(|r| r.abs() <= self.config.target_tolerance) {
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
            let mut residual = |log_factor: f64| band.residual(&band.paths(), &scaled(log_factor), scratch);
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

    fn prior_cost(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let mut cost = 0.0;
        for (g, z) in gradient.iter_mut().zip(x) {
            cost += 0.5 * z * z;
            *g = *z;
        }
        for &(low, high) in self.neighbours() {
            let step = x[high] - x[low];
            cost += 0.5 * self.config.smoothness * step * step;
            gradient[high] += self.config.smoothness * step;
            gradient[low] -= self.config.smoothness * step;
        }
        cost
    }

    /// Variables of the same material in neighbouring bands; without smoothness each band is a group of its own.
    pub fn neighbours(&self) -> &[(usize, usize)] {
        &self.neighbours
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

/// The augmented Lagrangian of a group: prior cost + sum of weight/2 (residual + shift)2 over the bands.
struct Rounds<'g, 'a, 'b> {
    group: &'g Group<'a, 'b>,
    models: Vec<Model<'b>>,
    weight: Vec<f64>,
    shift: Vec<f64>,
}

impl<'g, 'a, 'b> Rounds<'g, 'a, 'b> {
    fn new(group: &'g Group<'a, 'b>, models: Vec<Model<'b>>, x: &[f64]) -> Self {
        let count = models.len();
        let mut rounds = Self { group, models, weight: vec![0.0; count], shift: vec![0.0; count] };
        for (weight, residual) in rounds.weight.iter_mut().zip(group.residuals(&rounds.models, x)) {
            let square: f64 = residual.map_or(0.0, |(_, g)| g.iter().map(|g| g * g).sum());
            *weight = if square > 0.0 { 1.0 / (group.config.prior_weight * square) } else { 0.0 };
        }
        rounds
    }

    fn residual(&self, x: &[f64]) -> Vec<Option<f64>> {
        self.group.residuals(&self.models, x).into_iter().map(|r| r.map(|(r, _)| r)).collect()
    }

    /// Minimises, shifts the targets by what is missing, and minimises again, until they are met or nothing helps.
    fn solve(&mut self, start: &[f64]) -> Result<Minimum, Error> {
        let config = self.group.config;
        // A tenth of the tolerance, so that a target is well met where it can be.
        let enough = 0.1 * config.target_tolerance;
        let mut before = vec![f64::INFINITY; self.models.len()];
        let mut stuck = vec![0; self.models.len()];
        let mut minimum = Minimum { x: start.to_vec(), cost: f64::NAN, iterations: 0 };
        for _ in 0..config.max_rounds {
            let (lower, upper) = (&self.group.lower, &self.group.upper);
            let next = minimise(&*self, &minimum.x, lower, upper, config.max_iterations)?;
            minimum = Minimum { iterations: minimum.iterations + next.iterations, ..next };
            let mut open = false;
            for (b, residual) in self.residual(&minimum.x).into_iter().enumerate() {
                let Some(r) = residual.filter(|r| r.abs() > enough && self.weight[b] > 0.0) else { continue };
                stuck[b] += usize::from(r.abs() > 0.9 * before[b]);
                open |= stuck[b] < 2;
                let grow = if r.abs() > 0.25 * before[b] { 10.0 } else { 1.0 };
                self.shift[b] = (self.shift[b] + r) / grow;
                self.weight[b] *= grow;
                before[b] = r.abs();
            }
            if !open {
                break;
            }
        }
        Ok(minimum)
    }
}

impl Group<'_, '_> {
    /// Residual of each band and its gradient by the deviations of its materials, in standard deviations.
    fn residuals(&self, models: &[Model<'_>], x: &[f64]) -> Vec<Option<(f64, Vec<f64>)>> {
        self.bands
            .par_iter()
            .zip(models)
            .zip(self.absorption(x))
            .map(|((band, model), absorption)| {
                let mut gradient = vec![0.0; absorption.len()];
                let residual = band.residual(model, &absorption, &mut gradient)?;
                gradient.iter_mut().zip(&band.standard_deviation).for_each(|(g, sd)| *g *= sd);
                Some((residual, gradient))
            })
            .collect()
    }
}

impl Objective for Rounds<'_, '_, '_> {
    fn dimension(&self) -> usize {
        self.group.free.len()
    }

    fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let mut cost = self.group.prior_cost(x, gradient);
        let residuals = self.group.residuals(&self.models, x);
        for (b, residual) in residuals.iter().enumerate() {
            if let Some((r, _)) = residual {
                cost += 0.5 * self.weight[b] * (r + self.shift[b]).powi(2);
            }
        }
        for (g, &(b, k)) in gradient.iter_mut().zip(&self.group.free) {
            if let Some((r, by)) = &residuals[b] {
                *g += self.weight[b] * (r + self.shift[b]) * by[k];
            }
        }
        cost
    }
}
