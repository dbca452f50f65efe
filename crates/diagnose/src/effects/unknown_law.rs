//! `unknown_law`: a cause that no catalogue lists, by what it goes with.

use super::law_effect::tabulated_law::TabulatedLaw;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, EffectInfo, FittedCase, Parameter, Stage};
use crate::extend::model_change::ModelChange;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use sabine_paths::laws::{Law, LawError, LawParameter, LawTarget};

/// Greatest amplitude that is sought, in dB.
const MOST_DB: f64 = 10.0;
/// Standard deviation of the prior of the amplitude, in dB: 90 % lie within [`MOST_DB`].
const PRIOR_DB: f64 = 6.0;
/// The same of its change from octave to octave, and its bounds.
const PER_OCTAVE_DB: (f64, f64) = (1.5, 4.0);
/// Frequency at which the amplitude is stated.
const AT_HZ: f64 = 1000.0;

/// What a law may go with.
struct Covariate {
    target: LawTarget,
    surface: Option<String>,
    form: Form,
    /// Whether it may add as well as take: not where paths meet it a hundred times.
    both_signs: bool,
}

/// A pure number by name, and lengths and times in it.
type Form = (&'static str, &'static str, &'static [(&'static str, f64, &'static str)]);

/// What reflections from one surface may go with beside its absorption, which is refitted anyway.
const OF_REFLECTIONS: [Form; 2] =
    [("grazing", "(1 - cos_incidence)^2", &[]), ("normal", "cos_incidence^2", &[])];
/// What paths may go with.
const OF_PATHS: [Form; 11] = [
    ("length", "length_m / l", &[("l", 100.0, "m")]),
    ("scattered", "scatterings / (1 + reflections)", &[]),
    ("departure_x", "cos(departure_azimuth_deg)", &[]),
    ("departure_y", "sin(departure_azimuth_deg)", &[]),
    ("departure_up", "sin(departure_elevation_deg)", &[]),
    ("departure_steep", "sin(departure_elevation_deg)^2", &[]),
    ("arrival_x", "cos(arrival_azimuth_deg)", &[]),
    ("arrival_y", "sin(arrival_azimuth_deg)", &[]),
    ("arrival_up", "sin(arrival_elevation_deg)", &[]),
    ("arrival_steep", "sin(arrival_elevation_deg)^2", &[]),
    ("near", "exp(-distance_m / l)", &[("l", 1.0, "m")]),
];
/// What a recording may go with.
const OF_RECORDINGS: [Form; 2] = [
    ("drift", "file_time_s / t", &[("t", 0.5, "s")]),
    ("early", "exp(-time_after_direct_s / t)", &[("t", 0.05, "s")]),
];

/// A law of one term that the data choose: each case is one covariate, with an amplitude in dB that goes up or down evenly from octave to
/// octave. Covariates are the angle at each surface, length and share of scattering of paths, where they leave the source and reach the
/// receiver, distance, and time.
///
/// Mark: none of the catalogue explains what is left, and it goes with one of these. Mimicked by: every cause of the catalogue that goes with
/// the same; an effect with many cases pays for their number, so that a listed cause wins where both explain as much. What is found says
/// what the misfit goes with, not why: other forms that rise and fall with the covariate would do as well.
///
/// Not part of [`catalogue`](crate::catalogue): [`Diagnoser::discovering`](crate::Diagnoser::discovering) adds it.
///
/// Source: short forms enumerated in place of a random search, D. J. Bartlett, H. Desmond, P. G. Ferreira: Exhaustive symbolic regression,
/// 2022; the score is that of all effects.
#[derive(Clone, Copy, Debug, Default)]
pub struct UnknownLaw;

impl Effect for UnknownLaw {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "unknown_law",
            "A law that no catalogue lists",
            "What the simulation gets wrong goes with the quantity that is named; the amplitude says how much is taken where that quantity is 1.",
        )
        .decided_by(20, NextMeasurement::MorePositionsAndSource)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        covariates(survey).iter().filter_map(|covariate| covariate.case().ok()).collect()
    }
}

fn covariates(survey: &Survey) -> Vec<Covariate> {
    let of_surface = |name: &String| {
        let surface = Some(name.clone());
        let target = LawTarget::Reflection;
        OF_REFLECTIONS.map(|form| Covariate { target, surface: surface.clone(), form, both_signs: false })
    };
    let plain = |target: LawTarget| {
        move |form: &Form| Covariate { target, surface: None, form: *form, both_signs: true }
    };
    let mut all: Vec<Covariate> = survey.materials().iter().flat_map(of_surface).collect();
    all.extend(OF_PATHS.iter().map(plain(LawTarget::Path)));
    all.extend(OF_RECORDINGS.iter().map(plain(LawTarget::Recorder)));
    all
}

impl Covariate {
    /// A law with this covariate: a formula before it, and parameters beside its own.
    fn law(&self, factor: &str, parameters: Vec<(&str, LawParameter)>) -> Result<Law, LawError> {
        let (name, covariate, scales) = self.form;
        let own =
            scales.iter().map(|&(name, value, unit)| (name, LawParameter::new(value, [value; 2], unit)));
        let formula = format!("{factor} * {covariate}");
        let surface = self.surface.as_deref();
        let letters = surface.unwrap_or_default().chars().filter(char::is_ascii_alphanumeric).take(40);
        let id: String = name.chars().chain(surface.map(|_| '_')).chain(letters).collect();
        Law::new(id, self.target, surface, &formula, parameters.into_iter().chain(own))
    }

    fn case(&self) -> Result<Case, LawError> {
        let least = self.least_db();
        let law = self.law("-a", vec![("a", LawParameter::new(0.0, [least, MOST_DB], "dB"))])?;
        let index = law.parameters().position(|(name, _)| name == "a").unwrap_or(0);
        let term = OverBands { law: TabulatedLaw::new(law, index, (least, MOST_DB)) };
        let (sd, most) = PER_OCTAVE_DB;
        let parameters = vec![
            Parameter::new("amplitude_1_khz", "dB", 0.0, PRIOR_DB, (least, MOST_DB)).typically(0.3 * MOST_DB),
            Parameter::new("amplitude_per_octave", "dB", 0.0, sd, (-most, most)).typically(0.3 * sd),
        ];
        let mut starts = vec![vec![1.0, 0.0], vec![3.0, 1.0]];
        if self.both_signs {
            starts.push(vec![-1.0, 0.0]);
        }
        let found = self.found();
        let subject = match &self.surface {
            Some(surface) => format!("reflections from {surface} go with {}", self.form.1),
            None => format!("{} goes with {}", self.of_what(), self.form.1),
        };
        let stage = if self.target == LawTarget::Recorder { Stage::Recorder } else { Stage::Room };
        let changes = move |fitted: &FittedCase<'_>| {
            let parameter = |i: usize| {
                let (value, [low, high]) = (fitted.values()[i], fitted.interval(i));
                LawParameter::new(value, [low, high], "dB")
            };
            let law = found(parameter(0), parameter(1));
            law.map_or_else(|_| Vec::new(), |law| vec![ModelChange::Law(Box::new(law))])
        };
        Ok(Case::decay(parameters, term).about(subject).at(stage).starting(starts).changing(changes))
    }

    /// Least amplitude that is sought.
    fn least_db(&self) -> f64 {
        if self.both_signs { -MOST_DB } else { 0.0 }
    }

    fn of_what(&self) -> &'static str {
        if self.target == LawTarget::Recorder { "what is recorded" } else { "the level of paths" }
    }

    /// The law with amplitudes at 1 kHz and per octave.
    fn found(&self) -> impl Fn(LawParameter, LawParameter) -> Result<Law, LawError> + Send + Sync + use<> {
        let own = Self { surface: self.surface.clone(), ..*self };
        move |at_1_khz, per_octave| {
            let amplitude = "a + b * ln(frequency_hz / f) / 0.6931471805599453";
            // As far as amplitudes are sought, so that what renders is what was fitted.
            let factor = format!("-min(max({amplitude}, low), high)");
            let known = |value: f64, unit: &str| LawParameter::new(value, [value; 2], unit);
            let (low, high) = (known(own.least_db(), "dB"), known(MOST_DB, "dB"));
            let parameters = vec![
                ("a", at_1_khz),
                ("b", per_octave),
                ("f", known(AT_HZ, "Hz")),
                ("low", low),
                ("high", high),
            ];
            own.law(&factor, parameters)
        }
    }
}

/// A law whose amplitude changes evenly from octave to octave.
struct OverBands {
    law: TabulatedLaw,
}

impl OverBands {
    fn amplitude_db(&self, values: &[f64], view: &BandView<'_>) -> f64 {
        let (least, most) = self.law.range();
        (values[0] + values[1] * view.survey().octaves_from_1khz(view.band())).clamp(least, most)
    }
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
        self.law.apply(self.amplitude_db(values, view), view, ln_energy);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn every_covariate_is_a_case_whose_law_takes_what_was_fitted() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let cases = UnknownLaw.cases(&survey);
        assert_eq!(cases.len(), 2 * survey.materials().len() + OF_PATHS.len() + OF_RECORDINGS.len());
        // Carpet at grazing incidence: 4 dB at 1 kHz and 3 dB more each octave, up to 10 dB, nothing below zero.
        let changes = cases[0].model_changes(&FittedCase::of_values(&survey, &[4.0, 3.0]));
        let [ModelChange::Law(law)] = changes.as_slice() else { panic!("{changes:?}") };
        for (hz, taken_db) in [(1000.0, 4.0), (2000.0, 7.0), (16_000.0, 10.0), (250.0, 0.0)] {
            let at = |name: &str| Some(if name == "frequency_hz" { hz } else { 0.0 });
            let found = law.value(at).expect("a value");
            assert!((found + taken_db).abs() < 1e-9, "{hz}: {found}");
        }
        assert_eq!((law.id(), law.surface()), ("grazing_carpet", Some("carpet")));
    }
}
