//! What is fitted: the materials, what is known of them, the air, and what else bears on the paths.

use crate::Error;
use crate::config::AbsorptionPrior;
use crate::history::{History, Trace, Unabsorbed, rigid};
use rayon::prelude::*;
use sabine_acoustics::{Air, Material};
use sabine_paths::Conditions;

/// Added sound is looked for in steps of this length, in seconds.
const STEP_S: f64 = 0.01;

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
    /// Under which conditions the paths of each pair carry sound, in the order of the pairs: another attenuation, directional sources and
    /// receivers, laws. Their materials are not used. Empty: plain air between omnidirectional ends.
    pub under: &'a [Conditions<'a>],
}

impl<'a> FitProblem<'a> {
    /// Takes the three; the fit checks that they belong together.
    pub fn new(materials: &'a [Material], priors: &'a [AbsorptionPrior], air: &'a Air) -> Self {
        Self { materials, priors, air, under: &[] }
    }

    /// The same under conditions, one for each pair.
    #[must_use]
    pub fn under(self, conditions: &'a [Conditions<'a>]) -> Self {
        Self { under: conditions, ..self }
    }

    /// Everything that the traces keep while absorption is sought.
    pub(crate) fn histories(
        &self,
        traces: &[Trace<'_>],
        bin_s: f64,
    ) -> Result<(Vec<History>, Vec<Unabsorbed>), Error> {
        self.histories_since(traces, bin_s, usize::MAX)
    }

    /// The same, the time of pairs from `tables_from` on counted from their first arrival, as parameters are.
    pub(crate) fn histories_since(
        &self,
        traces: &[Trace<'_>],
        bin_s: f64,
        tables_from: usize,
    ) -> Result<(Vec<History>, Vec<Unabsorbed>), Error> {
        let history = |trace: &Trace<'_>, air: &Air, delays_s: Option<&[f64]>| {
            if trace.pair >= tables_from {
                History::since_first_arrival(trace.paths, air, delays_s, bin_s)
            } else {
                History::delayed(trace.paths, air, delays_s, bin_s)
            }
        };
        let pairs = traces.iter().map(|trace| trace.pair + 1).max().unwrap_or(0);
        if !self.under.is_empty() && self.under.len() != pairs {
            return Err(Error::ConditionCount { pairs, found: self.under.len() });
        }
        let rigid = rigid(self.materials)?;
        let one = |trace: &Trace<'_>| -> Result<(History, Unabsorbed), Error> {
            let Some(conditions) = self.under.get(trace.pair) else {
                let bands = self.materials[0].bands();
                let unabsorbed = Unabsorbed::Air(self.air.energy_exponent_per_m(bands));
                return Ok((history(trace, self.air, None), unabsorbed));
            };
            let conditions = conditions.with_materials(&rigid);
            if trace.paths.added_energy(&conditions, STEP_S, 1)?.is_some() {
                return Err(Error::AddedSound);
            }
            let delays_s = trace.paths.delays_s(&conditions)?;
            let history = history(trace, conditions.air, delays_s.as_deref());
            Ok((history, Unabsorbed::Under(trace.paths.energies(&conditions)?)))
        };
        let all = traces.par_iter().map(one).collect::<Result<Vec<_>, Error>>()?;
        Ok(all.into_iter().unzip())
    }
}
