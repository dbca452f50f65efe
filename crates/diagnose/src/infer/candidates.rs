//! The cases that compete to explain the observations.

use crate::effect::{Case, Effect, Observable};
use crate::survey::Survey;

/// One case of one effect of the catalogue.
pub(crate) struct Candidate<'a> {
    pub effect: usize,
    pub id: &'static str,
    pub case: &'a dyn Case,
}

/// All cases of some effects.
pub(crate) fn cases(
    effects: &[Box<dyn Effect>],
    survey: &Survey,
) -> Vec<(usize, &'static str, Box<dyn Case>)> {
    effects
        .iter()
        .enumerate()
        .flat_map(|(i, effect)| effect.cases(survey).into_iter().map(move |case| (i, effect.info().id, case)))
        .collect()
}

/// The chosen cases that take part in one fit, in their order.
pub(crate) fn cases_of<'a>(
    candidates: &[Candidate<'a>],
    chosen: &[usize],
    part: Observable,
) -> Vec<&'a dyn Case> {
    chosen.iter().map(|&c| candidates[c].case).filter(|c| c.observable().concerns(part)).collect()
}
