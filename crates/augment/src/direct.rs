//! Where the direct sound is.

use crate::error::Error;
use sabine_acoustics::ImpulseResponse;

/// Half the length of the direct sound, s (Bryan 2020; `t_d +- 2.5 ms`).
pub(crate) const HALF_DIRECT_S: f64 = 0.0025;
/// Least ratio of peak to root mean square, dB: Gaussian noise of a second reaches about 13 dB.
const LEAST_PEAK_DB: f64 = 15.5;
/// Least time from the end of the direct sound to the end of the response, s.
const LEAST_LATE_S: f64 = 0.02;
/// Consecutive samples at the peak that mean clipping.
const CLIPPED_RUN: usize = 4;
/// A second peak at least this strong (dB re the first)...
const SECOND_PEAK_DB: f64 = -1.0;
/// ... and this late (s) is a second response rather than a reflection.
const SECOND_PEAK_S: f64 = 0.1;

/// The direct sound: `[start, end)` about the largest sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Direct {
    pub(crate) peak: usize,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

impl Direct {
    /// Finds the largest sample and 2.5 ms on either side.
    ///
    /// # Errors
    /// [`Error::NoDirectSound`], [`Error::Clipped`], [`Error::NoLatePart`], [`Error::TwoDirectPeaks`].
    pub(crate) fn find(response: &ImpulseResponse) -> Result<Self, Error> {
        let samples = response.samples();
        let rate = f64::from(response.sample_rate_hz());
        let (peak, level) = samples
            .iter()
            .enumerate()
            .fold((0, 0.0_f32), |best, (i, s)| if s.abs() > best.1 { (i, s.abs()) } else { best });
        let power = samples.iter().map(|s| f64::from(s * s)).sum::<f64>() / samples.len() as f64;
        let peak_db = 10.0 * (f64::from(level).powi(2) / power).log10();
        let half = (HALF_DIRECT_S * rate).round() as usize;
        let direct =
            Self { peak, start: peak.saturating_sub(half), end: (peak + half + 1).min(samples.len()) };
        let late_s = (samples.len() - direct.end) as f64 / rate;
        if level <= 0.0 {
            return Err(Error::NoDirectSound { peak_db: f64::NEG_INFINITY });
        }
        if late_s < LEAST_LATE_S {
            return Err(Error::NoLatePart { late_s });
        }
        if peak_db.is_nan() || peak_db < LEAST_PEAK_DB {
            return Err(Error::NoDirectSound { peak_db });
        }
        let mut run = 0;
        for s in samples {
            run = if s.abs() >= 0.9999 * level { run + 1 } else { 0 };
            if run >= CLIPPED_RUN {
                return Err(Error::Clipped { samples: run });
            }
        }
        let far = (SECOND_PEAK_S * rate) as usize;
        let second = samples.iter().enumerate().filter(|(i, _)| i.abs_diff(peak) > far);
        let (at, strength) =
            second.fold((0, 0.0_f32), |best, (i, s)| if s.abs() > best.1 { (i, s.abs()) } else { best });
        let second_db = 20.0 * f64::from(strength / level).log10();
        if second_db > SECOND_PEAK_DB {
            return Err(Error::TwoDirectPeaks { second_db, delay_s: (at as f64 - peak as f64) / rate });
        }
        Ok(direct)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decay(n: usize) -> Vec<f32> {
        let mut s: Vec<f32> = (0..n)
            .map(|i| 0.1 * (i as f32 * 1.7 + (i * i) as f32 * 0.01).sin() * (-(i as f32) / 1500.0).exp())
            .collect();
        s[100] = 1.0;
        s
    }

    fn find(samples: Vec<f32>) -> Result<Direct, Error> {
        Direct::find(&ImpulseResponse::new(samples, 16_000).unwrap())
    }

    #[test]
    fn the_direct_sound_spans_5_ms() {
        assert_eq!(find(decay(8000)).unwrap(), Direct { peak: 100, start: 60, end: 141 });
    }

    #[test]
    fn responses_that_cannot_be_split_are_refused() {
        assert!(matches!(find(vec![0.0; 8000]), Err(Error::NoDirectSound { .. })));
        let noise = (0..8000).map(|i| ((i * 7919 % 1000) as f32 / 500.0) - 1.0).collect();
        assert!(matches!(find(noise), Err(Error::NoDirectSound { .. })));
        assert!(matches!(find(decay(200)), Err(Error::NoLatePart { .. })));
        let mut clipped = decay(8000);
        clipped[100..106].fill(1.0);
        assert!(matches!(find(clipped), Err(Error::Clipped { samples: 4 })));
        let mut twice = decay(8000);
        twice[4000] = -0.95;
        assert!(matches!(find(twice), Err(Error::TwoDirectPeaks { .. })));
    }
}
