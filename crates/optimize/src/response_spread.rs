//! What measured responses tell of the materials, and what they leave open.

use crate::fit::at_bound;
use crate::response_expansion::ResponseExpansion;
use crate::table_expansion::TableExpansion;
use crate::uncertainty::Spread;
use crate::unknowns::Unknowns;
use nalgebra::{DMatrix, DVector};

/// Information of the data on a material alone, as a share of the prior's, from which on it shows.
const SHOWS: f64 = 1.0 / 3.0;

impl Spread {
    /// Errors of a fit to responses, linearised at the solution: cov = C (P + F + M) C in standard deviations of the priors, with
    /// C the inverse of prior plus data information, P the prior's, F what the measurement's chance and M what that of the
    /// rays adds. A material at a bound keeps its prior's error; the others do not take it for known, or they would seem sure of
    /// what they had to make up for.
    pub fn of_responses(
        unknowns: &Unknowns<'_>,
        expansions: &[ResponseExpansion<'_>],
        absorption: &[Vec<f64>],
        dispersion: &[f64],
        bounds: (f64, f64),
    ) -> Self {
        let n = unknowns.len();
        let zeros = || -> Vec<Vec<f64>> { absorption.iter().map(|a| vec![0.0; a.len()]).collect() };
        let mut spread = Self {
            standard_error: zeros(),
            remaining: zeros(),
            shows: absorption.iter().map(|a| vec![false; a.len()]).collect(),
            data: expansions.iter().map(|e| !e.bins.is_empty() || !e.tables.is_empty()).collect(),
        };
        let mut information = DMatrix::<f64>::zeros(n, n);
        let mut chance = DMatrix::<f64>::zeros(n, n);
        let of_bins = expansions.iter().flat_map(|e| e.bins.first()).map(|b| b.batches.len());
        let of_tables = expansions.iter().flat_map(|e| e.tables.first()).map(|t| t.parts.len());
        let batches = of_bins.chain(of_tables).max().unwrap_or(0);
        let mut parts = vec![DVector::<f64>::zeros(n); batches];
        for (b, expansion) in expansions.iter().enumerate() {
            let sd = &expansion.band.prior.standard_deviation;
            // Derivative of ln E by each deviation.
            let by = |slopes: Vec<f64>| {
                DVector::from_fn(n, |i, _| match unknowns.free[i] {
                    (of, k) if of == b => slopes[k] * sd[k],
                    _ => 0.0,
                })
            };
            let raw: Vec<DVector<f64>> =
                expansion.bins.iter().map(|bin| by(expansion.slopes(bin, &absorption[b]))).collect();
            // What a gain takes up is no information.
            let mut means = vec![(DVector::zeros(n), 0.0); expansion.groups()];
            for (bin, row) in expansion.bins.iter().zip(&raw) {
                if let Some(g) = bin.group {
                    means[g].0 += row * bin.weight;
                    means[g].1 += bin.weight;
                }
            }
            for (bin, row) in expansion.bins.iter().zip(raw) {
                let row = bin.group.map_or_else(|| row.clone(), |g| &row - &means[g].0 / means[g].1);
                let weight = bin.weight / dispersion[b];
                let outer = &row * row.transpose();
                information += &outer * weight;
                chance += outer * (weight * weight * dispersion[b] * bin.chance);
                for (part, share) in parts.iter_mut().zip(&bin.batches) {
                    *part += &row * (weight * share);
                }
            }
            for table in &expansion.tables {
                let row = |slopes: &DMatrix<f64>, value: usize, i: usize| match unknowns.free[i] {
                    (of, k) if of == b => slopes[(value, k)] * sd[k],
                    _ => 0.0,
                };
                let Some(slopes) = table.slopes(&absorption[b]) else { continue };
                let rows = DMatrix::from_fn(slopes.nrows(), n, |value, i| row(&slopes, value, i));
                add_table(
                    table,
                    rows,
                    expansion.table_dispersion,
                    (&mut information, &mut chance, &mut parts),
                );
            }
        }
        let rays = scatter(&parts, n);

        let prior = unknowns.prior_precision();
        // Positive definite by construction: a unit matrix and squares.
        let or_unit = |matrix: DMatrix<f64>| matrix.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n));
        let prior_covariance = or_unit(prior.clone());
        let fixed = |i: usize| {
            let a = absorption[unknowns.free[i].0][unknowns.free[i].1];
            at_bound(a, bounds.0) || at_bound(a, bounds.1)
        };
        let inverse = or_unit(&prior + &information);
        let covariance = &inverse * (prior + chance + rays) * &inverse;
        for (i, &(b, k)) in unknowns.free.iter().enumerate() {
            let before = prior_covariance[(i, i)];
            let after = if fixed(i) { before } else { covariance[(i, i)] };
            spread.standard_error[b][k] = expansions[b].band.prior.standard_deviation[k] * after.sqrt();
            // What the data confuse is not known worse than its prior says.
            spread.remaining[b][k] = (after / before).min(1.0);
            spread.shows[b][k] = information[(i, i)] >= SHOWS / before;
        }
        spread
    }
}

/// Adds what a table tells of the deviations, by the derivatives of its values: information, what chance makes of it, what each batch of
/// rays does.
fn add_table(
    table: &TableExpansion<'_>,
    rows: DMatrix<f64>,
    dispersion: f64,
    (information, chance, parts): (&mut DMatrix<f64>, &mut DMatrix<f64>, &mut [DVector<f64>]),
) {
    let weighted = rows.transpose() * &table.weight / dispersion;
    *information += &weighted * &rows;
    *chance += &weighted * &table.chance * weighted.transpose() * dispersion;
    for (part, of_batch) in parts.iter_mut().zip(&table.parts) {
        *part += &weighted * of_batch;
    }
}

/// Covariance of the sum of independent parts of `n` numbers, from their scatter.
pub(crate) fn scatter(parts: &[DVector<f64>], n: usize) -> DMatrix<f64> {
    let batches = parts.len() as f64;
    let mean = parts.iter().fold(DVector::zeros(n), |sum, part| sum + part) / batches.max(1.0);
    let mut scatter = DMatrix::<f64>::zeros(n, n);
    for part in parts {
        let off = part - &mean;
        scatter += &off * off.transpose();
    }
    if parts.len() > 1 { scatter * (batches / (batches - 1.0)) } else { scatter }
}
