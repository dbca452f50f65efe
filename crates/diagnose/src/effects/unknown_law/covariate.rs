//! What a law may go with.

use crate::survey::Survey;
use sabine_paths::laws::{Law, LawError, LawParameter, LawTarget};

/// A pure number by name, and lengths and times in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Form {
    pub name: &'static str,
    pub text: &'static str,
    scales: &'static [(&'static str, f64, &'static str)],
}

const fn form(name: &'static str, text: &'static str) -> Form {
    Form { name, text, scales: &[] }
}

/// What reflections from one surface may go with beside its absorption, which is refitted anyway.
pub(crate) const OF_REFLECTIONS: [Form; 3] = [
    form("grazing", "(1 - cos_incidence)^2"),
    form("normal", "cos_incidence^2"),
    form("near_grazing", "exp(-5 * cos_incidence)"),
];
/// What paths may go with.
pub(crate) const OF_PATHS: [Form; 13] = [
    Form { name: "length", text: "length_m / l", scales: &[("l", 100.0, "m")] },
    Form { name: "root_length", text: "sqrt(length_m / l)", scales: &[("l", 100.0, "m")] },
    Form { name: "short", text: "exp(-length_m / s)", scales: &[("s", 10.0, "m")] },
    form("scattered", "scatterings / (1 + reflections)"),
    form("departure_x", "cos(departure_azimuth_deg)"),
    form("departure_y", "sin(departure_azimuth_deg)"),
    form("departure_up", "sin(departure_elevation_deg)"),
    form("departure_steep", "sin(departure_elevation_deg)^2"),
    form("arrival_x", "cos(arrival_azimuth_deg)"),
    form("arrival_y", "sin(arrival_azimuth_deg)"),
    form("arrival_up", "sin(arrival_elevation_deg)"),
    form("arrival_steep", "sin(arrival_elevation_deg)^2"),
    Form { name: "near", text: "exp(-distance_m / d)", scales: &[("d", 1.0, "m")] },
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
    Form { name: "drift", text: "file_time_s / t", scales: &[("t", 0.5, "s")] },
    Form { name: "early", text: "exp(-time_after_direct_s / t)", scales: &[("t", 0.05, "s")] },
];
/// Shares of the probability beforehand: reflections, single quantities of paths, products of two, recordings.
const SHARES: [f64; 4] = [0.4, 0.3, 0.1, 0.2];

/// A quantity that a law goes with: one form, or the product of two.
#[derive(Clone, Debug)]
pub(crate) struct Covariate {
    pub target: LawTarget,
    pub surface: Option<String>,
    pub forms: Vec<Form>,
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
            both_signs: false,
            share: of_reflections,
        })
    };
    let plain = |target: LawTarget, forms: Vec<Form>, share: f64| Covariate {
        target,
        surface: None,
        forms,
        both_signs: true,
        share,
    };
    let mut all: Vec<Covariate> = materials.iter().flat_map(of_surface).collect();
    all.extend(OF_PATHS.iter().map(|f| plain(LawTarget::Path, vec![*f], each(1, OF_PATHS.len()))));
    let product = |&(a, b): &(usize, usize)| {
        plain(LawTarget::Path, vec![OF_PATHS[a], OF_PATHS[b]], each(2, PRODUCTS.len()))
    };
    all.extend(PRODUCTS.iter().map(product));
    all.extend(
        OF_RECORDINGS.iter().map(|f| plain(LawTarget::Recorder, vec![*f], each(3, OF_RECORDINGS.len()))),
    );
    all
}

impl Covariate {
    /// As it stands in a formula.
    pub fn text(&self) -> String {
        self.forms.iter().map(|form| form.text).collect::<Vec<_>>().join(" * ")
    }

    /// Whether it asks where paths go or come from.
    pub fn has_direction(&self) -> bool {
        let ends = ["departure", "arrival"];
        self.forms.iter().any(|form| ends.iter().any(|end| form.name.starts_with(end)))
    }

    /// Least amplitude that is sought, in dB.
    pub fn least_db(&self) -> f64 {
        if self.both_signs { -super::MOST_DB } else { 0.0 }
    }

    /// A law with this covariate: a factor before it, and parameters beside its own.
    pub fn law(&self, factor: &str, parameters: Vec<(&str, LawParameter)>) -> Result<Law, LawError> {
        let scales = self.forms.iter().flat_map(|form| form.scales);
        let own = scales.map(|&(name, value, unit)| (name, LawParameter::new(value, [value; 2], unit)));
        let formula = format!("{factor} * {}", self.text());
        let surface = self.surface.as_deref();
        let letters = surface.unwrap_or_default().chars().filter(char::is_ascii_alphanumeric).take(40);
        let name = self.forms.iter().map(|form| form.name).collect::<Vec<_>>().join("_");
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
        format!("{what} with {}", self.text())
    }
}
