//! Decays and a noise floor as a model of the bins: expectation, likelihood, information.

use super::bins::Bin;
use super::noise_floor::NoiseFloor;
use super::numerics::{bisect, leave_out, solve};

/// ln(10^6): the power falls by 60 dB in this many time constants.
pub(super) const LN_MILLION: f64 = 13.815_510_557_964_274;

/// The model at a point: for each slope ln(power at time zero) and ln(rate), then ln(noise power).
#[derive(Clone, Debug)]
pub(super) struct Model {
    pub(super) parameters: Vec<f64>,
    /// Expected power of each bin.
    pub(super) expected: Vec<f64>,
    /// Its logarithmic derivative by each parameter, bin after bin.
    pub(super) derivatives: Vec<f64>,
    /// Twice the negative log-likelihood, up to a constant of the data.
    pub(super) deviance: f64,
    pub(super) bounds: Bounds,
    /// True if the noise is not to be fitted.
    pub(super) noise_is_known: bool,
    /// Whether the likelihood is at its maximum here.
    pub(super) converged: bool,
}

/// Logarithms of a noise that counts as none, and of the power from which no decay starts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) least_noise: f64,
    pub(super) most_power: f64,
}

impl Model {
    pub(super) fn single(floor: &NoiseFloor, bins: &[Bin]) -> Self {
        let loudest = bins.iter().fold(f64::MIN_POSITIVE, |most, bin| most.max(bin.power));
        // A decay may start well above the mean of its first bin, but not by more than 30 dB.
        let bounds = Bounds { least_noise: (1e-16 * loudest).ln(), most_power: (1e3 * loudest).ln() };
        let start = floor.start_power.ln().max(bounds.least_noise);
        Self::at(vec![start, floor.rate_per_s.ln(), floor.power.ln()], bins, bounds)
    }

    /// Where a fit of one slope to other bins may start, with the noise of this model held.
    pub(super) fn single_again(&self, bins: &[Bin]) -> Self {
        let n = self.parameters.len();
        let strongest = self.parameters[..n - 1]
            .chunks_exact(2)
            .max_by(|a, b| a[0].total_cmp(&b[0]))
            .map_or_else(|| self.parameters[..2].to_vec(), <[f64]>::to_vec);
        let parameters = vec![strongest[0], strongest[1], self.parameters[n - 1]];
        Self { noise_is_known: true, ..Self::at(parameters, bins, self.bounds) }
    }

    pub(super) fn at(mut parameters: Vec<f64>, bins: &[Bin], bounds: Bounds) -> Self {
        let n = parameters.len();
        parameters[n - 1] = parameters[n - 1].max(bounds.least_noise);
        for power in parameters[..n - 1].iter_mut().step_by(2) {
            *power = power.min(bounds.most_power);
        }
        let noise = parameters[n - 1].exp();
        let mut expected = vec![noise; bins.len()];
        let mut derivatives = vec![noise; bins.len() * n];
        for k in 0..n / 2 {
            let power = parameters[2 * k].exp();
            mean_decay(bins, parameters[2 * k + 1].exp(), |i, mean, by_rate| {
                expected[i] += power * mean;
                derivatives[i * n + 2 * k] = power * mean;
                derivatives[i * n + 2 * k + 1] = power * by_rate;
            });
        }
        let mut deviance = 0.0;
        for (i, bin) in bins.iter().enumerate() {
            derivatives[i * n..(i + 1) * n].iter_mut().for_each(|d| *d /= expected[i]);
            deviance += 2.0 * bin.shape * (bin.power / expected[i] + expected[i].ln());
        }
        Self { parameters, expected, derivatives, deviance, bounds, noise_is_known: false, converged: false }
    }

    pub(super) fn moved(&self, parameters: Vec<f64>, bins: &[Bin]) -> Self {
        Self { noise_is_known: self.noise_is_known, ..Self::at(parameters, bins, self.bounds) }
    }

    pub(super) fn slopes(&self) -> usize {
        self.parameters.len() / 2
    }

    /// When the decays together have fallen by so many dB.
    pub(super) fn time_of_fall(&self, fall_db: f64) -> f64 {
        let n = self.parameters.len();
        let power = |t: f64| -> f64 {
            self.parameters[..n - 1].chunks_exact(2).map(|pair| (pair[0] - t * pair[1].exp()).exp()).sum()
        };
        let target = power(0.0) * 10f64.powf(-0.1 * fall_db);
        let slowest = self.parameters[1..n - 1].iter().step_by(2).copied().fold(f64::MAX, f64::min).exp();
        bisect(0.0, fall_db / 60.0 * LN_MILLION / slowest, |t| power(t) - target)
    }

    /// Score and Fisher information.
    pub(super) fn score(&self, bins: &[Bin]) -> (Vec<f64>, Vec<f64>) {
        let n = self.parameters.len();
        let (mut score, mut information) = (vec![0.0; n], vec![0.0; n * n]);
        for (i, bin) in bins.iter().enumerate() {
            let derivatives = &self.derivatives[i * n..(i + 1) * n];
            let residual = bin.shape * (bin.power / self.expected[i] - 1.0);
            for (a, &by_a) in derivatives.iter().enumerate() {
                score[a] += residual * by_a;
                for (b, &by_b) in derivatives.iter().enumerate() {
                    information[a * n + b] += bin.shape * by_a * by_b;
                }
            }
        }
        if self.noise_is_known {
            score[n - 1] = 0.0;
            leave_out(&mut information, n, n - 1);
        }
        (score, information)
    }

    /// Pearson's chi-squared per degree of freedom, over groups of bins that hold at least eight independent values each.
    pub(super) fn dispersion(&self, bins: &[Bin]) -> f64 {
        let (mut chi_squared, mut groups) = (0.0, 0.0);
        let (mut shape, mut sum) = (0.0, 0.0);
        for (bin, expected) in bins.iter().zip(&self.expected) {
            shape += bin.shape;
            sum += bin.shape * (bin.power / expected - 1.0);
            if shape >= 8.0 {
                chi_squared += sum * sum / shape;
                groups += 1.0;
                (shape, sum) = (0.0, 0.0);
            }
        }
        let freedom = groups - self.parameters.len() as f64;
        if freedom >= 4.0 { chi_squared / freedom } else { 1.0 }
    }

    /// Inverse of the information; a floor that does not show has no say.
    pub(super) fn covariance(&self, bins: &[Bin], dispersion: f64) -> Option<Vec<f64>> {
        let n = self.parameters.len();
        let (_, mut information) = self.score(bins);
        let floor = n * n - 1;
        if information[floor] < 1e-3 {
            leave_out(&mut information, n, n - 1);
        }
        let mut covariance = vec![0.0; n * n];
        for i in 0..n {
            let mut unit = vec![0.0; n];
            unit[i] = dispersion.max(1.0);
            let column = solve(&information, &unit)?;
            for (j, x) in column.into_iter().enumerate() {
                covariance[j * n + i] = x;
            }
        }
        Some(covariance)
    }
}

/// Mean of exp(-rate t) over each bin, and the derivative of that mean by ln(rate).
pub(super) fn mean_decay(bins: &[Bin], rate: f64, mut each: impl FnMut(usize, f64, f64)) {
    // The end of a bin is the start of the next.
    let mut e0 = bins.first().map_or(1.0, |bin| (-rate * bin.from_s).exp());
    for (i, bin) in bins.iter().enumerate() {
        let width = bin.to_s - bin.from_s;
        let e1 = (-rate * bin.to_s).exp();
        let mean = if rate * width > 1e-6 { (e0 - e1) / (rate * width) } else { e0 };
        each(i, mean, (e1 * bin.to_s - e0 * bin.from_s) / width - mean);
        e0 = e1;
    }
}
