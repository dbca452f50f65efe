//! What is named, and what more may be.

use crate::effect::Observable;
use crate::infer::candidates::{CatalogueCase, EffectScore};
use crate::infer::ray_dependence::OwedToRays;

/// What the search found.
#[derive(Default)]
pub(crate) struct Selection {
    pub chosen: Vec<usize>,
    /// Those of them that were given, and not found.
    pub(super) given: Vec<usize>,
    pub(super) probabilities: Vec<(usize, f64)>,
    /// The last cause and those that explain as much: a set.
    pub rivals: Vec<String>,
    /// All effects beside the baseline, and beside the causes that were given.
    pub first: Vec<EffectScore>,
    /// Causes at the end of the search, and all other effects beside them, where none of these was worth a name.
    pub last: Option<(Vec<usize>, Vec<EffectScore>)>,
    /// Effects of these candidates are named no more: they did not help at positions left out.
    pub without: Vec<usize>,
    /// What the evidence for a cause owes to the rays that were drawn.
    pub owed_to_rays: Vec<OwedToRays>,
    /// Each cause, and cases of the same effect that explained as much when it was named.
    pub(super) interchangeable: Vec<(usize, Vec<usize>)>,
}

impl Selection {
    /// Takes a name back, and the set that it stands for.
    pub fn drop(&mut self, candidate: usize) {
        if self.chosen.last() == Some(&candidate) {
            self.rivals.clear();
        }
        self.chosen.retain(|&c| c != candidate);
    }

    /// Of which observables more causes may be named: so many of decays (`most`), and as many of all others, for these speak of other data.
    pub fn open(&self, cases: &[CatalogueCase], most: usize) -> Open {
        let found = || self.chosen.iter().filter(|c| !self.given.contains(c));
        let of_decays = found().filter(|&&c| is_of_decays(cases, c)).count();
        Open { decays: of_decays < most, others: found().count() - of_decays < most }
    }

    pub fn probability(&self, candidate: usize) -> f64 {
        self.probabilities.iter().find(|p| p.0 == candidate).map_or(0.0, |p| p.1)
    }

    /// Cases of the same effect that explained as much as a cause when it was named.
    pub fn interchangeable(&self, candidate: usize) -> &[usize] {
        self.interchangeable.iter().find(|i| i.0 == candidate).map_or(&[], |i| &i.1)
    }
}

/// Whether more causes may be named that bear on decays alone, and others.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Open {
    pub decays: bool,
    pub others: bool,
}

pub(super) fn is_of_decays(cases: &[CatalogueCase], candidate: usize) -> bool {
    cases[candidate].case.observable() == Observable::Decay
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::effects::{PositionError, SurfaceAbsorption};
    use crate::hand_made;
    use crate::infer::candidates::cases;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn a_set_falls_with_the_cause_that_stands_for_it_and_with_no_other() {
        let all = || Selection {
            chosen: vec![4, 7],
            rivals: vec!["a".to_owned(), "b".to_owned()],
            ..Selection::default()
        };
        let mut without_last = all();
        without_last.drop(7);
        assert!(without_last.chosen == [4] && without_last.rivals.is_empty());
        let mut without_first = all();
        without_first.drop(4);
        assert!(without_first.chosen == [7] && without_first.rivals == ["a", "b"]);
    }

    #[test]
    fn causes_of_decays_and_others_are_counted_apart() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(PositionError), Box::new(SurfaceAbsorption)];
        let cases = cases(&effects, &survey);
        let two_of = |effect: usize| -> Vec<usize> {
            (0..cases.len()).filter(|&c| cases[c].effect == effect).take(2).collect()
        };
        let open = |chosen: Vec<usize>, given: Vec<usize>| {
            let named = Selection { chosen, given, ..Selection::default() };
            let Open { decays, others } = named.open(&cases, 2);
            (decays, others)
        };
        let (places, materials) = (two_of(0), two_of(1));
        assert_eq!(open(Vec::new(), Vec::new()), (true, true));
        assert_eq!(open(places.clone(), Vec::new()), (true, false));
        assert_eq!(open(materials.clone(), Vec::new()), (false, true));
        assert_eq!(open([&places[..], &materials].concat(), Vec::new()), (false, false));
        // What was given was not found.
        assert_eq!(open(materials.clone(), materials[..1].to_vec()), (true, true));
    }
}
