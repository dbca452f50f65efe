//! Standing waves below a frequency, in place of the images.

use super::hidden::Hidden;
use super::steep_bands::amplitude_at;
use super::truth::{Medium, Truth};
use crate::BoxModes;
use crate::own_air::energy_exponent_per_m;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use sabine_acoustics::RealTransforms;
use sabine_acoustics::{Bands, Error, OutOfRange};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Width of the crossover between standing waves and images, in octaves.
const CROSSOVER_OCTAVES: f64 = 1.0 / 3.0;
/// Silence after the samples, in seconds: the ringing of the crossover must not wrap around to the beginning.
const PADDING_S: f64 = 0.4;
/// The waves are summed as if they lost so many nepers more over the length of the transform: what lasts longer than that
/// does not come round again.
const DAMPED_NEPERS: f64 = 5.0;
/// Above the crossover the waves fade out over this factor of frequency before the damping is taken back.
const FADE: f64 = 1.3;
/// Terms of the sum that are left out.
const LEFT_OUT: f64 = 1e-5;
/// Most that a wall takes: the formula for its admittance ends there.
const MOST_ABSORPTION: f64 = 0.9;
/// Bounds of the crossover in a typical case, in Hz: just above all that a filter for the lowest octave (125 Hz) lets in, and what can
/// still be summed in good time.
const TYPICAL_HZ: (f64, f64) = (280.0, 400.0);
/// The least distance along some axis between a source and a receiver, in metres: closer, the sum has too many terms.
const LEAST_APART_M: f64 = 0.21;

/// Up to where the room is one of standing waves (Schroeder 1962: 2000 sqrt(T / V)), at least the lowest octave.
pub(crate) fn typical_below_hz(truth: &Truth, decay_s: f64) -> f64 {
    (2000.0 * (decay_s / truth.volume_m3()).sqrt()).clamp(TYPICAL_HZ.0, TYPICAL_HZ.1)
}

/// The crossover, where there is one.
fn below_hz(truth: &Truth) -> Option<f64> {
    let one = |effect: &Hidden| match effect {
        Hidden::RoomModes { below_hz } => Some(*below_hz),
        _ => None,
    };
    truth.effects.iter().filter_map(one).next_back().filter(|hz| *hz > 0.0)
}

/// Refuses places that are too near for the sum.
pub(crate) fn check(truth: &Truth) -> Result<(), Error> {
    if below_hz(truth).is_none() {
        return Ok(());
    }
    for source in &truth.sources {
        for receiver in &truth.receivers_m {
            let value = (0..3).map(|k| (source.position_m[k] - receiver[k]).abs()).fold(0.0, f64::max);
            if value < LEAST_APART_M {
                let field = "distance between source and receiver along an axis (m)";
                return Err(
                    OutOfRange { field, value, range: "at least 0.21 m where rooms have modes" }.into()
                );
            }
        }
    }
    Ok(())
}

/// Puts standing waves in place of what lies below the crossover.
///
/// The sum of modes has the same unit as the images (direct sound 1 at 1 m), the walls that admittance which takes the same at random
/// incidence (Kuttruff, Room Acoustics, 6th ed., 2.5 and chapter 3), octave values running straight over the logarithm of
/// frequency between the centres, and the same air. Waves W and images I have the direct sound D in common and nothing else:
/// cos (W - D) + sin (I - D) + D keeps both the direct sound and, at the crossover, the energy of the rest. Sources radiate alike
/// to all sides here, and surfaces that the box does not have are not met.
pub(crate) fn join(
    truth: &Truth,
    medium: &Medium,
    bands: Bands,
    index: usize,
    sample_rate_hz: u32,
    samples: Vec<f64>,
) -> Result<Vec<f64>, Error> {
    let Some(below_hz) = below_hz(truth) else { return Ok(samples) };
    let count = samples.len();
    let rate_hz = f64::from(sample_rate_hz);
    let size = (count + (PADDING_S * rate_hz) as usize).next_power_of_two();
    let bin_hz = rate_hz / size as f64;
    // Lines in the time of the recorder's clock stand for other frequencies in the room.
    let clock = 1.0 + 1e-6 * truth.clock_ppm;
    let loss_per_s = DAMPED_NEPERS * bin_hz * clock;
    let pair = (index / truth.receivers_m.len(), index % truth.receivers_m.len());
    let (from, to) = (truth.sources[pair.0].position_m, truth.receivers_m[pair.1]);
    let direct_m = (0..3).map(|k| (from[k] - to[k]).powi(2)).sum::<f64>().sqrt();
    let (highest_hz, air) = (below_hz * half().powi(2), truth.air()?);
    let amplitudes: Vec<f64> = truth.source_gains_db.iter().map(|db| 10f64.powf(db / 20.0)).collect();
    let last = (((highest_hz * FADE) / (bin_hz * clock)) as usize).min(size / 2 - 1);
    // Waves and direct sound, damped, and fading out above all that is wanted.
    let lines: Vec<[Complex<f64>; 2]> = (0..=last)
        .into_par_iter()
        .map(|i| {
            let hz = i as f64 * bin_hz * clock;
            let loss_per_m = 0.5 * energy_exponent_per_m(&air, hz.max(1.0)) + loss_per_s / medium.speed_m_s;
            let fading = ((hz / highest_hz).log2() / FADE.log2()).clamp(0.0, 1.0);
            let gain = (FRAC_PI_2 * fading).cos().powi(2) * amplitude_at(bands, &amplitudes, hz);
            let late = Complex::from_polar(gain, -TAU * hz * truth.latencies_s[index])
                * (-loss_per_s * truth.latencies_s[index]).exp();
            let walls = BoxModes::new(truth.size_m, admittances(truth, bands, hz), medium.speed_m_s)
                .with_air_loss(loss_per_m)
                .summed_to(LEFT_OUT);
            // A source of constant volume velocity leaves a static pressure, which no image has: nothing is said of 0 Hz.
            let (re, im) = if i == 0 { (0.0, 0.0) } else { walls.pressure(from, to, hz) };
            let direct = Complex::from_polar(
                (-loss_per_m * direct_m).exp() / direct_m,
                -TAU * hz * direct_m / medium.speed_m_s,
            );
            [Complex::new(re, im) * late, direct * late]
        })
        .collect();
    let RealTransforms { forward, inverse } = RealTransforms::<f64>::new(size);
    let spectrum = |mut samples: Vec<f64>| {
        let mut lines = forward.make_output_vec();
        samples.resize(size, 0.0);
        // The plan made all buffers: their lengths agree.
        let _ = forward.process(&mut samples, &mut lines);
        lines
    };
    let undamped = |part: usize| {
        let mut all = inverse.make_input_vec();
        for (to, line) in all.iter_mut().zip(&lines) {
            *to = line[part];
        }
        all[0].im = 0.0;
        let mut samples = inverse.make_output_vec();
        let _ = inverse.process(&mut all, &mut samples);
        samples.truncate(count);
        let damping = loss_per_s / (rate_hz * clock);
        samples.iter_mut().enumerate().for_each(|(n, s)| *s *= (damping * n as f64).exp() / size as f64);
        spectrum(samples)
    };
    let (waves, direct) = (undamped(0), undamped(1));
    let mut all = spectrum(samples);
    for (i, line) in all.iter_mut().enumerate() {
        let turn = FRAC_PI_2 * step(i as f64 * bin_hz * clock, below_hz);
        let (sine, cosine) = if turn < FRAC_PI_2 { turn.sin_cos() } else { (1.0, 0.0) };
        *line = (*line - direct[i]) * sine + (waves[i] - direct[i]) * cosine + direct[i];
    }
    let end = all.len() - 1;
    (all[0].im, all[end].im) = (0.0, 0.0);
    let mut joined = inverse.make_output_vec();
    let _ = inverse.process(&mut all, &mut joined);
    joined.truncate(count);
    joined.iter_mut().for_each(|s| *s /= size as f64);
    Ok(joined)
}

/// Half of the crossover, as a factor.
fn half() -> f64 {
    (0.5 * CROSSOVER_OCTAVES).exp2()
}

/// From 0 below the crossover to 1 above it.
fn step(hz: f64, below_hz: f64) -> f64 {
    ((hz.max(1e-3) / below_hz).log2() / CROSSOVER_OCTAVES + 0.5).clamp(0.0, 1.0)
}

/// The admittance of each face at a frequency.
fn admittances(truth: &Truth, bands: Bands, hz: f64) -> [f64; 6] {
    let count = bands.len();
    let octaves = (hz.max(1e-3) / bands.exact_hz(0)).log2();
    let place = (octaves * bands.per_octave() as f64).clamp(0.0, (count - 1) as f64);
    let lower = (place as usize).min(count.saturating_sub(2));
    let (upper, share) = ((lower + 1).min(count - 1), place - lower as f64);
    truth.faces.map(|m| {
        let absorption = &truth.materials[m].absorption;
        let value = absorption[lower] * (1.0 - share) + absorption[upper] * share;
        BoxModes::admittance(value.min(MOST_ABSORPTION))
    })
}
