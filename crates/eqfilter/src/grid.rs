//! The frequency grid of a design: parts as taps and as responses, and the power that they pass in an octave.

use crate::octave::{support_hz, weight};
use realfft::num_complex::Complex;
use sabine_acoustics::{Bands, RealTransforms};

/// Shape of the Kaiser window on the taps: its main lobe is 1.6 times as wide as without a window, its side lobes are 30 dB down.
const KAISER_BETA: f64 = 4.0;

/// The frequency grid of a plan, and the transforms on it.
pub(crate) struct Grid {
    length: usize,
    bin_hz: f64,
    transforms: RealTransforms<f64>,
}

impl Grid {
    /// A grid for filters of `2 half + 1` taps: |H|^2 has `4 half + 1` lags, and twice as many points let it be interpolated.
    pub fn new(half: usize, sample_rate_hz: u32) -> Self {
        let length = fast_length(8 * half);
        Self {
            length,
            bin_hz: f64::from(sample_rate_hz) / length as f64,
            transforms: RealTransforms::<f64>::new(length),
        }
    }

    /// Right half of the taps of part `i`, and its zero-phase response.
    ///
    /// Parts overlap with their neighbours by half a cosine over the logarithm of frequency and add up to one; the outermost
    /// go on to 0 Hz and to half the sample rate.
    pub fn part(&self, centres_hz: &[f64], i: usize, window: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let cross = |hz: f64, from_hz: f64, to_hz: f64| {
            let u = ((hz / from_hz).ln() / (to_hz / from_hz).ln()).clamp(0.0, 1.0);
            0.5 - 0.5 * (std::f64::consts::PI * u).cos()
        };
        let (below, centre, above) =
            (i.checked_sub(1).map(|i| centres_hz[i]), centres_hz[i], centres_hz.get(i + 1).copied());
        let gain = |hz: f64| match (below, above) {
            (Some(below), _) if hz <= below => 0.0,
            (_, Some(above)) if hz >= above => 0.0,
            (Some(below), _) if hz < centre => cross(hz, below, centre),
            (_, Some(above)) if hz > centre => 1.0 - cross(hz, centre, above),
            _ => 1.0,
        };
        let mut spectrum: Vec<Complex<f64>> =
            (0..=self.length / 2).map(|k| Complex::new(gain(k as f64 * self.bin_hz), 0.0)).collect();
        let mut time = vec![0.0; self.length];
        let done = self.transforms.inverse.process(&mut spectrum, &mut time);
        debug_assert!(done.is_ok(), "a real spectrum of the planned length");
        let scale = 1.0 / self.length as f64;
        let taps: Vec<f64> = time.iter().zip(window).map(|(x, w)| x * w * scale).collect();
        time.fill(0.0);
        time[..taps.len()].copy_from_slice(&taps);
        for (n, &tap) in taps.iter().enumerate().skip(1) {
            time[self.length - n] = tap;
        }
        let done = self.transforms.forward.process(&mut time, &mut spectrum);
        debug_assert!(done.is_ok(), "lengths agree by construction");
        (taps, spectrum.iter().map(|x| x.re).collect())
    }

    /// Mean over an octave of the products of the responses: the quadratic form of its power gain, row by row.
    pub fn power_form(&self, bands: Bands, band: usize, responses: &[Vec<f64>]) -> Vec<f64> {
        let weights = self.weights(bands, band);
        // Only the bins that count, so that the products run over neighbours in memory.
        let picked: Vec<Vec<f64>> =
            responses.iter().map(|response| weights.iter().map(|&(k, _)| response[k]).collect()).collect();
        let n = responses.len();
        let mut form = vec![0.0; n * n];
        let mut weighted = vec![0.0; weights.len()];
        for i in 0..n {
            for ((to, r), (_, w)) in weighted.iter_mut().zip(&picked[i]).zip(&weights) {
                *to = r * w;
            }
            for j in 0..=i {
                let product = dot(&weighted, &picked[j]);
                form[i * n + j] = product;
                form[j * n + i] = product;
            }
        }
        form
    }

    /// Mean power gain over an octave of a filter of at most `2 half + 1` taps, for each of the first `active` bands, in dB.
    pub fn band_gains_db(&self, taps: &[f32], bands: Bands, active: usize) -> Vec<f64> {
        let mut time = vec![0.0; self.length];
        for (to, &from) in time.iter_mut().zip(taps) {
            *to = f64::from(from);
        }
        let mut spectrum = vec![Complex::default(); self.length / 2 + 1];
        let done = self.transforms.forward.process(&mut time, &mut spectrum);
        debug_assert!(done.is_ok(), "lengths agree by construction");
        let mean =
            |band| self.weights(bands, band).iter().map(|&(k, w)| w * spectrum[k].norm_sqr()).sum::<f64>();
        (0..active).map(|band| 10.0 * mean(band).log10()).collect()
    }

    /// Bins and weights by which the mean over an octave of a power response is formed; the weights add up to one.
    ///
    /// A low octave holds few bins: there the power between bins is interpolated, by a sinc in a window (cos^4) of sixteen bins,
    /// and the weights are the mean of the octave's shape with that kernel. A high octave is smooth over a bin.
    fn weights(&self, bands: Bands, band: usize) -> Vec<(usize, f64)> {
        /// From this many bins up an octave is smooth over a bin.
        const FINE: usize = 100;
        /// Points between bins.
        const POINTS: usize = 8;
        /// Half the width of the kernel, in bins.
        const REACH: f64 = 8.0;
        let nyquist = self.length / 2;
        let (low_hz, high_hz) = support_hz(bands, band);
        let first = (low_hz / self.bin_hz).floor() as usize;
        let last = ((high_hz / self.bin_hz).ceil() as usize).min(nyquist);
        let mut weights = Vec::new();
        if first > FINE {
            // Half the bins sample the power without loss.
            weights
                .extend((first..=last).step_by(2).map(|k| (k, weight(bands, band, k as f64 * self.bin_hz))));
        } else {
            let lowest = first.saturating_sub(REACH as usize);
            let highest = (last + REACH as usize).min(nyquist);
            weights.extend((lowest..=highest).map(|k| (k, 0.0)));
            // A point between two bins is made of REACH bins on either side, the same way between any two.
            let kernel: [[f64; 2 * REACH as usize]; POINTS] = std::array::from_fn(|point| {
                std::array::from_fn(|i| {
                    let t = (point as f64 + 0.5) / POINTS as f64 + REACH - 1.0 - i as f64;
                    let window = (std::f64::consts::FRAC_PI_2 * t / REACH).cos().powi(4);
                    window * (std::f64::consts::PI * t).sin() / (std::f64::consts::PI * t)
                })
            });
            for bin in first..last {
                for (point, kernel) in kernel.iter().enumerate() {
                    let at = bin as f64 + (point as f64 + 0.5) / POINTS as f64;
                    let shape = weight(bands, band, at * self.bin_hz);
                    for (i, share) in kernel.iter().enumerate() {
                        // The spectrum of a real signal is even about 0 Hz and about half the sample rate.
                        let k = (bin + i + 1).abs_diff(REACH as usize);
                        let k = if k > nyquist { self.length - k } else { k };
                        weights[k - lowest].1 += shape * share;
                    }
                }
            }
        }
        let total: f64 = weights.iter().map(|w| w.1).sum();
        weights.iter_mut().for_each(|w| w.1 /= total);
        weights
    }
}

/// Sum of products in four lanes, which the compiler turns into vectors.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a4.zip(b4) {
        for ((lane, x), y) in lanes.iter_mut().zip(x).zip(y) {
            *lane += x * y;
        }
    }
    lanes.iter().sum::<f64>() + rest
}

/// The least product of a power of two and at most one 3 that is not below `length`: such transforms are fast.
pub(crate) fn fast_length(length: usize) -> usize {
    let two = length.next_power_of_two();
    if two >= 4 && two / 4 * 3 >= length { two / 4 * 3 } else { two }
}

/// Middle and right half of a Kaiser window of `2 half + 1` samples.
pub(crate) fn kaiser_half(half: usize) -> Vec<f64> {
    let peak = bessel_i0(KAISER_BETA);
    let at = |n: usize| {
        let x = n as f64 / (half as f64 + 1.0);
        bessel_i0(KAISER_BETA * (1.0 - x * x).sqrt()) / peak
    };
    (0..=half).map(at).collect()
}

/// Modified Bessel function of the first kind, order 0, by its power series.
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > 1e-12 * sum {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transform_lengths_are_the_next_that_are_fast() {
        for (length, expected) in [(1, 1), (2, 2), (3, 3), (5, 6), (2048, 2048), (5644, 6144), (6145, 8192)] {
            assert_eq!(fast_length(length), expected, "{length}");
        }
    }

    /// I0(1) and I0(4): Abramowitz and Stegun, table 9.8.
    #[test]
    fn the_bessel_function_meets_its_table() {
        assert!((bessel_i0(1.0) - 1.266_065_878).abs() < 1e-9);
        assert!((bessel_i0(4.0) - 11.301_921_95).abs() < 1e-7);
    }
}
