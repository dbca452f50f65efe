//! The measured decays of one band against those of the paths.

use crate::AbsorptionPrior;
use crate::FitConfig;
use crate::expansion::Bins;
use crate::history::{History, variance_of_sum};
use crate::measured_decay::BinnedDecay;
use crate::responses::gain_group;
use crate::scale::Scale;
use crate::uncertainty::Spread;
use nalgebra::{DMatrix, DVector};
use sabine_acoustics::{Levels, Objective};

/// Variance of the prior, as a share, to which the data would have to bring a material alone to say anything of it: the
/// information of the data must be a third of the prior's.
const SHOWS: f64 = 1.0 / 3.0;

/// One band: its priors and the responses that can be read in it.
pub(crate) struct ResponseBand<'a> {
    pub mean: Vec<f64>,
    pub standard_deviation: Vec<f64>,
    levels: Levels,
    responses: Vec<BandResponse<'a>>,
}

/// A response in a band, its bins counted from the emission.
struct BandResponse<'a> {
    index: usize,
    history: &'a History,
    weights: Vec<f32>,
    edges_s: Vec<f64>,
    energy: &'a [f64],
    shape: &'a [f64],
}

impl<'a> ResponseBand<'a> {
    pub fn new(priors: &[AbsorptionPrior], band: usize, levels: Levels) -> Self {
        Self {
            mean: priors.iter().map(|p| p.mean.values()[band]).collect(),
            standard_deviation: priors.iter().map(|p| p.standard_deviation.values()[band]).collect(),
            levels,
            responses: Vec::new(),
        }
    }

    /// Adds a response as far as the paths reach; whether anything is left of it.
    pub fn add(
        &mut self,
        index: usize,
        history: &'a History,
        weights: Vec<f32>,
        decay: &'a BinnedDecay,
        latency_s: f64,
    ) -> bool {
        let end_s = history.bins() as f64 * history.bin_s;
        let edges_s: Vec<f64> =
            decay.edges_s.iter().map(|t| t - latency_s).take_while(|t| *t <= end_s).collect();
        let bins = edges_s.len().saturating_sub(1);
        if bins < 2 {
            return false;
        }
        let (energy, shape) = (&decay.energy[..bins], &decay.shape[..bins]);
        self.responses.push(BandResponse { index, history, weights, edges_s, energy, shape });
        true
    }

    pub fn is_empty(&self) -> bool {
        self.responses.is_empty()
    }

    /// The priors' means within the bounds.
    pub fn start(&self, bounds: (f64, f64)) -> Vec<f64> {
        let of = |(&mean, &sd): (&f64, &f64)| if sd == 0.0 { mean } else { mean.clamp(bounds.0, bounds.1) };
        self.mean.iter().zip(&self.standard_deviation).map(of).collect()
    }
}

/// A measured bin and what the paths give for it near an absorption.
struct Bin {
    /// Gain group; `None` for a gain of 1.
    group: Option<usize>,
    response: usize,
    measured: f64,
    /// Inverse relative variance, of the measurement alone and with that of the paths.
    shape: f64,
    weight: f64,
    log_energy: f64,
    hits: Vec<f64>,
    /// Relative share of each batch of rays.
    batches: Vec<f64>,
}

/// A band, expanded about an absorption.
pub(crate) struct BandFit<'b> {
    band: &'b ResponseBand<'b>,
    about: Vec<f64>,
    bins: Vec<Bin>,
}

/// Where the fit of a band ended.
pub(crate) struct Solved {
    pub absorption: Vec<f64>,
    pub spread: Spread,
    /// Gain of each response in dB.
    pub gains_db: Vec<(usize, f64)>,
    pub dispersion: Option<f64>,
    pub prior_cost: f64,
    pub iterations: usize,
}

impl<'b> BandFit<'b> {
    /// Sums the paths into the measured bins.
    pub fn about(band: &'b ResponseBand<'b>, absorption: &[f64]) -> Self {
        let materials = absorption.len();
        let mut bins = Vec::new();
        for response in &band.responses {
            let traces = vec![(response.history, response.weights.clone())];
            let fine = Bins::of(&traces, absorption);
            for (j, window) in response.edges_s.windows(2).enumerate() {
                // A bin of the paths that lies across an edge counts in part.
                let share = |i: usize| -> f64 {
                    let (from, to) = (i as f64 * fine.bin_s, (i + 1) as f64 * fine.bin_s);
                    ((window[1].min(to) - window[0].max(from)) / fine.bin_s).max(0.0)
                };
                let first = (window[0].max(0.0) / fine.bin_s) as usize;
                let last = ((window[1] / fine.bin_s).ceil().max(0.0) as usize).min(fine.energy.len());
                let mut functional = vec![0.0; fine.energy.len()];
                let (mut energy, mut hits) = (0.0, vec![0.0; materials]);
                for (i, part) in functional.iter_mut().enumerate().take(last).skip(first) {
                    *part = share(i);
                    let e = *part * fine.energy[i];
                    energy += e;
                    let row = &fine.hits[i * materials..(i + 1) * materials];
                    hits.iter_mut().zip(row).for_each(|(h, n)| *h += e * n);
                }
                if energy <= 0.0 {
                    continue;
                }
                hits.iter_mut().for_each(|h| *h /= energy);
                let mut batches = response.history.batch_sums(&response.weights, absorption, &functional);
                batches.iter_mut().for_each(|p| *p /= energy);
                let shape = response.shape[j];
                bins.push(Bin {
                    group: gain_group(band.levels, response.index),
                    response: response.index,
                    measured: response.energy[j],
                    shape,
                    weight: 1.0 / (1.0 / shape + variance_of_sum(&batches)),
                    log_energy: energy.ln(),
                    hits,
                    batches,
                });
            }
        }
        Self { band, about: absorption.to_vec(), bins }
    }

    /// ln E of a bin at an absorption.
    fn log_energy(&self, bin: &Bin, absorption: &[f64]) -> f64 {
        let change = absorption.iter().zip(&self.about).zip(&bin.hits);
        bin.log_energy + change.map(|((a, a0), h)| h * ((-a).ln_1p() - (-a0).ln_1p())).sum::<f64>()
    }

    fn groups(&self) -> usize {
        self.bins.iter().filter_map(|b| b.group).max().map_or(0, |g| g + 1)
    }

    /// Most likely logarithm of each gain: the weighted mean ratio of measured to expected energy.
    fn log_gains(&self, log_energy: &[f64]) -> Vec<f64> {
        let mut sums = vec![(0.0, 0.0); self.groups()];
        for (bin, log_energy) in self.bins.iter().zip(log_energy) {
            if let Some(group) = bin.group {
                sums[group].0 += bin.weight * bin.measured * (-log_energy).exp();
                sums[group].1 += bin.weight;
            }
        }
        sums.into_iter().map(|(ratio, weight): (f64, f64)| (ratio / weight).ln()).collect()
    }

    /// Negative logarithm of the likelihood, up to a constant, and its derivative by each absorption.
    fn cost(&self, absorption: &[f64], gradient: &mut [f64]) -> f64 {
        gradient.fill(0.0);
        let log_energy: Vec<f64> = self.bins.iter().map(|b| self.log_energy(b, absorption)).collect();
        let gains = self.log_gains(&log_energy);
        let mut cost = 0.0;
        for (bin, log_energy) in self.bins.iter().zip(&log_energy) {
            let expected = log_energy + bin.group.map_or(0.0, |g| gains[g]);
            let ratio = bin.measured * (-expected).exp();
            cost += bin.weight * (expected + ratio);
            // At its most likely value a gain takes no part in the gradient.
            let by = bin.weight * (1.0 - ratio);
            for (k, g) in gradient.iter_mut().enumerate() {
                *g -= by * bin.hits[k] / (1.0 - absorption[k]);
            }
        }
        cost
    }

    /// Mean deviance of the bins, in what it would be by chance; at least 1.
    pub fn dispersion(&self, absorption: &[f64]) -> f64 {
        let log_energy: Vec<f64> = self.bins.iter().map(|b| self.log_energy(b, absorption)).collect();
        let gains = self.log_gains(&log_energy);
        let deviance: f64 = self
            .bins
            .iter()
            .zip(&log_energy)
            .map(|(bin, log_energy)| {
                let log_ratio = bin.measured.ln() - log_energy - bin.group.map_or(0.0, |g| gains[g]);
                2.0 * bin.weight * (log_ratio.exp() - 1.0 - log_ratio)
            })
            .sum();
        let free = (self.bins.len() as f64 - self.groups() as f64).max(1.0);
        (deviance / free).max(1.0)
    }

    /// The result with its uncertainty: cov = C (1 + F + M) C in standard deviations of the prior, with C the inverse of prior plus
    /// data information, F what the measurement's chance and M what that of the rays adds. Materials at a bound or held do not follow.
    pub fn solved(
        &self,
        absorption: &[f64],
        dispersion: f64,
        config: &FitConfig,
        iterations: usize,
    ) -> Solved {
        let n = absorption.len();
        let sd = &self.band.standard_deviation;
        let fixed = |k: usize| {
            let a = absorption[k];
            sd[k] == 0.0
                || crate::fitter::at_bound(a, config.bounds.0)
                || crate::fitter::at_bound(a, config.bounds.1)
        };
        // Derivative of ln E by each deviation, the gain's share taken out.
        let raw: Vec<DVector<f64>> = self
            .bins
            .iter()
            .map(|bin| DVector::from_fn(n, |k, _| -bin.hits[k] * sd[k] / (1.0 - absorption[k])))
            .collect();
        let mut means = vec![(DVector::zeros(n), 0.0); self.groups()];
        for (bin, row) in self.bins.iter().zip(&raw) {
            if let Some(g) = bin.group {
                means[g].0 += row * bin.weight;
                means[g].1 += bin.weight;
            }
        }
        let rows: Vec<DVector<f64>> = self
            .bins
            .iter()
            .zip(raw)
            .map(|(bin, row)| bin.group.map_or(row.clone(), |g| &row - &means[g].0 / means[g].1))
            .collect();
        let mut information = DMatrix::<f64>::zeros(n, n);
        let mut chance = DMatrix::<f64>::zeros(n, n);
        let batches = self.bins.first().map_or(0, |b| b.batches.len());
        let mut parts = vec![DVector::<f64>::zeros(n); batches];
        for (bin, row) in self.bins.iter().zip(&rows) {
            let weight = bin.weight / dispersion;
            let outer = row * row.transpose();
            information += &outer * weight;
            chance += outer * (weight * weight * dispersion / bin.shape);
            for (part, share) in parts.iter_mut().zip(&bin.batches) {
                *part += row * (weight * share);
            }
        }
        let shows = (0..n).map(|k| sd[k] > 0.0 && information[(k, k)] >= SHOWS).collect();
        let mean = parts.iter().fold(DVector::zeros(n), |sum, part| sum + part) / batches.max(1) as f64;
        let mut rays = DMatrix::<f64>::zeros(n, n);
        for part in &parts {
            let off = part - &mean;
            rays += &off * off.transpose();
        }
        if batches > 1 {
            rays *= batches as f64 / (batches as f64 - 1.0);
        }
        let mut precision = DMatrix::<f64>::identity(n, n) + &information;
        for k in (0..n).filter(|&k| fixed(k)) {
            precision.row_mut(k).fill(0.0);
            precision.column_mut(k).fill(0.0);
            precision[(k, k)] = 1.0;
        }
        // Positive definite by construction: a unit matrix and squares.
        let inverse = precision.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n));
        let middle = DMatrix::identity(n, n) + chance + rays;
        let covariance = &inverse * middle * &inverse;
        let variance = |k: usize| if fixed(k) { 1.0 } else { covariance[(k, k)] };
        let mut spread = Spread {
            standard_error: vec![(0..n).map(|k| sd[k] * variance(k).sqrt()).collect()],
            remaining: vec![(0..n).map(variance).collect()],
            shows: vec![shows],
            data: vec![!self.bins.is_empty()],
        };
        // What stands at a bound is not known worse than its prior says, nor better.
        spread.remaining[0].iter_mut().for_each(|r| *r = r.min(1.0));
        let deviation = |(k, a): (usize, &f64)| (a - self.band.mean[k]) / sd[k];
        let prior_cost = absorption
            .iter()
            .enumerate()
            .filter(|(k, _)| sd[*k] > 0.0)
            .map(|at| 0.5 * deviation(at).powi(2))
            .sum();
        let log_energy: Vec<f64> = self.bins.iter().map(|b| self.log_energy(b, absorption)).collect();
        let gains = self.log_gains(&log_energy);
        let of = |r: &BandResponse<'_>| {
            let bin = self.bins.iter().find(|b| b.response == r.index)?;
            Some((r.index, 10.0 * bin.group.map_or(0.0, |g| gains[g]) / std::f64::consts::LN_10))
        };
        let gains_db = self.band.responses.iter().filter_map(of).collect();
        let dispersion = (!self.bins.is_empty()).then_some(dispersion);
        Solved { absorption: absorption.to_vec(), spread, gains_db, dispersion, prior_cost, iterations }
    }
}

/// Cost of bands that are solved together: priors, smoothness, and likelihoods divided by the dispersion.
pub(crate) struct Likelihood<'f, 'b> {
    fits: &'f [BandFit<'b>],
    dispersion: &'f [f64],
    bounds: (f64, f64),
    smoothness: f64,
    /// Band and material of each variable.
    free: Vec<(usize, usize)>,
    scales: Vec<Scale>,
    /// Variables of the same material in neighbouring bands.
    neighbours: Vec<(usize, usize)>,
}

impl<'f, 'b> Likelihood<'f, 'b> {
    pub fn new(fits: &'f [BandFit<'b>], dispersion: &'f [f64], config: &FitConfig) -> Self {
        let sd = |b: usize, k: usize| fits[b].band.standard_deviation[k];
        let free: Vec<(usize, usize)> = (0..fits.len())
            .flat_map(|b| (0..fits[b].about.len()).map(move |k| (b, k)))
            .filter(|&(b, k)| sd(b, k) > 0.0)
            .collect();
        let mean = |b: usize, k: usize| fits[b].band.mean[k].clamp(config.bounds.0, config.bounds.1);
        let scales = free.iter().map(|&(b, k)| Scale::about(mean(b, k), sd(b, k))).collect();
        let at = |b: usize, k: usize| free.iter().position(|&f| f == (b, k));
        let pairs = free.iter().enumerate();
        let neighbours = pairs.filter_map(|(low, &(b, k))| at(b + 1, k).map(|high| (low, high))).collect();
        Self {
            fits,
            dispersion,
            bounds: config.bounds,
            smoothness: config.smoothness,
            free,
            scales,
            neighbours,
        }
    }

    pub fn variables(&self, absorption: &[Vec<f64>]) -> Vec<f64> {
        self.free.iter().zip(&self.scales).map(|(&(b, k), s)| s.variable(absorption[b][k])).collect()
    }

    pub fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        let of = |a: f64| self.scales.iter().map(|s| s.variable(a)).collect();
        (of(self.bounds.0), of(self.bounds.1))
    }

    /// Absorption by band and material.
    pub fn absorption(&self, x: &[f64]) -> Vec<Vec<f64>> {
        let mut absorption: Vec<Vec<f64>> = self.fits.iter().map(|f| f.about.clone()).collect();
        for ((&(b, k), scale), x) in self.free.iter().zip(&self.scales).zip(x) {
            absorption[b][k] = scale.absorption(*x).clamp(self.bounds.0, self.bounds.1);
        }
        absorption
    }
}

impl Objective for Likelihood<'_, '_> {
    fn dimension(&self) -> usize {
        self.free.len()
    }

    fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let absorption = self.absorption(x);
        let mut cost = 0.0;
        let mut by_absorption = Vec::with_capacity(self.fits.len());
        for ((fit, a), dispersion) in self.fits.iter().zip(&absorption).zip(self.dispersion) {
            let mut by = vec![0.0; a.len()];
            cost += fit.cost(a, &mut by) / dispersion;
            by.iter_mut().for_each(|g| *g /= dispersion);
            by_absorption.push(by);
        }
        let deviation = |&(b, k): &(usize, usize)| {
            (absorption[b][k] - self.fits[b].band.mean[k]) / self.fits[b].band.standard_deviation[k]
        };
        let z: Vec<f64> = self.free.iter().map(deviation).collect();
        cost += 0.5 * z.iter().map(|z| z * z).sum::<f64>();
        gradient.copy_from_slice(&z);
        for &(low, high) in &self.neighbours {
            let step = z[high] - z[low];
            cost += 0.5 * self.smoothness * step * step;
            gradient[high] += self.smoothness * step;
            gradient[low] -= self.smoothness * step;
        }
        for (i, g) in gradient.iter_mut().enumerate() {
            let (b, k) = self.free[i];
            *g = (*g / self.fits[b].band.standard_deviation[k] + by_absorption[b][k])
                * self.scales[i].by_variable(x[i]);
        }
        cost
    }
}
