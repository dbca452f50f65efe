//! L-BFGS-B on any objective.

use crate::Error;
use crate::objective::Objective;
use basin::{
    BoxBounds, ConstraintDescription, ConstraintSet, Executor, FirstOrderState, Lbfgsb, Termination,
};
use std::convert::Infallible;

/// Why a minimisation stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stop {
    /// The projected gradient is below 1e-9, or the cost fell by no more than rounding.
    Converged,
    /// The iterations ran out.
    IterationLimit,
    /// No step along a direction of descent lowered the cost: it is not finite there, rounding hides its fall, or the gradient is
    /// wrong. `x` is the best point so far, which may be the start.
    NoDescent,
}

/// Where a minimisation ended. Only [`Stop::Converged`] says that it is a minimum.
#[derive(Clone, Debug, PartialEq)]
pub struct Minimum {
    /// The variables.
    pub x: Vec<f64>,
    /// The cost there.
    pub cost: f64,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Why it stopped.
    pub stop: Stop,
    /// Euclidean norm of the gradient there, without the components that point out of the bounds.
    pub gradient_norm: f64,
}

impl Minimum {
    /// Whether the cost could fall by no more than `gain` from here on. The costs of this crate contain squared standardised
    /// deviations, whose curvature is 1: at most half the squared gradient is left.
    pub(crate) fn is_within(&self, gain: f64) -> bool {
        self.stop == Stop::Converged || 0.5 * self.gradient_norm * self.gradient_norm <= gain
    }
}

/// Minimises an objective within bounds by L-BFGS-B (Zhu et al. 1997, version 3.0) from `start`, which is moved inside them.
///
/// ```
/// use sabine_optimize::Objective;
/// struct Parabola;
/// impl Objective for Parabola {
///     fn dimension(&self) -> usize { 1 }
///     fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
///         gradient[0] = 2.0 * (x[0] - 3.0);
///         (x[0] - 3.0).powi(2)
///     }
/// }
/// let minimum = sabine_optimize::minimise(&Parabola, &[0.0], &[0.0], &[2.0], 20)?;
/// assert_eq!(minimum.x, [2.0]); // 3 lies beyond the bound
/// assert_eq!(minimum.stop, sabine_optimize::Stop::Converged);
/// # Ok::<(), sabine_optimize::Error>(())
/// ```
///
/// # Errors
/// [`Error::Count`] where lengths differ, [`Error::Solver`] for bounds that contradict each other, [`Error::NotFinite`] if the
/// cost at the start is not finite. A minimisation that stops early is no error: see [`Minimum::stop`].
pub fn minimise(
    objective: &dyn Objective,
    start: &[f64],
    lower: &[f64],
    upper: &[f64],
    max_iterations: usize,
) -> Result<Minimum, Error> {
    let expected = objective.dimension();
    for (what, found) in
        [("start", start.len()), ("lower bounds", lower.len()), ("upper bounds", upper.len())]
    {
        if found != expected {
            return Err(Error::Count { what, expected, found });
        }
    }
    if expected == 0 {
        let cost = objective.value_and_gradient(&[], &mut []);
        let stop = Stop::Converged;
        return Ok(Minimum { x: Vec::new(), cost, iterations: 0, stop, gradient_norm: 0.0 });
    }
    let inside = |i: usize| start[i].clamp(lower[i], upper[i].max(lower[i]));
    let at_start: Vec<f64> = (0..expected).map(inside).collect();
    let cost = objective.value_and_gradient(&at_start, &mut vec![0.0; expected]);
    if !cost.is_finite() {
        return Err(Error::NotFinite { cost });
    }
    let problem = Boxed { objective, lower: lower.to_vec(), upper: upper.to_vec() };
    let result = Executor::new(problem, Lbfgsb::new(), FirstOrderState::new(start.to_vec()))
        .max_iter(max_iterations as u64)
        .run()
        .map_err(|source| Error::Solver { source: Box::new(source) })?;
    let (x, cost) = (result.best_param().clone(), result.best_cost());
    let stop = match result.report.termination {
        Termination::Converged(_) => Stop::Converged,
        Termination::Limit(_) => Stop::IterationLimit,
        _ => Stop::NoDescent,
    };
    let mut gradient = vec![0.0; expected];
    objective.value_and_gradient(&x, &mut gradient);
    let inward = |i: usize| {
        let outward = (x[i] <= lower[i] && gradient[i] > 0.0) || (x[i] >= upper[i] && gradient[i] < 0.0);
        if outward { 0.0 } else { gradient[i] }
    };
    let gradient_norm = (0..expected).map(|i| inward(i).powi(2)).sum::<f64>().sqrt();
    Ok(Minimum { x, cost, iterations: result.iter() as usize, stop, gradient_norm })
}

struct Boxed<'a> {
    objective: &'a dyn Objective,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl basin::Constraints for Boxed<'_> {
    type Set = ConstraintSet<BoxBounds<Vec<f64>>>;

    fn constraints(&self) -> <Self::Set as ConstraintDescription>::Borrowed<'_> {
        ConstraintSet::new().with_bounds(BoxBounds::new(Some(&self.lower), Some(&self.upper)))
    }
}

impl basin::CostFunction for Boxed<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Infallible;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Infallible> {
        Ok(self.objective.value_and_gradient(x, &mut vec![0.0; x.len()]))
    }
}

impl basin::Gradient for Boxed<'_> {
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, Infallible> {
        Ok(basin::Gradient::cost_and_gradient(self, x)?.1)
    }

    fn cost_and_gradient(&self, x: &Vec<f64>) -> Result<(f64, Vec<f64>), Infallible> {
        let mut gradient = vec![0.0; x.len()];
        let cost = self.objective.value_and_gradient(x, &mut gradient);
        Ok((cost, gradient))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Falls steeply towards 1 and is infinite from there on.
    struct Cliff;

    impl Objective for Cliff {
        fn dimension(&self) -> usize {
            1
        }

        fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
            gradient[0] = 1e4 * (x[0] - 0.9);
            if x[0] < 1.0 { 0.5e4 * (x[0] - 0.9).powi(2) } else { f64::INFINITY }
        }
    }

    #[test]
    fn a_step_that_is_too_long_does_not_look_like_a_minimum() {
        let failed = minimise(&Cliff, &[0.0], &[-1e3], &[1e3], 50).unwrap();
        assert_eq!((failed.stop, failed.iterations), (Stop::NoDescent, 0));
        assert!(failed.gradient_norm > 1.0 && !failed.is_within(1e-3));
        let found = minimise(&Cliff, &[0.0], &[-0.5], &[0.95], 50).unwrap();
        assert_eq!(found.stop, Stop::Converged);
        assert!((found.x[0] - 0.9).abs() < 1e-6);
    }

    #[test]
    fn a_start_without_a_finite_cost_is_refused() {
        let refused = minimise(&Cliff, &[2.0], &[0.0], &[3.0], 50);
        assert!(matches!(refused, Err(Error::NotFinite { cost }) if cost == f64::INFINITY), "{refused:?}");
    }
}
