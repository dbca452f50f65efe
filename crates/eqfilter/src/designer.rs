//! The linear-phase design that corrects for its own smoothing.

use crate::error::check_range;
use crate::octave::{support_hz, upper_share, weight};
use crate::solve::solve_levels;
use crate::{EqFilter, EqFilterConfig, Error};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use sabine_acoustics::{OctaveBands, PerBand};

/// Half the width, in octaves, of the step from one band's level to the next.
const STEP_OVERLAP: f64 = 0.15;
/// Shape of the Kaiser window on the taps.
const KAISER_BETA: f64 = 4.0;

/// Designs linear-phase filters for one set of bands, sample rate and delay; planned once, run many times.
///
/// A filter is a sum of one windowed low-, band- or high-pass for each octave. The power that it passes in each octave is then a
/// quadratic form in the levels of these parts, so the levels that *realise* the wanted gains, after all smoothing by the
/// finite length, solve a few small equations (damped Newton steps in dB). Where no levels do, the solution is nearest
/// in least squares, and [`EqFilter::realised_db`] says what it gives.
#[derive(Clone, Debug)]
pub struct EqDesigner {
    bands: OctaveBands,
    sample_rate_hz: u32,
    config: EqFilterConfig,
    /// Samples on either side of the middle tap.
    half: usize,
    /// Right half, middle tap first, of each part: one for each band below half the sample rate, then the one above.
    parts: Vec<Vec<f64>>,
    /// Number of bands below half the sample rate.
    active: usize,
    /// For each active band: the quadratic form of its mean power gain in the amplitudes of the parts, row by row.
    power: Vec<Vec<f64>>,
}

impl EqDesigner {
    /// Plans designs for gains at these bands.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting out of its range, [`Error::AboveOverlaps`] if `config.above` starts at a band that
    /// is among `bands`, [`Error::NothingBelowNyquist`] if no band is, [`Error::Acoustics`] for an unknown octave.
    pub fn new(bands: OctaveBands, sample_rate_hz: u32, config: EqFilterConfig) -> Result<Self, Error> {
        let half = config.check(bands, sample_rate_hz)?;
        let nyquist_hz = f64::from(sample_rate_hz) / 2.0;
        let active = (0..bands.len()).take_while(|&b| bands.edges_hz(b).0 < nyquist_hz).count();
        // Frequencies at which one part gives way to the next.
        let mut edges_hz: Vec<f64> = (1..active).map(|b| bands.edges_hz(b).0).collect();
        if let Some(above) = config.above {
            let (low_hz, _) = OctaveBands::new(above.from_band_hz, above.from_band_hz)?.edges_hz(0);
            if low_hz < nyquist_hz {
                edges_hz.push(low_hz);
            }
        }
        // |H|^2 of a filter of 2 half + 1 taps has 4 half + 1 lags, so this grid samples it without loss.
        let grid = Grid::new(fast_length(4 * half), sample_rate_hz);
        let window = kaiser_half(half);
        let (mut parts, mut responses) = (Vec::new(), Vec::new());
        for part in 0..=edges_hz.len() {
            let below = part.checked_sub(1).map(|i| edges_hz[i]);
            let (taps, response) = grid.part(below, edges_hz.get(part).copied(), &window);
            parts.push(taps);
            responses.push(response);
        }
        let power = (0..active).map(|b| grid.power_form(bands, b, &responses)).collect();
        Ok(Self { bands, sample_rate_hz, config, half, parts, active, power })
    }

    /// The bands that it takes gains for.
    pub fn bands(&self) -> OctaveBands {
        self.bands
    }

    /// Taps of the filters that it designs: odd.
    pub fn taps(&self) -> usize {
        2 * self.half + 1
    }

    /// The filter whose octave-band gains are these, in dB. Gains of bands that lie wholly above half the sample rate have
    /// no effect.
    ///
    /// # Errors
    /// [`Error::Bands`] for other bands than planned, [`Error::Gain`] for a gain that is not finite or beyond 120 dB.
    pub fn design(&self, gains_db: &PerBand<f64>) -> Result<EqFilter, Error> {
        if gains_db.bands() != self.bands {
            return Err(Error::Bands {
                planned: self.bands.len(),
                planned_first_hz: self.bands.nominal_hz(0),
                given: gains_db.bands().len(),
                given_first_hz: gains_db.bands().nominal_hz(0),
            });
        }
        check_gains(gains_db)?;
        let fixed_db = (self.parts.len() > self.active).then(|| self.config.above.map_or(0.0, |a| a.gain_db));
        let solution = solve_levels(&self.power, &gains_db.values()[..self.active], fixed_db);
        let mut right = vec![0.0; self.half + 1];
        for (part, &amplitude) in self.parts.iter().zip(&solution.amplitudes) {
            for (sum, &tap) in right.iter_mut().zip(part) {
                *sum += amplitude * tap;
            }
        }
        let taps = right[1..].iter().rev().chain(&right).map(|&tap| tap as f32).collect();
        let realised = PerBand::from_fn(self.bands, |b| solution.realised_db.get(b).copied());
        Ok(EqFilter::linear(taps, self.sample_rate_hz, gains_db.clone(), realised))
    }
}

/// Checks each gain.
pub(crate) fn check_gains(gains_db: &PerBand<f64>) -> Result<(), Error> {
    for (band_hz, &gain_db) in gains_db.iter() {
        check_range("gain (dB)", gain_db, -120.0, 120.0, "").map_err(|_| Error::Gain { band_hz, gain_db })?;
    }
    Ok(())
}

/// The frequency grid of a plan, and the transforms on it.
struct Grid {
    length: usize,
    bin_hz: f64,
    forward: std::sync::Arc<dyn realfft::RealToComplex<f64>>,
    backward: std::sync::Arc<dyn realfft::ComplexToReal<f64>>,
}

impl Grid {
    fn new(length: usize, sample_rate_hz: u32) -> Self {
        let mut planner = RealFftPlanner::new();
        Self {
            length,
            bin_hz: f64::from(sample_rate_hz) / length as f64,
            forward: planner.plan_fft_forward(length),
            backward: planner.plan_fft_inverse(length),
        }
    }

    /// Right half of the taps of a part that passes what lies between two edges (`None`: no edge), and its zero-phase response.
    fn part(&self, below_hz: Option<f64>, above_hz: Option<f64>, window: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let bins = self.length / 2 + 1;
        let mut spectrum: Vec<Complex<f64>> = (0..bins)
            .map(|k| {
                let hz = k as f64 * self.bin_hz;
                let from = below_hz.map_or(1.0, |edge| upper_share(hz, edge, STEP_OVERLAP));
                let to = above_hz.map_or(1.0, |edge| 1.0 - upper_share(hz, edge, STEP_OVERLAP));
                Complex::new(from * to, 0.0)
            })
            .collect();
        let mut time = vec![0.0; self.length];
        let done = self.backward.process(&mut spectrum, &mut time);
        debug_assert!(done.is_ok(), "a real spectrum of the planned length");
        let scale = 1.0 / self.length as f64;
        let taps: Vec<f64> = time.iter().zip(window).map(|(x, w)| x * w * scale).collect();
        time.fill(0.0);
        time[..taps.len()].copy_from_slice(&taps);
        for (n, &tap) in taps.iter().enumerate().skip(1) {
            time[self.length - n] = tap;
        }
        let done = self.forward.process(&mut time, &mut spectrum);
        debug_assert!(done.is_ok(), "lengths agree by construction");
        (taps, spectrum.iter().map(|x| x.re).collect())
    }

    /// Mean over a band of the products of the responses: the quadratic form of the band's power gain.
    fn power_form(&self, bands: OctaveBands, band: usize, responses: &[Vec<f64>]) -> Vec<f64> {
        let (low_hz, high_hz) = support_hz(bands, band);
        let first = (low_hz / self.bin_hz).floor() as usize;
        let last = ((high_hz / self.bin_hz).ceil() as usize).min(self.length / 2);
        let weights: Vec<f64> = (first..=last).map(|k| self.bin_weight(bands, band, k)).collect();
        let total: f64 = weights.iter().sum();
        let n = responses.len();
        let mut form = vec![0.0; n * n];
        for i in 0..n {
            let weighted: Vec<f64> =
                responses[i][first..=last].iter().zip(&weights).map(|(r, w)| r * w / total).collect();
            for j in 0..=i {
                let product = weighted.iter().zip(&responses[j][first..=last]).map(|(a, b)| a * b).sum();
                form[i * n + j] = product;
                form[j * n + i] = product;
            }
        }
        form
    }

    /// Weight of a bin when the power between bins is interpolated linearly: a triangle's mean over the weight around it. In
    /// low octaves, which hold few bins, this counts.
    fn bin_weight(&self, bands: OctaveBands, band: usize, bin: usize) -> f64 {
        /// From this many bins up an octave is smooth enough for its value at the bin.
        const FINE: usize = 64;
        if bin > FINE {
            return weight(bands, band, bin as f64 * self.bin_hz);
        }
        let nyquist = self.length as f64 / 2.0;
        let share = |step: i32| {
            let offset = f64::from(step) / 8.0;
            let at = (bin as f64 + offset).max(0.0);
            if at > nyquist { 0.0 } else { (1.0 - offset.abs()) * weight(bands, band, at * self.bin_hz) }
        };
        (-7..8).map(share).sum::<f64>() / 8.0
    }
}

/// The least product of a power of two and at most one 3 that is not below `length`: such transforms are fast.
pub(crate) fn fast_length(length: usize) -> usize {
    let two = length.next_power_of_two();
    if two / 4 * 3 >= length && two >= 4 { two / 4 * 3 } else { two }
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
