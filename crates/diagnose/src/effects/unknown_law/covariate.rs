//! What a law may go with.

use super::release::Release;
use super::wave::{WAVE, Wave};
use crate::survey::{LEAST_RECORDINGS, Survey};
use sabine_paths::laws::{Law, LawError, LawParameter, LawTarget};
use sabine_scene::Levels;

/// A number in a covariate: name, value and unit.
pub(super) type Scale = (&'static str, f64, &'static str);

/// A pure number by name, and lengths and times in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Form {
    pub name: &'static str,
    pub text: &'static str,
    scales: &'static [Scale],
    /// What the text does not tell by itself.
    meaning: &'static str,
}

pub(super) const fn form(name: &'static str, text: &'static str) -> Form {
    scaled(name, text, &[])
}

pub(super) const fn scaled(name: &'static str, text: &'static str, scales: &'static [Scale]) -> Form {
    Form { name, text, scales, meaning: "" }
}

/// What reflections from one surface may go with beside its absorption, which is refitted anyway.
pub(crate) const OF_REFLECTIONS: [Form; 3] = [
    form("grazing", "(1 - cos_incidence)^2"),
    form("normal", "cos_incidence^2"),
    form("near_grazing", "exp(-5 * cos_incidence)"),
];
/// What paths may go with.
pub(crate) const OF_PATHS: [Form; 13] = [
    scaled("length", "length_m / l", &[("l", 100.0, "m")]),
    scaled("root_length", "sqrt(length_m / l)", &[("l", 100.0, "m")]),
    scaled("short", "exp(-length_m / s)", &[("s", 10.0, "m")]),
    form("scattered", "scatterings / (1 + reflections)"),
    form("departure_x", "cos(departure_azimuth_deg)"),
    form("departure_y", "sin(departure_azimuth_deg)"),
    form("departure_up", "sin(departure_elevation_deg)"),
    form("departure_steep", "sin(departure_elevation_deg)^2"),
    form("arrival_x", "cos(arrival_azimuth_deg)"),
    form("arrival_y", "sin(arrival_azimuth_deg)"),
    form("arrival_up", "sin(arrival_elevation_deg)"),
    form("arrival_steep", "sin(arrival_elevation_deg)^2"),
    scaled("near", "exp(-distance_m / d)", &[("d", 1.0, "m")]),
];
/// Products of two of them, by their places: what grows along the way with where it goes and comes from, and both ends together.
const PRODUCTS: [(usize, usize); 18] = [
    (0, 3),
    (0, 4),
    (0, 5),
    (0, 6),
    (0, 7),
    (0, 8),
    (0, 9),
    (0, 10),
    (0, 11),
    (2, 4),
    (2, 5),
    (2, 6),
    (2, 8),
    (2, 9),
    (2, 10),
    (4, 8),
    (5, 9),
    (6, 10),
];
/// What a recording may go with.
pub(crate) const OF_RECORDINGS: [Form; 2] = [
    scaled("drift", "file_time_s / t", &[("t", 0.5, "s")]),
    scaled("early", "exp(-time_after_direct_s / t)", &[("t", 0.05, "s")]),
];
/// The same where the order of the recordings is stated: `r0` is the first, `r` what lies between it and the last.
pub(crate) const OF_ORDER: [Form; 2] = [
    Form {
        name: "order",
        text: "(recording_order - r0) / r",
        scales: &[],
        meaning: ", 0 in the first recording and 1 in the last",
    },
    Form {
        name: "warming",
        text: "(1 - exp(-5 * (recording_order - r0) / r))",
        scales: &[],
        meaning: ", 0 in the first recording and nearly 1 from the middle on",
    },
];
/// Shares of the probability beforehand: reflections, single quantities of paths, products of two, recordings.
const SHARES: [f64; 4] = [0.4, 0.3, 0.1, 0.2];

/// A quantity that a law goes with: one form, or the product of two.
#[derive(Clone, Debug)]
pub(crate) struct Covariate {
    pub target: LawTarget,
    pub surface: Option<String>,
    pub forms: Vec<Form>,
    /// Numbers in it that are those of the room.
    scales: Vec<Scale>,
    /// What it is as a course along the recording, if it is one.
    pub wave: Option<Wave>,
    /// The same, if the course is one of a gain that comes up again.
    pub release: Option<Release>,
    /// Whether it may add as well as take: not where paths meet it a hundred times.
    pub both_signs: bool,
    /// Its share of the probability beforehand; the shares of all sum to one.
    pub share: f64,
}

/// All covariates in a room.
pub(crate) fn covariates(survey: &Survey) -> Vec<Covariate> {
    let materials = survey.materials();
    let whole: f64 = SHARES.iter().sum::<f64>() - if materials.is_empty() { SHARES[0] } else { 0.0 };
    let each = |kind: usize, count: usize| SHARES[kind] / whole / count as f64;
    let of_reflections = each(0, (OF_REFLECTIONS.len() * materials.len()).max(1));
    let of_surface = |name: &String| {
        let surface = Some(name.clone());
        OF_REFLECTIONS.map(|form| Covariate {
            target: LawTarget::Reflection,
            surface: surface.clone(),
            forms: vec![form],
            scales: Vec::new(),
            wave: None,
            release: None,
            both_signs: false,
            share: of_reflections,
        })
    };
    let plain = |target: LawTarget, forms: Vec<Form>, share: f64| Covariate {
        target,
        surface: None,
        forms,
        scales: Vec::new(),
        wave: None,
        release: None,
        both_signs: true,
        share,
    };
    let mut all: Vec<Covariate> = materials.iter().flat_map(of_surface).collect();
    all.extend(OF_PATHS.iter().map(|f| plain(LawTarget::Path, vec![*f], each(1, OF_PATHS.len()))));
    let product = |&(a, b): &(usize, usize)| {
        plain(LawTarget::Path, vec![OF_PATHS[a], OF_PATHS[b]], each(2, PRODUCTS.len()))
    };
    all.extend(PRODUCTS.iter().map(product));
    let order = order_of_recordings(survey);
    let of_order = if order.is_some() { &OF_ORDER[..] } else { &[] };
    let waves = Wave::all(survey);
    let share = each(3, OF_RECORDINGS.len() + 1 + of_order.len() + usize::from(!waves.is_empty()));
    all.extend(OF_RECORDINGS.iter().map(|f| plain(LawTarget::Recorder, vec![*f], share)));
    all.extend(Release::ALL.map(|release| Covariate {
        release: Some(release),
        ..plain(LawTarget::Recorder, vec![release.form()], share / Release::ALL.len() as f64)
    }));
    let scales = order.map_or_else(Vec::new, Vec::from);
    all.extend(of_order.iter().map(|f| {
        let of_recordings = plain(LawTarget::Recorder, vec![*f], share);
        Covariate { scales: scales.clone(), ..of_recordings }
    }));
    all.extend(waves.iter().map(|wave| Covariate {
        scales: wave.scales().to_vec(),
        wave: Some(*wave),
        ..plain(LawTarget::Recorder, vec![WAVE], share / waves.len() as f64)
    }));
    all
}

/// The first of the recordings and what lies between it and the last, where the order of all is stated and levels mean something.
fn order_of_recordings(survey: &Survey) -> Option<[Scale; 2]> {
    let times: Vec<f64> = survey.responses().iter().map(|r| r.recorded_at).collect::<Option<_>>()?;
    let first = times.iter().copied().fold(f64::INFINITY, f64::min);
    let span = times.iter().copied().fold(f64::NEG_INFINITY, f64::max) - first;
    let told = times.len() >= LEAST_RECORDINGS && survey.measurement().levels != Levels::PerResponse;
    (told && span > 0.0).then_some([("r0", first, "1"), ("r", span, "1")])
}

impl Covariate {
    /// As it stands in a formula.
    pub fn text(&self) -> String {
        self.forms.iter().map(|form| form.text).collect::<Vec<_>>().join(" * ")
    }

    /// The same of one form alone.
    pub fn of_form(&self, form: Form) -> Self {
        Self { forms: vec![form], ..self.clone() }
    }

    /// Whether it is a course of the recorder's gain whose own numbers are fitted.
    pub fn is_fitted_course(&self) -> bool {
        self.wave.is_some() || self.release.is_some()
    }

    /// Whether it asks where paths go or come from.
    pub fn has_direction(&self) -> bool {
        let ends = ["departure", "arrival"];
        self.forms.iter().any(|form| ends.iter().any(|end| form.name.starts_with(end)))
    }

    /// Least amplitude that is sought, in dB.
    pub fn least_db(&self) -> f64 {
        if self.both_signs { -super::MOST_ADDED_DB } else { 0.0 }
    }

    /// A law with this covariate: a factor before it, and parameters beside its own.
    pub fn law(&self, factor: &str, parameters: Vec<(&str, LawParameter)>) -> Result<Law, LawError> {
        let scales = self.forms.iter().flat_map(|form| form.scales).chain(&self.scales);
        let own = scales.map(|&(name, value, unit)| (name, LawParameter::new(value, [value; 2], unit)));
        let formula = format!("{factor} * {}", self.text());
        let surface = self.surface.as_deref();
        let letters = surface.unwrap_or_default().chars().filter(char::is_ascii_alphanumeric).take(40);
        let mut name = self.forms.iter().map(|form| form.name).collect::<Vec<_>>().join("_");
        name.extend(self.wave.map(Wave::id));
        let id: String = name.chars().chain(surface.map(|_| '_')).chain(letters).collect();
        Law::new(id, self.target, surface, &formula, parameters.into_iter().chain(own))
    }

    /// The law that takes 1 dB where the covariate is 1: parameter `a`, the first.
    pub fn unit_law(&self) -> Result<Law, LawError> {
        self.law("-a", vec![("a", LawParameter::new(1.0, [self.least_db(), super::MOST_DB], "dB"))])
    }

    /// What goes with it, in words.
    pub fn words(&self) -> String {
        let what = match &self.surface {
            Some(surface) => format!("reflections from {surface} go"),
            None if self.target == LawTarget::Recorder => "what is recorded goes".to_owned(),
            None => "the level of paths goes".to_owned(),
        };
        let mut meaning: String = self.forms.iter().map(|form| form.meaning).collect();
        meaning.extend(self.wave.map(|wave| {
            let [shortest, longest] = wave.periods_s();
            format!(", a period of {shortest:.2} to {longest:.2} s")
        }));
        meaning.extend(self.release.map(|release| {
            let [shortest, longest] = release.times_s();
            format!(", a time constant of {shortest:.2} to {longest:.2} s")
        }));
        format!("{what} with {}{meaning}", self.text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made;
    use sabine_scene::{Measurement, TimeZero};

    /// Recordings at 100, 101 ... of three receivers, twice.
    fn in_order() -> Survey {
        let mut survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        survey.responses = [survey.responses.clone(), survey.responses.clone()].concat();
        for (i, response) in survey.responses.iter_mut().enumerate() {
            response.recorded_at = Some(100.0 + i as f64);
        }
        survey
    }

    #[test]
    fn the_order_of_recordings_counts_from_the_first_to_the_last() {
        let all = covariates(&in_order());
        let of_order: Vec<&Covariate> = all.iter().filter(|c| c.text().contains("recording_order")).collect();
        assert_eq!(of_order.len(), 2);
        for own in of_order {
            let taken = |at: f64| {
                own.unit_law().expect("a law").value(|name| (name == "recording_order").then_some(at))
            };
            assert!(taken(100.0).is_ok_and(|db| db.abs() < 1e-12), "{own:?}");
            assert!(taken(105.0).is_ok_and(|db| (db + 1.0).abs() < 0.01), "{own:?}");
            assert!(own.words().ends_with("from the middle on") || own.words().ends_with("1 in the last"));
        }
        assert!((all.iter().map(|c| c.share).sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn an_order_that_says_nothing_is_no_covariate() {
        let none = |survey: &Survey| covariates(survey).iter().all(|c| !c.text().contains("recording_order"));
        let (mut unordered, mut at_once, mut free) = (in_order(), in_order(), in_order());
        unordered.responses[2].recorded_at = None;
        at_once.responses.iter_mut().for_each(|r| r.recorded_at = Some(7.0));
        free.measurement = Measurement { time_zero: TimeZero::Emission, levels: Levels::PerResponse };
        let mut few = in_order();
        few.responses.truncate(5);
        assert!(none(&unordered) && none(&at_once) && none(&free) && none(&few));
    }
}
