//! What parts of the rays take from what was found.

use super::Weighed;
use crate::error::Error;
use crate::infer::ray_dependence::{OwedToRays, bearing_on_decays, owed_to_rays, unsettled};
use sabine_acoustics::Observer;

impl Weighed {
    /// Whether something that was found owes its name to the rays that were drawn.
    pub(super) fn owes_a_name(&mut self, effects: usize, observer: &dyn Observer) -> Result<bool, Error> {
        Ok(self.weakest_owing(effects, observer)?.is_some())
    }

    /// Takes back what owes its name to the rays, the weakest first, and gives it: what another owes beside it need not be what that owes
    /// alone.
    pub(super) fn drop_owing(
        &mut self,
        effects: usize,
        observer: &dyn Observer,
    ) -> Result<Vec<OwedToRays>, Error> {
        let mut fallen = Vec::new();
        while let Some(weakest) = self.weakest_owing(effects, observer)? {
            self.found.drop(weakest.0);
            fallen.push(weakest);
        }
        Ok(fallen)
    }

    /// What stands least, if it would not with other rays.
    fn weakest_owing(
        &mut self,
        effects: usize,
        observer: &dyn Observer,
    ) -> Result<Option<OwedToRays>, Error> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::effects::{CoupledVolume, TransducerResponse};
    use crate::infer::baseline::Baseline;
    use crate::infer::candidates::cases;
    use crate::infer::selection::Selection;
    use crate::report::diagnosis::RayDependence;
    use std::sync::Arc;

    #[test]
    fn what_owes_its_name_to_rays_falls_and_what_stands_is_asked_again_without_it() {
        let mut baseline = Baseline::of_laboratory(5);
        // Every recording has 12 dB more in one octave.
        for measured in &mut baseline.observations.measured {
            for energy in measured.energies[2].iter_mut().flatten() {
                *energy *= 16.0;
            }
        }
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(TransducerResponse), Box::new(CoupledVolume)];
        let cases = cases(&effects, baseline.survey());
        assert_eq!(cases.len(), 2);
        assert!(baseline.prepare(&cases).expect("tables").iter().all(|refused| !refused));
        let mut weighed = Weighed {
            first_dispersion: baseline.dispersion.clone(),
            used: baseline.observations.fitted.clone(),
            baseline,
            cases,
            given: Vec::new(),
            found: Selection::default(),
            arrival_fits: Arc::default(),
        };
        // As if little of what speaks for the first were the rays', and more than speaks for the second.
        let owing =
            |owed_nats: f64| RayDependence { owed_nats, ..RayDependence::new(1.0, vec![1.0; 4], 0.01) };
        weighed.found.chosen = vec![0, 1];
        weighed.found.owed_to_rays = vec![(0, owing(5.0)), (1, owing(50.0))];
        assert!(weighed.owes_a_name(2, &()).expect("fits"));
        let fallen = weighed.drop_owing(2, &()).expect("fits");
        assert_eq!(fallen, [(1, owing(50.0))]);
        assert_eq!(weighed.found.chosen, [0]);
        let [(0, rays)] = &weighed.found.owed_to_rays[..] else { panic!("{:?}", weighed.found.owed_to_rays) };
        assert!(rays.decay_nats > 20.0 && rays.owed_nats < 0.5 * rays.decay_nats, "{rays:?}");
        assert!(!weighed.owes_a_name(2, &()).expect("fits"));
    }
}
