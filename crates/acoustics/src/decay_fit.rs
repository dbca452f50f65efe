//! Exponential decays plus noise, by maximum likelihood.
//!
//! Squared samples of a band are summed over bins. Band-limited Gaussian noise of bandwidth B holds about B dt independent
//! values in a bin of width dt, so a bin's mean power y is nearly Gamma distributed about its expectation m with shape
//! B dt. The expectation is a sum of decays and a floor,
//! m(t) = sum_k a_k exp(-t / tau_k) + n, T_k = ln(10^6) tau_k,
//! integrated over the bin. The parameters (as logarithms) maximise the likelihood by Fisher scoring; its information
//! matrix gives the standard errors (Karjalainen et al. 2002 for the model; Balint et al. and the theory of generalised
//! linear models with Gamma response for the errors).

use crate::estimate::{Estimate, NoReading};

/// ln(10^6): the power falls by 60 dB in this many time constants.
const LN_MILLION: f64 = 13.815_510_557_964_274;
/// Width of the first and of the widest bin as shares of the time to the knee, and how much each is wider than the last:
/// narrow ones where a steep first slope may hide, about sixty in all.
const FIRST_BIN: f64 = 0.005;
const WIDEST_BIN: f64 = 0.04;
const BIN_GROWTH: f64 = 1.035;
/// Bins after the knee, where only noise is left.
const FLOOR_BINS: usize = 24;
/// Fewest bins that a confined fit may rest on.
const LEAST_BINS: usize = 16;
/// Most iterations of Fisher scoring.
const ITERATIONS: usize = 60;
/// Gain in deviance below which the fit has converged.
const NEGLIGIBLE_GAIN: f64 = 1e-4;
/// Most slopes that are looked for.
const MOST_SLOPES: usize = 3;
/// Twice the gain in log-likelihood that one more slope (two parameters) must bring. By chance a single slope reaches 16
/// with a probability below 0.1 %, which leaves room for what the bins idealise.
const SLOPE_EVIDENCE: f64 = 16.0;
/// Least ratio of the decay times of two slopes.
const LEAST_RATIO: f64 = 1.3;
/// Least fall that shows of the slowest of several slopes, in dB: less might be a floor that drifts.
const LEAST_VISIBLE_FALL_DB: f64 = 12.0;
/// Least fall of any of several slopes from the start to the end of the response, in dB, for the same reason.
const LEAST_FALL_DB: f64 = 20.0;
/// Dispersion above which the decay is not what the model says, and the fall from the start, in dB, to which the fit then
/// confines itself: the range from which a reverberation time is defined, -5 to -35 dB, and 10 dB beyond.
const LARGEST_DISPERSION: f64 = 2.0;
const CONFINED_FALL_DB: f64 = 45.0;
/// Power of the decay over the noise below which nothing is fitted, in dB.
const LEAST_RANGE_DB: f64 = 10.0;

/// One exponential decay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// Time in which it falls by 60 dB, in seconds.
    pub t60_s: Estimate,
    /// Power (mean square) at the start of the fit.
    pub power: f64,
    /// The same relative to the power of all slopes together, in dB: 0 for a single slope.
    pub level_db: Estimate,
}

/// One to three decays and a noise floor, fitted to the energy of a band.
#[derive(Clone, Debug, PartialEq)]
pub struct DecayFit {
    slopes: Vec<Slope>,
    noise_power: f64,
    start_s: f64,
    end_s: f64,
    dispersion: f64,
    parameters: Vec<f64>,
    covariance: Vec<f64>,
}

/// What is fitted: mean power in a bin.
#[derive(Clone, Copy, Debug)]
struct Bin {
    from_s: f64,
    to_s: f64,
    power: f64,
    shape: f64,
}

impl DecayFit {
    /// Fits squared samples (or energies) `energy`, `step_s` apart, from `start_s` to the end; time zero is the first of them.
    /// `bandwidth_hz` is the bandwidth of the samples: half the sample rate for white noise.
    ///
    /// ```
    /// use sabine_acoustics::DecayFit;
    /// // A decay of 60 dB in 0.5 s that sinks into a floor 40 dB below its start.
    /// let power = |t: f64| 10f64.powf(-6.0 * t / 0.5) + 1e-4;
    /// let energy: Vec<f64> = (0..16000).map(|i| power(i as f64 / 16000.0)).collect();
    /// let fit = DecayFit::fit(&energy, 1.0 / 16000.0, 0.0, 8000.0)?;
    /// assert!((fit.t60_s().value - 0.5).abs() < 1e-3);
    /// assert!((fit.knee_s() - 0.5 * 40.0 / 60.0).abs() < 2e-3);
    /// # Ok::<(), sabine_acoustics::NoReading>(())
    /// ```
    ///
    /// # Errors
    /// [`NoReading::NoOnset`] for silence, [`NoReading::TooShort`] for fewer than 16 steps or less than 8 independent values,
    /// [`NoReading::NoDecay`] where the level does not fall, [`NoReading::DynamicRange`] where it falls by less than 10 dB
    /// before the noise or the end, [`NoReading::NotConverged`] where the likelihood has no maximum that can be found.
    pub fn fit(energy: &[f64], step_s: f64, start_s: f64, bandwidth_hz: f64) -> Result<Self, NoReading> {
        let first = (start_s / step_s).round().max(0.0) as usize;
        let samples = energy.get(first..).unwrap_or(&[]);
        let least = (8.0 / (bandwidth_hz * step_s)).ceil().max(16.0) as usize;
        if samples.len() < least {
            return Err(NoReading::TooShort {
                needed_s: (first + least) as f64 * step_s,
                available_s: energy.len() as f64 * step_s,
            });
        }
        let floor = NoiseFloor::find(samples, step_s, bandwidth_hz)?;
        let mut bins = bins(samples, step_s, bandwidth_hz, floor.knee_s);
        let longest_s = 60.0 / LEAST_FALL_DB * samples.len() as f64 * step_s;
        let limits = Limits { bandwidth_hz, longest_s };
        let mut best = Model::single(&floor, &bins).best(&bins, &limits);
        if best.dispersion(&bins) > LARGEST_DISPERSION {
            // Decays of real rooms bend: what is far below the range of interest must not decide. The noise is known by now.
            let confined_s = best.time_of_fall(CONFINED_FALL_DB);
            let kept = bins.iter().take_while(|bin| bin.to_s <= confined_s).count();
            if kept >= LEAST_BINS && kept < bins.len() {
                bins.truncate(kept);
                best = best.single_again(&bins).best(&bins, &limits);
            }
        }
        if !best.is_needed(&bins) {
            return Err(NoReading::NoDecay);
        }
        if !best.converged {
            return Err(NoReading::NotConverged);
        }
        let dispersion = best.dispersion(&bins);
        let covariance = best.covariance(&bins, dispersion).ok_or(NoReading::NoDecay)?;
        let fit = best.finish(covariance, dispersion, first as f64 * step_s, energy.len() as f64 * step_s);
        fit.check()
    }

    /// The decays, the steepest first.
    pub fn slopes(&self) -> &[Slope] {
        &self.slopes
    }

    /// Mean square of the noise; zero where the response ends before any shows.
    pub fn noise_power(&self) -> f64 {
        self.noise_power
    }

    /// Start of the fit, in seconds.
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// Variance of the bins relative to that of Gaussian noise: 1 for an ideal decay. Standard errors include it.
    pub fn dispersion(&self) -> f64 {
        self.dispersion
    }

    /// Power of the decays, without the noise, at a time in seconds.
    pub fn decay_power_at(&self, time_s: f64) -> f64 {
        self.slopes
            .iter()
            .map(|slope| slope.power * (-(time_s - self.start_s) * LN_MILLION / slope.t60_s.value).exp())
            .sum()
    }

    /// Energy of the decays from a time on, without the noise, divided by the step: what Schroeder integration would sum.
    pub(crate) fn decay_energy_after(&self, time_s: f64, step_s: f64) -> f64 {
        self.slopes
            .iter()
            .map(|slope| {
                let tau_s = slope.t60_s.value / LN_MILLION;
                slope.power * (-(time_s - self.start_s) / tau_s).exp() * tau_s / step_s
            })
            .sum()
    }

    /// When the decay has sunk to the noise, in seconds; the end of the response if that comes first.
    pub fn knee_s(&self) -> f64 {
        if self.decay_power_at(self.end_s) >= self.noise_power {
            return self.end_s;
        }
        bisect(self.start_s, self.end_s, |t| self.decay_power_at(t) - self.noise_power)
    }

    /// Level of the decay at the start over its level at the knee, in dB.
    pub fn range_db(&self) -> f64 {
        10.0 * (self.decay_power_at(self.start_s) / self.decay_power_at(self.knee_s())).log10()
    }

    /// Reverberation time: twice the time in which the backward-integrated decay, free of noise, falls from -5 to -35 dB
    /// below its value at the start of the fit. For one slope this is its own decay time.
    pub fn t60_s(&self) -> Estimate {
        let value = |parameters: &[f64]| {
            let level_db = |t: f64| {
                let energy = |t: f64| -> f64 {
                    parameters.chunks_exact(2).map(|pair| (pair[0] - pair[1] - t * pair[1].exp()).exp()).sum()
                };
                10.0 * (energy(t) / energy(0.0)).log10()
            };
            let longest_s =
                LN_MILLION / parameters.iter().skip(1).step_by(2).copied().fold(f64::MAX, f64::min).exp();
            let when = |db: f64| bisect(0.0, 2.0 * longest_s, |t| level_db(t) - db);
            2.0 * (when(-35.0) - when(-5.0))
        };
        let count = 2 * self.slopes.len();
        let centre = value(&self.parameters[..count]);
        let gradient: Vec<f64> = (0..count)
            .map(|i| {
                let mut shifted = self.parameters[..count].to_vec();
                shifted[i] += 1e-4;
                let above = value(&shifted);
                shifted[i] -= 2e-4;
                (above - value(&shifted)) / 2e-4
            })
            .collect();
        let width = self.parameters.len();
        let variance: f64 = (0..count)
            .flat_map(|i| (0..count).map(move |j| (i, j)))
            .map(|(i, j)| gradient[i] * gradient[j] * self.covariance[i * width + j])
            .sum();
        Estimate::new(centre, variance.max(0.0).sqrt())
    }

    fn check(self) -> Result<Self, NoReading> {
        let available_db = self.range_db();
        let plausible = self.slopes.iter().all(|slope| slope.t60_s.value.is_finite() && slope.power > 0.0);
        if !plausible || available_db.is_nan() {
            return Err(NoReading::NoDecay);
        }
        if available_db < LEAST_RANGE_DB {
            return Err(NoReading::DynamicRange { needed_db: LEAST_RANGE_DB, available_db });
        }
        Ok(self)
    }
}

/// A first guess of where the decay meets the noise (after Lundeby et al. 1995).
struct NoiseFloor {
    power: f64,
    knee_s: f64,
    rate_per_s: f64,
    start_power: f64,
}

impl NoiseFloor {
    fn find(samples: &[f64], step_s: f64, bandwidth_hz: f64) -> Result<Self, NoReading> {
        // Blocks of about eight independent values: 1.5 dB of scatter.
        let block = ((8.0 / (bandwidth_hz * step_s)).ceil() as usize).clamp(1, samples.len() / 2);
        let block = block.max(samples.len() / 400);
        let power: Vec<f64> =
            samples.chunks_exact(block).map(|chunk| chunk.iter().sum::<f64>() / block as f64).collect();
        let block_s = block as f64 * step_s;
        let loudest = (0..power.len()).max_by(|&a, &b| power[a].total_cmp(&power[b])).unwrap_or(0);
        if power[loudest] <= 0.0 {
            return Err(NoReading::NoOnset);
        }
        let mean_from = |from: usize| {
            let tail = &power[from.min(power.len() - power.len().div_ceil(10))..];
            tail.iter().sum::<f64>() / tail.len() as f64
        };
        let mut noise = mean_from(power.len()).max(1e-20 * power[loudest]);
        let mut found = None;
        for _ in 0..6 {
            let above = noise * 10f64.powf(0.5);
            let end =
                (loudest..power.len()).find(|&i| power[i] < above).unwrap_or(power.len()).max(loudest + 2);
            let Some((level, rate)) = log_line(&power, loudest, end.min(power.len()), block_s) else { break };
            if rate <= 0.0 {
                break;
            }
            let knee_s = ((level - noise.ln()) / rate).clamp(block_s, power.len() as f64 * block_s);
            found = Some((level, rate, knee_s));
            // The floor is read 7 dB of decay after the knee.
            noise = mean_from(((knee_s + 1.6 / rate) / block_s) as usize).max(1e-20 * power[loudest]);
        }
        let (level, rate_per_s, knee_s) = found.ok_or(NoReading::NoDecay)?;
        Ok(Self { power: noise, knee_s, rate_per_s, start_power: level.exp() })
    }
}

/// Least-squares line through the logarithm of powers `from..to`: its value at time zero and how fast it falls.
fn log_line(power: &[f64], from: usize, to: usize, block_s: f64) -> Option<(f64, f64)> {
    let (mut n, mut t1, mut y1, mut tt, mut ty) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (i, &p) in power.iter().enumerate().take(to).skip(from).filter(|(_, p)| **p > 0.0) {
        let (t, y) = ((i as f64 + 0.5) * block_s, p.ln());
        n += 1.0;
        t1 += t;
        y1 += y;
        tt += t * t;
        ty += t * y;
    }
    let slope = (n * ty - t1 * y1) / (n * tt - t1 * t1);
    slope.is_finite().then(|| ((y1 - slope * t1) / n, -slope))
}

/// Growing bins up to a little beyond the knee, wide ones after it.
fn bins(samples: &[f64], step_s: f64, bandwidth_hz: f64, knee_s: f64) -> Vec<Bin> {
    let knee = ((1.2 * knee_s / step_s) as usize).clamp(1, samples.len());
    let least = (1.0 / (bandwidth_hz * step_s)).max(1.0);
    let floor = ((samples.len() - knee) as f64 / FLOOR_BINS as f64).max(WIDEST_BIN * knee as f64);
    let mut width = FIRST_BIN * knee as f64;
    let mut bins = Vec::with_capacity(128);
    let mut from = 0;
    while from < samples.len() {
        let wanted = if from < knee { width.min(WIDEST_BIN * knee as f64) } else { floor };
        let to = (from + wanted.max(least).ceil() as usize).min(samples.len());
        let power = samples[from..to].iter().sum::<f64>() / (to - from) as f64;
        let (from_s, to_s) = (from as f64 * step_s, to as f64 * step_s);
        bins.push(Bin { from_s, to_s, power, shape: bandwidth_hz * (to_s - from_s) });
        width *= BIN_GROWTH;
        from = to;
    }
    bins
}

/// Mean of exp(-rate t) over each bin, and the derivative of that mean by ln(rate).
fn mean_decay(bins: &[Bin], rate: f64, mut each: impl FnMut(usize, f64, f64)) {
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

/// The model at a point: for each slope ln(power at time zero) and ln(rate), then ln(noise power).
#[derive(Clone, Debug)]
struct Model {
    parameters: Vec<f64>,
    /// Expected power of each bin.
    expected: Vec<f64>,
    /// Its logarithmic derivative by each parameter, bin after bin.
    derivatives: Vec<f64>,
    /// Twice the negative log-likelihood, up to a constant of the data.
    deviance: f64,
    bounds: Bounds,
    /// True if the noise is not to be fitted.
    noise_is_known: bool,
    /// Whether the likelihood is at its maximum here.
    converged: bool,
}

/// Logarithms of a noise that counts as none, and of the power from which no decay starts.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    least_noise: f64,
    most_power: f64,
}

/// What limits the slopes that may be added.
struct Limits {
    bandwidth_hz: f64,
    longest_s: f64,
}

impl Model {
    /// The likeliest model of as many slopes as the data ask for.
    fn best(self, bins: &[Bin], limits: &Limits) -> Self {
        let mut best = self.maximise(bins);
        while best.slopes() < MOST_SLOPES {
            let Some(next) = best.with_one_more_slope(bins, limits) else { break };
            best = next;
        }
        best
    }

    /// Where a fit of one slope to other bins may start, with the noise of this model held.
    fn single_again(&self, bins: &[Bin]) -> Self {
        let n = self.parameters.len();
        let strongest = self.parameters[..n - 1]
            .chunks_exact(2)
            .max_by(|a, b| a[0].total_cmp(&b[0]))
            .map_or_else(|| self.parameters[..2].to_vec(), <[f64]>::to_vec);
        let parameters = vec![strongest[0], strongest[1], self.parameters[n - 1]];
        Self { noise_is_known: true, ..Self::at(parameters, bins, self.bounds) }
    }

    /// When the decays together have fallen by so many dB.
    fn time_of_fall(&self, fall_db: f64) -> f64 {
        let n = self.parameters.len();
        let power = |t: f64| -> f64 {
            self.parameters[..n - 1].chunks_exact(2).map(|pair| (pair[0] - t * pair[1].exp()).exp()).sum()
        };
        let target = power(0.0) * 10f64.powf(-0.1 * fall_db);
        let slowest = self.parameters[1..n - 1].iter().step_by(2).copied().fold(f64::MAX, f64::min).exp();
        bisect(0.0, fall_db / 60.0 * LN_MILLION / slowest, |t| power(t) - target)
    }

    fn single(floor: &NoiseFloor, bins: &[Bin]) -> Self {
        let loudest = bins.iter().fold(f64::MIN_POSITIVE, |most, bin| most.max(bin.power));
        // A decay may start well above the mean of its first bin, but not by more than 30 dB.
        let bounds = Bounds { least_noise: (1e-16 * loudest).ln(), most_power: (1e3 * loudest).ln() };
        let start = floor.start_power.ln().max(bounds.least_noise);
        Self::at(vec![start, floor.rate_per_s.ln(), floor.power.ln()], bins, bounds)
    }

    fn at(mut parameters: Vec<f64>, bins: &[Bin], bounds: Bounds) -> Self {
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

    /// True if the data speak for a decay against noise alone.
    fn is_needed(&self, bins: &[Bin]) -> bool {
        let shape: f64 = bins.iter().map(|bin| bin.shape).sum();
        let mean = bins.iter().map(|bin| bin.shape * bin.power).sum::<f64>() / shape;
        let alone: f64 = bins.iter().map(|bin| 2.0 * bin.shape * (bin.power / mean + mean.ln())).sum();
        (alone - self.deviance) / self.dispersion(bins).max(1.0) > SLOPE_EVIDENCE
    }

    fn moved(&self, parameters: Vec<f64>, bins: &[Bin]) -> Self {
        Self { noise_is_known: self.noise_is_known, ..Self::at(parameters, bins, self.bounds) }
    }

    fn slopes(&self) -> usize {
        self.parameters.len() / 2
    }

    /// Score and Fisher information.
    fn score(&self, bins: &[Bin]) -> (Vec<f64>, Vec<f64>) {
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

    /// Fisher scoring with Levenberg's damping.
    fn maximise(mut self, bins: &[Bin]) -> Self {
        let n = self.parameters.len();
        let mut damping = 1e-4;
        let (mut score, mut information) = self.score(bins);
        for _ in 0..ITERATIONS {
            let mut damped = information.clone();
            for i in 0..n {
                damped[i * n + i] += damping * information[i * n + i] + 1e-9;
            }
            // What a bound holds stays where it is; the others must not make up for a step that it cannot take.
            let mut free = score.clone();
            for i in (0..n).filter(|&i| self.is_held_by_bound(i, score[i])) {
                free[i] = 0.0;
                leave_out(&mut damped, n, i);
            }
            let Some(step) = solve(&damped, &free) else { break };
            let parameters = self.parameters.iter().zip(&step).map(|(p, s)| p + s.clamp(-1.0, 1.0)).collect();
            let tried = self.moved(parameters, bins);
            if tried.deviance <= self.deviance {
                let gain = self.deviance - tried.deviance;
                self = tried;
                if gain < NEGLIGIBLE_GAIN {
                    self.converged = true;
                    break;
                }
                (score, information) = self.score(bins);
                damping = (damping * 0.2).max(1e-9);
            } else {
                damping = (8.0 * damping).max(1e-3);
                if damping > 1e8 {
                    // Rounding hides a gain that is small; a large one that cannot be had is a failure.
                    let promised: f64 = step.iter().zip(&score).map(|(s, g)| s * g).sum();
                    self.converged = promised * damping < NEGLIGIBLE_GAIN;
                    break;
                }
            }
        }
        self
    }

    /// Whether a parameter is at its bound and wants to leave it: the noise of a response that has none.
    fn is_held_by_bound(&self, i: usize, score: f64) -> bool {
        let (noise, value) = (self.parameters.len() - 1, self.parameters[i]);
        let is_power = i.is_multiple_of(2) && i < noise;
        (i == noise && value <= self.bounds.least_noise && score < 0.0)
            || (is_power && value >= self.bounds.most_power && score > 0.0)
    }

    /// The model with one more slope, if the data ask for it.
    fn with_one_more_slope(&self, bins: &[Bin], limits: &Limits) -> Option<Self> {
        let end_s = bins.last()?.to_s;
        let dispersion = self.dispersion(bins).max(1.0);
        let needed = SLOPE_EVIDENCE.max(2.0 * (limits.bandwidth_hz * end_s).ln());
        let (evidence, start) = self.most_wanted_slope(bins)?;
        // The score test anticipates the gain; only a promising slope is worth a fit.
        if evidence < 0.25 * needed {
            return None;
        }
        let tried = self.moved(start, bins).maximise(bins);
        let dispersion = dispersion.min(tried.dispersion(bins).max(1.0));
        ((self.deviance - tried.deviance) / dispersion > needed
            && tried.converged
            && tried.is_physical(end_s, limits))
        .then_some(tried)
    }

    /// Rao's score test of one more slope of a given rate, over a range of rates: the largest statistic (chi-squared with
    /// one degree of freedom if there is no such slope) and where a fit should start.
    fn most_wanted_slope(&self, bins: &[Bin]) -> Option<(f64, Vec<f64>)> {
        let n = self.parameters.len();
        let (_, mut information) = self.score(bins);
        for i in 0..n {
            information[i * n + i] *= 1.0 + 1e-9;
            information[i * n + i] += 1e-9;
        }
        let rates = self.parameters[1..n - 1].iter().step_by(2).map(|rate| rate.exp());
        let (slowest, fastest) =
            rates.fold((f64::MAX, 0.0_f64), |(low, high), rate| (low.min(rate), high.max(rate)));
        let (low, high) = (slowest / 10.0, fastest * 10.0);
        let mut best: Option<(f64, Vec<f64>)> = None;
        for i in 0..16 {
            let rate = low * (high / low).powf(f64::from(i) / 15.0);
            let (mut score, mut own) = (0.0, 0.0);
            let mut shared = vec![0.0; n];
            mean_decay(bins, rate, |i, mean, _| {
                let by_power = mean / self.expected[i];
                let weight = bins[i].shape * by_power;
                score += weight * (bins[i].power / self.expected[i] - 1.0);
                own += weight * by_power;
                for (sum, derivative) in shared.iter_mut().zip(&self.derivatives[i * n..(i + 1) * n]) {
                    *sum += weight * derivative;
                }
            });
            let explained: f64 = solve(&information, &shared)?.iter().zip(&shared).map(|(a, b)| a * b).sum();
            let free = own - explained;
            if score <= 0.0 || free <= 1e-9 * own {
                continue;
            }
            let statistic = score * score / free;
            if best.as_ref().is_none_or(|(most, _)| statistic > *most) {
                let mut start = self.parameters[..n - 1].to_vec();
                start.extend([(score / free).ln(), rate.ln(), self.parameters[n - 1]]);
                best = Some((statistic, start));
            }
        }
        best
    }

    /// Slopes far enough apart, each long enough to be seen, the slowest distinct from a drifting floor.
    fn is_physical(&self, end_s: f64, limits: &Limits) -> bool {
        let n = self.parameters.len();
        let mut slopes: Vec<(f64, f64)> =
            self.parameters[..n - 1].chunks_exact(2).map(|pair| (pair[0], pair[1].exp())).collect();
        slopes.sort_by(|a, b| b.1.total_cmp(&a.1));
        let apart = slopes.windows(2).all(|pair| pair[0].1 > LEAST_RATIO * pair[1].1);
        let times_s = slopes.iter().map(|(_, rate)| LN_MILLION / rate);
        let unsmeared =
            times_s.clone().all(|t60_s| limits.bandwidth_hz * t60_s > 8.0 && t60_s < limits.longest_s);
        let [.., (fast_log, fast), (slow_log, slow)] = slopes[..] else { return apart && unsmeared };
        // From where the last two cross to where the slowest meets the noise, or the end.
        let crossing_s = ((fast_log - slow_log) / (fast - slow)).max(0.0);
        let knee_s = ((slow_log - self.parameters[n - 1]) / slow).min(end_s);
        let fall_db = 60.0 * slow / LN_MILLION * (knee_s - crossing_s);
        apart && unsmeared && fall_db > LEAST_VISIBLE_FALL_DB
    }

    /// Pearson's chi-squared per degree of freedom, over groups of bins that hold at least eight independent values each.
    fn dispersion(&self, bins: &[Bin]) -> f64 {
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
    fn covariance(&self, bins: &[Bin], dispersion: f64) -> Option<Vec<f64>> {
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

    fn finish(self, covariance: Vec<f64>, dispersion: f64, start_s: f64, end_s: f64) -> DecayFit {
        let n = self.parameters.len();
        let noise = self.parameters[n - 1].exp();
        let total: f64 = self.parameters[..n - 1].iter().step_by(2).map(|p| p.exp()).sum();
        let mut slopes: Vec<Slope> = (0..self.slopes())
            .map(|k| {
                let power = self.parameters[2 * k].exp();
                let t60_s = LN_MILLION / self.parameters[2 * k + 1].exp();
                let sd = |i: usize| covariance[i * n + i].max(0.0).sqrt();
                let level_db = 10.0 * (power / total).log10();
                Slope {
                    t60_s: Estimate::new(t60_s, t60_s * sd(2 * k + 1)),
                    power,
                    level_db: Estimate::new(level_db, 10.0 / std::f64::consts::LN_10 * sd(2 * k)),
                }
            })
            .collect();
        slopes.sort_by(|a, b| a.t60_s.value.total_cmp(&b.t60_s.value));
        DecayFit {
            slopes,
            noise_power: if noise.ln() > self.bounds.least_noise + 0.01 { noise } else { 0.0 },
            start_s,
            end_s,
            dispersion,
            parameters: self.parameters,
            covariance,
        }
    }
}

/// Takes a parameter out of an information matrix of order `n`.
fn leave_out(information: &mut [f64], n: usize, parameter: usize) {
    for i in 0..n {
        information[i * n + parameter] = 0.0;
        information[parameter * n + i] = 0.0;
    }
    information[parameter * n + parameter] = 1.0;
}

/// Solves a symmetric positive definite system by Cholesky's method; none if it is not.
fn solve(matrix: &[f64], right: &[f64]) -> Option<Vec<f64>> {
    let n = right.len();
    let mut lower = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| lower[i * n + k] * lower[j * n + k]).sum();
            let rest = matrix[i * n + j] - sum;
            if i == j {
                if rest.is_nan() || rest <= 0.0 {
                    return None;
                }
                lower[i * n + i] = rest.sqrt();
            } else {
                lower[i * n + j] = rest / lower[j * n + j];
            }
        }
    }
    let mut x = right.to_vec();
    for i in 0..n {
        let sum: f64 = (0..i).map(|k| lower[i * n + k] * x[k]).sum();
        x[i] = (x[i] - sum) / lower[i * n + i];
    }
    for i in (0..n).rev() {
        let sum: f64 = (i + 1..n).map(|k| lower[k * n + i] * x[k]).sum();
        x[i] = (x[i] - sum) / lower[i * n + i];
    }
    Some(x)
}

/// Where a falling function crosses zero.
fn bisect(mut low: f64, mut high: f64, falling: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if falling(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_maximum_out_of_reach_does_not_count_as_found() {
        // 60 dB in 0.5 s over a floor, in bins of 5 ms.
        let (step_s, rate_per_s) = (5e-3, LN_MILLION / 0.5);
        let power = |i: usize| (-rate_per_s * (i as f64 + 0.5) * step_s).exp() + 1e-4;
        let bin = |i: usize| Bin {
            from_s: i as f64 * step_s,
            to_s: (i + 1) as f64 * step_s,
            power: power(i),
            shape: 20.0,
        };
        let bins: Vec<Bin> = (0..100).map(bin).collect();
        let bounds = Bounds { least_noise: -40.0, most_power: 10.0 };
        let from = |log_rate: f64, log_noise: f64| {
            Model::at(vec![0.0, log_rate, log_noise], &bins, bounds).maximise(&bins)
        };
        let near = from(rate_per_s.ln() + 0.5, 1e-4f64.ln());
        assert!(
            near.converged && (near.parameters[1] - rate_per_s.ln()).abs() < 0.01,
            "{:?}",
            near.parameters
        );
        // No step is longer than 1, and there are 60 of them.
        let far = from(rate_per_s.ln(), 100.0);
        assert!(!far.converged, "{:?}", far.parameters);
    }
}
