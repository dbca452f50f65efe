//! Exponential decays plus noise, by maximum likelihood.
//!
//! Squared samples of a band are summed over bins. Band-limited Gaussian noise of bandwidth B holds about B dt independent
//! values in a bin of width dt, so a bin's mean power y is nearly Gamma distributed about its expectation m with shape
//! B dt. The expectation is a sum of decays and a floor,
//! m(t) = sum_k a_k exp(-t / tau_k) + n, T_k = ln(10^6) tau_k,
//! integrated over the bin. The parameters (as logarithms) maximise the likelihood by Fisher scoring; its information
//! matrix gives the standard errors (Karjalainen et al. 2002 for the model; Balint et al. and the theory of generalised
//! linear models with Gamma response for the errors).

mod bins;
mod maximum;
mod model;
mod noise_floor;
mod numerics;
mod selection;

use crate::estimate::{Estimate, NoReading};
use bins::bins;
use model::{LN_MILLION, Model};
use noise_floor::NoiseFloor;
use numerics::bisect;
use selection::Limits;

/// Fewest bins that a confined fit may rest on.
const LEAST_BINS: usize = 16;
/// Least fall of any of several slopes from the start to the end of the response, in dB: less might be a floor that drifts.
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
        let fit = Self::of(best, covariance, dispersion, first as f64 * step_s, energy.len() as f64 * step_s);
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

    /// Reads the decays from a fitted model.
    fn of(model: Model, covariance: Vec<f64>, dispersion: f64, start_s: f64, end_s: f64) -> Self {
        let n = model.parameters.len();
        let noise = model.parameters[n - 1].exp();
        let total: f64 = model.parameters[..n - 1].iter().step_by(2).map(|p| p.exp()).sum();
        let mut slopes: Vec<Slope> = (0..model.slopes())
            .map(|k| {
                let power = model.parameters[2 * k].exp();
                let t60_s = LN_MILLION / model.parameters[2 * k + 1].exp();
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
        Self {
            slopes,
            noise_power: if noise.ln() > model.bounds.least_noise + 0.01 { noise } else { 0.0 },
            start_s,
            end_s,
            dispersion,
            parameters: model.parameters,
            covariance,
        }
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
