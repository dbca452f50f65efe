//! Noise: the recorder's own, which is always there, and that of the room.

use super::hidden::Hidden;
use super::steep_bands::colour;
use super::stream::{Purpose, stream};
use super::truth::Truth;
use rand::Rng;
use rand_distr::StandardNormal;
use sabine_acoustics::Bands;

/// Energy of the recorder's noise over the whole response relative to the response's own, in dB, in the octave and the response
/// where it is largest.
const FLOOR_DB: f64 = -63.0;
/// Interval whose energy background noise is relative to, in seconds.
const STRONGEST_S: f64 = 0.02;

/// Energies of a response before any noise, by band.
pub(crate) struct BandEnergies {
    total: Vec<f64>,
    /// Largest mean square of a sample within 20 ms.
    strongest: Vec<f64>,
}

impl BandEnergies {
    /// From the columns of pulses: white within each band.
    pub(crate) fn of(columns: &[Vec<f64>], rate_hz: f64) -> Self {
        let width = ((STRONGEST_S * rate_hz) as usize).max(1);
        let strongest = |column: &Vec<f64>| {
            let (mut sum, mut best) = (0.0, 0.0f64);
            for (i, s) in column.iter().enumerate() {
                sum += s * s;
                if i >= width {
                    sum -= column[i - width] * column[i - width];
                }
                best = best.max(sum);
            }
            best / width as f64
        };
        Self {
            total: columns.iter().map(|c| c.iter().map(|s| s * s).sum()).collect(),
            strongest: columns.iter().map(strongest).collect(),
        }
    }
}

/// Amplitudes of all noise in a room: the same at every receiver.
pub(crate) struct Noise {
    floor: f64,
    /// Amplitude of each octave, for each hidden background noise.
    backgrounds: Vec<Vec<f64>>,
}

impl Noise {
    pub(crate) fn new(truth: &Truth, energies: &[BandEnergies], samples: usize) -> Self {
        let least = energies.iter().flat_map(|e| &e.total).copied().fold(f64::INFINITY, f64::min);
        let floor = (least * 10f64.powf(0.1 * FLOOR_DB) / samples as f64).sqrt();
        let typical = |band: usize| {
            let mut all: Vec<f64> = energies.iter().map(|e| e.strongest[band]).collect();
            all.sort_by(f64::total_cmp);
            all[all.len() / 2]
        };
        let amplitudes = |effect: &Hidden| match effect {
            Hidden::BackgroundNoise { levels_db } => {
                let amplitude = |(band, db): (usize, &f64)| (typical(band) * 10f64.powf(0.1 * db)).sqrt();
                Some(levels_db.iter().enumerate().map(amplitude).collect())
            }
            _ => None,
        };
        Self { floor, backgrounds: truth.effects.iter().filter_map(amplitudes).collect() }
    }

    /// Adds a response's share of the noise.
    pub(crate) fn add(
        &self,
        truth: &Truth,
        index: usize,
        bands: Bands,
        sample_rate_hz: u32,
        samples: &mut [f64],
    ) {
        let mut random = stream(truth.seed, Purpose::Floor, index);
        samples.iter_mut().for_each(|s| *s += self.floor * random.sample::<f64, _>(StandardNormal));
        let mut random = stream(truth.seed, Purpose::Background, index);
        for amplitudes in &self.backgrounds {
            let white = (0..samples.len()).map(|_| random.sample(StandardNormal)).collect();
            let noise = colour(bands, white, amplitudes, sample_rate_hz);
            samples.iter_mut().zip(noise).for_each(|(s, n)| *s += n);
        }
    }
}
