//! Objectives built from others: with a prior, in unbounded variables, and for argmin's solvers.

use crate::objective::Objective;
use crate::{Error, SlopeEvaluation};
use sabine_acoustics::OutOfRange;

/// Half the squared deviations of absorption from a prior, in standard deviations, plus weight/2 (m/m' - 1)2: what the fit
/// minimises in one band, as an objective for any solver. Variables are absorptions.
pub struct RegularisedSlope {
    slope: SlopeEvaluation,
    mean: Vec<f64>,
    standard_deviation: Vec<f64>,
    weight: f64,
}

impl RegularisedSlope {
    /// A slope with a prior for each material; `weight` is the inverse of the variance that m/m' is allowed: 1e6 for 0.1 %.
    ///
    /// # Errors
    /// [`Error::Count`] where there are not as many means or deviations as materials, [`Error::OutOfRange`] for a weight that is
    /// not positive, [`Error::Prior`] for a deviation that is not positive.
    pub fn new(
        slope: SlopeEvaluation,
        mean: Vec<f64>,
        standard_deviation: Vec<f64>,
        weight: f64,
    ) -> Result<Self, Error> {
        let expected = slope.dimension();
        for (what, found) in [("means", mean.len()), ("standard deviations", standard_deviation.len())] {
            if found != expected {
                return Err(Error::Count { what, expected, found });
            }
        }
        if !(weight > 0.0 && weight.is_finite()) {
            return Err(OutOfRange { field: "weight", value: weight, range: "finite and positive" }.into());
        }
        let band_hz = slope.band_hz();
        match standard_deviation.iter().position(|&sd| !(sd > 0.0 && sd.is_finite())) {
            Some(material) => Err(Error::Prior {
                material,
                band_hz,
                field: "standard_deviation",
                value: standard_deviation[material],
                range: "finite and positive",
            }),
            None => Ok(Self { slope, mean, standard_deviation, weight }),
        }
    }
}

impl Objective for RegularisedSlope {
    fn dimension(&self) -> usize {
        self.mean.len()
    }

    fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let wanted = self.slope.target_slope_db_per_s();
        let mut cost = 0.0;
        match self.slope.slope_db_per_s(x, gradient) {
            Some(slope) => {
                let residual = slope / wanted - 1.0;
                cost += 0.5 * self.weight * residual * residual;
                gradient.iter_mut().for_each(|g| *g *= self.weight * residual / wanted);
            }
            None => gradient.fill(0.0),
        }
        for (k, g) in gradient.iter_mut().enumerate() {
            let z = (x[k] - self.mean[k]) / self.standard_deviation[k];
            cost += 0.5 * z * z;
            *g += z / self.standard_deviation[k];
        }
        cost
    }
}

/// An objective within bounds, in variables without bounds: x = lower + (upper - lower) / (1 + exp(-y)).
/// For solvers that know no bounds; an optimum at a bound lies infinitely far out.
pub struct Logit<O> {
    /// The objective in its own variables.
    pub objective: O,
    /// Lower bound of each variable.
    pub lower: Vec<f64>,
    /// Upper bound of each variable.
    pub upper: Vec<f64>,
}

impl<O: Objective> Logit<O> {
    /// The variables of the objective.
    pub fn bounded(&self, y: &[f64]) -> Vec<f64> {
        let bounds = self.lower.iter().zip(&self.upper);
        y.iter().zip(bounds).map(|(y, (l, u))| l + (u - l) / (1.0 + (-y).exp())).collect()
    }

    /// The variables without bounds for a point strictly inside the bounds.
    pub fn unbounded(&self, x: &[f64]) -> Vec<f64> {
        let bounds = self.lower.iter().zip(&self.upper);
        x.iter().zip(bounds).map(|(x, (l, u))| ((x - l) / (u - x)).ln()).collect()
    }
}

impl<O: Objective> Objective for Logit<O> {
    fn dimension(&self) -> usize {
        self.objective.dimension()
    }

    fn value_and_gradient(&self, y: &[f64], gradient: &mut [f64]) -> f64 {
        let x = self.bounded(y);
        let cost = self.objective.value_and_gradient(&x, gradient);
        for (k, g) in gradient.iter_mut().enumerate() {
            *g *= (x[k] - self.lower[k]) * (self.upper[k] - x[k]) / (self.upper[k] - self.lower[k]);
        }
        cost
    }
}

/// Any objective for any of argmin's solvers: `argmin::core::{CostFunction, Gradient}` on `Vec<f64>`.
///
/// ```
/// use argmin::core::{CostFunction, Gradient};
/// use sabine_optimize::Objective;
/// use sabine_optimize::ForArgmin;
/// struct Parabola;
/// impl Objective for Parabola {
///     fn dimension(&self) -> usize { 1 }
///     fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
///         gradient[0] = 2.0 * (x[0] - 3.0);
///         (x[0] - 3.0).powi(2)
///     }
/// }
/// assert_eq!(ForArgmin(&Parabola).cost(&vec![1.0])?, 4.0);
/// assert_eq!(ForArgmin(&Parabola).gradient(&vec![1.0])?, [-4.0]);
/// # Ok::<(), argmin::core::Error>(())
/// ```
pub struct ForArgmin<'a>(
    /// The objective.
    pub &'a dyn Objective,
);

impl argmin::core::CostFunction for ForArgmin<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        Ok(self.0.value_and_gradient(x, &mut vec![0.0; x.len()]))
    }
}

impl argmin::core::Gradient for ForArgmin<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, argmin::core::Error> {
        let mut gradient = vec![0.0; x.len()];
        self.0.value_and_gradient(x, &mut gradient);
        Ok(gradient)
    }
}
