//! A case as the fit left it.

use crate::effect::Nuisance;
use crate::found_parameter::FoundParameter;
use crate::survey::Survey;
use sabine_acoustics::Material;

/// What [`Case::model_changes`](crate::Case::model_changes) is given: fitted values, and what levels and changes refer to.
#[derive(Clone)]
pub struct FittedCase<'a> {
    pub(crate) survey: &'a Survey,
    pub(crate) values: &'a [f64],
    pub(crate) intervals: Vec<[f64; 2]>,
    pub(crate) relaxed: Vec<(Nuisance, Vec<f64>)>,
    pub(crate) auxiliary: Vec<FoundParameter>,
    pub(crate) level_per_s: Vec<f64>,
    pub(crate) materials: &'a [Material],
    pub(crate) confirmed: Vec<usize>,
    pub(crate) levels_db: Vec<Vec<f64>>,
}

impl<'a> FittedCase<'a> {
    /// Values alone: enough for changes that depend on nothing else.
    pub(crate) fn of_values(survey: &'a Survey, values: &'a [f64]) -> Self {
        Self {
            survey,
            values,
            intervals: Vec::new(),
            relaxed: Vec::new(),
            auxiliary: Vec::new(),
            level_per_s: Vec::new(),
            materials: &[],
            confirmed: Vec::new(),
            levels_db: Vec::new(),
        }
    }

    /// The survey.
    pub fn survey(&self) -> &Survey {
        self.survey
    }

    /// Fitted values of the case's parameters, in their order; empty for a case that is not fitted.
    pub fn values(&self) -> &[f64] {
        self.values
    }

    /// The 90 % interval of a parameter (by its place), no wider than its range; the value alone where nothing is known of its uncertainty.
    pub fn interval(&self, parameter: usize) -> [f64; 2] {
        self.intervals.get(parameter).copied().unwrap_or([self.values[parameter]; 2])
    }

    /// Fitted values of a nuisance whose prior the case relaxes: one by band for absorption, three for a position (offset in metres), one
    /// for a gain (dB).
    pub fn relaxed(&self, nuisance: Nuisance) -> Option<&[f64]> {
        self.relaxed.iter().find(|(n, _)| *n == nuisance).map(|(_, values)| values.as_slice())
    }

    /// A parameter by name that single reflections, or what comes before the direct sound, gave.
    pub fn found(&self, name: &str) -> Option<f64> {
        self.auxiliary.iter().find(|p| p.name == name).map(|p| p.value)
    }

    /// Energy per second of a typical early bin of a band, relative to that of the direct sound at 1 m: what levels of added sound refer to.
    pub fn level_per_s(&self, band: usize) -> Option<f64> {
        self.level_per_s.get(band).copied()
    }

    /// Materials as the room file states them, in the order of [`Survey::materials`].
    pub fn materials(&self) -> &[Material] {
        self.materials
    }

    /// Responses (indices) in which a peak was measured where the case adds a reflection.
    pub fn confirmed_responses(&self) -> &[usize] {
        &self.confirmed
    }

    /// Level of a response (index) in a band that every fit leaves open and this one found, in dB beside the prediction; zero where it was
    /// not fitted.
    pub fn level_db(&self, response: usize, band: usize) -> f64 {
        self.levels_db.get(response).and_then(|bands| bands.get(band)).copied().unwrap_or(0.0)
    }

    /// One value for each band.
    pub fn per_band(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..self.survey.bands().len()).map(value).collect()
    }
}
