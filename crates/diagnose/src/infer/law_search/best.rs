//! What decays go with most, and whether chance would make as much of it.

use super::features::Features;
use super::law_screen::LawScreen;
use crate::effect::Case;
use crate::effects::Grammar;
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::likelihood::laplace::LaplaceFit;

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
}

impl Formulas {
    pub fn of(baseline: &Baseline) -> Result<Self, Error> {
        let grammar = Grammar::of(baseline.survey());
        let features = Features::gather(baseline, &grammar)?;
        Ok(Self { grammar, features })
    }

    /// What the best of them goes with, in words, beside a fit of the decays under some cases, and what is said for it.
    pub fn best(
        &self,
        baseline: &Baseline,
        cases: &[&Case],
        fit: &LaplaceFit,
        used: &[bool],
    ) -> Option<(String, BestFormula)> {
        let screen = LawScreen::of(baseline, &self.grammar, &self.features, cases, fit, used);
        let (formula, p_value) = screen.best()?;
        let subject = self.grammar.subject(&self.grammar.formulas[formula], baseline.survey());
        Some((subject, BestFormula { nats: screen.nats(formula), p_value }))
    }
}
