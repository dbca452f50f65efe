//! The seam between a cost and what minimises it.

/// A differentiable cost.
pub trait Objective {
    /// Number of variables.
    fn dimension(&self) -> usize;

    /// The value at `x`; its gradient is written to `gradient`, both of [`Objective::dimension`] numbers.
    fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64;
}
