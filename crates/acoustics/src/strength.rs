//! Sound strength: how much louder a room makes a source than the free field (ISO 3382-1:2009, A.2.1).

use crate::band_energy::{BandEnergy, Prepared};
use crate::bands::Bands;
use crate::error::Error;
use crate::estimate::{Estimate, NoReading, Reading};
use crate::filter_bank::{BandMask, padding_s};
use crate::out_of_range::OutOfRange;
use crate::parameters::positive;
use crate::per_band::PerBand;
use crate::signal::{ImpulseResponse, check_samples};
use crate::spectrum::Spectrum;

/// The distance at which the free field is the reference, in metres.
const REFERENCE_M: f64 = 10.0;
/// What parts early from late sound, in seconds after the onset.
const EARLY_S: f64 = 0.080;

/// What the source of a measurement makes in the free field at 10 m, in each band: the zero of the sound strength and of the
/// late lateral level.
///
/// It holds for responses of one sample rate and one gain of the measuring chain.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeFieldReference {
    /// Sum of the squared samples.
    energy: PerBand<f64>,
    sample_rate_hz: u32,
}

impl FreeFieldReference {
    /// The reference of responses in which a sample of 1 is the direct sound at 1 m: those that this project simulates.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a sample rate outside 1 kHz to 768 kHz.
    pub fn unit_source(bands: Bands, sample_rate_hz: u32) -> Result<Self, Error> {
        let mut pulse = vec![0.0; (0.02 * f64::from(sample_rate_hz)) as usize + 1];
        pulse[0] = 1.0;
        Self::measured(&[ImpulseResponse::new(pulse, sample_rate_hz)?], 1.0, bands)
    }

    /// The reference from responses that were measured in the free field, `distance_m` from the source, with the gain of the
    /// measurement in the room: L_pE,10 = L_pE,d + 20 lg(d / 10 m) (ISO 3382-1, A.2.1). Several responses are directions from
    /// the source, every 12.5 degrees by the standard; the mean of their energies counts.
    ///
    /// Everything in the responses counts as direct sound: reflections and noise are to be cut off before.
    ///
    /// # Errors
    /// [`Error::Empty`] without responses, [`Error::SampleRates`] where they differ, [`Error::OutOfRange`] for a distance
    /// outside 0.1 m to 100 m or a response that is silent in a band below half the sample rate.
    pub fn measured(responses: &[ImpulseResponse], distance_m: f64, bands: Bands) -> Result<Self, Error> {
        OutOfRange::check("distance of the reference (m)", distance_m, 0.1, 100.0, "between 0.1 and 100 m")?;
        let first = responses.first().ok_or(Error::Empty { what: "the list of reference responses" })?;
        let sample_rate_hz = first.sample_rate_hz();
        let mut sums = vec![0.0; bands.len()];
        for response in responses {
            check_rates(sample_rate_hz, response.sample_rate_hz())?;
            let samples: Vec<f64> = response.samples().iter().copied().map(f64::from).collect();
            let spectrum = Spectrum::new(&samples, sample_rate_hz, padding_s(bands.edges_hz(0)));
            for (i, sum) in sums.iter_mut().enumerate() {
                let mask = BandMask::between(bands.edges_hz(i));
                *sum += spectrum.product(&spectrum, mask.support_hz(), |hz| mask.gain(hz));
            }
        }
        let scale = (distance_m / REFERENCE_M).powi(2) / responses.len() as f64;
        let energy = PerBand::from_fn(bands, |i| scale * sums[i]);
        Self::new(energy, sample_rate_hz)
    }

    /// The reference from the sound exposure level that the source makes at 10 m in the free field, in each band, in dB re the
    /// square of a sample of 1 over one second: 10 lg of the time integral of the squared samples.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a level outside -300 to 300 dB or a sample rate outside 1 kHz to 768 kHz.
    pub fn from_exposure_levels(level_db: &PerBand<f64>, sample_rate_hz: u32) -> Result<Self, Error> {
        for &level in level_db.values() {
            OutOfRange::check("reference level (dB)", level, -300.0, 300.0, "between -300 and 300 dB")?;
        }
        let rate = f64::from(sample_rate_hz);
        Self::new(level_db.map(|level| 10f64.powf(0.1 * level) * rate), sample_rate_hz)
    }

    fn new(energy: PerBand<f64>, sample_rate_hz: u32) -> Result<Self, Error> {
        check_samples("reference", &[0.0], sample_rate_hz)?;
        for (i, &energy_in_band) in energy.values().iter().enumerate() {
            let is_measured = energy.bands().edges_hz(i).1 <= 0.5 * f64::from(sample_rate_hz);
            if is_measured {
                let range = "above zero in each band";
                OutOfRange::check(
                    "energy of the reference",
                    energy_in_band,
                    f64::MIN_POSITIVE,
                    f64::MAX,
                    range,
                )?;
            }
        }
        Ok(Self { energy, sample_rate_hz })
    }

    /// The bands.
    pub fn bands(&self) -> Bands {
        self.energy.bands()
    }

    /// Level of an energy over the reference.
    pub(crate) fn level(&self, band: usize, energy: f64, variance: f64) -> Reading {
        let error_db = 10.0 / std::f64::consts::LN_10 * variance.sqrt() / energy;
        Ok(Estimate::new(10.0 * (energy / self.energy.values()[band]).log10(), error_db))
    }

    /// That a response was sampled as the reference was.
    pub(crate) fn check(&self, response: &ImpulseResponse) -> Result<(), Error> {
        check_rates(self.sample_rate_hz, response.sample_rate_hz())
    }
}

pub(crate) fn check_rates(left_hz: u32, right_hz: u32) -> Result<(), Error> {
    if left_hz == right_hz { Ok(()) } else { Err(Error::SampleRates { left_hz, right_hz }) }
}

/// Sound strength of a response, whole and parted at 80 ms, in dB (ISO 3382-1:2009, A.2.1, equation A.1).
///
/// Standard errors are what the background noise adds. Where the response ends before its decay, the fitted decay stands in for
/// what is missing. The uncertainty of the reference is not in them.
///
/// ```
/// use sabine_acoustics::{Bands, FreeFieldReference, ImpulseResponse, SoundStrength};
/// // The direct sound at 10 m and a reflection as strong as it 100 ms later: 0 dB early, 0 dB late, 3 dB in all.
/// let mut samples = vec![0.0; 48_000];
/// (samples[4800], samples[9600]) = (0.1, 0.1);
/// let response = ImpulseResponse::new(samples, 48_000)?;
/// let octaves = Bands::octaves(500.0, 4000.0)?;
/// let strength = SoundStrength::measure(&response, &FreeFieldReference::unit_source(octaves, 48_000)?)?;
/// let at_1_khz = |readings: &sabine_acoustics::PerBand<sabine_acoustics::Reading>| {
///     readings.at_hz(1000.0).unwrap().as_ref().unwrap().value
/// };
/// assert!((at_1_khz(&strength.g_db) - 3.01).abs() < 0.05);
/// assert!(at_1_khz(&strength.early_db).abs() < 0.05 && at_1_khz(&strength.late_db).abs() < 0.05);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SoundStrength {
    /// Sound strength G: the whole response against the free field at 10 m, in dB.
    pub g_db: PerBand<Reading>,
    /// Early strength G80: what arrives within 80 ms of the onset, in dB.
    pub early_db: PerBand<Reading>,
    /// Late strength: what arrives later, in dB.
    pub late_db: PerBand<Reading>,
}

impl SoundStrength {
    /// Measures a response in the bands of the reference. What cannot be read in a band says why in its place.
    ///
    /// # Errors
    /// [`Error::SampleRates`] if the response has another sample rate than the reference.
    pub fn measure(response: &ImpulseResponse, reference: &FreeFieldReference) -> Result<Self, Error> {
        reference.check(response)?;
        let bands = reference.bands();
        let read: Vec<[Reading; 3]> = Prepared::new(response)
            .bands((0..bands.len()).map(|i| bands.edges_hz(i)))
            .into_iter()
            .enumerate()
            .map(|(i, band)| match band {
                Ok(band) => Self::read(&band, i, reference),
                Err(reason) => [0; 3].map(|_| Err(reason.clone())),
            })
            .collect();
        let pick = |part: usize| PerBand::from_fn(bands, |i| read[i][part].clone());
        Ok(Self { g_db: pick(0), early_db: pick(1), late_db: pick(2) })
    }

    fn read(band: &BandEnergy, index: usize, reference: &FreeFieldReference) -> [Reading; 3] {
        let (total, variance) = band.total();
        let level = |(energy, variance): (f64, f64)| {
            reference.level(index, positive(energy, variance, total.max(0.0))?, variance)
        };
        let limit = band.onset + (EARLY_S / band.step_s).round() as usize;
        if limit >= band.energy.len() {
            let available_s = (band.energy.len() - band.onset) as f64 * band.step_s;
            let reason = NoReading::TooShort { needed_s: EARLY_S, available_s };
            return [level((total, variance)), Err(reason.clone()), Err(reason)];
        }
        [level((total, variance)), level(band.net(band.first, limit)), level(band.from(limit))]
    }
}
