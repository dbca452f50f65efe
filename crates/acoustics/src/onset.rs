//! When the direct sound arrives.

use crate::estimate::NoReading;

/// Blocks in which the level is judged, in seconds.
const BLOCK_S: f64 = 0.005;
/// Least level of the loudest block above the quietest fifth, in dB. The blocks of stationary Gaussian noise stay within
/// 3 dB of each other at 16 kHz.
const LEAST_CONTRAST_DB: f64 = 10.0;
/// The direct sound starts where the level first comes within this of the peak (ISO 3382-1, 5.3.3: the onset is where the
/// signal rises clearly above the background but is still more than 20 dB below the maximum).
const BELOW_PEAK_DB: f64 = 20.0;

/// The start of the response proper and its largest sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Onset {
    /// Index of the first sample within 20 dB of the peak: time zero of all parameters.
    pub index: usize,
    /// The same in seconds from the first sample.
    pub time_s: f64,
    /// Index of the largest magnitude, at or after the onset.
    pub peak_index: usize,
}

impl Onset {
    /// Finds the onset of a response. A constant offset should be removed first.
    ///
    /// ```
    /// use sabine_acoustics::Onset;
    /// let mut samples = vec![0.0_f32; 4000];
    /// for (i, x) in samples[800..].iter_mut().enumerate() {
    ///     *x = (-0.01 * i as f32).exp();
    /// }
    /// assert_eq!(Onset::find(&samples, 16000)?.time_s, 0.05);
    /// # Ok::<(), sabine_acoustics::NoReading>(())
    /// ```
    ///
    /// # Errors
    /// [`NoReading::NoOnset`] for silence, and where no block of 5 ms stands 10 dB above the quietest fifth of the blocks;
    /// [`NoReading::TooShort`] where there are fewer than four such blocks.
    pub fn find(samples: &[f32], sample_rate_hz: u32) -> Result<Self, NoReading> {
        let rate = f64::from(sample_rate_hz);
        let block = ((BLOCK_S * rate) as usize).max(1);
        let peak = samples.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
        if peak <= 0.0 {
            return Err(NoReading::NoOnset);
        }
        let mut power: Vec<f64> = samples
            .chunks_exact(block)
            .map(|chunk| chunk.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>() / block as f64)
            .collect();
        if power.len() < 4 {
            return Err(NoReading::TooShort {
                needed_s: 4.0 * BLOCK_S,
                available_s: samples.len() as f64 / rate,
            });
        }
        power.sort_by(f64::total_cmp);
        let quiet = power[power.len() / 5];
        let loud = power[power.len() - 1];
        if loud < quiet * 10f64.powf(0.1 * LEAST_CONTRAST_DB) {
            return Err(NoReading::NoOnset);
        }
        let peak_index = samples.iter().position(|x| x.abs() == peak).unwrap_or(0);
        // Noise must not be taken for the onset: stay above five times its standard deviation.
        let threshold = (f64::from(peak) * 10f64.powf(-0.05 * BELOW_PEAK_DB))
            .max((5.0 * quiet.sqrt()).min(f64::from(peak)));
        let index = samples.iter().position(|x| f64::from(x.abs()) >= threshold).unwrap_or(peak_index);
        Ok(Self { index, time_s: index as f64 / rate, peak_index })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_noise_and_a_single_sample_have_no_onset() {
        assert_eq!(Onset::find(&[0.0; 1000], 16000), Err(NoReading::NoOnset));
        assert!(matches!(Onset::find(&[1.0], 16000), Err(NoReading::TooShort { .. })));
        let mut state = 1u32;
        let noise: Vec<f32> = (0..32000)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as f32 / (1 << 23) as f32 - 1.0
            })
            .collect();
        assert_eq!(Onset::find(&noise, 16000), Err(NoReading::NoOnset));
    }

    #[test]
    fn an_echo_louder_than_the_direct_sound_does_not_move_time_zero() {
        let mut samples = vec![0.0; 2000];
        samples[300] = 0.5;
        samples[700] = 1.0;
        let onset = Onset::find(&samples, 16000).unwrap();
        assert_eq!((onset.index, onset.peak_index), (300, 700));
    }
}
