//! How much a law changes what is recorded.

use sabine::acoustics::{Bands, FilterBank, ImpulseResponse};
use sabine_validation::AnyError;

/// Width of the stretches whose levels are compared, in seconds.
const STRETCH_S: f64 = 0.02;
/// Stretches so far below the strongest of their octave say nothing, in dB: a diagnosis compares as far.
const RANGE_DB: f64 = 35.0;

/// Root mean square of the change of level in dB, over responses, octaves and stretches of 20 ms from the first sample, less the mean change:
/// the gain of all is open. The two lists are the same rooms, but for the law.
///
/// # Errors
/// For bands that the sample rate does not hold.
pub fn change_db(
    with: &[ImpulseResponse],
    without: &[ImpulseResponse],
    bands: Bands,
) -> Result<f64, AnyError> {
    let levels = |response: &ImpulseResponse| -> Result<Vec<Vec<f64>>, AnyError> {
        let rate_hz = response.sample_rate_hz();
        let width = (STRETCH_S * f64::from(rate_hz)).round().max(1.0) as usize;
        let split = FilterBank::new(bands, rate_hz)?.analyse(response.samples());
        let binned = |samples: &Vec<f32>| -> Vec<f64> {
            samples.chunks(width).map(|bin| bin.iter().map(|&s| f64::from(s).powi(2)).sum()).collect()
        };
        Ok(split.values().iter().map(binned).collect())
    };
    let mut changes = Vec::new();
    for (with, without) in with.iter().zip(without) {
        for (with, without) in levels(with)?.iter().zip(levels(without)?) {
            let floor = without.iter().copied().fold(0.0, f64::max) * 10f64.powf(-0.1 * RANGE_DB);
            let heard = with.iter().zip(&without).filter(|(w, o)| **o > floor && **w > 0.0);
            changes.extend(heard.map(|(w, o)| 10.0 * (w / o).log10()));
        }
    }
    let count = changes.len().max(1) as f64;
    let mean = changes.iter().sum::<f64>() / count;
    Ok((changes.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / count).sqrt())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    #[test]
    fn a_gain_of_one_response_of_two_is_half_a_gain_off_the_mean() {
        let decay = |gain: f64| {
            let sample = |i: u32| (gain * (-f64::from(i) / 4000.0).exp() * (f64::from(i) * 1.7).sin()) as f32;
            ImpulseResponse::new((0..16_000).map(sample).collect(), 48_000).unwrap()
        };
        let without = [decay(1.0), decay(1.0)];
        let with = [decay(10f64.powf(0.1)), decay(1.0)];
        assert!((change_db(&with, &without, Bands::T60).unwrap() - 1.0).abs() < 1e-3);
        assert!(change_db(&without, &without, Bands::T60).unwrap() < 1e-9);
    }
}
