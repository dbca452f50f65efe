//! One formula of the grammar, as a case that is fitted.

use super::band_law::{BandLaw, BandTerm};
use super::covariate::{Covariate, covariates};
use super::release::{FittedRelease, Release};
use super::wave::{FittedWave, Wave};
use crate::effect::{Case, DecayTerm, FittedCase, Parameter, Stage};
use crate::effects::law_effect::tabulated_law::TabulatedLaw;
use crate::extend::model_change::ModelChange;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use sabine_acoustics::Bands;
use sabine_paths::laws::{Law, LawError, LawParameter, LawTarget};

/// Logarithm of energy in one decibel.
pub(super) const LN_PER_DB: f64 = std::f64::consts::LN_10 / 10.0;

/// A covariate (index) and how its amplitude goes with the octave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Formula {
    pub covariate: usize,
    pub bands: BandLaw,
    /// Logarithm of its probability beforehand.
    pub ln_prior: f64,
}

/// All formulas of a room: what they may go with, and each covariate with each band law. Their probabilities sum to one.
pub(crate) struct Grammar {
    pub covariates: Vec<Covariate>,
    pub formulas: Vec<Formula>,
}

impl Grammar {
    /// The grammar of a room.
    pub fn of(survey: &Survey) -> Self {
        let covariates = covariates(survey);
        let band_laws = BandLaw::all(survey.bands().len());
        // What changes the gain of a recording does so in all octaves.
        let of_courses = [(BandLaw::Same, 1.0)];
        let of_covariate = |(covariate, own): (usize, &Covariate)| {
            let share = own.share;
            let band_laws = if own.is_fitted_course() { &of_courses[..] } else { &band_laws };
            let one = move |&(bands, of_bands): &(BandLaw, f64)| Formula {
                covariate,
                bands,
                ln_prior: (share * of_bands).ln(),
            };
            band_laws.iter().map(one).collect::<Vec<Formula>>()
        };
        let formulas = covariates.iter().enumerate().flat_map(of_covariate).collect();
        Self { covariates, formulas }
    }

    /// What a formula goes with, in words.
    pub fn subject(&self, formula: &Formula, survey: &Survey) -> String {
        let covariate = &self.covariates[formula.covariate];
        format!("{}{}", covariate.words(), formula.bands.words(survey.bands()))
    }

    /// A formula as a case.
    pub fn case(&self, formula: &Formula, survey: &Survey) -> Result<Case, LawError> {
        let covariate = &self.covariates[formula.covariate];
        if let Some(wave) = covariate.wave {
            return Ok(self.wave_case(formula, wave, survey));
        }
        if let Some(release) = covariate.release {
            return Ok(self.release_case(formula, release, survey));
        }
        let amplitude = self.amplitude(formula, survey);
        let law = TabulatedLaw::new(covariate.unit_law()?, 0, amplitude.range_db);
        let found = found(covariate.clone(), formula.bands, survey.bands());
        let changes = move |fitted: &FittedCase<'_>| {
            let parameters = (0..fitted.values().len()).map(|i| fitted_parameter(fitted, i, "dB"));
            let law = found(&parameters.collect::<Vec<_>>());
            law.map_or_else(|_| Vec::new(), |law| vec![ModelChange::Law(Box::new(law))])
        };
        let (parameters, stage) = (self.parameters(formula, survey), self.stage(formula));
        let starts = starts(&parameters);
        Ok(Case::decay(parameters, OverBands { law, amplitude })
            .about(self.subject(formula, survey))
            .at(stage)
            .starting(starts)
            .changing(changes))
    }

    /// A wave as a case: its period and its phase are fitted with its amplitude.
    fn wave_case(&self, formula: &Formula, wave: Wave, survey: &Survey) -> Case {
        let law = move |fitted: &FittedCase<'_>| {
            wave.law([(0, "dB"), (1, "rad/s"), (2, "rad")].map(|(i, unit)| fitted_parameter(fitted, i, unit)))
        };
        self.course_case(formula, survey, wave.parameters().to_vec(), FittedWave, law)
    }

    /// A release as a case: its time constant is fitted with its amplitude.
    fn release_case(&self, formula: &Formula, release: Release, survey: &Survey) -> Case {
        let law = move |fitted: &FittedCase<'_>| {
            release.law([(0, "dB"), (1, "s")].map(|(i, unit)| fitted_parameter(fitted, i, unit)))
        };
        self.course_case(formula, survey, vec![release.parameter()], FittedRelease, law)
    }

    /// A course of the recorder's gain as a case, with these parameters behind its amplitude.
    fn course_case(
        &self,
        formula: &Formula,
        survey: &Survey,
        own: Vec<Parameter>,
        term: impl DecayTerm + 'static,
        law: impl Fn(&FittedCase<'_>) -> Result<Law, LawError> + Send + Sync + 'static,
    ) -> Case {
        let mut parameters = self.parameters(formula, survey);
        let begin: Vec<f64> = own.iter().map(|p| p.neutral).collect();
        let starts = starts(&parameters).into_iter().map(|start| [start, begin.clone()].concat()).collect();
        parameters.extend(own);
        Case::decay(parameters, term)
            .about(self.subject(formula, survey))
            .at(self.stage(formula))
            .starting(starts)
            .changing(move |fitted| {
                law(fitted).map_or_else(|_| Vec::new(), |law| vec![ModelChange::Law(Box::new(law))])
            })
    }

    /// A formula with these numbers for its covariate, `[pair][band][bin]`: one for each bin in the place of one for each path.
    pub fn case_of_bins(&self, formula: &Formula, survey: &Survey, covariate: Vec<Vec<Vec<f64>>>) -> Case {
        let (parameters, stage) = (self.parameters(formula, survey), self.stage(formula));
        let starts = starts(&parameters);
        let amplitude = self.amplitude(formula, survey);
        Case::decay(parameters, OfBins { covariate, amplitude }).at(stage).starting(starts)
    }

    fn parameters(&self, formula: &Formula, survey: &Survey) -> Vec<Parameter> {
        let least = self.covariates[formula.covariate].least_db();
        let parameter = |term: &BandTerm| {
            let may_fall = least < 0.0 || term.name == "amplitude_per_octave";
            let low = if may_fall { -term.most_db.min(super::MOST_ADDED_DB) } else { 0.0 };
            Parameter::new(term.name, "dB", 0.0, term.sd_db, (low, term.most_db)).typically(0.5 * term.sd_db)
        };
        formula.bands.terms(survey).iter().map(parameter).collect()
    }

    fn stage(&self, formula: &Formula) -> Stage {
        let of_recordings = self.covariates[formula.covariate].target == LawTarget::Recorder;
        if of_recordings { Stage::Recorder } else { Stage::Room }
    }

    fn amplitude(&self, formula: &Formula, survey: &Survey) -> Amplitude {
        let range_db = (self.covariates[formula.covariate].least_db(), super::MOST_DB);
        let shares = formula.bands.terms(survey).into_iter().map(|t| t.shares).collect();
        Amplitude { shares, range_db }
    }
}

/// A fitted value with its interval, as a number of a law.
fn fitted_parameter(fitted: &FittedCase<'_>, i: usize, unit: &'static str) -> LawParameter {
    LawParameter::new(fitted.values()[i], fitted.interval(i), unit)
}

/// Small and large amplitudes, on each side where both are sought.
fn starts(parameters: &[Parameter]) -> Vec<Vec<f64>> {
    let at = |first: f64, second: f64| -> Vec<f64> {
        [first, second].into_iter().take(parameters.len()).collect()
    };
    let mut starts = if parameters.len() > 1 {
        vec![at(1.0, 0.0), at(3.0, 1.0)]
    } else {
        let sd = parameters[0].prior_sd;
        vec![at(0.2 * sd, 0.0), at(0.7 * sd, 0.0)]
    };
    if parameters[0].bounds.0 < 0.0 {
        starts.push(starts[0].iter().map(|x| -x).collect());
    }
    starts
}

/// The law of fitted parameters, in words as well.
fn found(
    covariate: Covariate,
    law: BandLaw,
    bands: Bands,
) -> impl Fn(&[LawParameter]) -> Result<Law, LawError> + Send + Sync {
    move |fitted| {
        let range = (covariate.least_db(), super::MOST_DB);
        let (factor, parameters) = law.factor(bands, fitted, range);
        Ok(covariate.law(&factor, parameters)?.with_words(words(&covariate, law, bands, fitted)))
    }
}

/// What a law says, in a sentence.
fn words(covariate: &Covariate, law: BandLaw, bands: Bands, fitted: &[LawParameter]) -> String {
    let one = match &covariate.surface {
        Some(surface) => format!("Each meeting with {surface}"),
        None if covariate.target == LawTarget::Recorder => "The recording".to_owned(),
        None => "Each path".to_owned(),
    };
    let interval = |p: &LawParameter| format!("[{:.1}, {:.1}]", p.low, p.high);
    let size = |p: &LawParameter| {
        let verb = if p.value < 0.0 { "gains" } else { "loses" };
        format!("{verb} {:.1} dB {}", p.value.abs(), interval(p))
    };
    let (amplitude, slope) = match law {
        BandLaw::Octaves => (String::new(), Some(&fitted[0])),
        BandLaw::SameAndOctaves => (format!("{} at 1 kHz", size(&fitted[0])), Some(&fitted[1])),
        _ => (size(&fitted[0]), None),
    };
    let slope = slope.map_or(String::new(), |p| {
        let and = if amplitude.is_empty() { "loses" } else { ", and" };
        format!("{and} {:.1} dB {} more from octave to octave", p.value, interval(p))
    });
    let place = law.words(bands);
    format!("{one} {amplitude}{slope} where {} is 1, and in proportion elsewhere{place}.", covariate.text())
}

/// An amplitude that goes with the octave.
struct Amplitude {
    /// Share of each parameter in each band, `[parameter][band]`.
    shares: Vec<Vec<f64>>,
    range_db: (f64, f64),
}

impl Amplitude {
    fn db(&self, values: &[f64], band: usize) -> f64 {
        let sum: f64 = self.shares.iter().zip(values).map(|(shares, x)| shares[band] * x).sum();
        sum.clamp(self.range_db.0, self.range_db.1)
    }
}

/// Decibels that are taken from each bin where its covariate is one.
struct OfBins {
    /// `[pair][band][bin]`.
    covariate: Vec<Vec<Vec<f64>>>,
    amplitude: Amplitude,
}

impl DecayTerm for OfBins {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let taken = -LN_PER_DB * self.amplitude.db(values, view.band());
        let covariate = &self.covariate[view.pair][view.band()];
        ln_energy.iter_mut().zip(covariate).for_each(|(l, own)| *l += taken * own);
    }
}

/// A law whose amplitude goes with the octave.
struct OverBands {
    law: TabulatedLaw,
    amplitude: Amplitude,
}

impl DecayTerm for OverBands {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        self.law.prepare(room)
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        Some(self.law.by_hand(bins))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        self.law.apply(self.amplitude.db(values, view.band()), view, ln_energy);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::hand_made;
    use crate::infer::baseline::Baseline;
    use crate::likelihood::decay::EnergyModel;
    use sabine_paths::laws::BoundLaws;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn probabilities_of_all_formulas_sum_to_one() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let grammar = Grammar::of(&survey);
        let sum: f64 = grammar.formulas.iter().map(|f| f.ln_prior.exp()).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        for (i, a) in grammar.formulas.iter().enumerate() {
            let same = |b: &&Formula| (b.covariate, b.bands) == (a.covariate, a.bands);
            assert!(!grammar.formulas[..i].iter().any(|b| same(&b)), "{a:?}");
        }
    }

    /// What is rendered is what was fitted: the formula of each case against what the case does to energies of an octave.
    #[test]
    fn every_formula_renders_the_amplitude_that_was_fitted() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let grammar = Grammar::of(&survey);
        for formula in &grammar.formulas {
            let case = grammar.case(formula, &survey).unwrap();
            let terms = formula.bands.terms(&survey);
            // Those of a course behind its amplitude stay as they are.
            let value =
                |(i, p): (usize, &Parameter)| if i < terms.len() { 0.3 * p.bounds.1 } else { p.neutral };
            let fitted: Vec<f64> = case.parameters.iter().enumerate().map(value).collect();
            let changes = case.model_changes(&FittedCase::of_values(&survey, &fitted));
            let [ModelChange::Law(law)] = changes.as_slice() else { panic!("{changes:?}") };
            let covariate = &grammar.covariates[formula.covariate];
            let variable = |name: &str| match name {
                "scatterings" | "reflections" => Some(2.0),
                other => Some(0.4 + 0.01 * other.len() as f64),
            };
            let unit = covariate.unit_law().unwrap().value(variable).unwrap();
            for (band, hz) in survey.bands().iter_hz().enumerate() {
                let sum: f64 = terms.iter().zip(&fitted).map(|(t, x)| t.shares[band] * x).sum();
                let expected = unit * sum.clamp(covariate.least_db(), crate::effects::unknown_law::MOST_DB);
                let own = |name: &str| if name == "frequency_hz" { Some(hz) } else { variable(name) };
                let found = law.value(own).unwrap();
                assert!(
                    (found - expected).abs() < 1e-3 * expected.abs().max(0.1),
                    "{law:?} {hz} {found} {expected}"
                );
            }
            assert!(law.words().ends_with('.') && case.starts.iter().all(|s| s.len() == fitted.len()));
        }
    }

    /// What is fitted, against energies of all paths under the law that is then rendered.
    #[test]
    fn what_a_fit_of_a_course_does_to_each_bin_is_what_its_law_does_to_the_paths() {
        let baseline = Baseline::of_laboratory(32);
        let (survey, data) = (baseline.survey(), baseline.energy_data());
        let grammar = Grammar::of(survey);
        let used = vec![true; baseline.pairs()];
        let plain = EnergyModel::new(&data, &[], &used);
        let room = baseline.room_view().unwrap();
        let (pair, band) = (1, 3);
        let count = data.ends[pair][band];
        let is_course = |f: &&Formula| grammar.covariates[f.covariate].is_fitted_course();
        let courses: Vec<&Formula> = grammar.formulas.iter().filter(is_course).collect();
        assert_eq!(courses.len(), 44);
        let (releases, waves) = courses.split_at(Release::ALL.len());
        for formula in releases.iter().chain(waves.iter().step_by(7)) {
            let case = grammar.case(formula, survey).unwrap();
            let found: Vec<f64> =
                case.parameters.iter().map(|p| if p.unit == "dB" { 2.0 } else { 1.02 * p.neutral }).collect();
            let cases = [&case];
            let model = EnergyModel::new(&data, &cases, &used);
            let mut values = model.start(None);
            let first = model.first_of(0);
            values[first..first + found.len()].copy_from_slice(&found);
            let before = plain.predicted(&plain.start(None), pair, band, count);
            let after = model.predicted(&values, pair, band, count);
            let changes = case.model_changes(&FittedCase::of_values(survey, &found));
            let [ModelChange::Law(law)] = changes.as_slice() else { panic!("{changes:?}") };
            let bound = BoundLaws::new(std::slice::from_ref(&**law), &room.pair(pair).law_site()).unwrap();
            let paths =
                room.pair(pair).ln_changes(band, &room.pair(pair).energies_under(&bound).unwrap()[band]);
            let mut most = 0.0f64;
            for (bin, expected) in paths.iter().take(count).enumerate() {
                let change = after[bin] - before[bin];
                assert!((change - expected).abs() < 0.02, "{}: {bin}: {change} {expected}", law.words());
                most = most.max(change.abs());
            }
            assert!(most > 0.1, "{most}");
        }
    }

    #[test]
    fn a_case_of_bins_takes_its_amplitude_times_its_number_from_each() {
        let tables = hand_made::Tables::new(Levels::Absolute, TimeZero::Emission);
        let baseline = tables.baseline(DiagnoseConfig::default());
        let (data, survey, used) = (baseline.energy_data(), baseline.survey(), [true; 3]);
        let grammar = Grammar::of(survey);
        let from_second =
            |f: &&Formula| f.bands == BandLaw::Above(1) && grammar.covariates[f.covariate].both_signs;
        let formula = grammar.formulas.iter().find(from_second).unwrap();
        let number = |pair: usize, band: usize, bin: usize| (0.3 * (7 * pair + 3 * band + bin) as f64).sin();
        let of_band = |pair: usize, band: usize| {
            (0..data.ends[pair][band]).map(|bin| number(pair, band, bin)).collect()
        };
        let numbers = (0..3).map(|pair| (0..2).map(|band| of_band(pair, band)).collect()).collect();
        let case = grammar.case_of_bins(formula, survey, numbers);
        let (cases, plain) = ([&case], EnergyModel::new(&data, &[], &used));
        let model = EnergyModel::new(&data, &cases, &used);
        let mut values = model.start(None);
        values[model.first_of(0)] = 2.0;
        for (pair, band) in [(0, 0), (2, 1)] {
            let count = data.ends[pair][band];
            let before = plain.predicted(&plain.start(None), pair, band, count);
            let after = model.predicted(&values, pair, band, count);
            for (bin, (before, after)) in before.iter().zip(after).enumerate() {
                let taken = if band == 1 { 2.0 * number(pair, band, bin) } else { 0.0 };
                let found = (before - after) / LN_PER_DB;
                assert!((found - taken).abs() < 1e-9, "{pair} {band} {bin}: {found} {taken}");
            }
        }
    }
}
