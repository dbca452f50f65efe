//! How strong a law would have to be for these positions to show it.

use super::features::Features;
use super::law_screen::{Family, LawScreen};
use crate::effect::Observable;
use crate::effects::{BandLaw, Grammar};
use crate::error::Error;
use crate::infer::search::{Search, State};

/// Size at which laws of grazing absorption were found whenever they were hidden (five rooms of five, `docs/validation/laws.md`), in standard
/// deviations.
const PLAIN_D_PRIME: f64 = 10.0;
/// Decibels beyond which no figure means anything.
const BEYOND_DB: f64 = 100.0;

/// Each quantity of the grammar, products left out, with the amplitude in dB from which a law that goes with it, the same in all octaves, would
/// be plain beside what is named; none beyond 100 dB. The smallest first.
pub(crate) fn visible_from(search: &Search<'_>, state: &State) -> Result<Vec<(String, Option<f64>)>, Error> {
    let baseline = search.baseline;
    let grammar = Grammar::of(baseline.survey());
    let features = Features::gather(baseline, &grammar)?;
    let cases = search.cases_of(&state.chosen, Observable::Decay);
    let family = Family { grammar: &grammar, features: &features, from_band: 0, shams: false };
    let screen = LawScreen::of(baseline, family, &cases, &state.energy, &search.used)?;
    let plain = (0..grammar.formulas.len()).filter(|&f| {
        let formula = &grammar.formulas[f];
        formula.bands == BandLaw::Same && grammar.covariates[formula.covariate].forms.len() == 1
    });
    let from_db = |formula: usize| {
        let db = PLAIN_D_PRIME * screen.sd_db(formula);
        (db < BEYOND_DB).then_some(db)
    };
    let place = |db: Option<f64>| db.unwrap_or(f64::INFINITY);
    let mut found: Vec<(String, Option<f64>)> = Vec::new();
    for formula in plain {
        let (words, db) = (grammar.covariates[grammar.formulas[formula].covariate].words(), from_db(formula));
        // Waves of one period have one name: their phase is known only once one is found.
        match found.iter_mut().find(|(known, _)| *known == words) {
            Some((_, most)) if place(db) > place(*most) => *most = db,
            Some(_) => {}
            None => found.push((words, db)),
        }
    }
    found.sort_by(|a, b| place(a.1).total_cmp(&place(b.1)));
    Ok(found)
}
