//! The energy of one band of a response over time, and where its decay ends.

use crate::decay_fit::DecayFit;
use crate::estimate::NoReading;
use crate::filter_bank::{BandMask, padding_s};
use crate::onset::Onset;
use crate::signal::ImpulseResponse;
use crate::spectrum::Spectrum;

/// Share of the response, from its end, in which a constant offset is read.
const OFFSET_SHARE: usize = 5;
/// The direct sound lies within this of the largest sample (Bryan 2019).
const DIRECT_HALF_WIDTH_S: f64 = 0.0025;
/// What follows the onset by less than this is direct sound, not decay, in seconds.
const DIRECT_S: f64 = 0.005;
/// Time that a filter's ringing keeps the fit away from the onset and the end, in units of one over the bandwidth.
const RINGING_BANDWIDTH_TIMES: f64 = 1.5;

/// A response made ready: without offset and trailing digital silence, its onset known.
#[derive(Clone, Debug)]
pub(crate) struct Prepared {
    samples: Vec<f64>,
    /// Number of samples before the digital silence at the end.
    last: usize,
    sample_rate_hz: u32,
    pub(crate) onset: Result<Onset, NoReading>,
}

impl Prepared {
    pub(crate) fn new(response: &ImpulseResponse) -> Self {
        let sample_rate_hz = response.sample_rate_hz();
        let samples = response.samples();
        // Digital silence at the end says nothing about the noise of the measurement.
        let last = samples.iter().rposition(|&x| x != 0.0).map_or(0, |last| last + 1);
        let offset = offset(&samples[..last]);
        let mut level = samples.to_vec();
        for x in &mut level[..last] {
            *x = (f64::from(*x) - offset) as f32;
        }
        let onset = Onset::find(&level, sample_rate_hz);
        Self { samples: level.into_iter().map(f64::from).collect(), last, sample_rate_hz, onset }
    }

    /// A response made ready whose time zero is that of another channel of the same measurement.
    pub(crate) fn with_onset(response: &ImpulseResponse, onset: Result<Onset, NoReading>) -> Self {
        Self { onset, ..Self::new(response) }
    }

    /// The samples without offset.
    pub(crate) fn samples(&self) -> &[f64] {
        &self.samples
    }

    /// The direct sound alone, in place, the rest silent.
    fn direct(&self, onset: Onset) -> Vec<f64> {
        let half = (DIRECT_HALF_WIDTH_S * f64::from(self.sample_rate_hz)).round() as usize;
        let end = (onset.peak_index + half + 1).min(self.samples.len());
        let start = onset.peak_index.saturating_sub(half);
        let mut direct = vec![0.0; self.samples.len()];
        direct[start..end].copy_from_slice(&self.samples[start..end]);
        direct
    }

    /// The unfiltered response as one band.
    pub(crate) fn full_band(&self) -> Result<BandEnergy, NoReading> {
        let onset = self.onset.clone()?;
        let direct: f64 = self.direct(onset).iter().map(|x| x * x).sum();
        let energy = self.samples.iter().map(|x| x * x).collect();
        let bandwidth_hz = 0.5 * f64::from(self.sample_rate_hz);
        let bandwidths_hz = (bandwidth_hz, bandwidth_hz);
        Ok(BandEnergy::new(energy, self.last, self.sample_rate_hz, onset, bandwidths_hz, (direct, direct)))
    }

    /// The response split by masks; the outer result is that of the onset, the inner that of each band.
    pub(crate) fn bands(
        &self,
        edges_hz: impl Iterator<Item = (f64, f64)> + Clone,
    ) -> Vec<Result<BandEnergy, NoReading>> {
        let onset = match &self.onset {
            Ok(onset) => *onset,
            Err(reason) => return edges_hz.map(|_| Err(reason.clone())).collect(),
        };
        let sample_rate_hz = self.sample_rate_hz;
        let padding = edges_hz.clone().map(padding_s).fold(0.0, f64::max);
        let spectrum = Spectrum::new(&self.samples, sample_rate_hz, padding);
        let direct = Spectrum::new(&self.direct(onset), sample_rate_hz, padding);
        let limit_hz = 0.5 * f64::from(sample_rate_hz);
        edges_hz
            .map(|edges| {
                if edges.1 > limit_hz {
                    return Err(NoReading::AboveNyquist { sample_rate_hz });
                }
                let mask = BandMask::between(edges);
                let gain = |hz: f64| mask.gain(hz);
                let band = spectrum.filtered(mask.support_hz(), gain);
                Ok(BandEnergy::new(
                    band.into_iter().map(|x| x * x).collect(),
                    self.last,
                    sample_rate_hz,
                    onset,
                    (mask.statistical_bandwidth_hz(limit_hz), mask.energy_bandwidth_hz(limit_hz)),
                    (
                        direct.product(&direct, mask.support_hz(), gain),
                        direct.product(&spectrum, mask.support_hz(), gain),
                    ),
                ))
            })
            .collect()
    }
}

/// The constant part of a response: the mean of the middle half of the samples in its last fifth, where a pulse or a decay
/// leaves least.
fn offset(samples: &[f32]) -> f64 {
    let mut tail = samples[samples.len() - samples.len().div_ceil(OFFSET_SHARE)..].to_vec();
    tail.sort_by(f32::total_cmp);
    let middle = &tail[tail.len() / 4..tail.len() - tail.len() / 4];
    middle.iter().copied().map(f64::from).sum::<f64>() / middle.len().max(1) as f64
}

/// Squared samples of a band, with what is known of their decay.
#[derive(Clone, Debug)]
pub(crate) struct BandEnergy {
    pub(crate) energy: Vec<f64>,
    pub(crate) step_s: f64,
    /// First step that may hold signal: the onset less the filter's ringing.
    pub(crate) first: usize,
    /// Step of the onset.
    pub(crate) onset: usize,
    /// Step at which summation stops: where the decay meets the noise, or the end.
    pub(crate) end: usize,
    /// Energy that is left after `end`, by the fit.
    pub(crate) tail: f64,
    /// Mean noise in a step.
    pub(crate) noise: f64,
    pub(crate) statistical_bandwidth_hz: f64,
    pub(crate) energy_bandwidth_hz: f64,
    /// Energy within 2.5 ms of the peak of the unfiltered response.
    pub(crate) direct: f64,
    /// Sum of the products of the direct sound and the whole, both in the band.
    pub(crate) direct_in_all: f64,
    pub(crate) fit: Result<DecayFit, NoReading>,
}

impl BandEnergy {
    fn new(
        energy: Vec<f64>,
        last: usize,
        sample_rate_hz: u32,
        onset: Onset,
        (statistical_bandwidth_hz, energy_bandwidth_hz): (f64, f64),
        (direct, direct_in_all): (f64, f64),
    ) -> Self {
        let rate = f64::from(sample_rate_hz);
        let step_s = 1.0 / rate;
        let ringing_s = RINGING_BANDWIDTH_TIMES / statistical_bandwidth_hz;
        let ringing = (ringing_s * rate).ceil() as usize;
        let trusted = last.saturating_sub(ringing);
        let start_s = onset.time_s + DIRECT_S.max(ringing_s);
        let fit = DecayFit::fit(&energy[..trusted], step_s, start_s, statistical_bandwidth_hz);
        let (end, tail, noise) = match &fit {
            Ok(fit) => {
                let end = ((fit.knee_s() * rate) as usize).clamp(onset.index + 1, energy.len());
                (end, fit.decay_energy_after(end as f64 * step_s, step_s), fit.noise_power())
            }
            Err(_) => {
                let quiet = &energy[energy.len() - energy.len().div_ceil(10)..];
                (energy.len(), 0.0, quiet.iter().sum::<f64>() / quiet.len() as f64)
            }
        };
        let first = onset.index.saturating_sub(ringing);
        Self {
            energy,
            step_s,
            first,
            onset: onset.index,
            end,
            tail,
            noise,
            statistical_bandwidth_hz,
            energy_bandwidth_hz,
            direct,
            direct_in_all,
            fit,
        }
    }

    /// Energy from a step on without the noise, with what the fitted decay says of the time after the knee, and the variance that
    /// the noise gives it.
    pub(crate) fn from(&self, step: usize) -> (f64, f64) {
        let end = self.trusted_end();
        let (net, variance) = self.net(step, end.max(step));
        let tail = match &self.fit {
            Ok(fit) if end == self.end => {
                fit.decay_energy_after(end.max(step) as f64 * self.step_s, self.step_s)
            }
            _ => 0.0,
        };
        (net + tail, variance)
    }

    /// Energy of the whole response without the noise, and the variance that the noise gives it.
    pub(crate) fn total(&self) -> (f64, f64) {
        self.from(self.first)
    }

    /// The knee, or the end of the response where sound follows that the fitted decay does not know: a distinct echo.
    pub(crate) fn trusted_end(&self) -> usize {
        let (after, variance) = self.net(self.end, self.energy.len());
        let unexplained = after - self.tail;
        // Six standard deviations of the noise, and 0.1 dB of what the fit says.
        let is_echo = unexplained > 6.0 * variance.sqrt() && unexplained > 0.023 * self.tail;
        if is_echo { self.energy.len() } else { self.end }
    }

    /// Energy between two steps without the noise, and the variance that the noise gives it.
    pub(crate) fn net(&self, from: usize, to: usize) -> (f64, f64) {
        let to = to.min(self.energy.len());
        let from = from.min(to);
        self.without_noise(self.energy[from..to].iter().sum(), to - from)
    }

    /// An energy summed over so many steps less the noise in them, and the variance that the noise gives it.
    pub(crate) fn without_noise(&self, gross: f64, steps: usize) -> (f64, f64) {
        let net = gross - self.noise * steps as f64;
        // Signal times noise, and noise alone, each with 1 / (B dt) of relative variance in a step dt.
        let spread = 1.0 / (self.statistical_bandwidth_hz * self.step_s);
        let variance = spread * (2.0 * net.max(0.0) * self.noise + steps as f64 * self.noise.powi(2));
        (net, variance)
    }
}
