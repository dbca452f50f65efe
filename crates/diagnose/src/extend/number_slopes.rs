//! How the numbers of a model follow what its fit leaves open: from the covariance of fitted parameters to that of the model.

use crate::effect::{Case, FittedCase};
use crate::extend::uncertainty::Uncertainty;
use nalgebra::DMatrix;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A parameter is moved by so many of its standard deviations to either side to see what follows it: numbers that follow it by a power of
/// ten, as noise in dB does, get the slope over the width that counts.
const STEP_SD: f64 = 0.5;

/// What a fit leaves open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Origin {
    /// A parameter of the decays, by its place.
    Decays(usize),
    /// One of the arrival times.
    Arrivals(usize),
    /// One by itself: the cause (its place in the model), which of its parameters, and the variance.
    Alone(usize, usize, f64),
}

/// A part of a fitted case, with its standard deviation.
#[derive(Clone, Copy)]
pub(super) struct Input {
    pub kind: InputKind,
    pub origin: Origin,
    pub sd: f64,
}

/// Which part: a parameter, a coordinate of a nuisance, a parameter that single reflections gave.
#[derive(Clone, Copy)]
pub(super) enum InputKind {
    Value(usize),
    Relaxed(usize, usize),
    Auxiliary(usize),
}

/// Numbers of a model, by their JSON pointers, and their slopes.
#[derive(Default)]
pub(super) struct NumberSlopes {
    places: BTreeMap<String, usize>,
    origins: Vec<Origin>,
    slopes: Vec<(usize, usize, f64)>,
}

impl NumberSlopes {
    /// A number that follows an origin.
    pub fn add(&mut self, place: String, origin: Origin, slope: f64) {
        let next = self.places.len();
        let number = *self.places.entry(place).or_insert(next);
        let known = self.origins.iter().position(|other| *other == origin);
        let column = known.unwrap_or_else(|| {
            self.origins.push(origin);
            self.origins.len() - 1
        });
        self.slopes.push((number, column, slope));
    }

    /// The numbers in the changes of a case that follow what its fit leaves open; `cause` is its place in the model.
    pub fn add_case(&mut self, cause: usize, case: &Case, fitted: &FittedCase<'_>, inputs: &[Input]) {
        for input in inputs.iter().filter(|input| input.sd > 0.0) {
            let at = |steps: f64| {
                numbers_in(&json!(case.model_changes_at(fitted, input.kind, steps * STEP_SD * input.sd)))
            };
            let (below, above) = (at(-1.0), at(1.0));
            // Changes of another form, or fewer of them: no slope says how one becomes the other.
            if !below.keys().eq(above.keys()) {
                continue;
            }
            for ((place, low), high) in below.into_iter().zip(above.values()) {
                let slope = (high - low) / (2.0 * STEP_SD * input.sd);
                if slope != 0.0 {
                    self.add(format!("/causes/{cause}/changes{place}"), input.origin, slope);
                }
            }
        }
    }

    /// The covariance of the numbers, given that of the parameters of decays and of arrival times, which are fitted apart.
    pub fn uncertainty(self, decays: &DMatrix<f64>, arrivals: &DMatrix<f64>) -> Option<Uncertainty> {
        let between = |a: &Origin, b: &Origin| match (a, b) {
            (Origin::Decays(a), Origin::Decays(b)) => decays[(*a, *b)],
            (Origin::Arrivals(a), Origin::Arrivals(b)) => arrivals[(*a, *b)],
            (Origin::Alone(.., variance), _) if a == b => *variance,
            _ => 0.0,
        };
        let n = self.origins.len();
        let of_origins = DMatrix::from_fn(n, n, |a, b| between(&self.origins[a], &self.origins[b]));
        let mut slopes = DMatrix::<f64>::zeros(self.places.len(), n);
        for (number, column, slope) in self.slopes {
            slopes[(number, column)] += slope;
        }
        let covariance = &slopes * of_origins * slopes.transpose();
        let mut places: Vec<(usize, String)> = self.places.into_iter().map(|(place, i)| (i, place)).collect();
        places.sort_unstable();
        Uncertainty::new(places.into_iter().map(|(_, place)| place).collect(), &covariance)
    }
}

impl Case {
    /// Its changes with one part of the fit moved by so much.
    fn model_changes_at(&self, fitted: &FittedCase<'_>, kind: InputKind, by: f64) -> Vec<crate::ModelChange> {
        let mut values = fitted.values.to_vec();
        let mut moved = fitted.clone();
        match kind {
            InputKind::Value(i) => values[i] += by,
            InputKind::Relaxed(which, i) => moved.relaxed[which].1[i] += by,
            InputKind::Auxiliary(i) => moved.auxiliary[i].value += by,
        }
        self.model_changes(&FittedCase { values: &values, ..moved })
    }
}

/// All numbers of a document by their JSON pointers.
fn numbers_in(document: &Value) -> BTreeMap<String, f64> {
    fn walk(at: &str, value: &Value, found: &mut BTreeMap<String, f64>) {
        match value {
            Value::Array(all) => {
                all.iter().enumerate().for_each(|(i, one)| walk(&format!("{at}/{i}"), one, found));
            }
            Value::Object(all) => {
                let place = |name: &str| format!("{at}/{}", super::uncertainty::escaped(name));
                all.iter().for_each(|(name, one)| walk(&place(name), one, found));
            }
            other => {
                found.extend(other.as_f64().map(|number| (at.to_owned(), number)));
            }
        }
    }
    let mut found = BTreeMap::new();
    walk("", document, &mut found);
    found
}
