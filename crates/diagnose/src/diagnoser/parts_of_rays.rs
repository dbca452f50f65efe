//! What parts of the rays take from what was found.

use super::Weighed;
use crate::error::Error;
use crate::infer::ray_dependence::{bearing_on_decays, owed_to_rays, unsettled};
use sabine_acoustics::Observer;

impl Weighed {
    /// Whether something that was found owes its name to the rays that were drawn.
    pub(super) fn owes_a_name(&mut self, effects: usize, observer: &dyn Observer) -> Result<bool, Error> {
        Ok(self.least_settled(effects, observer)?.is_some())
    }

    /// Takes back what owes its name to the rays, the weakest first, and gives it: what another owes beside it need not be what that owes
    /// alone.
    pub(super) fn settled(&mut self, effects: usize, observer: &dyn Observer) -> Result<Vec<usize>, Error> {
        let mut fallen = Vec::new();
        while let Some(weakest) = self.least_settled(effects, observer)? {
            self.found.drop(weakest);
            fallen.push(weakest);
        }
        Ok(fallen)
    }

    /// What stands least, if it would not with other rays.
    fn least_settled(&mut self, effects: usize, observer: &dyn Observer) -> Result<Option<usize>, Error> {
        let chosen = &self.found.chosen;
        let asked = self.found.owed_to_rays.iter().map(|(candidate, _)| *candidate);
        if !asked.eq(bearing_on_decays(&self.cases, chosen)) {
            self.found.owed_to_rays =
                owed_to_rays(&mut self.baseline, &self.cases, chosen, &self.used, observer)?;
        }
        let search = self.search(effects);
        let state = search.state(&self.found.chosen, None)?;
        unsettled(&search, &state, &self.found.owed_to_rays)
    }
}
