//! What happens to a response after propagation: sound that joins, loudspeaker and microphone, noise, recorder.

use crate::error::Error;
use crate::extend::applied_changes::AppliedChanges;
use crate::extend::applied_changes::BUILD_UP_S;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Bands, FilterBank, ImpulseResponse};

/// Rates of energy are laid down on a grid of this step and interpolated between.
const STEP_S: f64 = 2e-3;
/// Rounds in which filters' overlap is made up for.
const ROUNDS: usize = 40;
/// Length of the pulse on which filters are measured, to either side, in units of one over the bandwidth.
const REACH_BANDWIDTH_TIMES: f64 = 8.0;
/// Samples to either side that interpolation between samples looks at.
const TAPS: i64 = 48;

/// The part of an extended model that acts on rendered responses.
#[derive(Clone, Debug)]
pub(crate) struct RecordingChain {
    model: AppliedChanges,
    bands: Bands,
}

/// The octave filters of the measurement on a unit pulse.
struct Filters {
    bank: FilterBank,
    /// Bands that lie wholly below half the sample rate.
    used: Vec<bool>,
    /// Share of white noise's energy that each lets pass.
    share: Vec<f64>,
    /// `[b][c]`: share of band b's energy that noise filtered by c makes, if the white noise before is as strong as that which fills b.
    mixing: Vec<Vec<f64>>,
    pulse: Vec<f32>,
}

impl RecordingChain {
    /// A model that has passed its checks, and its bands.
    pub fn new(model: AppliedChanges, bands: Bands) -> Self {
        Self { model, bands }
    }

    /// `direct_s` is when the direct sound comes, in seconds after the emission.
    pub fn apply(
        &self,
        [source, receiver]: [&str; 2],
        direct_s: f64,
        receiver_m: [f64; 3],
        response: ImpulseResponse,
        seed: u64,
    ) -> Result<ImpulseResponse, Error> {
        let rate_hz = response.sample_rate_hz();
        let filters = Filters::new(self.bands, rate_hz)?;
        let name = format!("{source}-{receiver}");
        let gains = self.gains(&name);
        let mut samples = response.into_samples();
        let patterns = self.pattern_gains(receiver);
        let pattern_gains: Vec<f64> = gains.iter().zip(patterns).map(|(g, p)| g * p).collect();
        filters.amplify(&mut samples, &pattern_gains);
        let rate = f64::from(rate_hz);
        let stretch = 1.0 + 1e-6 * self.model.clock_ppm.unwrap_or(0.0);
        let latency_s = self.model.latency_s.unwrap_or(0.0);
        samples = warped(&samples, stretch, latency_s * rate);
        let begin_s = direct_s * stretch + latency_s;
        let steps = ((samples.len() as f64 / rate - begin_s) / STEP_S).max(0.0) as usize + 2;
        let rates: Vec<Vec<f64>> = (0..steps)
            .map(|i| {
                let after_s = i as f64 * STEP_S;
                (0..self.bands.len())
                    .map(|b| gains[b] * self.coupled_per_s(b, after_s, receiver_m) + self.noise_per_s(b))
                    .collect()
            })
            .collect();
        filters.add_noise(&mut samples, begin_s, rates, generator(seed, &name));
        if let Some(gain) = &self.model.gain_over_time {
            for (i, sample) in samples.iter_mut().enumerate() {
                *sample = (f64::from(*sample) * 10f64.powf(gain.at(i as f64 / rate) / 20.0)) as f32;
            }
        }
        if let Some([end_s, fade_s]) = self.model.truncation {
            for (i, sample) in samples.iter_mut().enumerate() {
                let left_s = end_s - i as f64 / rate;
                let share = if left_s <= 0.0 { 0.0 } else { (left_s / fade_s.max(1e-9)).min(1.0) };
                *sample *= (0.5 - 0.5 * (std::f64::consts::PI * share).cos()) as f32;
            }
        }
        let gain_db = self.model.response_gain_db.get(&name).copied().unwrap_or(0.0);
        let sign = if self.model.inverted.contains(&name) { -1.0 } else { 1.0 };
        let gain = sign * 10f64.powf(gain_db / 20.0);
        if gain != 1.0 {
            samples.iter_mut().for_each(|s| *s = (f64::from(*s) * gain) as f32);
        }
        Ok(ImpulseResponse::new(samples, rate_hz)?)
    }

    /// Energy gain of loudspeaker and microphone by octave, and of the channel of a response.
    fn gains(&self, response: &str) -> Vec<f64> {
        let own = self.model.response_band_gain_db.get(response);
        let gain = |list: &[f64], b: usize| list.get(b).map_or(1.0, |db| 10f64.powf(db / 10.0));
        (0..self.bands.len())
            .map(|b| gain(&self.model.gain_db, b) * own.map_or(1.0, |own| gain(own, b)))
            .collect()
    }

    /// What makes the power of a directional source, rendered with gain 1 on its axis, that of an omnidirectional one, and likewise the
    /// sensitivity of a directional receiver in a diffuse field.
    fn pattern_gains(&self, receiver: &str) -> Vec<f64> {
        let heard = self.model.receiver_directed_share.get(receiver);
        let gain =
            |list: &[f64], b: usize| list.get(b).map_or(1.0, |d| 1.0 / ((1.0 - d).powi(2) + d * d / 3.0));
        (0..self.bands.len())
            .map(|b| gain(&self.model.directed_share, b) * heard.map_or(1.0, |heard| gain(heard, b)))
            .collect()
    }

    fn noise_per_s(&self, band: usize) -> f64 {
        self.model.noise_per_s.get(band).copied().unwrap_or(0.0)
    }

    fn coupled_per_s(&self, band: usize, after_s: f64, receiver_m: [f64; 3]) -> f64 {
        let Some(coupled) = self.model.coupled.as_ref().filter(|_| after_s > 0.0) else { return 0.0 };
        let place_db: f64 =
            (0..3).map(|k| coupled.gradient_db_per_m[k] * (receiver_m[k] - coupled.centre_m[k])).sum();
        let built = 1.0 - (-after_s / BUILD_UP_S).exp();
        let fall_db = -60.0 * after_s / coupled.decay_time_s[band];
        coupled.energy_per_s[band] * built * 10f64.powf((place_db + fall_db) / 10.0)
    }
}

impl Filters {
    fn new(bands: Bands, rate_hz: u32) -> Result<Self, Error> {
        let bank = FilterBank::new(bands, rate_hz)?;
        let (low, high) = bands.edges_hz(0);
        let half = (REACH_BANDWIDTH_TIMES / (high - low) * f64::from(rate_hz)).ceil() as usize;
        let mut pulse = vec![0.0f32; 2 * half + 1];
        pulse[half] = 1.0;
        let once = bank.analyse(&pulse);
        let used: Vec<bool> = (0..bands.len()).map(|b| bank.is_complete(b)).collect();
        let share: Vec<f64> = once.values().iter().map(|h| energy(h)).collect();
        let mut mixing = vec![vec![0.0; bands.len()]; bands.len()];
        for (c, filtered) in once.values().iter().enumerate() {
            for (b, twice) in bank.analyse(filtered).values().iter().enumerate() {
                mixing[b][c] = energy(twice) / share[b].max(f64::MIN_POSITIVE);
            }
        }
        Ok(Self { bank, used, share, mixing, pulse })
    }

    /// Amplifies so that the octaves of a pulse change in energy by these factors.
    fn amplify(&self, samples: &mut [f32], gains: &[f64]) {
        if gains.iter().all(|g| (g - 1.0).abs() < 1e-12) {
            return;
        }
        let parts = self.bank.split(&self.pulse);
        let mut amplitudes: Vec<f64> = gains.iter().map(|g| g.sqrt()).collect();
        for _ in 0..ROUNDS {
            let mut sum = vec![0.0f32; self.pulse.len()];
            for (part, amplitude) in parts.values().iter().zip(&amplitudes) {
                sum.iter_mut().zip(part).for_each(|(s, p)| *s += (f64::from(*p) * amplitude) as f32);
            }
            let measured = self.bank.analyse(&sum);
            for (b, band) in measured.values().iter().enumerate().filter(|(b, _)| self.used[*b]) {
                amplitudes[b] *= (gains[b] * self.share[b] / energy(band).max(f64::MIN_POSITIVE)).sqrt();
            }
        }
        let parts = self.bank.split(samples);
        samples.fill(0.0);
        for (part, amplitude) in parts.values().iter().zip(&amplitudes) {
            samples.iter_mut().zip(part).for_each(|(s, p)| *s += (f64::from(*p) * amplitude) as f32);
        }
    }

    /// Adds Gaussian noise whose octaves have these energies per second relative to those of a unit pulse, `[step][band]` from
    /// `begin_s` on; before that it is as at the first step.
    fn add_noise(&self, samples: &mut [f32], begin_s: f64, mut rates: Vec<Vec<f64>>, mut random: Pcg64Mcg) {
        for rates in &mut rates {
            rates.iter_mut().zip(&self.used).for_each(|(r, used)| *r = if *used { *r } else { 0.0 });
        }
        if rates.iter().flatten().all(|&r| r == 0.0) {
            return;
        }
        let before: Vec<Vec<f64>> = rates.iter().map(|rates| self.before_filtering(rates)).collect();
        let rate = f64::from(self.bank.sample_rate_hz());
        for band in 0..self.used.len() {
            if before.iter().all(|b| b[band] == 0.0) {
                continue;
            }
            let white: Vec<f32> = (0..samples.len()).map(|_| StandardNormal.sample(&mut random)).collect();
            let filtered = self.bank.analyse(&white);
            for (i, (sum, noise)) in samples.iter_mut().zip(&filtered.values()[band]).enumerate() {
                let at = ((i as f64 / rate - begin_s) / STEP_S).max(0.0);
                let step = (at as usize).min(before.len() - 2);
                let part = at - step as f64;
                let per_s = before[step][band] * (1.0 - part) + before[step + 1][band] * part;
                *sum += (f64::from(*noise) * (per_s / rate).sqrt()) as f32;
            }
        }
    }

    /// White noise before the filters that makes these energies after: filters overlap, and what a neighbour lets in must not count twice.
    fn before_filtering(&self, rates: &[f64]) -> Vec<f64> {
        let mut found = rates.to_vec();
        for _ in 0..ROUNDS {
            let made: Vec<f64> =
                self.mixing.iter().map(|row| row.iter().zip(&found).map(|(m, f)| m * f).sum()).collect();
            for (f, (wanted, made)) in found.iter_mut().zip(rates.iter().zip(&made)) {
                *f *= if *made > 0.0 { wanted / made } else { 0.0 };
            }
        }
        found
    }
}

fn energy(samples: &[f32]) -> f64 {
    samples.iter().map(|&s| f64::from(s) * f64::from(s)).sum()
}

/// Another stream for each response.
fn generator(seed: u64, name: &str) -> Pcg64Mcg {
    // Fowler, Noll and Vo's hash: the names of one room differ little.
    let hash = name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325, |h: u64, byte| (h ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    Pcg64Mcg::seed_from_u64(seed ^ hash)
}

/// The signal with its time axis stretched about the first sample, then delayed by so many samples.
fn warped(samples: &[f32], stretch: f64, delay: f64) -> Vec<f32> {
    if stretch == 1.0 && delay == 0.0 {
        return samples.to_vec();
    }
    let length = ((samples.len() as f64 * stretch + delay).ceil()).max(1.0) as usize;
    (0..length)
        .map(|n| {
            let at = (n as f64 - delay) / stretch;
            let nearest = at.round() as i64;
            let sum: f64 = (nearest - TAPS..=nearest + TAPS)
                .filter_map(|k| {
                    let sample = samples.get(usize::try_from(k).ok()?)?;
                    let x = at - k as f64;
                    Some(f64::from(*sample) * interpolation(x))
                })
                .sum();
            sum as f32
        })
        .collect()
}

/// A sinc under a raised cosine.
fn interpolation(x: f64) -> f64 {
    let angle = std::f64::consts::PI * x;
    let sinc = if angle.abs() < 1e-9 { 1.0 } else { angle.sin() / angle };
    sinc * (0.5 + 0.5 * (angle / (TAPS as f64 + 1.0)).cos())
}
