//! What decays go with most, and whether chance would make as much of it.

use super::features::Features;
use super::law_screen::{Family, LawScreen};
use crate::effect::Case;
use crate::effects::Grammar;
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::likelihood::decay::WarmStart;
use crate::likelihood::laplace::LaplaceFit;

/// Formulas that are fitted, at most.
const FITTED: usize = 4;

/// What is said for the best of all formulas beside a fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BestFormula {
    /// Its evidence, times its probability beforehand, in nats.
    pub nats: f64,
    /// The probability that one as good is found where no law acts.
    pub p_value: f64,
}

/// All formulas, and what is known of their covariates in each bin: the same beside any causes, as long as nothing is traced or expanded again.
pub(crate) struct Formulas {
    grammar: Grammar,
    features: Features,
    /// The lowest band that is asked.
    from_band: usize,
}

impl Formulas {
    pub fn of(baseline: &Baseline) -> Result<Self, Error> {
        let grammar = Grammar::of(baseline.survey());
        let features = Features::gather(baseline, &grammar)?;
        // Below the Schroeder frequency few modes decide how decays differ from place to place, and no quantity of paths.
        let survey = baseline.survey();
        let from_band = if survey.bands_of_modes < survey.bands.len() { survey.bands_of_modes } else { 0 };
        Ok(Self { grammar, features, from_band })
    }

    /// What the best of them goes with, in words, beside a fit of the decays under some cases, and what is said for it. Those for which the screen
    /// says most are fitted: where single bins lie far off, its parabola promises what no fit gives.
    pub fn best(
        &self,
        baseline: &Baseline,
        cases: &[&Case],
        (fit, firsts): (&LaplaceFit, &[usize]),
        used: &[bool],
    ) -> Result<Option<(String, BestFormula)>, Error> {
        let survey = baseline.survey();
        let Self { grammar, features, from_band } = self;
        let family = Family { grammar, features, from_band: *from_band, shams: false };
        let screen = LawScreen::of(baseline, family, cases, fit, used)?;
        let mut best: Option<(usize, f64)> = None;
        for (formula, promised) in screen.best(FITTED) {
            if best.is_some_and(|(_, nats)| nats > promised) {
                break;
            }
            let case = screen.case((&self.features, survey), (formula, None), &baseline.simulation.ends);
            let all: Vec<&Case> = cases.iter().copied().chain([&case]).collect();
            let (more, _) =
                baseline.fit_energy(&all, used, Some(WarmStart { values: &fit.values, firsts }))?;
            let gained = more.log_evidence - fit.log_evidence + self.grammar.formulas[formula].ln_prior;
            let nats = promised.min(gained);
            if best.is_none_or(|(_, most)| nats > most) {
                best = Some((formula, nats));
            }
        }
        let told = |(formula, nats): (usize, f64)| {
            let subject = self.grammar.subject(&self.grammar.formulas[formula], survey);
            (subject, BestFormula { nats, p_value: screen.p_value(nats) })
        };
        Ok(best.map(told))
    }
}
