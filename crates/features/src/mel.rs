//! The mel scale of Slaney's Auditory Toolbox and its triangular bands.

use crate::Error;

/// Mel per hertz below [`BREAK_HZ`], where the scale is linear (Slaney 1998).
const MEL_PER_HZ: f64 = 3.0 / 200.0;
/// Where the scale turns logarithmic, in Hz.
const BREAK_HZ: f64 = 1000.0;
/// The same in mel.
const BREAK_MEL: f64 = BREAK_HZ * MEL_PER_HZ;
/// Natural logarithm of the frequency ratio per mel above the break: 6.4 in 27 steps.
fn log_step() -> f64 {
    6.4_f64.ln() / 27.0
}

/// Frames that are turned into bands side by side: eight single-precision numbers fill the vectors of common processors.
pub(crate) const LANES: usize = 8;

/// Frequency in Hz to mel (Slaney 1998: linear below 1 kHz, logarithmic above).
///
/// ```
/// use sabine_features::hz_to_mel;
/// assert!((hz_to_mel(1000.0) - 15.0).abs() < 1e-12);
/// assert!((hz_to_mel(6400.0) - 42.0).abs() < 1e-12);
/// ```
pub fn hz_to_mel(hz: f64) -> f64 {
    if hz < BREAK_HZ { hz * MEL_PER_HZ } else { BREAK_MEL + (hz / BREAK_HZ).ln() / log_step() }
}

/// Mel to frequency in Hz, the inverse of [`hz_to_mel`].
pub fn mel_to_hz(mel: f64) -> f64 {
    if mel < BREAK_MEL { mel / MEL_PER_HZ } else { BREAK_HZ * ((mel - BREAK_MEL) * log_step()).exp() }
}

/// Triangular bands, equally spaced in mel, each with unit area over frequency in Hz, as sparse rows over the bins of an FFT.
#[derive(Clone, Debug)]
pub struct MelBands {
    bands: Vec<MelBand>,
    bins: usize,
}

#[derive(Clone, Debug)]
struct MelBand {
    first_bin: usize,
    weights: Vec<f32>,
}

impl MelBands {
    /// `mels` triangles between `low_hz` and `high_hz` over the `n_fft / 2 + 1` bins of a transform of `n_fft` samples.
    /// The ranges are the caller's to check.
    pub(crate) fn new(
        sample_rate_hz: u32,
        n_fft: usize,
        mels: usize,
        low_hz: f64,
        high_hz: f64,
    ) -> Result<Self, Error> {
        let (low, high) = (hz_to_mel(low_hz), hz_to_mel(high_hz));
        let corner_hz = |i: usize| mel_to_hz(low + (high - low) * i as f64 / (mels + 1) as f64);
        let bins = n_fft / 2 + 1;
        let bin_hz = |k: usize| k as f64 * f64::from(sample_rate_hz) / n_fft as f64;
        let mut bands = Vec::with_capacity(mels);
        for band in 0..mels {
            let (left, centre, right) = (corner_hz(band), corner_hz(band + 1), corner_hz(band + 2));
            let height = 2.0 / (right - left);
            let weight = |hz: f64| {
                height * ((hz - left) / (centre - left)).min((right - hz) / (right - centre)).max(0.0)
            };
            let inside = |k: &usize| weight(bin_hz(*k)) > 0.0;
            let Some(first_bin) = (0..bins).find(inside) else {
                return Err(Error::EmptyMelBand { band, mels, n_fft });
            };
            let weights = (first_bin..bins).take_while(inside).map(|k| weight(bin_hz(k)) as f32).collect();
            bands.push(MelBand { first_bin, weights });
        }
        Ok(Self { bands, bins })
    }

    /// Number of bands.
    #[allow(clippy::len_without_is_empty)] // never empty by construction
    pub fn len(&self) -> usize {
        self.bands.len()
    }

    /// Weight of each bin in a band.
    ///
    /// # Panics
    /// If there is no such band.
    pub fn row(&self, band: usize) -> Vec<f64> {
        let mut row = vec![0.0; self.bins];
        let MelBand { first_bin, weights } = &self.bands[band];
        for (to, &from) in row[*first_bin..].iter_mut().zip(weights) {
            *to = f64::from(from);
        }
        row
    }

    /// Power in each band of [`LANES`] frames side by side, handed to `take(band, powers)`. Each lane is summed in the order of
    /// its bins, so that a frame's power does not depend on its neighbours.
    pub(crate) fn apply(&self, power: &[[f32; LANES]], mut take: impl FnMut(usize, &[f32; LANES])) {
        for (i, band) in self.bands.iter().enumerate() {
            let mut sum = [0.0; LANES];
            for (bin, &weight) in power[band.first_bin..].iter().zip(&band.weights) {
                for (sum, &p) in sum.iter_mut().zip(bin) {
                    *sum += weight * p;
                }
            }
            take(i, &sum);
        }
    }
}
