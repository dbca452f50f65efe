//! From ratings to what can be said of the conditions (Tang et al. 2020, section 5.5).

use super::ratings::{Ratings, Trial};
use super::screening::{Excluded, Roles, screen};
use super::statistics::{
    PairedTest, RepeatedMeasures, Spread, StatisticsError, paired_tests, repeated_measures,
};
use clap::ValueEnum;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What counts as one subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// An assessor, with the mean over the items: independent subjects.
    Assessor,
    /// A trial, as in the paper: ratings of one assessor count as independent, which makes p too small where they are not.
    Trial,
}

/// Ratings that cannot be analysed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnalysisError {
    /// A stimulus that was not rated.
    #[error("{}: rating_stimulus: {option} {name}: not among {}", path.display(), found.join(", "))]
    NoSuchStimulus { path: PathBuf, option: &'static str, name: String, found: Vec<String> },
    /// A test that cannot be made.
    #[error("{}: {source}", path.display())]
    Statistics { path: PathBuf, source: StatisticsError },
    /// Assessors who rated different items: their means cannot be compared.
    #[error(
        "{}: trial_id: {assessor} did not rate {item}: with --unit assessor everybody must have rated all items",
        path.display()
    )]
    DifferentItems { path: PathBuf, assessor: String, item: String },
}

/// Everything that is concluded.
#[derive(Serialize)]
pub struct Analysis {
    unit: Unit,
    assessors: usize,
    excluded: Vec<Excluded>,
    /// All ratings that count, of each stimulus, the hidden reference and the low anchor included.
    ratings: BTreeMap<String, Spread>,
    /// The mid-range anchor and the conditions under test: the others only calibrate the scale.
    anova: RepeatedMeasures,
    pairs: Vec<PairedTest>,
}

impl Analysis {
    /// Screens the assessors and compares the conditions.
    pub fn new(ratings: &Ratings, roles: &Roles, unit: Unit) -> Result<Self, AnalysisError> {
        for (option, name) in [
            ("--reference", &roles.reference),
            ("--low-anchor", &roles.low_anchor),
            ("--mid-anchor", &roles.mid_anchor),
        ] {
            if !ratings.stimuli.contains(name) {
                return Err(AnalysisError::NoSuchStimulus {
                    path: ratings.path.clone(),
                    option,
                    name: name.clone(),
                    found: ratings.stimuli.iter().cloned().collect(),
                });
            }
        }
        let (kept, excluded) = screen(ratings, roles);
        let tested: Vec<&str> = ratings
            .stimuli
            .iter()
            .map(String::as_str)
            .filter(|name| *name != roles.reference && *name != roles.low_anchor)
            .collect();
        let rows = match unit {
            Unit::Trial => kept.values().flat_map(|items| items.values()).map(|t| row(t, &tested)).collect(),
            Unit::Assessor => {
                check_same_items(ratings, &kept)?;
                kept.values().map(|items| mean_row(items, &tested)).collect::<Vec<_>>()
            }
        };
        let failed = |source| AnalysisError::Statistics { path: ratings.path.clone(), source };
        let spread = |name: &String| {
            let scores = kept.values().flat_map(|items| items.values()).map(|trial| trial[name]);
            Some((name.clone(), Spread::of(scores.collect())?))
        };
        Ok(Self {
            unit,
            assessors: kept.len(),
            ratings: ratings.stimuli.iter().filter_map(spread).collect(),
            anova: repeated_measures(&rows).map_err(failed)?,
            pairs: paired_tests(&tested, &rows).map_err(failed)?,
            excluded,
        })
    }

    /// The same in words.
    pub fn print(&self) {
        let (kept, excluded) = (self.assessors, self.excluded.len());
        println!("{} assessors, {excluded} left out (ITU-R BS.1534-3, 4.1.2)", kept + excluded);
        for Excluded { assessor, items, reference_below_90, mid_anchor_above_90 } in &self.excluded {
            println!(
                "  {assessor}: hidden reference below 90 in {reference_below_90} of {items} items, mid-range anchor above 90 in {mid_anchor_above_90}"
            );
        }
        println!("{:14}{:>8}{:>10}{:>10}{:>10}", "stimulus", "ratings", "quarter", "median", "quarter");
        for (name, s) in &self.ratings {
            println!(
                "{name:14}{:>8}{:>10.1}{:>10.1}{:>10.1}",
                s.count, s.lower_quartile, s.median, s.upper_quartile
            );
        }
        let a = &self.anova;
        let unit = if self.unit == Unit::Assessor { "assessors" } else { "trials" };
        println!(
            "repeated measures over {} {unit}: F({}, {}) = {:.2}, p {}; Greenhouse-Geisser epsilon {:.3}, p {}",
            a.subjects,
            a.degrees.0,
            a.degrees.1,
            a.f,
            probability(a.p),
            a.epsilon,
            probability(a.p_greenhouse_geisser)
        );
        println!("paired t tests, p by Bonferroni for {} pairs:", self.pairs.len());
        for test in &self.pairs {
            println!(
                "  {} - {}: {:+.1} ({:+.1} to {:+.1}), t({}) = {:.2}, p {}",
                test.first,
                test.second,
                test.difference,
                test.interval_95.0,
                test.interval_95.1,
                test.degrees,
                test.t,
                probability(test.p_bonferroni)
            );
        }
    }
}

fn probability(p: f64) -> String {
    if p < 0.001 { "< 0.001".to_owned() } else { format!("= {p:.3}") }
}

fn row(trial: &Trial, tested: &[&str]) -> Vec<f64> {
    tested.iter().map(|name| trial[*name]).collect()
}

fn mean_row(items: &BTreeMap<String, Trial>, tested: &[&str]) -> Vec<f64> {
    let mean = |name: &&str| items.values().map(|trial| trial[*name]).sum::<f64>() / items.len() as f64;
    tested.iter().map(mean).collect()
}

fn check_same_items(
    ratings: &Ratings,
    kept: &BTreeMap<&str, &BTreeMap<String, Trial>>,
) -> Result<(), AnalysisError> {
    for item in kept.values().flat_map(|items| items.keys()) {
        if let Some((assessor, _)) = kept.iter().find(|(_, items)| !items.contains_key(item)) {
            return Err(AnalysisError::DifferentItems {
                path: ratings.path.clone(),
                assessor: (*assessor).to_owned(),
                item: item.clone(),
            });
        }
    }
    Ok(())
}
