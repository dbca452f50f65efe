//! What happens to samples after the microphone: all but the clock, which acts on arrival times.

use super::hidden::{Fault, Hidden};
use super::steep_bands::colour;
use super::stream::{Purpose, key, unit};
use super::truth::Truth;
use sabine_acoustics::Bands;
use sabine_acoustics::RealTransforms;
use std::f64::consts::{PI, TAU};

/// Duration over which a gap opens and closes, in seconds.
const GAP_EDGE_S: f64 = 1e-3;
/// Share of a chirp over which it rises, and falls.
const CHIRP_EDGE: f64 = 0.2;

/// Applies gains, polarity and everything that happens over time to the samples of one response.
pub(crate) fn record(truth: &Truth, index: usize, bands: Bands, sample_rate_hz: u32, samples: &mut Vec<f64>) {
    let rate_hz = f64::from(sample_rate_hz);
    let octaves = &truth.channel_gains_db[index];
    if octaves.iter().any(|db| *db != 0.0) {
        let amplitudes: Vec<f64> = octaves.iter().map(|db| 10f64.powf(db / 20.0)).collect();
        *samples = colour(bands, std::mem::take(samples), &amplitudes, sample_rate_hz);
    }
    let sign = if truth.inverted[index] { -1.0 } else { 1.0 };
    let gain = sign * 10f64.powf(truth.gains_db[index] / 20.0);
    samples.iter_mut().for_each(|s| *s *= gain);
    // A foreign sound is heard before anything happens in the recorder, and what ends the recording comes last.
    for effect in &truth.effects {
        if let Hidden::ForeignChirp { .. } = effect {
            add_chirp(truth, effect, index, rate_hz, samples);
        }
    }
    for effect in &truth.effects {
        match effect {
            Hidden::GainDrift { depth_db, period_s, phase_rad } => {
                let gain = |i: usize| {
                    let phase = TAU * i as f64 / rate_hz / period_s + phase_rad;
                    10f64.powf(depth_db * phase.sin() / 20.0)
                };
                samples.iter_mut().enumerate().for_each(|(i, s)| *s *= gain(i));
            }
            Hidden::Dropouts { gaps } => {
                for gap in gaps.iter().filter(|g| g.response == index) {
                    let open = |i: usize| {
                        let time_s = i as f64 / rate_hz - gap.start_s;
                        let inside_s = time_s.min(gap.length_s - time_s);
                        1.0 - rise(inside_s / GAP_EDGE_S)
                    };
                    samples.iter_mut().enumerate().for_each(|(i, s)| *s *= open(i));
                }
            }
            _ => {}
        }
    }
    for effect in &truth.effects {
        if let Hidden::Truncation { end_s, fade_s } = effect {
            let left = |i: usize| {
                let to_come_s = end_s - i as f64 / rate_hz;
                if to_come_s <= 0.0 {
                    0.0
                } else if *fade_s > 0.0 {
                    rise(to_come_s / fade_s)
                } else {
                    1.0
                }
            };
            samples.iter_mut().enumerate().for_each(|(i, s)| *s *= left(i));
        }
    }
}

/// Exchanges recordings.
pub(crate) fn swap(truth: &Truth, responses: &mut [Vec<f64>]) {
    for effect in &truth.effects {
        if let Hidden::ChannelFault { fault: Fault::Swap { a, b } } = *effect {
            responses.swap(a, b);
        }
    }
}

/// Raised cosine from 0 at 0 to 1 at 1.
fn rise(x: f64) -> f64 {
    0.5 - 0.5 * (PI * x.clamp(0.0, 1.0)).cos()
}

fn add_chirp(truth: &Truth, effect: &Hidden, index: usize, rate_hz: f64, samples: &mut [f64]) {
    let Hidden::ForeignChirp { start_s, length_s, from_hz, to_hz, level_db } = effect else { return };
    let first = (start_s * rate_hz) as usize;
    let last = samples.len().min(first + (length_s * rate_hz) as usize);
    if first >= last {
        return;
    }
    let phase_rad = TAU * unit(key(truth.seed, Purpose::Chirp, index));
    let octaves = (to_hz / from_hz).ln();
    let value = |i: usize| {
        let x = i as f64 / (length_s * rate_hz);
        // The integral of from (to / from)^x over time.
        let cycles =
            from_hz * length_s * if octaves.abs() < 1e-9 { x } else { ((octaves * x).exp() - 1.0) / octaves };
        let edge = rise(x / CHIRP_EDGE) * rise((1.0 - x) / CHIRP_EDGE);
        edge * (TAU * cycles + phase_rad).sin()
    };
    let chirp: Vec<f64> = (0..last - first).map(value).collect();
    let own: f64 = chirp.iter().map(|s| s * s).sum();
    let there = energy_between(&samples[first..last], rate_hz, from_hz.min(*to_hz), from_hz.max(*to_hz));
    let gain = (there / own * 10f64.powf(0.1 * level_db)).sqrt();
    samples[first..last].iter_mut().zip(chirp).for_each(|(s, c)| *s += gain * c);
}

/// Energy of samples between two frequencies.
fn energy_between(samples: &[f64], rate_hz: f64, low_hz: f64, high_hz: f64) -> f64 {
    let size = samples.len().next_power_of_two();
    let mut padded = samples.to_vec();
    padded.resize(size, 0.0);
    let forward = RealTransforms::<f64>::new(size).forward;
    let mut spectrum = forward.make_output_vec();
    // The plan made both buffers: their lengths agree.
    let _ = forward.process(&mut padded, &mut spectrum);
    let bin_hz = rate_hz / size as f64;
    let inside = |i: usize| (low_hz..=high_hz).contains(&(i as f64 * bin_hz));
    let sum: f64 = spectrum.iter().enumerate().filter(|(i, _)| inside(*i)).map(|(_, v)| v.norm_sqr()).sum();
    2.0 * sum / size as f64
}
