//! Whether what was deconvolved is a response: the octaves arrive together, and the clocks agree.

use crate::bands::Bands;
use crate::error::Error;
use crate::filter_bank::FilterBank;
use crate::spectrum::{Spectrum, fast_len};
use crate::sweep::ExponentialSweep;
use crate::sweep_error::SweepError;
use realfft::num_complex::Complex;

/// Lowest octave whose arrival is judged, nominal centre in Hz: lower ones ring for too long.
const LEAST_HZ: f64 = 500.0;
/// Time over which the energy of an octave is averaged, in seconds.
const SMOOTHING_S: f64 = 0.002;
/// An octave arrives where its energy first comes within this factor of its largest.
const ARRIVAL: f64 = 0.1;
/// Least factor of an octave's largest energy over its median: with less it is noise.
const LEAST_CONTRAST: f64 = 100.0;
/// Largest time between the arrivals of the octaves, in seconds: in a room the strongest sound may be a reflection.
const LARGEST_SPREAD_S: f64 = 0.05;
/// What is kept of a response to judge its clock, before and after its largest sample, in seconds.
const BEFORE_S: f64 = 0.02;
const AFTER_S: f64 = 0.08;
/// Differences of the clocks that are tried on a single sweep: as a share, and as a stretch in seconds.
const LARGEST_DRIFT: f64 = 2e-3;
const LARGEST_STRETCH_S: f64 = 0.02;
/// Least stretch of a single sweep that counts, in seconds: loudspeakers delay low octaves against high ones by as much.
const LEAST_STRETCH_S: f64 = 0.001;
/// Least factor by which the peak grows when the stretch is taken out.
const LEAST_GAIN: f64 = 1.25;

/// That the octaves of a deconvolved recording arrive together. `deconvolved` is the whole of it, negative times
/// first.
///
/// # Errors
/// [`SweepError::Mismatch`]; [`SweepError::NoOnset`] where no octave stands out of the noise.
pub(super) fn check_arrivals(deconvolved: &[f64], sweep: &ExponentialSweep) -> Result<(), Error> {
    let config = sweep.config();
    let rate = f64::from(config.sample_rate_hz);
    let all = Bands::octaves(31.5, 16_000.0)?;
    let inside: Vec<usize> = (0..all.len())
        .filter(|&i| {
            let (low_hz, high_hz) = all.edges_hz(i);
            low_hz >= config.from_hz && high_hz <= config.to_hz && all.nominal_hz(i) >= LEAST_HZ
        })
        .collect();
    let (Some(&first), Some(&last)) = (inside.first(), inside.last()) else { return Ok(()) };
    let samples: Vec<f32> = deconvolved.iter().map(|&x| x as f32).collect();
    let bank = FilterBank::new(all.part(first..last + 1), config.sample_rate_hz)?;
    let width = ((SMOOTHING_S * rate) as usize).max(1);
    let arrivals_s: Vec<f64> = bank
        .analyse(&samples)
        .values()
        .iter()
        .filter_map(|band| arrival(band, width))
        .map(|at| at / rate)
        .collect();
    let earliest = arrivals_s.iter().copied().fold(f64::INFINITY, f64::min);
    let spread_s = arrivals_s.iter().copied().fold(0.0, f64::max) - earliest;
    if arrivals_s.is_empty() {
        return Err(SweepError::NoOnset.into());
    }
    if spread_s > LARGEST_SPREAD_S { Err(SweepError::Mismatch { spread_s }.into()) } else { Ok(()) }
}

/// Sample at which an octave arrives; none where it does not stand out of the noise.
fn arrival(band: &[f32], width: usize) -> Option<f64> {
    let mut energy: Vec<f64> =
        band.chunks(width).map(|chunk| chunk.iter().map(|&x| f64::from(x).powi(2)).sum()).collect();
    let most = energy.iter().fold(0.0, |most: f64, &e| most.max(e));
    let at = energy.iter().position(|&e| e >= ARRIVAL * most)?;
    let middle = energy.len() / 2;
    let usual = *energy.select_nth_unstable_by(middle, f64::total_cmp).1;
    (most > LEAST_CONTRAST * usual).then_some((at * width) as f64)
}

/// That a single response is not stretched: the clocks differ if another speed of the sweep makes its peak higher.
///
/// At a difference d of the clocks a frequency f arrives d t(f) late, where t(f) is its time in the sweep: a phase that is
/// taken out of the spectrum.
///
/// # Errors
/// [`SweepError::ClockDrift`].
pub(super) fn check_clock(response: &[f64], sweep: &ExponentialSweep) -> Result<(), SweepError> {
    let config = sweep.config();
    let rate = f64::from(config.sample_rate_hz);
    let magnitude = |i: &usize| response[*i].abs();
    let Some(peak) = (0..response.len()).max_by(|a, b| magnitude(a).total_cmp(&magnitude(b))) else {
        return Ok(());
    };
    let start = peak.saturating_sub((BEFORE_S * rate) as usize);
    let end = (peak + (AFTER_S * rate) as usize).min(response.len());
    let part = &response[start..end];
    let spectrum = Spectrum::with_length(part, config.sample_rate_hz, fast_len(2 * part.len()));
    let scale_s = sweep.scale_s();
    let peak_at = |drift: f64| -> f64 {
        spectrum
            .changed(|_, hz, bin| {
                if hz <= config.from_hz {
                    return bin;
                }
                // The integral of the group delay d L ln(f / f1) over frequency.
                let turns = drift * scale_s * (hz * (hz / config.from_hz).ln() - hz);
                bin * Complex::from_polar(1.0, std::f64::consts::TAU * turns)
            })
            .iter()
            .fold(0.0, |most, x| most.max(x.abs()))
    };
    // Steps that shift the last frequency by half its period against the first.
    let step = 0.5 / (config.to_hz * config.duration_s);
    let steps = (LARGEST_DRIFT.min(LARGEST_STRETCH_S / config.duration_s) / step) as i64;
    let (mut best, mut highest) = (0.0, 0.0);
    let plain = peak_at(0.0);
    for i in -steps..=steps {
        let drift = i as f64 * step;
        let found = peak_at(drift);
        if found > highest {
            (best, highest) = (drift, found);
        }
    }
    if f64::abs(best) * config.duration_s >= LEAST_STRETCH_S && highest > LEAST_GAIN * plain {
        return Err(SweepError::ClockDrift { ppm: 1e6 * best });
    }
    Ok(())
}
