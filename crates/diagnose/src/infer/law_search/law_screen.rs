//! All laws of the grammar, and their shams, beside one fit.

use super::columns::{Column, Sham, ShamPlaces, columns};
use super::family::{by_chance, largest, tail};
use super::features::Features;
use super::null_model::{NullModel, Rows};
use super::screen::{ReadyTerm, Screen, ScreenPair, ScreenTerm};
use crate::effect::Case;
use crate::effects::{Formula, Grammar};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::likelihood::decay::EnergyModel;
use crate::likelihood::laplace::{LaplaceFit, known_beforehand};
use crate::survey::Survey;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::LN_10;

/// Logarithm of energy in one decibel.
const LN_PER_DB: f64 = LN_10 / 10.0;
/// Measurements without a law that are drawn.
const DRAWS: usize = 399;
/// A sham that keeps so much of what it was (cosine, nuisances projected out) is none: what is the same at all positions stays when they are
/// exchanged. Half of the information is left at 0.7.
const SHAM_COSINE: f64 = 0.7;
/// Laws closer than this cannot be told apart (cosine, nuisances projected out).
const SAME_COSINE: f64 = 0.95;
/// Laws whose evidence differs by less are not told apart, in nats.
const SAME_NATS: f64 = 3.0;
/// Formulas that are compared with each other, the best.
const MAX_COMPARED: usize = 120;

/// What is screened.
#[derive(Clone, Copy)]
pub(crate) struct Family<'a> {
    pub grammar: &'a Grammar,
    pub features: &'a Features,
    /// The lowest band in which laws act.
    pub from_band: usize,
    /// Whether shams compete: three columns in five.
    pub shams: bool,
}

/// Laws beside a fit.
pub(crate) struct LawScreen<'a> {
    grammar: &'a Grammar,
    screen: Screen,
    null: NullModel,
    /// By formula.
    terms: Vec<ReadyTerm>,
    /// Shams, each with the formula whose covariate it was.
    shams: Vec<(Sham, usize, ReadyTerm)>,
    places: ShamPlaces,
    /// The lowest band in which laws act.
    from_band: usize,
    seed: u64,
}

/// A sham that does well.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenedSham {
    pub sham: Sham,
    /// The formula whose covariate it was.
    pub formula: usize,
    /// Evidence times probability beforehand, in nats.
    pub nats: f64,
}

/// Laws that explain the same: the place among the formulas of the one that speaks for them, and the evidence of the best.
#[derive(Clone, Debug)]
pub(crate) struct LawClass {
    pub formula: usize,
    pub nats: f64,
}

impl<'a> LawScreen<'a> {
    /// Beside a fit of the decays under some cases to the responses that are used.
    pub fn of(
        baseline: &Baseline,
        Family { grammar, features, from_band, shams }: Family<'a>,
        cases: &[&Case],
        fit: &LaplaceFit,
        used: &[bool],
    ) -> Result<Self, Error> {
        let (data, survey) = (baseline.energy_data(), baseline.survey());
        let model = EnergyModel::new(&data, cases, used);
        let bands = survey.bands().len();
        let pairs: Vec<usize> = (0..used.len()).filter(|&p| used[p]).collect();
        let mut all = columns(grammar, pairs.len());
        if !shams {
            all.truncate(grammar.covariates.len());
        }
        let seed = baseline.config.seed;
        let sham_places = ShamPlaces::draw(&pairs, used.len(), survey.materials().len(), seed);
        let one = |&pair: &usize| {
            let expansion = model.expansion(&fit.values, pair);
            let rows = model.rows_of(pair);
            // What terms behind the paths let through of a change along them.
            let through = expansion.slopes.column(model.gain_of(pair)) / LN_PER_DB;
            let mut x = DMatrix::zeros(through.len(), all.len() * bands);
            let mut first = 0;
            for &(band, count) in &rows {
                let acting = if band < from_band { &[] } else { &all[..] };
                for (place, column) in acting.iter().enumerate() {
                    let values = column.values((features, grammar, &sham_places), (pair, band, count));
                    for (bin, value) in values.into_iter().flatten().enumerate() {
                        x[(first + bin, place * bands + band)] = -LN_PER_DB * value * through[first + bin];
                    }
                }
                first += count;
            }
            let rows = Rows { receiver: survey.responses()[pair].receiver, of_bands: rows };
            (ScreenPair { pulls: model.pulls(&fit.values, pair), expansion, x }, rows)
        };
        let (screened, rows): (Vec<ScreenPair>, Vec<Rows>) = pairs.par_iter().map(one).unzip();
        let null = NullModel::of(&screened, &rows, known_beforehand(&model))?;
        let screen = Screen::new(bands, screened, null.covariance());
        let (terms, shams) = terms(grammar, survey, &screen, &all);
        Ok(Self { grammar, screen, null, terms, shams, places: sham_places, from_band, seed })
    }

    /// Evidence of a formula (by its place), times its probability beforehand, in nats.
    pub fn nats(&self, formula: usize) -> f64 {
        self.screen.nats(&self.terms[formula], &self.screen.slopes)
    }

    /// Standard deviation of the amplitude of a formula of one parameter, as these data alone tell it, in dB.
    pub fn sd_db(&self, formula: usize) -> f64 {
        self.screen.sd(&self.terms[formula])
    }

    /// All formulas, the best first.
    fn ranked(&self) -> Vec<(usize, f64)> {
        let mut ranked: Vec<(usize, f64)> = (0..self.terms.len()).map(|f| (f, self.nats(f))).collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        ranked
    }

    fn cosine(&self, a: usize, b: usize) -> f64 {
        self.screen.cosine(&self.terms[a], &self.terms[b]).abs()
    }

    /// The best laws that can be told apart, at most `most`. Among those that cannot, the shortest speaks: it was the most probable beforehand.
    pub fn classes(&self, most: usize) -> Vec<LawClass> {
        let prior = |formula: usize| self.grammar.formulas[formula].ln_prior;
        let mut classes: Vec<LawClass> = Vec::new();
        for (formula, nats) in self.ranked().into_iter().take(MAX_COMPARED) {
            let own = classes.iter().position(|class| self.cosine(class.formula, formula) > SAME_COSINE);
            let Some(place) = own else {
                if classes.len() < most {
                    classes.push(LawClass { formula, nats });
                }
                continue;
            };
            let class = &mut classes[place];
            if class.nats - nats < SAME_NATS && prior(formula) > prior(class.formula) {
                class.formula = formula;
            }
        }
        classes
    }

    /// Formulas that the data do not tell from one: as good within 3 nats, or the same in the bins that were measured.
    pub fn not_told_from(&self, formula: usize) -> Vec<usize> {
        let own = self.nats(formula);
        let same = |&(other, nats): &(usize, f64)| {
            other != formula && (own - nats < SAME_NATS || self.cosine(formula, other) > SAME_COSINE)
        };
        self.ranked().into_iter().take(MAX_COMPARED).filter(same).map(|(other, _)| other).collect()
    }

    /// The most promising formulas, the best first.
    pub fn best(&self, most: usize) -> Vec<(usize, f64)> {
        let mut ranked = self.ranked();
        ranked.truncate(most);
        ranked
    }

    /// Probability that the best of the whole family has so much evidence where no law acts, beyond what is drawn too.
    pub fn p_value(&self, nats: f64) -> f64 {
        tail(nats, &self.drawn())
    }

    /// Probability that the best of the whole family is as good as a formula where no law acts.
    pub fn family_p(&self, formula: usize) -> f64 {
        by_chance(self.nats(formula), &self.drawn())
    }

    /// The best of the whole family in measurements without a law.
    fn drawn(&self) -> Vec<f64> {
        let columns = self.grammar.covariates.len();
        largest(&self.screen, &self.terms, columns, &self.null, (DRAWS, self.seed ^ 0xFA111))
    }

    /// All shams, the best first.
    pub fn shams(&self) -> Vec<ScreenedSham> {
        let one = |(sham, formula, term): &(Sham, usize, ReadyTerm)| ScreenedSham {
            sham: *sham,
            formula: *formula,
            nats: self.screen.nats(term, &self.screen.slopes),
        };
        let mut ranked: Vec<ScreenedSham> = self.shams.iter().map(one).collect();
        ranked.sort_by(|a, b| b.nats.total_cmp(&a.nats));
        ranked
    }

    /// A formula, or a sham of it, as a case that is fitted: what it takes from each bin is its mean over the energy there. `ends` are the bins that
    /// are compared.
    pub fn case(
        &self,
        (features, survey): (&Features, &Survey),
        (formula, sham): (usize, Option<Sham>),
        ends: &[Vec<usize>],
    ) -> Case {
        let formula = &self.grammar.formulas[formula];
        let column = Column { covariate: formula.covariate, sham };
        let of_band = |(pair, band, &count): (usize, usize, &usize)| {
            let known = (features, self.grammar, &self.places);
            let acts = count > 0 && band >= self.from_band;
            column.values(known, (pair, band, count)).filter(|_| acts).unwrap_or_default()
        };
        let of_pair = |(pair, ends): (usize, &Vec<usize>)| {
            ends.iter().enumerate().map(|(band, count)| of_band((pair, band, count))).collect()
        };
        self.grammar.case_of_bins(formula, survey, ends.iter().enumerate().map(of_pair).collect())
    }
}

/// The terms of all formulas, and of those shams that are some.
fn terms(
    grammar: &Grammar,
    survey: &Survey,
    screen: &Screen,
    columns: &[Column],
) -> (Vec<ReadyTerm>, Vec<(Sham, usize, ReadyTerm)>) {
    let term = |formula: &Formula, column: usize| {
        let own = formula.bands.terms(survey);
        ScreenTerm {
            column,
            shares: own.iter().map(|t| DVector::from_row_slice(&t.shares)).collect(),
            sd: own.iter().map(|t| t.sd_db).collect(),
            takes_only: !grammar.covariates[formula.covariate].both_signs,
            ln_prior: formula.ln_prior,
        }
    };
    let ready: Vec<ReadyTerm> = grammar.formulas.iter().map(|f| screen.ready(term(f, f.covariate))).collect();
    let mut shams = Vec::new();
    for (place, column) in columns.iter().enumerate() {
        let Some(sham) = column.sham else { continue };
        for (number, formula) in grammar.formulas.iter().enumerate() {
            if formula.covariate != column.covariate {
                continue;
            }
            let own = term(formula, place);
            let direction = own.shares[0].clone();
            if screen.cosine_of((formula.covariate, &direction), (place, &direction)).abs() < SHAM_COSINE {
                shams.push((sham, number, screen.ready(own)));
            }
        }
    }
    (ready, shams)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::{DecayTerm, Parameter};
    use crate::hand_made::Tables;
    use crate::simulate::views::BandView;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn octaves_below_the_lowest_in_which_laws_act_say_nothing() {
        let baseline = Tables::new(Levels::Common, TimeZero::Emission).baseline(DiagnoseConfig::default());
        let survey = baseline.survey();
        let grammar = Grammar::of(survey);
        let features = Features::by_hand(&grammar, (3, 2, 14));
        let used = [true; 3];
        let (fit, _) = baseline.fit_energy(&[], &used, None).expect("a fit");
        let screens = [0, 1].map(|from_band| {
            let family = Family { grammar: &grammar, features: &features, from_band, shams: from_band == 0 };
            LawScreen::of(&baseline, family, &[], &fit, &used).expect("a screen")
        });
        assert!(screens[1].shams.is_empty() && !screens[0].shams.is_empty());
        let acting_in = |shares: [f64; 2]| {
            let acts = |f: &Formula| {
                let terms = f.bands.terms(survey);
                terms.len() == 1 && terms[0].shares == shares
            };
            grammar.formulas.iter().position(acts).expect("one octave alone")
        };
        let (lower, upper) = (acting_in([1.0, 0.0]), acting_in([0.0, 1.0]));
        let beyond_prior = |screen: &LawScreen<'_>, f: usize| screen.nats(f) - grammar.formulas[f].ln_prior;
        assert!(beyond_prior(&screens[0], lower).abs() > 0.1);
        assert!(beyond_prior(&screens[1], lower).abs() < 1e-9);
        assert!(beyond_prior(&screens[0], upper).abs() > 0.1);
        assert!((screens[0].nats(upper) - screens[1].nats(upper)).abs() < 1e-9);
    }

    /// It takes what a formula takes, and bins scatter the less the more that is.
    struct Steadier {
        /// `[pair][band][bin]`.
        covariate: Vec<Vec<Vec<f64>>>,
    }

    impl DecayTerm for Steadier {
        fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
            let own = &self.covariate[view.pair][view.band()];
            ln_energy.iter_mut().zip(own).for_each(|(l, own)| *l -= LN_PER_DB * own * values[0]);
        }

        fn variance(&self, values: &[f64], _: &BandView<'_>, variance: &mut [f64]) {
            variance.iter_mut().for_each(|v| *v *= (-values[0]).exp());
        }
    }

    /// How bins scatter tells what a cause amounts to, and no column of the screen knows of that.
    #[test]
    fn what_a_fit_leaves_open_makes_no_law() {
        for levels in [Levels::Common, Levels::PerResponse] {
            let baseline = Tables::new(levels, TimeZero::Emission).baseline(DiagnoseConfig::default());
            let grammar = Grammar::of(baseline.survey());
            let features = Features::by_hand(&grammar, (3, 2, 14));
            let formula = grammar.formulas.iter().find(|f| grammar.covariates[f.covariate].both_signs);
            let column = formula.expect("a formula").covariate;
            let of_pair = |pair| (0..2).map(|band| features.of(pair, band, column, 14)).collect();
            let parameter = Parameter::new("x", "dB", 0.0, 5.0, (-20.0, 20.0));
            let case = Case::decay(vec![parameter], Steadier { covariate: (0..3).map(of_pair).collect() });
            let used = [true; 3];
            let (fit, _) = baseline.fit_energy(&[&case], &used, None).expect("a fit");
            let family = Family { grammar: &grammar, features: &features, from_band: 0, shams: false };
            let mut screen = LawScreen::of(&baseline, family, &[&case], &fit, &used).expect("a screen");
            screen.null = screen.null.without_random_effects();
            let most = screen.drawn().into_iter().fold(f64::NEG_INFINITY, f64::max);
            // Half the greatest square of 399 times some 400 normal deviates, less what a formula costs.
            assert!(most < 14.0, "{levels:?}: {most}");
        }
    }
}
