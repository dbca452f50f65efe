//! Waves below, paths above.

use super::error::WaveError;
use super::response::WaveResponse;
use crate::Error;
use crate::spectrum::Spectrum;
use realfft::num_complex::Complex;
use sabine_acoustics::{ImpulseResponse, OutOfRange};
use std::f64::consts::{PI, SQRT_2};

/// Rounds in which the energy of the octave is matched; each leaves less than a tenth of the difference.
const ROUNDS: usize = 12;
/// Largest gain or loss at the crossover (amplitude).
const MOST_GAIN: f64 = 2.0;
/// Samples beyond both ends for what the filters ring, in periods of the crossover.
const MARGIN_PERIODS: f64 = 16.0;

/// Joins a wave solution below a frequency to a response from paths above it.
///
/// # Method
/// Complementary filters without phase: the wave's share falls from 1 to 0 as cos^2 over the octave about the crossover, by the
/// logarithm of frequency, and the paths have the rest. Both have the same source (direct sound 1 at 1 m), time zero and
/// speed of sound, so the direct sound comes out whole. What follows it agrees in energy only: where two such signals of
/// equal energy meet half and half, half of it is missing. So the energy of that octave is brought to
///
/// ```text
/// E = sum_f share |wave|^2 + (1 - share) |paths|^2
/// ```
///
/// by a gain at the crossover that is 1 again at both ends of the octave. Neither side is scaled outside it, even where they differ
/// in level: [`JoinedResponse::level_difference_db`] says by how much they do. In a room, whose octave holds a few modes at
/// low frequencies, a few decibels from place to place are what waves do and energies cannot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossover {
    crossover_hz: f64,
}

/// A response over all frequencies, and what was found where it was joined.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct JoinedResponse {
    /// Pressure, as long and with the same time zero as that of the paths.
    pub response: ImpulseResponse,
    /// Energy of the waves over that of the paths in the octave about the crossover, in dB.
    pub level_difference_db: f64,
    /// Gain at the crossover, in dB; 0 where both sides are equal, about 3 where they have nothing but their energy in common,
    /// at most 6.
    pub gain_db: f64,
}

impl Crossover {
    /// A crossover at 20 to 3,500 Hz.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] outside these bounds.
    pub fn new(crossover_hz: f64) -> Result<Self, Error> {
        OutOfRange::check("crossover_hz", crossover_hz, 20.0, 3500.0, "between 20 and 3,500 Hz")?;
        Ok(Self { crossover_hz })
    }

    /// Up to where the waves must be right, in Hz: half an octave above the crossover.
    pub fn limit_hz(&self) -> f64 {
        SQRT_2 * self.crossover_hz
    }

    /// Joins two responses between the same points.
    ///
    /// # Errors
    /// [`WaveError::JoinedRates`] for different sample rates; [`Error::OutOfRange`] for waves that end below
    /// [`Crossover::limit_hz`], or before the paths do by more than 1 ms.
    pub fn join(&self, waves: &WaveResponse, paths: &ImpulseResponse) -> Result<JoinedResponse, Error> {
        let rate = paths.sample_rate_hz();
        if waves.sample_rate_hz != rate {
            return Err(WaveError::JoinedRates { waves_hz: waves.sample_rate_hz, paths_hz: rate }.into());
        }
        let least_hz = self.limit_hz() * (1.0 - 1e-9);
        let range = "at least sqrt 2 times the crossover";
        OutOfRange::check("limit_hz of the waves", waves.limit_hz, least_hz, f64::INFINITY, range)?;
        let rate_hz = f64::from(rate);
        let waves_s = (waves.samples.len() - waves.lead) as f64 / rate_hz;
        let range = "at least that of the paths";
        OutOfRange::check(
            "duration of the waves (s)",
            waves_s,
            paths.duration_s() - 1e-3,
            f64::INFINITY,
            range,
        )?;

        let margin = (MARGIN_PERIODS / self.crossover_hz * rate_hz) as usize + waves.lead;
        let count = paths.samples().len();
        let spectrum = Spectrum::new(count.max(waves.samples.len()) + 2 * margin, rate);
        let padded = |before: usize, samples: &mut dyn Iterator<Item = f64>| {
            let mut all = vec![0.0; before];
            all.extend(samples);
            spectrum.lines(all)
        };
        let low = padded(margin - waves.lead, &mut waves.samples.iter().copied());
        let high = padded(margin, &mut paths.samples().iter().map(|&s| f64::from(s)));

        let shares: Vec<f64> = (0..low.len()).map(|i| self.share(spectrum.frequency_hz(i))).collect();
        let mixed: Vec<Complex<f64>> =
            shares.iter().zip(low.iter().zip(&high)).map(|(s, (w, p))| w * *s + p * (1.0 - s)).collect();
        let octave: Vec<usize> = (0..low.len()).filter(|&i| shares[i] > 0.0 && shares[i] < 1.0).collect();
        let energy = |of: &dyn Fn(usize) -> f64| octave.iter().map(|&i| of(i)).sum::<f64>();
        let wanted = energy(&|i| shares[i] * low[i].norm_sqr() + (1.0 - shares[i]) * high[i].norm_sqr());
        let bump = |i: usize| 4.0 * shares[i] * (1.0 - shares[i]);
        let mut gain = 1.0;
        for _ in 0..ROUNDS {
            let found = energy(&|i| (1.0 + (gain - 1.0) * bump(i)).powi(2) * mixed[i].norm_sqr());
            if found > 0.0 {
                gain = (gain * (wanted / found).sqrt()).clamp(1.0 / MOST_GAIN, MOST_GAIN);
            }
        }
        let lines = mixed.iter().enumerate().map(|(i, line)| line * (1.0 + (gain - 1.0) * bump(i))).collect();
        let joined = spectrum.signal(lines);
        let samples = joined[margin..][..count].iter().map(|&s| s as f32).collect();
        let difference = energy(&|i| low[i].norm_sqr()) / energy(&|i| high[i].norm_sqr());
        Ok(JoinedResponse {
            response: ImpulseResponse::new(samples, rate)?,
            level_difference_db: 10.0 * difference.log10(),
            gain_db: 20.0 * gain.log10(),
        })
    }

    /// Share of the waves.
    fn share(&self, hz: f64) -> f64 {
        let octave = (hz.max(1e-3) / self.crossover_hz).log2();
        0.5 + 0.5 * (PI * (octave + 0.5).clamp(0.0, 1.0)).cos()
    }
}
