//! Quartiles, repeated-measures analysis of variance and paired t tests.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

/// Five numbers of a set of ratings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// How many.
    pub count: usize,
    pub mean: f64,
    pub lower_quartile: f64,
    pub median: f64,
    pub upper_quartile: f64,
}

/// A one-way analysis of variance with repeated measures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RepeatedMeasures {
    /// Subjects.
    pub subjects: usize,
    /// Ratio of the mean squares.
    pub f: f64,
    /// Degrees of freedom of conditions and residue.
    pub degrees: (f64, f64),
    /// Probability of such a ratio if the conditions do not differ, by sphericity.
    pub p: f64,
    /// Greenhouse and Geisser's epsilon: 1 where differences of all pairs of conditions vary alike.
    pub epsilon: f64,
    /// Probability with both degrees of freedom scaled by epsilon.
    pub p_greenhouse_geisser: f64,
}

/// A paired t test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairedTest {
    pub first: String,
    pub second: String,
    /// Mean of first less second.
    pub difference: f64,
    /// 95 % interval of the difference, for this pair alone.
    pub interval_95: (f64, f64),
    pub t: f64,
    pub degrees: f64,
    /// Two-sided probability.
    pub p: f64,
    /// The same by Bonferroni: times the number of pairs, at most 1.
    pub p_bonferroni: f64,
}

/// Why a test cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StatisticsError {
    /// Too little to compare.
    #[error("{what}: {found} left after screening; at least {needed} are needed")]
    TooFew { what: &'static str, found: usize, needed: usize },
    /// Everybody rates alike.
    #[error(
        "{what} of {conditions}: the differences do not vary from one to the next, so that nothing can be tested"
    )]
    NoVariance { what: &'static str, conditions: String },
    /// A distribution refused its degrees of freedom.
    #[error("degrees of freedom: {source}")]
    StudentsT { source: statrs::distribution::StudentsTError },
    /// A distribution refused its degrees of freedom.
    #[error("degrees of freedom: {source}")]
    FisherSnedecor { source: statrs::distribution::FisherSnedecorError },
}

impl Spread {
    /// Quartiles by linear interpolation between order statistics (type 7 of Hyndman and Fan 1996); `None` of nothing.
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        if values.is_empty() {
            return None;
        }
        values.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            let place = share * (values.len() - 1) as f64;
            let below = place.floor() as usize;
            let above = place.ceil() as usize;
            values[below] + (place - below as f64) * (values[above] - values[below])
        };
        Some(Self {
            count: values.len(),
            mean: mean(&values),
            lower_quartile: quantile(0.25),
            median: quantile(0.5),
            upper_quartile: quantile(0.75),
        })
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// `rows[subject][condition]`, at least two of each; rows of equal length.
///
/// Sums of squares as in any textbook (Winer 1971, 4.2); epsilon is Greenhouse and Geisser's (Psychometrika 24, 1959), from
/// the double-centred covariance of the conditions.
pub fn repeated_measures(rows: &[Vec<f64>]) -> Result<RepeatedMeasures, StatisticsError> {
    let (n, k) = (rows.len(), rows.first().map_or(0, Vec::len));
    at_least("subjects", n, 2)?;
    at_least("conditions", k, 2)?;
    let column = |j: usize| rows.iter().map(move |row| row[j]);
    let condition_means: Vec<f64> = (0..k).map(|j| column(j).sum::<f64>() / n as f64).collect();
    let subject_means: Vec<f64> = rows.iter().map(|row| mean(row)).collect();
    let grand = mean(&condition_means);
    let between: f64 = n as f64 * condition_means.iter().map(|m| (m - grand).powi(2)).sum::<f64>();
    let residue: f64 = rows
        .iter()
        .zip(&subject_means)
        .flat_map(|(row, subject)| {
            row.iter()
                .zip(&condition_means)
                .map(move |(x, condition)| (x - subject - condition + grand).powi(2))
        })
        .sum();
    let degrees = ((k - 1) as f64, ((k - 1) * (n - 1)) as f64);
    if residue <= 1e-12 * (between + 1.0) {
        return Err(StatisticsError::NoVariance { what: "analysis of variance", conditions: "all".into() });
    }
    let f = (between / degrees.0) / (residue / degrees.1);
    let epsilon = greenhouse_geisser(rows, &condition_means);
    Ok(RepeatedMeasures {
        subjects: n,
        f,
        degrees,
        p: upper_tail_f(f, degrees)?,
        epsilon,
        p_greenhouse_geisser: upper_tail_f(f, (epsilon * degrees.0, epsilon * degrees.1))?,
    })
}

/// Squared trace over trace of the square of the double-centred covariance.
fn greenhouse_geisser(rows: &[Vec<f64>], condition_means: &[f64]) -> f64 {
    let (n, k) = (rows.len(), condition_means.len());
    let mut covariance = vec![vec![0.0; k]; k];
    for row in rows {
        for i in 0..k {
            for j in 0..k {
                covariance[i][j] +=
                    (row[i] - condition_means[i]) * (row[j] - condition_means[j]) / (n - 1) as f64;
            }
        }
    }
    let means: Vec<f64> = covariance.iter().map(|row| mean(row)).collect();
    let grand = mean(&means);
    let centred = |i: usize, j: usize| covariance[i][j] - means[i] - means[j] + grand;
    let trace: f64 = (0..k).map(|i| centred(i, i)).sum();
    let squares: f64 =
        (0..k).flat_map(|i| (0..k).map(move |j| (i, j))).map(|(i, j)| centred(i, j).powi(2)).sum();
    (trace * trace / ((k - 1) as f64 * squares)).clamp(1.0 / (k - 1) as f64, 1.0)
}

fn upper_tail_f(f: f64, degrees: (f64, f64)) -> Result<f64, StatisticsError> {
    let distribution = FisherSnedecor::new(degrees.0, degrees.1)
        .map_err(|source| StatisticsError::FisherSnedecor { source })?;
    Ok(distribution.sf(f))
}

/// Tests all pairs of conditions; `rows[subject][condition]`.
pub fn paired_tests(names: &[&str], rows: &[Vec<f64>]) -> Result<Vec<PairedTest>, StatisticsError> {
    at_least("subjects", rows.len(), 2)?;
    let pairs = names.len() * names.len().saturating_sub(1) / 2;
    let mut tests = Vec::with_capacity(pairs);
    for first in 0..names.len() {
        for second in first + 1..names.len() {
            let differences: Vec<f64> = rows.iter().map(|row| row[first] - row[second]).collect();
            let n = differences.len() as f64;
            let difference = mean(&differences);
            let variance = differences.iter().map(|d| (d - difference).powi(2)).sum::<f64>() / (n - 1.0);
            let error = (variance / n).sqrt();
            if error <= 1e-9 {
                let conditions = format!("{} and {}", names[first], names[second]);
                return Err(StatisticsError::NoVariance { what: "paired test", conditions });
            }
            let student =
                StudentsT::new(0.0, 1.0, n - 1.0).map_err(|source| StatisticsError::StudentsT { source })?;
            let t = difference / error;
            let p = 2.0 * student.sf(t.abs());
            let half = student.inverse_cdf(0.975) * error;
            tests.push(PairedTest {
                first: names[first].to_owned(),
                second: names[second].to_owned(),
                difference,
                interval_95: (difference - half, difference + half),
                t,
                degrees: n - 1.0,
                p,
                p_bonferroni: (p * pairs as f64).min(1.0),
            });
        }
    }
    Ok(tests)
}

fn at_least(what: &'static str, found: usize, needed: usize) -> Result<(), StatisticsError> {
    if found < needed { Err(StatisticsError::TooFew { what, found, needed }) } else { Ok(()) }
}
