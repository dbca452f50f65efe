//! Interaural cross-correlation (ISO 3382-1:2009, annex B).

use crate::band_energy::{BandEnergy, Prepared};
use crate::bands::Bands;
use crate::correlation::Correlation;
use crate::error::Error;
use crate::estimate::{Estimate, NoReading, Reading};
use crate::filter_bank::{BandMask, padding_s};
use crate::lateral::check_pair;
use crate::onset::Onset;
use crate::parameters::positive;
use crate::per_band::PerBand;
use crate::signal::ImpulseResponse;
use crate::spectrum::Spectrum;
use std::ops::Range;

/// What parts early from late sound, in seconds after the onset.
const EARLY_S: f64 = 0.080;
/// Largest time between the ears that is searched, in seconds.
const LARGEST_DELAY_S: f64 = 0.001;

/// Interaural cross-correlation coefficients of a binaural response (ISO 3382-1:2009, annex B, equations B.1 and B.2).
///
/// IACC is the largest magnitude, over delays of up to 1 ms, of the correlation of both ears divided by the root of the product
/// of their energies: 0 to 1. Time zero is the onset of the ear that the sound reaches first. The correlation is interpolated
/// between samples. Noise is taken out of the energies: noise that differs between the ears does not lower the coefficient.
///
/// ```
/// use sabine_acoustics::{Bands, ImpulseResponse, InterauralCorrelation};
/// // The same sound at both ears, 0.5 ms later and half as loud at the right one.
/// let (mut left, mut right) = (vec![0.0; 24_000], vec![0.0; 24_000]);
/// (left[2400], right[2424]) = (1.0, 0.5);
/// let [left, right] = [left, right].map(|samples| ImpulseResponse::new(samples, 48_000).unwrap());
/// let iacc = InterauralCorrelation::measure(&left, &right, Bands::octaves(500.0, 2000.0)?)?;
/// let early = iacc.early.at_hz(1000.0).unwrap().as_ref().unwrap().value;
/// assert!((early - 1.0).abs() < 5e-3);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct InterauralCorrelation {
    /// IACC_E: from 0 to 80 ms.
    pub early: PerBand<Reading>,
    /// IACC_L: from 80 ms on.
    pub late: PerBand<Reading>,
    /// IACC_A: all.
    pub all: PerBand<Reading>,
}

impl InterauralCorrelation {
    /// Measures the responses at both ears, which have one length. What cannot be read in a band says why in its place.
    ///
    /// # Errors
    /// [`Error::SampleRates`] or [`Error::Length`] where the ears differ in sample rate or length.
    pub fn measure(left: &ImpulseResponse, right: &ImpulseResponse, bands: Bands) -> Result<Self, Error> {
        check_pair(left, right)?;
        let onset = first_onset(&Prepared::new(left), &Prepared::new(right));
        let ears = [left, right].map(|ear| Prepared::with_onset(ear, onset.clone()));
        let rate_hz = left.sample_rate_hz();
        let edges = (0..bands.len()).map(|i| bands.edges_hz(i));
        let energies = [ears[0].bands(edges.clone()), ears[1].bands(edges)];
        let padding = padding_s(bands.edges_hz(0));
        let spectra = [0, 1].map(|ear: usize| Spectrum::new(ears[ear].samples(), rate_hz, padding));
        let read: Vec<[Reading; 3]> = (0..bands.len())
            .map(|i| match (&energies[0][i], &energies[1][i]) {
                (Ok(left), Ok(right)) => {
                    let mask = BandMask::between(bands.edges_hz(i));
                    let filtered =
                        [0, 1].map(|ear: usize| spectra[ear].filtered(mask.support_hz(), |hz| mask.gain(hz)));
                    BothEars { samples: &filtered, energies: [left, right] }.read()
                }
                (Err(reason), _) | (_, Err(reason)) => [0; 3].map(|_| Err(reason.clone())),
            })
            .collect();
        let pick = |part: usize| PerBand::from_fn(bands, |i| read[i][part].clone());
        Ok(Self { early: pick(0), late: pick(1), all: pick(2) })
    }
}

/// The earlier onset of the two.
fn first_onset(left: &Prepared, right: &Prepared) -> Result<Onset, NoReading> {
    match (&left.onset, &right.onset) {
        (Ok(left), Ok(right)) => Ok(if left.index <= right.index { *left } else { *right }),
        (Err(reason), _) | (_, Err(reason)) => Err(reason.clone()),
    }
}

/// One band at both ears.
struct BothEars<'a> {
    samples: &'a [Vec<f64>; 2],
    energies: [&'a BandEnergy; 2],
}

impl BothEars<'_> {
    fn read(&self) -> [Reading; 3] {
        let [left, right] = self.energies;
        let parting = left.onset + (EARLY_S / left.step_s).round() as usize;
        let first = left.first.min(right.first);
        // Where the decay of the ear that stands out of the noise for longer sinks into it.
        let end = left.trusted_end().max(right.trusted_end());
        let late = if end > parting {
            self.coefficient(parting..end)
        } else {
            Err(NoReading::TooShort {
                needed_s: EARLY_S,
                available_s: (end - left.onset) as f64 * left.step_s,
            })
        };
        [self.coefficient(first..parting.min(end)), late, self.coefficient(first..end)]
    }

    fn coefficient(&self, range: Range<usize>) -> Reading {
        let read = |ear: usize| {
            let band = self.energies[ear];
            let (net, variance) = band.net(range.start, range.end);
            Ok::<_, NoReading>((positive(net, variance, band.total().0.max(net))?, variance))
        };
        let ((left, left_variance), (right, right_variance)) = (read(0)?, read(1)?);
        let scale = (left * right).sqrt();
        let value = self.largest_correlation(&range) / scale;
        // Each ear's noise enters its energy, and the product with the other ear's sound.
        let [left_band, right_band] = self.energies;
        let steps = range.len() as f64;
        let spread = 1.0 / (left_band.statistical_bandwidth_hz * left_band.step_s);
        let product = spread
            * (left * right_band.noise
                + right * left_band.noise
                + steps * left_band.noise * right_band.noise);
        let energies = left_variance / (left * left) + right_variance / (right * right);
        let error = (product / (scale * scale) + 0.25 * value * value * energies).sqrt();
        Ok(Estimate::new(value.min(1.0), error))
    }

    /// Largest magnitude of the correlation over delays of up to 1 ms.
    fn largest_correlation(&self, range: &Range<usize>) -> f64 {
        let [left, right] = self.samples;
        let reach = LARGEST_DELAY_S / self.energies[0].step_s;
        Correlation::new(left, right, range.clone(), reach)
            .points()
            .map(|(_, value)| value.abs())
            .fold(0.0, f64::max)
    }
}
