//! Bands that are fitted together, and the rounds in which their targets are met.

use crate::bounded::{Minimum, Stop, minimise};
use crate::decay_slope::DecaySlope;
use crate::expansion::Expansion;
use crate::fit::Unconverged;
use crate::history::History;
use crate::objective::Objective;
use crate::single_paths::SinglePathSlope;
use crate::slope_model::SlopeModel;
use crate::unknowns::{BandPrior, Unknowns};
use crate::{Error, FitConfig};
use rayon::prelude::*;
use sabine_acoustics::Reading;

/// Everything about one band: its slopes, its target, and its materials' priors.
pub(crate) struct Band<'a> {
    /// The decay curve, from which T60 is read whatever is fitted.
    pub curve: DecaySlope<&'a History>,
    /// The slope that is fitted, where that is another.
    pub line: Option<SinglePathSlope>,
    pub target_s: f64,
    pub prior: BandPrior,
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
    /// Why it is no result, if the fit has not converged.
    pub unconverged: Option<Unconverged>,
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
const PASSES: usize = 16;
/// Greatest change of a slope that is aimed at in one pass, as a factor: farther off an expansion means little.
const STRIDE: f64 = 1.6;
/// Change of any material, in standard deviations of its prior, below which another pass would bring nothing: the error
/// left is of the order of its square.
const SETTLED: f64 = 0.02;
/// How far a step may go after one that failed, and below which reach no shorter one is tried, in standard deviations of the priors.
const FIRST_REACH: f64 = 1.0;
const MIN_REACH: f64 = 1e-6;
/// A gain in log-probability that is not worth another iteration: it moves a material by a few hundredths of its standard deviation.
const WORTHLESS: f64 = 1e-3;
/// Square of the relative change of a slope over one standard deviation of the prior that is rounding: a slope that nothing moves, as
/// that of a single path, is not fitted.
const RIGID: f64 = 1e-18;

/// The most probable materials that meet the targets: minimises half the squared deviations from the priors, in standard
/// deviations, subject to m/m' = 1, by the method of multipliers (Nocedal and Wright 2006, chapter 17).
///
/// The decay curves are expanded about the present materials, the problem is solved on the expansion, and expanded again,
/// until the materials stay where they are. Four passes over the paths are usual, instead of one for each of some thirty evaluations.
pub(crate) struct Group<'a, 'b> {
    bands: &'b [Band<'a>],
    config: &'b FitConfig,
    pub unknowns: Unknowns<'b>,
}

impl<'a, 'b> Group<'a, 'b> {
    pub fn new(bands: &'b [Band<'a>], config: &'b FitConfig) -> Self {
        Self { bands, config, unknowns: Unknowns::new(bands.iter().map(|b| &b.prior).collect(), config) }
    }

    pub fn solve(&self) -> Result<Solution, Error> {
        let prior = self.solve_from(&self.unknowns.start())?;
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
        let bounds = self.unknowns.lower.iter().zip(&self.unknowns.upper);
        let mut x: Vec<f64> = start.iter().zip(bounds).map(|(x, (l, u))| x.clamp(*l, *u)).collect();
        let mut iterations = 0;
        let mut rounds = Rounds::new(self, self.expand(&x), &x);
        let mut reach = f64::INFINITY;
        let (mut relaxation, mut last) = (1.0, vec![0.0; x.len()]);
        for _ in 0..PASSES {
            let at_last = rounds.approach(&x);
            let (minimum, failed) = rounds.solve(&x, reach)?;
            iterations += minimum.iterations;
            if failed {
                // The solver's first step was too long.
                reach = 0.25 * reach.min(FIRST_REACH);
                continue;
            }
            let moved = self.unknowns.distance(&x, &minimum.x);
            // Steps that turn back upon themselves are shortened: what the expansion leaves out makes them overshoot.
            let step: Vec<f64> = x.iter().zip(&minimum.x).map(|(from, to)| to - from).collect();
            let along: f64 = step.iter().zip(&last).map(|(a, b)| a * b).sum();
            relaxation = if along < 0.0 { 0.5f64.max(0.6 * relaxation) } else { 1f64.min(1.3 * relaxation) };
            x.iter_mut().zip(&step).for_each(|(x, s)| *x += relaxation * s);
            last = step;
            let expected = rounds.residual(&x);
            rounds.models = self.expand(&x);
            let found = rounds.residual(&x);
            let surprise = expected.iter().zip(&found).fold(0.0, |w: f64, (e, f)| match (e, f) {
                (Some(e), Some(f)) => w.max((e - f).abs()),
                _ => w,
            });
            if at_last && moved < SETTLED && surprise < 0.1 * self.config.target_tolerance {
                return Ok(self.solution(&x, rounds.models, iterations, None));
            }
            // An expansion that was far off was trusted too far.
            let stepped = last.iter().fold(0.0, |w: f64, s| w.max(s.abs()));
            reach = if surprise > 0.1 { 0.5 * stepped } else { 2.0 * reach };
        }
        // The expansion does not converge, where bins hold few paths of very different histories: use the paths themselves.
        rounds.models = self.bands.iter().map(Band::paths).collect();
        rounds.aim.fill(1.0);
        let (mut minimum, mut failed) = rounds.solve(&x, f64::INFINITY)?;
        let mut reach = FIRST_REACH;
        while failed && reach > MIN_REACH {
            iterations += minimum.iterations;
            (minimum, failed) = rounds.solve(&x, reach)?;
            reach *= 0.25;
        }
        rounds.models = self.expand(&minimum.x);
        let unconverged = match minimum.stop {
            _ if failed => Some(Unconverged::NoDescent),
            Stop::Converged | Stop::NoDescent => None,
            // The curvature is 1 or more: no material would move farther than this.
            Stop::IterationLimit => Some(Unconverged::StillMoving { deviations: minimum.gradient_norm })
                .filter(|_| !minimum.is_within(WORTHLESS)),
        };
        Ok(self.solution(&minimum.x, rounds.models, iterations + minimum.iterations, unconverged))
    }

    fn solution(
        &self,
        x: &[f64],
        models: Vec<Model<'b>>,
        iterations: usize,
        unconverged: Option<Unconverged>,
    ) -> Solution {
        let absorption = self.unknowns.absorption(x);
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
        let cost = self.unknowns.prior_cost(x, &mut vec![0.0; x.len()]);
        Solution { bands, iterations, cost, unconverged }
    }

    fn expand(&self, x: &[f64]) -> Vec<Model<'b>> {
        self.bands.par_iter().zip(self.unknowns.absorption(x)).map(|(band, a)| band.expand(&a)).collect()
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
                band.prior.mean.iter().zip(&band.prior.standard_deviation).map(of).collect()
            };
            let scratch = &mut vec![0.0; band.prior.materials()];
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
        found.then(|| self.unknowns.variables(&absorption))
    }
}

/// The augmented Lagrangian of a group: prior cost + sum of weight/2 (residual + shift)2 over the bands.
struct Rounds<'g, 'a, 'b> {
    group: &'g Group<'a, 'b>,
    models: Vec<Model<'b>>,
    weight: Vec<f64>,
    shift: Vec<f64>,
    /// Slope that is aimed at, as a multiple of the target's: on the way there, a step of it.
    aim: Vec<f64>,
}

impl<'g, 'a, 'b> Rounds<'g, 'a, 'b> {
    fn new(group: &'g Group<'a, 'b>, models: Vec<Model<'b>>, x: &[f64]) -> Self {
        let count = models.len();
        let mut rounds =
            Self { group, models, weight: vec![0.0; count], shift: vec![0.0; count], aim: vec![1.0; count] };
        let residuals = group.residuals(&rounds.models, x);
        for ((weight, residual), band) in rounds.weight.iter_mut().zip(residuals).zip(group.bands) {
            // The slope's variance under the prior.
            let square: f64 = residual.map_or(0.0, |(_, g)| {
                g.iter().zip(&band.prior.standard_deviation).map(|(g, sd)| (g * sd).powi(2)).sum()
            });
            *weight = if square > RIGID { 1.0 / (group.config.prior_weight * square) } else { 0.0 };
        }
        rounds
    }

    /// Aims at most a stride from where the slopes are; whether at the targets themselves.
    fn approach(&mut self, x: &[f64]) -> bool {
        let mut at_last = true;
        for (b, residual) in self.residual(x).into_iter().enumerate() {
            let now = residual.map_or(1.0, |r| (1.0 + r).max(0.01));
            let aim = 1f64.clamp(now / STRIDE, now * STRIDE);
            if aim != self.aim[b] {
                // What was missing at another aim says nothing here.
                self.shift[b] = 0.0;
            }
            self.aim[b] = aim;
            at_last &= aim == 1.0 || self.weight[b] == 0.0;
        }
        at_last
    }

    /// m/m' - 1 of each band.
    fn residual(&self, x: &[f64]) -> Vec<Option<f64>> {
        self.group.residuals(&self.models, x).into_iter().map(|r| r.map(|(r, _)| r)).collect()
    }

    /// Minimises, shifts the targets by what is missing, and minimises again, until they are met or nothing helps.
    /// No variable moves by more than `reach`. Also whether the solver failed at the start.
    fn solve(&mut self, start: &[f64], reach: f64) -> Result<(Minimum, bool), Error> {
        let config = self.group.config;
        // A tenth of the tolerance, so that a target is well met where it can be.
        let enough = 0.1 * config.target_tolerance;
        let mut before = vec![f64::INFINITY; self.models.len()];
        let mut stuck = vec![0; self.models.len()];
        let (x, stop) = (start.to_vec(), Stop::IterationLimit);
        let mut minimum = Minimum { x, cost: f64::NAN, iterations: 0, stop, gradient_norm: f64::INFINITY };
        let unknowns = &self.group.unknowns;
        let lower: Vec<f64> = unknowns.lower.iter().zip(start).map(|(l, x)| l.max(x - reach)).collect();
        let upper: Vec<f64> = unknowns.upper.iter().zip(start).map(|(u, x)| u.min(x + reach)).collect();
        for _ in 0..config.max_rounds {
            let next = minimise(&*self, &minimum.x, &lower, &upper, config.max_iterations)?;
            if minimum.iterations == 0 && next.iterations == 0 && !next.is_within(WORTHLESS) {
                return Ok((next, true));
            }
            minimum = Minimum { iterations: minimum.iterations + next.iterations, ..next };
            let mut open = false;
            for (b, residual) in self.residual(&minimum.x).into_iter().enumerate() {
                let missing = residual.map(|r| (1.0 + r) / self.aim[b] - 1.0);
                let Some(r) = missing.filter(|r| r.abs() > enough && self.weight[b] > 0.0) else { continue };
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
        Ok((minimum, false))
    }
}

impl Group<'_, '_> {
    /// Residual of each band and its gradient by the absorption of its materials.
    fn residuals(&self, models: &[Model<'_>], x: &[f64]) -> Vec<Option<(f64, Vec<f64>)>> {
        self.bands
            .par_iter()
            .zip(models)
            .zip(self.unknowns.absorption(x))
            .map(|((band, model), absorption)| {
                let mut gradient = vec![0.0; absorption.len()];
                let residual = band.residual(model, &absorption, &mut gradient)?;
                Some((residual, gradient))
            })
            .collect::<Vec<_>>()
    }
}

impl Objective for Rounds<'_, '_, '_> {
    fn dimension(&self) -> usize {
        self.group.unknowns.len()
    }

    fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let mut cost = self.group.unknowns.prior_cost(x, gradient);
        let residuals = self.group.residuals(&self.models, x);
        for (b, residual) in residuals.iter().enumerate() {
            if let Some((r, _)) = residual {
                let missing = (1.0 + r) / self.aim[b] - 1.0;
                cost += 0.5 * self.weight[b] * (missing + self.shift[b]).powi(2);
            }
        }
        for (i, g) in gradient.iter_mut().enumerate() {
            let (b, k) = self.group.unknowns.free[i];
            if let Some((r, by)) = &residuals[b] {
                let missing = (1.0 + r) / self.aim[b] - 1.0;
                let by = by[k] * self.group.unknowns.by_variable(i, x) / self.aim[b];
                *g += self.weight[b] * (missing + self.shift[b]) * by;
            }
        }
        cost
    }
}
