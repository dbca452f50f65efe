//! Laws that did not stand, in the place of causes that were named without them.

use crate::effect::Observable;
use crate::error::Error;
use crate::infer::search::{RIVAL_NATS, Search};

/// A law that explains as much as a cause in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rival {
    /// Place of the cause among those named.
    pub place: usize,
    pub law: usize,
    /// Evidence of all causes with the law in that place less that with the cause, each less its price.
    pub nats: f64,
}

/// The law that explains most in the place of a cause of decays alone, if no more than [`RIVAL_NATS`] are lacking: `named` and `laws` are candidates.
pub(crate) fn closest(search: &Search<'_>, named: &[usize], laws: &[usize]) -> Result<Option<Rival>, Error> {
    let state = search.state(named, None)?;
    let mut found: Option<Rival> = None;
    for (place, &cause) in named.iter().enumerate() {
        if search.candidates[cause].case.observable() != Observable::Decay {
            continue;
        }
        for &law in laws {
            let instead: Vec<usize> = named.iter().map(|&c| if c == cause { law } else { c }).collect();
            let with_law = search.state(&instead, None)?.log_evidence() - search.price(law);
            let nats = with_law - (state.log_evidence() - search.price(cause));
            if nats > -RIVAL_NATS && found.is_none_or(|best| nats > best.nats) {
                found = Some(Rival { place, law, nats });
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::{Case, Effect};
    use crate::effects::{BandLaw, Grammar, SurfaceAbsorption, TimeZeroOffset, UnknownLaw};
    use crate::hand_made::Tables;
    use crate::infer::candidates::{CatalogueCase, cases};
    use sabine_scene::{Levels, TimeZero};

    /// The rival among two laws where each hit on carpet takes so many nepers more than stated: one takes from each bin as many decibels as there
    /// are hits on carpet, the other goes up and down from bin to bin.
    fn rival(nepers: f64) -> Option<Rival> {
        let (carpet, per_hit_db) = (0, 1.0);
        let mut tables = Tables::new(Levels::Absolute, TimeZero::Emission);
        let mut hits = Vec::new();
        for (measured, states) in tables.measured.iter_mut().zip(&tables.states) {
            let of_band =
                |(energies, state): (&mut Option<Vec<f64>>, &crate::simulate::band_state::BandState)| {
                    let bins = state.ln_energy.len();
                    let mean = |bin: usize| {
                        let own = state.groups[bin]..state.groups[bin + 1];
                        let all: f64 = state.group_energy[own.clone()].iter().sum();
                        own.map(|g| state.group_energy[g] * state.group_hits[carpet][g]).sum::<f64>() / all
                    };
                    let hits: Vec<f64> = (0..bins).map(mean).collect();
                    let energy = |(l, hits): (&f64, &f64)| (l - nepers * hits).exp();
                    *energies = Some(state.ln_energy.iter().zip(&hits).map(energy).collect());
                    hits.into_iter().map(|n| per_hit_db * n).collect::<Vec<f64>>()
                };
            hits.push(measured.energies.iter_mut().zip(states).map(of_band).collect::<Vec<_>>());
        }
        let up_and_down: Vec<Vec<Vec<f64>>> = hits
            .iter()
            .map(|pair| {
                pair.iter().map(|band| (0..band.len()).map(|i| (2.1 * i as f64).sin()).collect()).collect()
            })
            .collect();
        let baseline = tables.baseline(DiagnoseConfig::default());
        let survey = baseline.survey();
        let effects: Vec<Box<dyn Effect>> =
            vec![Box::new(SurfaceAbsorption), Box::new(TimeZeroOffset), Box::new(UnknownLaw)];
        let mut all = cases(&effects, survey);
        let grammar = Grammar::of(survey);
        let formula = *grammar.formulas.iter().find(|f| f.bands == BandLaw::Same)?;
        let one = |case: Case| CatalogueCase {
            effect: 2,
            id: UnknownLaw.id(),
            case,
            formula: Some(formula),
            inherited_nats: 0.0,
        };
        let first = all.len();
        all.extend([hits, up_and_down].map(|numbers| one(grammar.case_of_bins(&formula, survey, numbers))));
        let search = Search::new(&baseline, &all, effects.len(), vec![true; 3]);
        let is = |id: &str, subject: Option<&str>| {
            all.iter().position(|own| own.id == id && own.case.subject.as_deref() == subject).expect("a case")
        };
        let named = [is("time_zero", None), is("surface_absorption", Some("carpet"))];
        let found = closest(&search, &named, &[first + 1, first]).expect("fits");
        assert!(closest(&search, &named, &[first + 1]).expect("fits").is_none());
        // What moves arrivals has no rival among laws of decays.
        assert!(closest(&search, &named[..1], &[first]).expect("fits").is_none());
        found.map(|rival| Rival { law: rival.law - first, ..rival })
    }

    #[test]
    fn what_takes_as_much_from_each_bin_is_a_rival_and_what_takes_something_else_is_none() {
        let found = rival(1.5).expect("a rival");
        assert!(found.place == 1 && found.law == 0, "{found:?}");
    }
}
