//! Other ways to a filter: the plain window method, and minimum phase.

use crate::designer::check_gains;
use crate::filter::band_gains_db;
use crate::grid::fast_length;
use crate::{EqFilter, EqFilterConfig, Error, Phase};
use realfft::num_complex::Complex;
use sabine_acoustics::{Bands, PerBand, RealTransforms};

/// Least magnitude, relative to the largest, whose logarithm enters the minimum phase: -120 dB.
const LEAST_MAGNITUDE: f64 = 1e-6;

impl EqFilter {
    /// A linear-phase filter by the window method (Smith 2011, "Window method for FIR filter design"): gains joined by straight
    /// lines in dB over the logarithm of frequency, inverse transform, Hann window.
    ///
    /// This is what the augmentation of Tang et al. 2020 (section 3.4) uses. It does not correct for its own smoothing:
    /// [`EqFilter::realised_db`] says by how much the octaves miss. Levels go on unchanged beyond the outer centres.
    ///
    /// # Errors
    /// As [`EqFilter::design`].
    pub fn window_method(
        gains_db: &PerBand<f64>,
        sample_rate_hz: u32,
        config: EqFilterConfig,
    ) -> Result<Self, Error> {
        let bands = gains_db.bands();
        let half = config.check(bands, sample_rate_hz)?;
        check_gains(gains_db)?;
        let mut points: Vec<(f64, f64)> =
            (0..bands.len()).map(|b| (bands.exact_hz(b).log2(), gains_db.values()[b])).collect();
        if let Some(above) = config.above {
            let from = Bands::octaves(above.from_band_hz, above.from_band_hz)?;
            points.push((from.exact_hz(0).log2(), above.gain_db));
        }
        let length = fast_length(4 * half);
        let bin_hz = f64::from(sample_rate_hz) / length as f64;
        let mut spectrum: Vec<Complex<f64>> = (0..=length / 2)
            .map(|k| Complex::new(10f64.powf(interpolate(&points, (k as f64 * bin_hz).log2()) / 20.0), 0.0))
            .collect();
        let mut time = vec![0.0; length];
        let done = RealTransforms::<f64>::new(length).inverse.process(&mut spectrum, &mut time);
        debug_assert!(done.is_ok(), "a real spectrum of the planned length");
        let right: Vec<f64> = (0..=half)
            .map(|n| {
                let hann = (std::f64::consts::FRAC_PI_2 * n as f64 / (half as f64 + 1.0)).cos().powi(2);
                time[n] * hann / length as f64
            })
            .collect();
        let taps: Vec<f32> = right[1..].iter().rev().chain(&right).map(|&tap| tap as f32).collect();
        let realised = band_gains_db(&taps, sample_rate_hz, bands);
        Ok(Self::linear(taps, sample_rate_hz, gains_db.clone(), realised))
    }

    /// A minimum-phase filter with the magnitude of [`EqFilter::design`]: no delay, for live use.
    ///
    /// # Errors
    /// As [`EqFilter::design`].
    pub fn minimum_phase(
        gains_db: &PerBand<f64>,
        sample_rate_hz: u32,
        config: EqFilterConfig,
    ) -> Result<Self, Error> {
        Ok(Self::design(gains_db, sample_rate_hz, config)?.into_minimum_phase())
    }

    /// The filter of the same length and magnitude with minimum phase, by folding the cepstrum (Oppenheim and Schafer 2010,
    /// section 13.8). A filter that has minimum phase already is returned as it is.
    ///
    /// The zero-phase response of a linear-phase design is positive, so its exact minimum-phase counterpart is as long as
    /// itself. Magnitudes more than 120 dB below the largest are not kept.
    pub fn into_minimum_phase(self) -> Self {
        if self.phase() == Phase::Minimum {
            return self;
        }
        let taps = self.taps();
        // Eight times the length keeps the aliasing of the cepstrum below the resolution of the taps.
        let length = fast_length(8 * taps.len());
        let RealTransforms { forward, inverse: backward } = RealTransforms::<f64>::new(length);
        let mut time = vec![0.0; length];
        for (to, &from) in time.iter_mut().zip(taps) {
            *to = f64::from(from);
        }
        let mut spectrum = vec![Complex::default(); length / 2 + 1];
        let done = forward.process(&mut time, &mut spectrum);
        debug_assert!(done.is_ok(), "lengths agree by construction");
        let least = LEAST_MAGNITUDE * spectrum.iter().map(|x| x.norm()).fold(f64::MIN_POSITIVE, f64::max);
        for x in &mut spectrum {
            *x = Complex::new(x.norm().max(least).ln(), 0.0);
        }
        let done = backward.process(&mut spectrum, &mut time);
        debug_assert!(done.is_ok(), "a real spectrum of the planned length");
        // The cepstrum of the minimum-phase response is causal: fold what lies before time zero onto what lies after.
        let scale = 1.0 / length as f64;
        time[0] *= scale;
        time[length / 2] *= scale;
        time[1..length / 2].iter_mut().for_each(|c| *c *= 2.0 * scale);
        time[length / 2 + 1..].fill(0.0);
        let done = forward.process(&mut time, &mut spectrum);
        debug_assert!(done.is_ok(), "lengths agree by construction");
        for x in &mut spectrum {
            *x = x.exp() * scale;
        }
        spectrum[0].im = 0.0;
        spectrum[length / 2].im = 0.0;
        let done = backward.process(&mut spectrum, &mut time);
        debug_assert!(done.is_ok(), "the spectrum of a real response");
        let taps = time[..taps.len()].iter().map(|&tap| tap as f32).collect();
        self.with_taps(taps, Phase::Minimum)
    }
}

/// Straight lines between points of rising abscissa, level beyond them.
fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let after = points.partition_point(|p| p.0 <= x);
    match (after.checked_sub(1).map(|i| points[i]), points.get(after)) {
        (Some((x0, y0)), Some(&(x1, y1))) => y0 + (y1 - y0) * (x - x0) / (x1 - x0),
        (Some((_, y)), None) => y,
        (None, next) => next.map_or(0.0, |p| p.1),
    }
}
