//! The absorptions that are solved for, in one band or several, and what is expected of them.

use crate::scale::Scale;
use crate::{AbsorptionPrior, FitConfig};
use nalgebra::DMatrix;

/// What is known of the materials in one band before the fit, one entry for each material.
pub(crate) struct BandPrior {
    pub mean: Vec<f64>,
    /// Zero holds a material where it is.
    pub standard_deviation: Vec<f64>,
}

impl BandPrior {
    pub fn new(priors: &[AbsorptionPrior], band: usize) -> Self {
        Self {
            mean: priors.iter().map(|p| p.mean.values()[band]).collect(),
            standard_deviation: priors.iter().map(|p| p.standard_deviation.values()[band]).collect(),
        }
    }

    pub fn materials(&self) -> usize {
        self.mean.len()
    }

    /// Materials that may move.
    pub fn free(&self) -> impl Iterator<Item = usize> {
        (0..self.materials()).filter(|&k| self.standard_deviation[k] > 0.0)
    }

    /// Deviation of a material's absorption from its mean, in standard deviations.
    pub fn deviation(&self, material: usize, absorption: f64) -> f64 {
        (absorption - self.mean[material]) / self.standard_deviation[material]
    }
}

/// Variables of bands that are solved together: one for each material and band that is not held.
pub(crate) struct Unknowns<'a> {
    priors: Vec<&'a BandPrior>,
    bounds: (f64, f64),
    smoothness: f64,
    /// Band and material of each variable.
    pub free: Vec<(usize, usize)>,
    scales: Vec<Scale>,
    /// Variables of the same material in neighbouring bands.
    neighbours: Vec<(usize, usize)>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
}

impl<'a> Unknowns<'a> {
    pub fn new(priors: Vec<&'a BandPrior>, config: &FitConfig) -> Self {
        let free: Vec<(usize, usize)> =
            priors.iter().enumerate().flat_map(|(b, prior)| prior.free().map(move |k| (b, k))).collect();
        let scale = |&(b, k): &(usize, usize)| {
            let mean = priors[b].mean[k].clamp(config.bounds.0, config.bounds.1);
            Scale::about(mean, priors[b].standard_deviation[k])
        };
        let scales: Vec<Scale> = free.iter().map(scale).collect();
        let lower = scales.iter().map(|s| s.variable(config.bounds.0)).collect();
        let upper = scales.iter().map(|s| s.variable(config.bounds.1)).collect();
        let at = |b: usize, k: usize| free.iter().position(|&f| f == (b, k));
        let pairs = free.iter().enumerate();
        // Bands that do not hang together are groups of their own, and have no neighbours here.
        let neighbours = pairs.filter_map(|(low, &(b, k))| at(b + 1, k).map(|high| (low, high))).collect();
        let (bounds, smoothness) = (config.bounds, config.smoothness);
        Self { priors, bounds, smoothness, free, scales, neighbours, lower, upper }
    }

    pub fn len(&self) -> usize {
        self.free.len()
    }

    /// The means of the priors, within the bounds.
    pub fn start(&self) -> Vec<f64> {
        vec![0.0; self.len()]
    }

    pub fn variables(&self, absorption: &[Vec<f64>]) -> Vec<f64> {
        self.free.iter().zip(&self.scales).map(|(&(b, k), s)| s.variable(absorption[b][k])).collect()
    }

    /// Absorption by band and material.
    pub fn absorption(&self, x: &[f64]) -> Vec<Vec<f64>> {
        let mut absorption: Vec<Vec<f64>> = self.priors.iter().map(|p| p.mean.clone()).collect();
        for ((&(b, k), scale), x) in self.free.iter().zip(&self.scales).zip(x) {
            // The bound may be missed by a rounding error.
            absorption[b][k] = scale.absorption(*x).clamp(self.bounds.0, self.bounds.1);
        }
        absorption
    }

    /// Derivative of the absorption of a variable by it.
    pub fn by_variable(&self, variable: usize, x: &[f64]) -> f64 {
        self.scales[variable].by_variable(x[variable])
    }

    /// Deviations of absorption from the priors, in standard deviations.
    pub fn deviations(&self, x: &[f64]) -> Vec<f64> {
        let of = |((&(b, k), scale), x): ((&(usize, usize), &Scale), &f64)| {
            self.priors[b].deviation(k, scale.absorption(*x))
        };
        self.free.iter().zip(&self.scales).zip(x).map(of).collect()
    }

    /// Greatest change of a deviation between two points.
    pub fn distance(&self, x: &[f64], y: &[f64]) -> f64 {
        let (x, y) = (self.deviations(x), self.deviations(y));
        x.iter().zip(&y).fold(0.0, |w: f64, (a, b)| w.max((a - b).abs()))
    }

    /// Half the squared deviations from the priors and, weighted with the smoothness, between neighbouring bands; `gradient`
    /// receives its derivative by the variables.
    pub fn prior_cost(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let z = self.deviations(x);
        let mut cost = 0.5 * z.iter().map(|z| z * z).sum::<f64>();
        gradient.copy_from_slice(&z);
        for &(low, high) in &self.neighbours {
            let step = z[high] - z[low];
            cost += 0.5 * self.smoothness * step * step;
            gradient[high] += self.smoothness * step;
            gradient[low] -= self.smoothness * step;
        }
        for (i, g) in gradient.iter_mut().enumerate() {
            let (b, k) = self.free[i];
            *g *= self.by_variable(i, x) / self.priors[b].standard_deviation[k];
        }
        cost
    }

    /// Second derivative of that cost by the deviations.
    pub fn prior_precision(&self) -> DMatrix<f64> {
        let mut precision = DMatrix::<f64>::identity(self.len(), self.len());
        for &(low, high) in &self.neighbours {
            precision[(low, low)] += self.smoothness;
            precision[(high, high)] += self.smoothness;
            precision[(low, high)] -= self.smoothness;
            precision[(high, low)] -= self.smoothness;
        }
        precision
    }
}
