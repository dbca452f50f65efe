//! How well the data determine the materials, and what they leave open.

use crate::fit::at_bound;
use crate::fit::{AtBound, Undetermined, UndeterminedKind};
use crate::group::{Band, Group, Solution};
use nalgebra::{DMatrix, DVector};

/// Share of a prior's variance that may remain for a material to count as determined: half its standard deviation.
const DETERMINED: f64 = 0.25;
/// Share of the slope's prior variance below which a material does not show.
const SHOWS: f64 = 1e-3;

/// Standard errors and sensitivities of a solved group, by band and material.
pub(crate) struct Spread {
    pub standard_error: Vec<Vec<f64>>,
    /// Share of the prior's variance that remains.
    pub remaining: Vec<Vec<f64>>,
    /// Whether the data would tell each material, the others being known.
    pub shows: Vec<Vec<bool>>,
    /// Whether the band has a slope at all.
    pub data: Vec<bool>,
}

impl Spread {
    /// Errors of the constrained fit, linearised at the solution. With deviations z from the priors in standard deviations,
    /// prior covariance Q (unit, or what smoothness makes of it) and slopes G z known with errors S, the fit is the
    /// linear estimate with gain A = Q G'(G Q G')^-1, and its error has covariance (1 - A G) Q (1 - A G)' + A S A'.
    /// S sums what the target and the rays do not know. Materials at a bound do not follow the target: their rows of A
    /// are zero.
    pub fn new(
        group: &Group<'_, '_>,
        bands: &[Band<'_>],
        solution: &Solution,
        relative_error: &[f64],
        bounds: (f64, f64),
    ) -> Self {
        let free = &group.unknowns.free;
        let n = free.len();
        let zeros = || -> Vec<Vec<f64>> { bands.iter().map(|b| vec![0.0; b.prior.materials()]).collect() };
        let mut spread = Self {
            standard_error: zeros(),
            remaining: zeros(),
            shows: bands.iter().map(|b| vec![false; b.prior.materials()]).collect(),
            data: vec![false; bands.len()],
        };

        // Positive definite by construction: a unit matrix and squares.
        let prior = group.unknowns.prior_precision().try_inverse().unwrap_or_else(|| DMatrix::identity(n, n));

        // One row for each band with a slope: relative change of T60 by each deviation, and its error.
        let (mut rows, mut movable, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for (b, band) in bands.iter().enumerate() {
            let fitted = &solution.bands[b];
            let Some(residual) = fitted.residual.filter(|r| *r != -1.0) else { continue };
            spread.data[b] = true;
            let at = |i: usize| -> f64 {
                let (of, k) = free[i];
                if of == b {
                    fitted.gradient[k] / (1.0 + residual) * band.prior.standard_deviation[k]
                } else {
                    0.0
                }
            };
            let row = DVector::from_fn(n, |i, _| at(i));
            let fixed = |i: usize| {
                let a = solution.bands[free[i].0].absorption[free[i].1];
                at_bound(a, bounds.0) || at_bound(a, bounds.1)
            };
            movable.push(DVector::from_fn(n, |i, _| if fixed(i) { 0.0 } else { row[i] }));
            let rays = fitted.t60_s.as_ref().map_or(0.0, |t| (t.standard_error / t.value).powi(2));
            errors.push(relative_error[b] * relative_error[b] + rays);
            let total: f64 = row.norm_squared();
            for (i, &(of, k)) in free.iter().enumerate().filter(|(_, f)| f.0 == b) {
                spread.shows[of][k] = total > 0.0 && row[i] * row[i] / total >= SHOWS;
            }
            rows.push(row);
        }
        if rows.is_empty() {
            // Nothing is known beyond the priors.
            for (i, &(b, k)) in free.iter().enumerate() {
                spread.standard_error[b][k] = bands[b].prior.standard_deviation[k] * prior[(i, i)].sqrt();
                spread.remaining[b][k] = 1.0;
            }
            return spread;
        }
        let full = DMatrix::from_fn(rows.len(), n, |r, i| rows[r][i]);
        let moving = DMatrix::from_fn(rows.len(), n, |r, i| movable[r][i]);
        // Only bands in which something can move have a gain.
        let spectrum = &moving * &prior * moving.transpose();
        let gain = match spectrum.pseudo_inverse(1e-14) {
            Ok(inverse) => &prior * moving.transpose() * inverse,
            Err(_) => DMatrix::zeros(n, rows.len()),
        };
        let gain = DMatrix::from_fn(n, rows.len(), |i, r| {
            if movable.iter().all(|m| m[i] == 0.0) { 0.0 } else { gain[(i, r)] }
        });
        let left = DMatrix::identity(n, n) - &gain * full;
        let noise = DMatrix::from_diagonal(&DVector::from_vec(errors));
        let covariance = &left * &prior * left.transpose() + &gain * noise * gain.transpose();
        for (i, &(b, k)) in free.iter().enumerate() {
            let variance = covariance[(i, i)];
            spread.standard_error[b][k] = bands[b].prior.standard_deviation[k] * variance.sqrt();
            spread.remaining[b][k] = variance / prior[(i, i)];
        }
        spread
    }

    /// Names what is open in a band, joining it to a finding of the same kind in another.
    pub fn name_open(
        &self,
        b: usize,
        standard_deviation: &[f64],
        band_hz: f64,
        hits: &[u64],
        bounded: &[AtBound],
        findings: &mut Vec<Undetermined>,
    ) {
        // What is held is known, and what stands at a bound is said elsewhere.
        let candidates = (0..standard_deviation.len())
            .filter(|&k| standard_deviation[k] > 0.0 && bounded.iter().all(|a| a.material != k));
        let (mut never, mut silent, mut mixed) = (Vec::new(), Vec::new(), Vec::new());
        for k in candidates {
            if hits[k] == 0 {
                never.push(k);
            } else if !self.data[b] || !self.shows[b][k] {
                silent.push(k);
            } else if self.remaining[b][k] > DETERMINED {
                mixed.push(k);
            }
        }
        if mixed.len() == 1 {
            silent.append(&mut mixed);
            silent.sort_unstable();
        }
        let kinds = [
            (never, UndeterminedKind::NeverHit),
            (silent, UndeterminedKind::Insensitive),
            (mixed, UndeterminedKind::Together),
        ];
        for (materials, kind) in kinds.into_iter().filter(|(m, _)| !m.is_empty()) {
            match findings.iter_mut().find(|f| f.kind == kind && f.materials == materials) {
                Some(finding) => finding.bands_hz.push(band_hz),
                None => findings.push(Undetermined { materials, bands_hz: vec![band_hz], kind }),
            }
        }
    }
}
