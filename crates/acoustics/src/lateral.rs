//! Lateral energy: how much sound comes from the sides (ISO 3382-1:2009, A.2.4 and A.2.5).

use crate::band_energy::{BandEnergy, Prepared};
use crate::bands::Bands;
use crate::error::Error;
use crate::estimate::{Estimate, NoReading, Reading};
use crate::filter_bank::{BandMask, padding_s};
use crate::parameters::positive;
use crate::per_band::PerBand;
use crate::signal::ImpulseResponse;
use crate::spectrum::Spectrum;
use crate::strength::{FreeFieldReference, check_rates};
use std::ops::Range;

/// Early sound ends here, in seconds after the onset.
const EARLY_END_S: f64 = 0.080;
/// Early lateral sound begins here, so that the direct sound is left out.
const LATERAL_START_S: f64 = 0.005;
/// What belongs to the direct sound before the onset: the onset is the first sample within 20 dB of the peak.
const BEFORE_ONSET_S: f64 = 0.001;
/// How far the lateral channel's noise must lie below the early sound for J_LFC, in dB. Noise of that level in the place of
/// lateral sound would read 2/pi of -30 dB in amplitude, 0.02.
const COSINE_RANGE_DB: f64 = 30.0;

/// How the figure-of-eight channel relates to the omnidirectional one: for sound along its axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LateralNormalisation {
    /// Both are as loud. Two calibrated microphones; the channels W and Y of ambisonics in SN3D ("AmbiX", channels 0 and 1).
    #[default]
    Equal,
    /// The figure of eight is louder by the square root of three: ambisonics in N3D.
    N3d,
    /// The figure of eight is louder by the square root of two: B-format after Furse and Malham, channels W and Y (0 and 2).
    FuMa,
}

impl LateralNormalisation {
    /// What the figure-of-eight channel is multiplied by to be as loud as the omnidirectional one.
    fn gain(self) -> f64 {
        match self {
            Self::Equal => 1.0,
            Self::N3d => 3f64.sqrt().recip(),
            Self::FuMa => 2f64.sqrt().recip(),
        }
    }
}

/// Early lateral energy fractions and late lateral level (ISO 3382-1:2009, A.2.4 and A.2.5, equations A.14 to A.16).
///
/// Two channels of one measurement at one place: an omnidirectional one and a figure of eight **whose null points at the
/// source**, so that its axis lies along the listener's ears. The channel Y of ambisonics does so where the microphone faces the
/// source; a field that was measured otherwise has to be turned first.
///
/// The early responses are cut out before they are filtered, so that a reflection counts on its side of 5 and 80 ms in low bands
/// too. Noise is taken out of energies. Standard errors are what noise leaves open.
///
/// ```
/// use sabine_acoustics::{Bands, ImpulseResponse, LateralEnergy, LateralNormalisation};
/// // Direct sound from the front, and after 20 ms a reflection half as loud from 60 degrees to the side.
/// let (mut omni, mut eight) = (vec![0.0; 48_000], vec![0.0; 48_000]);
/// (omni[4800], omni[5760]) = (1.0, 0.5);
/// eight[5760] = 0.5 * 60f32.to_radians().sin();
/// let [omni, eight] = [omni, eight].map(|samples| ImpulseResponse::new(samples, 48_000).unwrap());
/// let octaves = Bands::octaves(1000.0, 4000.0)?;
/// let lateral = LateralEnergy::measure(&omni, &eight, LateralNormalisation::Equal, octaves, None)?;
/// // 0.25 sin^2(60) of 1.25, and 0.25 sin(60) of 1.25.
/// let at = |hz, readings: &sabine_acoustics::PerBand<sabine_acoustics::Reading>| readings.at_hz(hz).unwrap().as_ref().unwrap().value;
/// assert!((at(1000.0, &lateral.fraction) - 0.15).abs() < 0.001);
/// assert!((at(1000.0, &lateral.cosine_fraction) - 0.173).abs() < 0.001);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LateralEnergy {
    /// Early lateral energy fraction J_LF: figure of eight from 5 to 80 ms over omnidirectional from 0 to 80 ms, energies; 0 to
    /// about 1 (0.05 to 0.35 in halls).
    pub fraction: PerBand<Reading>,
    /// The same with the product of both channels, J_LFC, which weighs directions by the cosine instead of its square; noise is
    /// not taken out of it.
    pub cosine_fraction: PerBand<Reading>,
    /// Late lateral level L_J: figure of eight from 80 ms on against the free field at 10 m, in dB; none without a reference.
    pub late_level_db: Option<PerBand<Reading>>,
}

/// Both channels, ready to be read.
struct Pair {
    omni: Prepared,
    eight: Prepared,
    bands: Bands,
    rate_hz: u32,
}

impl LateralEnergy {
    /// Measures two channels of equal length. What cannot be read in a band says why in its place.
    ///
    /// # Errors
    /// [`Error::SampleRates`] or [`Error::Length`] where the channels differ in sample rate or length, [`Error::SampleRates`] or
    /// [`Error::BandMismatch`] where the reference has another sample rate or other bands.
    pub fn measure(
        omnidirectional: &ImpulseResponse,
        figure_of_eight: &ImpulseResponse,
        normalisation: LateralNormalisation,
        bands: Bands,
        reference: Option<&FreeFieldReference>,
    ) -> Result<Self, Error> {
        let rate_hz = omnidirectional.sample_rate_hz();
        check_pair(omnidirectional, figure_of_eight)?;
        if let Some(reference) = reference {
            reference.check(omnidirectional)?;
            if reference.bands() != bands {
                return Err(Error::BandMismatch { left: bands, right: reference.bands() });
            }
        }
        let gain = normalisation.gain() as f32;
        let scaled = figure_of_eight.samples().iter().map(|x| x * gain).collect();
        let omni = Prepared::new(omnidirectional);
        let eight = Prepared::with_onset(&ImpulseResponse::new(scaled, rate_hz)?, omni.onset.clone());
        let (early, late) = Pair { omni, eight, bands, rate_hz }.read(reference);
        let pick = |part: usize| PerBand::from_fn(bands, |i| early[i][part].clone());
        Ok(Self { fraction: pick(0), cosine_fraction: pick(1), late_level_db: late })
    }
}

/// That two responses are channels of one measurement.
pub(crate) fn check_pair(one: &ImpulseResponse, other: &ImpulseResponse) -> Result<(), Error> {
    check_rates(one.sample_rate_hz(), other.sample_rate_hz())?;
    let (expected, found) = (one.samples().len(), other.samples().len());
    if expected == found { Ok(()) } else { Err(Error::Length { expected, found }) }
}

impl Pair {
    /// J_LF and J_LFC of each band, and L_J with a reference.
    fn read(&self, reference: Option<&FreeFieldReference>) -> (Vec<[Reading; 2]>, Option<PerBand<Reading>>) {
        let edges = (0..self.bands.len()).map(|i| self.bands.edges_hz(i));
        let in_omni = self.omni.bands(edges.clone());
        let in_eight = self.eight.bands(edges);
        let early = match self.early() {
            Ok(early) => early,
            Err(reason) => {
                let none = || Err(reason.clone());
                let absent = PerBand::from_fn(self.bands, |_| none());
                let fractions = (0..self.bands.len()).map(|_| [none(), none()]).collect();
                return (fractions, reference.map(|_| absent));
            }
        };
        let fractions = (0..self.bands.len())
            .map(|i| match (&in_omni[i], &in_eight[i]) {
                (Ok(omni), Ok(eight)) => {
                    let mask = BandMask::between(self.bands.edges_hz(i));
                    early.fractions(&mask, omni, eight)
                }
                (Err(reason), _) | (_, Err(reason)) => [Err(reason.clone()), Err(reason.clone())],
            })
            .collect();
        let late = reference.map(|reference| {
            PerBand::from_fn(self.bands, |i| late_level(in_eight[i].as_ref(), i, reference))
        });
        (fractions, late)
    }

    /// The early parts of both channels.
    fn early(&self) -> Result<Early, NoReading> {
        let onset = self.omni.onset.clone()?;
        let samples_in = |seconds: f64| (seconds * f64::from(self.rate_hz)).round() as usize;
        let end = onset.index + samples_in(EARLY_END_S);
        let available = self.omni.samples().len();
        if end > available {
            return Err(NoReading::TooShort {
                needed_s: EARLY_END_S,
                available_s: (available - onset.index) as f64 / f64::from(self.rate_hz),
            });
        }
        let whole = onset.index.saturating_sub(samples_in(BEFORE_ONSET_S))..end;
        let lateral = onset.index + samples_in(LATERAL_START_S)..end;
        let padding = padding_s(self.bands.edges_hz(0));
        let cut = |samples: &[f64], range: &Range<usize>| {
            // A ring-down's silence before it, too: the filters ring on both sides.
            let mut part = vec![0.0; samples_in(padding)];
            part.resize(part.len() + range.start - whole.start, 0.0);
            part.extend_from_slice(&samples[range.clone()]);
            Spectrum::new(&part, self.rate_hz, padding)
        };
        Ok(Early {
            omni: cut(self.omni.samples(), &whole),
            omni_lateral_time: cut(self.omni.samples(), &lateral),
            eight: cut(self.eight.samples(), &lateral),
            steps: (whole.len(), lateral.len()),
        })
    }
}

/// The spectra of the early parts.
struct Early {
    omni: Spectrum,
    /// The omnidirectional channel in the time of the lateral one.
    omni_lateral_time: Spectrum,
    eight: Spectrum,
    /// Samples in the early and in the early lateral part.
    steps: (usize, usize),
}

impl Early {
    fn fractions(&self, mask: &BandMask, omni: &BandEnergy, eight: &BandEnergy) -> [Reading; 2] {
        let gain = |hz: f64| mask.gain(hz);
        let energy = |spectrum: &Spectrum| spectrum.product(spectrum, mask.support_hz(), gain);
        let (whole, whole_variance) = omni.without_noise(energy(&self.omni), self.steps.0);
        let whole = match positive(whole, whole_variance, whole) {
            Ok(whole) => whole,
            Err(reason) => return [Err(reason.clone()), Err(reason)],
        };
        let (lateral, lateral_variance) = eight.without_noise(energy(&self.eight), self.steps.1);
        let estimate = |numerator: f64, variance: f64| {
            let value = numerator / whole;
            Estimate::new(value, (variance + value * value * whole_variance).sqrt() / whole)
        };
        // No lateral sound is an answer, and noise may leave less than none.
        let fraction = Ok(estimate(lateral.max(0.0), lateral_variance));
        let noise = eight.noise * self.steps.1 as f64;
        let available_db = if noise > 0.0 { 10.0 * (whole / noise).log10() } else { f64::INFINITY };
        if available_db < COSINE_RANGE_DB {
            let reason = NoReading::DynamicRange { needed_db: COSINE_RANGE_DB, available_db };
            return [fraction, Err(reason)];
        }
        let filtered = |spectrum: &Spectrum| spectrum.filtered(mask.support_hz(), gain);
        let product: f64 = filtered(&self.omni_lateral_time)
            .iter()
            .zip(filtered(&self.eight))
            .map(|(omni, eight)| (omni * eight).abs())
            .sum();
        [fraction, Ok(estimate(product, lateral_variance))]
    }
}

fn late_level(
    eight: Result<&BandEnergy, &NoReading>,
    band: usize,
    reference: &FreeFieldReference,
) -> Reading {
    let eight = eight.map_err(NoReading::clone)?;
    let limit = eight.onset + (EARLY_END_S / eight.step_s).round() as usize;
    let (late, variance) = eight.from(limit);
    let total = eight.total().0.max(0.0);
    reference.level(band, positive(late, variance, total)?, variance)
}
