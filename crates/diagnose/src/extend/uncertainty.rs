//! How sure the numbers of a model are, all together.

use crate::extend::model_checks::Fault;
use crate::found_parameter::HALF_90;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Error as Cause, OutOfRange};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Most numbers of a model whose covariance is read: 4000 x 4000 / 2 values are 64 MB.
const MOST_NUMBERS: usize = 4000;
/// So many draws in a row that are no model end the drawing.
const MOST_REFUSED: usize = 200;
/// Digits that are kept of a covariance, behind the first.
const DIGITS: usize = 5;

/// The covariance of the numbers of a model, as its fit left it (Laplace: a normal distribution about the most probable values).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Uncertainty {
    /// Where each number stands in the model, as a JSON pointer (RFC 6901): `/absorption/carpet/0`, `/causes/0/changes/0/latency_s`.
    pub numbers: Vec<String>,
    /// Their covariance: the rows of its lower triangle, the first with one value; units as the numbers have them.
    pub covariance: Vec<Vec<f64>>,
}

impl Uncertainty {
    /// Of numbers at these places; none are kept that nothing is known to change.
    pub(crate) fn new(numbers: Vec<String>, covariance: &DMatrix<f64>) -> Option<Self> {
        let free: Vec<usize> = (0..numbers.len()).filter(|&i| covariance[(i, i)] > 0.0).collect();
        let row =
            |(n, &i): (usize, &usize)| free[..=n].iter().map(|&k| rounded(covariance[(i, k)])).collect();
        let covariance = free.iter().enumerate().map(row).collect();
        let numbers: Vec<String> = free.iter().map(|&i| numbers[i].clone()).collect();
        (!numbers.is_empty()).then_some(Self { numbers, covariance })
    }

    /// The 90 % interval of each number that a document has: its place, its ends.
    pub(super) fn intervals_90(&self, numbers: &Value) -> Vec<(&str, [f64; 2])> {
        let one = |(place, row): (&'_ String, &Vec<f64>)| {
            let value = numbers.pointer(place)?.as_f64()?;
            let half = HALF_90 * row.last()?.sqrt();
            let (low, high) = range_of(place);
            Some([(value - half).max(low), (value + half).min(high)])
        };
        let found = self.numbers.iter().zip(&self.covariance);
        found.filter_map(|(place, row)| Some((place.as_str(), one((place, row))?))).collect()
    }

    /// Everything that can be wrong with it beside a document of numbers.
    pub(super) fn check(&self, numbers: &Value) -> Result<(), Fault> {
        let fault = |value: f64, range: &'static str| {
            let error = OutOfRange { field: "value", value, range };
            ("uncertainty.covariance".to_owned(), Cause::OutOfRange(error))
        };
        if self.numbers.len() > MOST_NUMBERS {
            return Err(fault(self.numbers.len() as f64, "of at most 4000 numbers"));
        }
        let mut seen = BTreeSet::new();
        let is_known = |id: &str| numbers.pointer(id).is_some_and(Value::is_number);
        if let Some(id) = self.numbers.iter().find(|id| !is_known(id) || !seen.insert(*id)) {
            return Err(("uncertainty.numbers".to_owned(), Cause::UnknownId { id: id.clone() }));
        }
        if self.covariance.len() != self.numbers.len() {
            let (expected, found) = (self.numbers.len(), self.covariance.len());
            return Err(("uncertainty.covariance".to_owned(), Cause::BandCount { expected, found }));
        }
        for (i, row) in self.covariance.iter().enumerate() {
            if row.len() != i + 1 {
                let error = Cause::BandCount { expected: i + 1, found: row.len() };
                return Err((format!("uncertainty.covariance, row {}", i + 1), error));
            }
            if !(row[i] >= 0.0 && row[i].is_finite()) {
                return Err(fault(row[i], "a finite variance"));
            }
            for (k, &value) in row.iter().enumerate() {
                let most = (row[i] * self.covariance[k][k]).sqrt();
                // Rounding may bring a correlation of one just above it.
                if value.is_nan() || value.abs() > most * 1.001 + f64::MIN_POSITIVE {
                    return Err(fault(value, "at most the product of the two standard deviations"));
                }
            }
        }
        Ok(())
    }

    /// Of the numbers that are left without a cause: those after it move up.
    pub(super) fn without_cause(self, place: usize) -> Option<Self> {
        self.renamed(|at| match cause_of(at) {
            Some((cause, _)) if cause == place => None,
            Some((cause, rest)) if cause > place => Some(format!("/causes/{}/{rest}", cause - 1)),
            _ => Some(at.to_owned()),
        })
    }

    /// Of the causes alone, so many places later, and of materials other than these.
    pub(super) fn moved(self, later: usize, known: &BTreeSet<String>) -> Option<Self> {
        let is_known = |at: &str| {
            let material = at.strip_prefix("/absorption/").and_then(|rest| rest.rsplit_once('/'));
            material.is_some_and(|(name, _)| known.contains(&unescaped(name)))
        };
        self.renamed(|at| match cause_of(at) {
            Some((cause, rest)) => Some(format!("/causes/{}/{rest}", cause + later)),
            None => (!is_known(at)).then(|| at.to_owned()),
        })
    }

    fn renamed(self, name: impl Fn(&str) -> Option<String>) -> Option<Self> {
        let names: Vec<Option<String>> = self.numbers.iter().map(|at| name(at)).collect();
        let kept = |i: &usize| names[*i].is_some();
        let rows: Vec<usize> = (0..names.len()).filter(kept).collect();
        let row = |(n, &i): (usize, &usize)| rows[..=n].iter().map(|&k| self.covariance[i][k]).collect();
        let covariance = rows.iter().enumerate().map(row).collect();
        let numbers: Vec<String> = names.into_iter().flatten().collect();
        (!numbers.is_empty()).then_some(Self { numbers, covariance })
    }

    /// Of two sets of numbers that nothing is known to connect.
    pub(super) fn joined(first: Option<Self>, second: Option<Self>) -> Option<Self> {
        let (Some(mut all), Some(second)) = (first.clone(), second.clone()) else { return first.or(second) };
        let before = all.numbers.len();
        all.numbers.extend(second.numbers);
        all.covariance.extend(second.covariance.into_iter().map(|row| {
            let none = std::iter::repeat_n(0.0, before);
            none.chain(row).collect::<Vec<f64>>()
        }));
        Some(all)
    }

    /// So many draws about a document of numbers; what `build` makes nothing of is drawn again.
    pub(super) fn draws<T>(
        &self,
        centre: &Value,
        build: impl Fn(Value) -> Option<T>,
        count: usize,
        seed: u64,
    ) -> Result<Vec<T>, Fault> {
        self.check(centre)?;
        let (factor, n) = (self.factor(), self.numbers.len());
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut draws = Vec::with_capacity(count);
        let mut refused = 0;
        while draws.len() < count {
            let normal = DVector::from_fn(n, |_, _| StandardNormal.sample(&mut random));
            let away: DVector<f64> = &factor * normal;
            match self.moved_by(centre, &away).and_then(&build) {
                Some(drawn) => {
                    refused = 0;
                    draws.push(drawn);
                }
                None if refused < MOST_REFUSED => refused += 1,
                None => {
                    let error = OutOfRange {
                        field: "draws in a row that are no model",
                        value: f64::from(refused as u32),
                        range: "fewer: the covariance reaches far out of the range of its numbers",
                    };
                    return Err(("uncertainty.covariance".to_owned(), Cause::OutOfRange(error)));
                }
            }
        }
        Ok(draws)
    }

    /// A matrix whose product with its transpose is the covariance. Scaled to correlations first, so that metres and hertz weigh alike; what
    /// rounding made negative is none.
    fn factor(&self) -> DMatrix<f64> {
        let n = self.numbers.len();
        let sd: Vec<f64> = (0..n).map(|i| self.covariance[i][i].sqrt()).collect();
        let correlation = DMatrix::from_fn(n, n, |i, k| {
            let (i, k) = (i.max(k), i.min(k));
            let scale = sd[i] * sd[k];
            if scale > 0.0 { self.covariance[i][k] / scale } else { 0.0 }
        });
        let split = correlation.symmetric_eigen();
        let roots = split.eigenvalues.map(|value| value.max(0.0).sqrt());
        let mut factor = split.eigenvectors * DMatrix::from_diagonal(&roots);
        for (i, mut row) in factor.row_iter_mut().enumerate() {
            row *= sd[i];
        }
        factor
    }

    /// The document with its numbers elsewhere.
    fn moved_by(&self, centre: &Value, away: &DVector<f64>) -> Option<Value> {
        let mut numbers = centre.clone();
        for (place, away) in self.numbers.iter().zip(away.iter()) {
            let (low, high) = range_of(place);
            let value = (centre.pointer(place)?.as_f64()? + away).clamp(low, high);
            *numbers.pointer_mut(place)? = json!(value);
            widen(&mut numbers, place, value);
        }
        Some(numbers)
    }
}

/// The parameter of a law states its interval: that of a drawn value holds the value.
fn widen(numbers: &mut Value, place: &str, value: f64) {
    let Some(parent) = place.strip_suffix("/value") else { return };
    for (end, pick) in [("low", f64::min as fn(f64, f64) -> f64), ("high", f64::max)] {
        if let Some(end) = numbers.pointer_mut(&format!("{parent}/{end}")) {
            *end = json!(pick(end.as_f64().unwrap_or(value), value));
        }
    }
}

/// The cause (its place) that a number belongs to, and the rest of its pointer.
fn cause_of(place: &str) -> Option<(usize, &str)> {
    let (cause, rest) = place.strip_prefix("/causes/")?.split_once('/')?;
    Some((cause.parse().ok()?, rest))
}

/// The pointer of a material's absorption in a band.
pub(super) fn absorption_at(material: &str, band: usize) -> String {
    format!("/absorption/{}/{band}", escaped(material))
}

/// A name as part of a JSON pointer (RFC 6901, section 3).
pub(super) fn escaped(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1")
}

fn unescaped(name: &str) -> String {
    name.replace("~1", "/").replace("~0", "~")
}

/// The range of what a pointer points to: shares lie between 0 and 1, rates of energy are positive.
fn range_of(place: &str) -> (f64, f64) {
    let has = |key: &str| place.split('/').any(|part| part == key);
    if has("absorption") || has("scattering") || has("directed_share") {
        (0.0, 1.0)
    } else if has("noise_per_s") || has("energy_per_s") {
        (0.0, 1e6)
    } else if has("decay_time_s") {
        (0.01, 100.0)
    } else {
        (f64::NEG_INFINITY, f64::INFINITY)
    }
}

/// A number with as many digits as a covariance is worth.
fn rounded(value: f64) -> f64 {
    format!("{value:.DIGITS$e}").parse().unwrap_or(value)
}
