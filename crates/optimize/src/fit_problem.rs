//! What is fitted: the materials, what is known of them, and the air.

use crate::config::AbsorptionPrior;
use sabine_acoustics::{Air, Material};

/// What every fit starts from.
///
/// ```
/// use sabine_acoustics::{Air, Bands, Material, PerBand};
/// use sabine_optimize::{AbsorptionPrior, FitProblem};
/// let wall = [Material::uniform(Bands::T60, 0.1, 0.2)?];
/// let prior = [AbsorptionPrior {
///     mean: PerBand::uniform(Bands::T60, 0.1),
///     standard_deviation: PerBand::uniform(Bands::T60, 0.05),
/// }];
/// let air = Air::default();
/// let problem = FitProblem::new(&wall, &prior, &air);
/// assert_eq!(problem.materials.len(), problem.priors.len());
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FitProblem<'a> {
    /// The materials in the order of the paths: they give bands and scattering; their absorption is not used.
    pub materials: &'a [Material],
    /// What is known of each material's absorption, in the same order and bands, and where the search starts.
    pub priors: &'a [AbsorptionPrior],
    /// The air.
    pub air: &'a Air,
}

impl<'a> FitProblem<'a> {
    /// Takes the three; the fit checks that they belong together.
    pub fn new(materials: &'a [Material], priors: &'a [AbsorptionPrior], air: &'a Air) -> Self {
        Self { materials, priors, air }
    }
}
