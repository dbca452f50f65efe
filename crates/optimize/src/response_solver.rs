//! The most probable materials, given measured responses and tables of parameters.

use crate::bounded::minimise;
use crate::fit::Unconverged;
use crate::objective::Objective;
use crate::response_band::{BandResponse, ResponseBand};
use crate::response_expansion::ResponseExpansion;
use crate::uncertainty::Spread;
use crate::unknowns::Unknowns;
use crate::{Error, FitConfig};

/// Most times that the bins are weighed anew.
const WEIGHINGS: usize = 40;
/// From this weighing on only half of each step is taken: weights that follow the materials can make both swing between two places
/// for ever, and half the way leads to the place between them, which has the same fixed point.
const DAMPED_FROM: usize = 10;
/// Most expansions between two weighings.
const STEPS: usize = 40;
/// Change of any material from one weighing to the next, in standard deviations of its prior, below which the fit has converged.
const TOLERANCE: f64 = 0.005;
/// How far a first step may go, in standard deviations of the priors: an expansion says nothing of materials far away, and at
/// nearly full absorption the energy of late bins is zero.
const FIRST_REACH: f64 = 1.0;
/// A reach below which no shorter step is tried.
const MIN_REACH: f64 = 1e-6;
/// Dispersion above which the late decay is left out for a trial, and how far below the range of the fit it begins, in dB.
const MAX_DISPERSION: f64 = 2.0;
const MARGIN_DB: f64 = 10.0;
/// It stays out if the dispersion falls below this share.
const BETTER: f64 = 2.0 / 3.0;
/// Gain in log-probability that is not worth a step: it moves an answer by a thousandth of its standard error.
const NEGLIGIBLE: f64 = 1e-5;
/// A step is taken if the paths gain this share of what the expansion promised, and the next may be longer if they gain
/// that much (Nocedal and Wright 2006, algorithm 4.1).
const TAKEN: f64 = 0.1;
const LONGER: f64 = 0.75;
const SHORTER: f64 = 0.25;

/// Where the fit of bands that were solved together ended.
pub(crate) struct Solved {
    /// By band and material.
    pub absorption: Vec<Vec<f64>>,
    pub spread: Spread,
    /// Gain of each response of each band in dB.
    pub gains_db: Vec<Vec<(usize, f64)>>,
    /// `None` in a band without responses.
    pub dispersion: Vec<Option<f64>>,
    /// The same of tables of parameters.
    pub table_dispersion: Vec<Option<f64>>,
    pub prior_cost: f64,
    pub iterations: usize,
    /// Whether the late decay of each band was left out.
    pub confined: Vec<bool>,
    /// Why it is no result, if the fit has not converged.
    pub unconverged: Option<Unconverged>,
}

/// Solves, and once more without the late decay of bands that the paths do not explain. Where that explains the rest better, the late
/// decay stays out: as for the decay fit of `sabine-acoustics`, what lies far below the range of T30 must not decide where a decay
/// bends.
pub(crate) fn solve_where_explained(
    bands: &mut [ResponseBand<'_>],
    config: &FitConfig,
    start: Option<&[Vec<f64>]>,
) -> Result<Solved, Error> {
    bands.iter_mut().for_each(ResponseBand::take_all);
    let first = solve(bands, config, start)?;
    let level_db = config.range_db.1 - MARGIN_DB;
    let leave = |(band, dispersion): (&mut ResponseBand<'_>, &Option<f64>)| {
        dispersion.is_some_and(|d| d > MAX_DISPERSION) && band.leave_below(level_db)
    };
    let some: Vec<bool> = bands.iter_mut().zip(&first.dispersion).map(leave).collect();
    if !some.contains(&true) {
        return Ok(first);
    }
    let second = solve(bands, config, start)?;
    let explained = |b: usize| match (first.dispersion[b], second.dispersion[b]) {
        (Some(before), Some(after)) => after < BETTER * before,
        _ => false,
    };
    let confined: Vec<bool> = (0..bands.len()).map(|b| some[b] && explained(b)).collect();
    let all = confined == some;
    bands.iter_mut().zip(&confined).filter(|(_, confined)| !**confined).for_each(|(band, _)| band.take_all());
    let iterations = first.iterations + second.iterations;
    if all {
        return Ok(Solved { confined, iterations, ..second });
    }
    if !confined.contains(&true) {
        return Ok(Solved { iterations, ..first });
    }
    let third = solve(bands, config, start)?;
    Ok(Solved { confined, iterations: iterations + third.iterations, ..third })
}

/// Minimises priors plus half the deviance over the dispersion.
///
/// Two things are solved for in turn. With the weights of the bins and the dispersions held, a trust-region method: the paths
/// are expanded about the present materials, L-BFGS-B finds the minimum of the expansion within reach, the paths say
/// what that is worth, and the reach grows or shrinks by how well the expansion foretold it; until nothing more is promised. Then weights
/// and dispersions are taken anew, until the materials stay where they are: the iteratively reweighted fit of a generalised linear
/// model (McCullagh and Nelder 1989, section 2.5).
///
/// The search begins at `start`, by band and material, or else at the means of the priors.
pub(crate) fn solve(
    bands: &[ResponseBand<'_>],
    config: &FitConfig,
    start: Option<&[Vec<f64>]>,
) -> Result<Solved, Error> {
    let unknowns = Unknowns::new(bands.iter().map(|b| &b.prior).collect(), config);
    let expand = |x: &[f64]| -> Vec<ResponseExpansion<'_>> {
        let absorption = unknowns.absorption(x);
        bands
            .iter()
            .zip(absorption)
            .map(|(band, a)| ResponseExpansion::about(band, &a, config.reflection_error))
            .collect()
    };
    let mut x = start.map_or_else(|| unknowns.start(), |absorption| unknowns.variables(absorption));
    let mut expansions = expand(&x);
    // Far from the answer everything is badly explained, which says nothing of how well it will be.
    let mut dispersion = vec![1.0; bands.len()];
    let (mut iterations, mut unconverged) = (0, None);
    for weighing in 0..WEIGHINGS {
        let before = x.clone();
        let descent = descend(&unknowns, &mut x, &mut expansions, &dispersion, config)?;
        iterations += descent.iterations;
        let moved = unknowns.distance(&before, &x);
        if weighing >= DAMPED_FROM && moved >= TOLERANCE {
            x.iter_mut().zip(&before).for_each(|(x, before)| *x = 0.5 * (*x + before));
        }
        expansions = expand(&x);
        let absorption = unknowns.absorption(&x);
        dispersion = expansions.iter().zip(&absorption).map(|(e, a)| e.dispersion(a)).collect();
        expansions.iter_mut().zip(&absorption).for_each(|(e, a)| e.weigh_tables(a));
        unconverged = Some(Unconverged::StillMoving { deviations: moved });
        if moved < TOLERANCE {
            unconverged = (!descent.converged).then_some(Unconverged::NoDescent);
            break;
        }
    }
    let absorption = unknowns.absorption(&x);
    let spread = Spread::of_responses(&unknowns, &expansions, &absorption, &dispersion, config.bounds);
    let gains_db = expansions.iter().zip(&absorption).map(|(e, a)| gains_db(e, a)).collect();
    let prior_cost = unknowns.prior_cost(&x, &mut vec![0.0; x.len()]);
    let dispersion = dispersion.iter().zip(&expansions).map(|(d, e)| (!e.bins.is_empty()).then_some(*d));
    let dispersion = dispersion.collect();
    let of_tables = |e: &ResponseExpansion<'_>| (!e.tables.is_empty()).then_some(e.table_dispersion);
    let table_dispersion = expansions.iter().map(of_tables).collect();
    let confined = vec![false; bands.len()];
    Ok(Solved {
        absorption,
        spread,
        gains_db,
        dispersion,
        table_dispersion,
        prior_cost,
        iterations,
        confined,
        unconverged,
    })
}

/// What a descent came to.
struct Descent {
    iterations: usize,
    /// Whether no step promises anything any more.
    converged: bool,
}

/// The trust-region method with weights and dispersions held; moves `x` and the expansions.
fn descend(
    unknowns: &Unknowns<'_>,
    x: &mut Vec<f64>,
    expansions: &mut Vec<ResponseExpansion<'_>>,
    dispersion: &[f64],
    config: &FitConfig,
) -> Result<Descent, Error> {
    let (mut reach, mut iterations) = (FIRST_REACH, 0);
    for _ in 0..STEPS {
        let cost = Likelihood { unknowns, expansions, dispersion };
        let scratch = &mut vec![0.0; x.len()];
        let here = cost.value_and_gradient(x, scratch);
        let lower: Vec<f64> = unknowns.lower.iter().zip(&*x).map(|(l, x)| l.max(x - reach)).collect();
        let upper: Vec<f64> = unknowns.upper.iter().zip(&*x).map(|(u, x)| u.min(x + reach)).collect();
        let minimum = minimise(&cost, x, &lower, &upper, config.max_iterations)?;
        iterations += minimum.iterations;
        let step = x.iter().zip(&minimum.x).fold(0.0, |w: f64, (from, to)| w.max((to - from).abs()));
        let promised = here - minimum.cost;
        if !minimum.is_within(NEGLIGIBLE) && promised <= NEGLIGIBLE {
            // The solver failed, most likely because its first step was too long.
            reach *= 0.25;
            if reach < MIN_REACH {
                break;
            }
            continue;
        }
        // Little is promised at an optimum, but also where a short reach ends the step.
        if promised <= NEGLIGIBLE && step < 0.99 * reach {
            return Ok(Descent { iterations, converged: true });
        }
        let absorption = unknowns.absorption(&minimum.x);
        let moved: Option<Vec<ResponseExpansion<'_>>> = expansions
            .iter()
            .zip(&absorption)
            .map(|(expansion, a)| expansion.moved_to(a, config.reflection_error))
            .collect();
        let gained = moved.as_ref().map_or(f64::NEG_INFINITY, |moved| {
            here - Likelihood { unknowns, expansions: moved, dispersion }
                .value_and_gradient(&minimum.x, scratch)
        });
        let kept = gained / promised;
        if kept > LONGER {
            reach = reach.max(2.0 * step);
        } else if kept < SHORTER || kept.is_nan() {
            reach = 0.25 * step;
            if reach < MIN_REACH {
                break;
            }
        }
        if let Some(moved) = moved.filter(|_| kept > TAKEN) {
            *x = minimum.x;
            *expansions = moved;
        }
    }
    Ok(Descent { iterations, converged: false })
}

fn gains_db(expansion: &ResponseExpansion<'_>, absorption: &[f64]) -> Vec<(usize, f64)> {
    let gains = expansion.log_gains(absorption);
    let of = |(place, response): (usize, &BandResponse<'_>)| {
        let bin = expansion.bins.iter().find(|b| b.place == place)?;
        Some((response.index, crate::decay::DB_PER_NEPER * bin.group.map_or(0.0, |g| gains[g])))
    };
    expansion.band.responses.iter().enumerate().filter_map(of).collect()
}

/// Cost of bands that are solved together: priors, smoothness, and half the deviances divided by the dispersions.
struct Likelihood<'f, 'b> {
    unknowns: &'f Unknowns<'f>,
    expansions: &'f [ResponseExpansion<'b>],
    dispersion: &'f [f64],
}

impl Objective for Likelihood<'_, '_> {
    fn dimension(&self) -> usize {
        self.unknowns.len()
    }

    fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let absorption = self.unknowns.absorption(x);
        let mut cost = self.unknowns.prior_cost(x, gradient);
        let mut by_absorption = Vec::with_capacity(self.expansions.len());
        for ((expansion, a), dispersion) in self.expansions.iter().zip(&absorption).zip(self.dispersion) {
            let mut by = vec![0.0; a.len()];
            cost += expansion.cost(a, &mut by) / dispersion;
            by.iter_mut().for_each(|g| *g /= dispersion);
            cost += expansion.table_cost(a, &mut by);
            by_absorption.push(by);
        }
        for (i, g) in gradient.iter_mut().enumerate() {
            let (b, k) = self.unknowns.free[i];
            *g += by_absorption[b][k] * self.unknowns.by_variable(i, x);
        }
        cost
    }
}

#[cfg(test)]
mod tests;
