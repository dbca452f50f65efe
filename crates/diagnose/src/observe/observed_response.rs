//! What is read from one measured response.

use crate::observe::band_pulse::BandPulse;
use crate::observe::early_energy::{EarlySamples, is_fast};
use crate::observe::pre_arrival;
use crate::observe::pre_arrival::PreArrivalBand;
use crate::observe::stated_parameter::StatedParameter;
use crate::observe::time_bins::Bins;
use sabine_acoustics::{Bands, FilterBank, ImpulseResponse, NoReading, Onset};

/// The direct sound's largest sample is looked for so long after the onset, in seconds.
const DIRECT_S: f64 = 0.8e-3;
/// Peaks are looked for so long after the direct sound.
pub(crate) const PEAKS_S: f64 = 0.04;
/// Early samples begin so long before the direct sound.
const BEFORE_S: f64 = 2e-3;
/// Peaks this far below the direct sound are not trusted.
pub(crate) const PEAK_FLOOR_DB: f64 = 26.0;
/// Peaks closer than this are one.
pub(crate) const PEAK_DISTANCE_S: f64 = 0.4e-3;
/// Most peaks of a response.
pub(crate) const MAX_PEAKS: usize = 24;
/// Smoothing of the squared samples before peaks are sought.
const SMOOTHING_S: f64 = 0.08e-3;
/// Half of the direct pulse that is compared for its sign.
const PULSE_S: f64 = 0.5e-3;
/// Frames in which a response is held against its own end.
const FRAME_S: f64 = 0.02;
/// The share of a response that counts as its end.
const END_SHARE: f64 = 0.1;
/// Energy of a frame over the mean of those at the end from which it is more than they are.
const ABOVE_END: f64 = 2.0;

/// One measured response: energies relative to the direct sound's instant, arrivals in the time of the file.
#[derive(Clone, Debug)]
pub(crate) struct Measured {
    /// Energy of each whole bin, `[band][bin]`, 1 for an undisturbed pulse of amplitude 1; `None` in a band above half the sample rate. Of a
    /// pair with a table in place of a response: the quantities of its values
    /// ([`quantity`](crate::observe::stated_parameter::quantity)), `[band][value]`.
    pub energies: Vec<Option<Vec<f64>>>,
    /// What its values are of, `[band][value]`, where a table takes the place of the response.
    pub table: Option<Vec<Vec<StatedParameter>>>,
    /// When the direct sound's peak comes, in seconds from the first sample.
    pub direct_s: f64,
    /// Later peaks, in seconds from the first sample.
    pub peaks_s: Vec<f64>,
    /// Their heights over that of the direct sound, in dB.
    pub peaks_db: Vec<f64>,
    /// Early energy of the octaves in which single reflections can be told apart.
    pub early: EarlySamples,
    /// Samples about the direct peak.
    pub pulse: Vec<f64>,
    /// What comes before the direct sound.
    pub lead_in: Vec<PreArrivalBand>,
    pub sample_rate_hz: u32,
    pub duration_s: f64,
    /// When it is louder than at its end for the last time, in seconds from the first sample.
    pub sounds_until_s: f64,
}

impl Measured {
    pub fn new(response: &ImpulseResponse, bands: Bands, kernels: &[BandPulse]) -> Result<Self, NoReading> {
        let sample_rate_hz = response.sample_rate_hz();
        let rate = f64::from(sample_rate_hz);
        let onset = Onset::find(response.samples(), sample_rate_hz)?;
        let smooth = smoothed_energy(response.samples(), rate);
        let end = (onset.index + (DIRECT_S * rate).ceil() as usize + 1).min(smooth.len());
        let largest = (onset.index..end).max_by(|&a, &b| smooth[a].total_cmp(&smooth[b]));
        let direct = largest.unwrap_or(onset.index);
        let direct_s = vertex(&smooth, direct) / rate;
        Self::read(response, bands, kernels, direct_s)
    }

    /// With times from an instant (seconds from the first sample) other than that of its direct sound, which it need not have.
    pub fn read(
        response: &ImpulseResponse,
        bands: Bands,
        kernels: &[BandPulse],
        direct_s: f64,
    ) -> Result<Self, NoReading> {
        let sample_rate_hz = response.sample_rate_hz();
        let rate = f64::from(sample_rate_hz);
        let samples = response.samples();
        let smooth = smoothed_energy(samples, rate);
        let direct = ((direct_s * rate).round().max(0.0) as usize).min(smooth.len().saturating_sub(1));
        let bank = FilterBank::new(bands, sample_rate_hz).map_err(|_| NoReading::NoOnset)?;
        let filtered = bank.analyse(samples);
        let duration_s = samples.len() as f64 / rate;
        let energies = filtered
            .values()
            .iter()
            .enumerate()
            .map(|(band, samples)| {
                bank.is_complete(band).then(|| {
                    let bins = Bins::new(bands, band);
                    energies(samples, direct_s * rate, rate, bins, kernels[band].energy)
                })
            })
            .collect();
        let mut early = EarlySamples::new(bands.len(), direct_s - BEFORE_S, rate);
        for (band, samples) in filtered.values().iter().enumerate() {
            if bank.is_complete(band) && is_fast(bands, band) {
                early.fill(band, samples, BEFORE_S + PEAKS_S, kernels[band].energy);
            }
        }
        let half = (PULSE_S * rate).round() as usize;
        let pulse = (direct.saturating_sub(half)..=direct + half)
            .map(|i| samples.get(i).copied().map_or(0.0, f64::from))
            .collect();
        let (peaks_s, peaks_db) = peaks(&smooth, direct, rate);
        let complete = |band: usize| bank.is_complete(band);
        let lead_in = pre_arrival::of_response(filtered.values(), &complete, bands, direct_s * rate, rate);
        let sounds_until_s = sounds_until_s(samples, rate);
        Ok(Self {
            energies,
            table: None,
            direct_s,
            peaks_s,
            peaks_db,
            early,
            pulse,
            lead_in,
            sample_rate_hz,
            duration_s,
            sounds_until_s,
        })
    }

    /// Likeness of the direct pulses of two responses, -1 to 1, at the best of small lags.
    pub fn pulse_likeness(&self, other: &Self) -> Option<f64> {
        if self.sample_rate_hz != other.sample_rate_hz || self.pulse.len() != other.pulse.len() {
            return None;
        }
        let norm = |p: &[f64]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
        let scale = norm(&self.pulse) * norm(&other.pulse);
        let n = self.pulse.len() as i64;
        let at = |lag: i64| -> f64 {
            (0..n)
                .filter_map(|i| {
                    other.pulse.get(usize::try_from(i + lag).ok()?).map(|o| o * self.pulse[i as usize])
                })
                .sum::<f64>()
                / scale
        };
        (-2..=2).map(at).max_by(|a, b| a.abs().total_cmp(&b.abs())).filter(|c| c.is_finite())
    }
}

/// When a response is louder than at its end for the last time, in seconds: the beginning of the last frame of which that is so. Nothing
/// can have been cut off before.
fn sounds_until_s(samples: &[f32], rate: f64) -> f64 {
    let size = ((FRAME_S * rate).round() as usize).max(1);
    let frames: Vec<f64> =
        samples.chunks_exact(size).map(|f| f.iter().map(|&x| f64::from(x).powi(2)).sum()).collect();
    let last = ((END_SHARE * frames.len() as f64).ceil() as usize).min(frames.len());
    let end = frames[frames.len() - last..].iter().sum::<f64>() / last.max(1) as f64;
    let frame = frames.iter().rposition(|&energy| energy > ABOVE_END * end).unwrap_or(0);
    (frame * size) as f64 / rate
}

/// Energy of each bin from squared samples; bin edges fall between samples.
pub(crate) fn energies(samples: &[f32], direct: f64, rate: f64, bins: Bins, unit: f64) -> Vec<f64> {
    let mut sum = 0.0;
    let mut before = vec![0.0];
    before.extend(samples.iter().map(|&x| {
        sum += f64::from(x).powi(2);
        sum
    }));
    let until = |time_s: f64| {
        let at = (direct + 0.5 + time_s * rate).clamp(0.0, samples.len() as f64);
        let index = (at as usize).min(samples.len() - 1);
        before[index] + (before[index + 1] - before[index]) * (at - index as f64)
    };
    let count = bins.count((samples.len() as f64 - direct - 0.5) / rate);
    (0..count).map(|k| (until(bins.edge_s(k + 1)) - until(bins.edge_s(k))).max(0.0) / unit).collect()
}

fn smoothed_energy(samples: &[f32], rate: f64) -> Vec<f64> {
    let half = ((SMOOTHING_S * rate).round() as usize).max(1);
    let weights: Vec<f64> = (0..=2 * half)
        .map(|i| 0.5 - 0.5 * (std::f64::consts::TAU * (i as f64 + 1.0) / (2.0 * half as f64 + 2.0)).cos())
        .collect();
    (0..samples.len())
        .map(|i| {
            weights
                .iter()
                .enumerate()
                .filter_map(|(j, w)| {
                    samples.get((i + j).checked_sub(half)?).map(|&x| w * f64::from(x).powi(2))
                })
                .sum()
        })
        .collect()
}

/// Position of a maximum between samples, by the parabola through the logarithms of three.
fn vertex(values: &[f64], at: usize) -> f64 {
    if at == 0 || at + 1 >= values.len() {
        return at as f64;
    }
    let [a, b, c] = [values[at - 1], values[at], values[at + 1]].map(|v| v.max(1e-300).ln());
    let curvature = a - 2.0 * b + c;
    at as f64 + if curvature < -1e-12 { (0.5 * (a - c) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Times in seconds and heights in dB over the direct sound.
fn peaks(smooth: &[f64], direct: usize, rate: f64) -> (Vec<f64>, Vec<f64>) {
    let apart = PEAK_DISTANCE_S * rate;
    let end = (direct + (PEAKS_S * rate) as usize).min(smooth.len().saturating_sub(1));
    let floor = smooth[direct] * 10f64.powf(-PEAK_FLOOR_DB / 10.0);
    let mut found: Vec<usize> = (direct + apart as usize + 1..end)
        .filter(|&i| smooth[i] > floor && smooth[i] >= smooth[i - 1] && smooth[i] > smooth[i + 1])
        .collect();
    found.sort_by(|&a, &b| smooth[b].total_cmp(&smooth[a]));
    let mut kept: Vec<usize> = Vec::new();
    for peak in found {
        if kept.len() < MAX_PEAKS && kept.iter().all(|k| k.abs_diff(peak) as f64 > apart) {
            kept.push(peak);
        }
    }
    kept.sort_unstable();
    let height_db = |k: &usize| 10.0 * (smooth[*k] / smooth[direct]).log10();
    let heights = kept.iter().map(height_db).collect();
    (kept.into_iter().map(|k| vertex(smooth, k) / rate).collect(), heights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decay_sounds_until_it_meets_noise_or_is_cut_off() {
        let rate = 8000.0;
        // 60 dB in 0.6 s, beside noise 40 dB down: they meet at 0.4 s, and to be twice as much as noise takes as much again.
        let decay = |i: usize| 10f32.powf(-3.0 * i as f32 / (0.6 * rate as f32));
        let sign = |i: usize| if (i * i / 7).is_multiple_of(3) { 1.0 } else { -1.0 };
        let noisy: Vec<f32> = (0..8000).map(|i| sign(i) * (decay(i).powi(2) + 1e-4).sqrt()).collect();
        let found = sounds_until_s(&noisy, rate);
        assert!((0.34..=0.40).contains(&found), "{found}");
        let cut: Vec<f32> = (0..8000).map(|i| if i < 2000 { sign(i) * decay(i) } else { 0.0 }).collect();
        let found = sounds_until_s(&cut, rate);
        assert!((0.25 - 1.01 * FRAME_S..=0.25).contains(&found), "{found}");
        // Too short for a frame, and the same from beginning to end.
        assert_eq!(sounds_until_s(&cut[..100], rate), 0.0);
        assert_eq!(sounds_until_s(&[0.5; 8000], rate), 0.0);
    }
}
