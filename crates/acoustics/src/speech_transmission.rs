//! Speech transmission index by the indirect method (IEC 60268-16:2020).

use crate::band_energy::{BandEnergy, Prepared};
use crate::bands::Bands;
use crate::error::Error;
use crate::estimate::NoReading;
use crate::out_of_range::OutOfRange;
use crate::per_band::PerBand;
use crate::signal::ImpulseResponse;
use std::fmt;

/// Modulation frequencies of the full STI, in Hz (IEC 60268-16:2020, A.1.4).
pub const MODULATION_HZ: [f64; 14] =
    [0.63, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0, 10.0, 12.5];

/// Weights of the octaves (IEC 60268-16:2020, table A.1: male speech, the only one of this edition).
const ALPHA: [f64; 7] = [0.085, 0.127, 0.230, 0.233, 0.309, 0.224, 0.173];
/// Redundancies of neighbouring octaves (the same table).
const BETA: [f64; 6] = [0.085, 0.078, 0.065, 0.011, 0.047, 0.095];
/// Absolute threshold of speech reception in each octave, in dB (IEC 60268-16:2020, table A.3).
const THRESHOLD_DB: [f64; 7] = [46.0, 27.0, 12.0, 6.5, 7.5, 8.0, 12.0];
/// Octave levels of male speech relative to its A-weighted level, in dB (IEC 60268-16:2020, A.6.1).
const SPEECH_DB: [f64; 7] = [-2.5, 0.5, 0.0, -6.0, -12.0, -18.0, -24.0];
/// Effective signal-to-noise ratios are limited to this on both sides, in dB (A.2.1).
const LARGEST_SNR_DB: f64 = 15.0;
/// Lower limits of the qualification bands J to A+ (annex F).
const LIMITS: [(f64, QualificationBand); 11] = [
    (0.76, QualificationBand::APlus),
    (0.72, QualificationBand::A),
    (0.68, QualificationBand::B),
    (0.64, QualificationBand::C),
    (0.60, QualificationBand::D),
    (0.56, QualificationBand::E),
    (0.52, QualificationBand::F),
    (0.48, QualificationBand::G),
    (0.44, QualificationBand::H),
    (0.40, QualificationBand::I),
    (0.36, QualificationBand::J),
];
/// Where no decay can be fitted, the share of noise in the energy up to which a response is still read: then it is short, not
/// drowned.
const LARGEST_NOISE_SHARE: f64 = 0.01;

/// Modulation transfer of the octaves from 125 Hz to 8 kHz at the 14 modulation frequencies of [`MODULATION_HZ`]: what is left of
/// the modulation of speech, 0 to 1.
///
/// ```
/// use sabine_acoustics::{ImpulseResponse, ModulationTransfer, QualificationBand};
/// // White noise whose energy falls by 60 dB in 1 s.
/// let mut state = 1u32;
/// let samples = (0..72_000).map(|i| {
///     state = state.wrapping_mul(1664525).wrapping_add(1013904223);
///     ((state >> 8) as f32 / 8388608.0 - 1.0) * (-6.9078 * i as f32 / 48_000.0).exp()
/// });
/// let response = ImpulseResponse::new(samples.collect(), 48_000)?;
/// let empty_room = ModulationTransfer::of_response(&response)?;
/// let sti = empty_room.index();
/// assert!((sti.value - 0.588).abs() < 0.015);
/// assert!(sti.qualification >= QualificationBand::E);
/// // Noise as loud as the speech, in every octave.
/// let noisy = empty_room.with_snr(&sabine_acoustics::PerBand::uniform(empty_room.bands(), 0.0))?;
/// assert!(noisy.index().value < 0.4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ModulationTransfer {
    values: PerBand<[f64; 14]>,
}

impl ModulationTransfer {
    /// From values that were measured or computed elsewhere: for each of the seven octaves from 125 Hz to 8 kHz, one for each
    /// modulation frequency. Values between 1 and 1.3 count as 1 (IEC 60268-16:2020, A.2.4).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a value outside 0 to 1.3: the measurement is invalid then.
    pub fn new(values: [[f64; 14]; 7]) -> Result<Self, Error> {
        for &value in values.iter().flatten() {
            OutOfRange::check("modulation transfer", value, 0.0, 1.3, "between 0 and 1.3")?;
        }
        let values = PerBand::from_fn(Bands::T60, |i| values[i].map(|m| m.min(1.0)));
        Ok(Self { values })
    }

    /// From an impulse response, by Schroeder's integral (IEC 60268-16:2020, 6.1): the magnitude of the Fourier transform of the
    /// squared response of an octave at the modulation frequency, over its energy. The noise of the measurement is taken out, and
    /// the fitted decay stands in for what comes after the response sinks into it.
    ///
    /// The result holds for speech without background noise, well above the threshold of hearing:
    /// [`with_snr`](Self::with_snr) and [`at_levels`](Self::at_levels) add noise, masking and threshold.
    ///
    /// # Errors
    /// The reason why the first of the octaves cannot be read: [`NoReading::AboveNyquist`] below a sample rate of 22.5 kHz,
    /// [`NoReading::NoOnset`], [`NoReading::NoDecay`] and others where noise covers the response and no decay can be fitted.
    pub fn of_response(response: &ImpulseResponse) -> Result<Self, NoReading> {
        let bands = Bands::T60;
        let edges = (0..bands.len()).map(|i| bands.edges_hz(i));
        let values: Vec<[f64; 14]> = Prepared::new(response)
            .bands(edges)
            .into_iter()
            .map(|band| transfer(&band?))
            .collect::<Result<_, NoReading>>()?;
        Ok(Self { values: PerBand::from_fn(bands, |i| values[i]) })
    }

    /// The octaves: 125 Hz to 8 kHz.
    pub fn bands(&self) -> Bands {
        self.values.bands()
    }

    /// The values of each octave, in the order of [`MODULATION_HZ`].
    pub fn values(&self) -> &PerBand<[f64; 14]> {
        &self.values
    }

    /// With background noise at a signal-to-noise ratio in each octave, in dB: m / (1 + 10^(-SNR / 10)) (IEC 60268-16:2020,
    /// A.2.3). Masking and threshold are left out; they need levels.
    ///
    /// # Errors
    /// [`Error::BandMismatch`] for other octaves than 125 Hz to 8 kHz, [`Error::OutOfRange`] for a ratio outside -200 to 200 dB.
    pub fn with_snr(&self, snr_db: &PerBand<f64>) -> Result<Self, Error> {
        check_levels("signal-to-noise ratio (dB)", snr_db)?;
        self.scaled(&snr_db.map(|snr| 1.0 / (1.0 + 10f64.powf(-0.1 * snr))))
    }

    /// At stated levels of the speech, and of noise where there is any, in dB re 20 uPa in each octave: with noise, auditory
    /// masking by the octave below and the threshold of hearing (IEC 60268-16:2020, A.2.4, tables A.2 and A.3).
    ///
    /// # Errors
    /// As [`with_snr`](Self::with_snr).
    pub fn at_levels(
        &self,
        speech_db: &PerBand<f64>,
        noise_db: Option<&PerBand<f64>>,
    ) -> Result<Self, Error> {
        check_levels("level of the speech (dB)", speech_db)?;
        let intensity = |db: f64| 10f64.powf(0.1 * db);
        let mut noise = [0.0; 7];
        if let Some(noise_db) = noise_db {
            check_levels("level of the noise (dB)", noise_db)?;
            noise = std::array::from_fn(|i| intensity(noise_db.values()[i]));
        }
        let speech: [f64; 7] = std::array::from_fn(|i| intensity(speech_db.values()[i]));
        self.scaled(&PerBand::from_fn(self.bands(), |i| {
            let masking = if i == 0 {
                0.0
            } else {
                let below = speech[i - 1] + noise[i - 1];
                below * intensity(masking_db(10.0 * below.log10()))
            };
            speech[i] / (speech[i] + noise[i] + masking + intensity(THRESHOLD_DB[i]))
        }))
    }

    fn scaled(&self, factors: &PerBand<f64>) -> Result<Self, Error> {
        Ok(Self { values: self.values.zip_with(factors, |values, factor| values.map(|m| m * factor))? })
    }

    /// The speech transmission index (IEC 60268-16:2020, A.2.1).
    pub fn index(&self) -> SpeechTransmission {
        let transmission_indices = self.values.map(|values| {
            let of = |m: f64| {
                let snr_db = 10.0 * (m / (1.0 - m)).log10();
                (snr_db.clamp(-LARGEST_SNR_DB, LARGEST_SNR_DB) + LARGEST_SNR_DB) / (2.0 * LARGEST_SNR_DB)
            };
            values.iter().map(|&m| of(m)).sum::<f64>() / values.len() as f64
        });
        let indices = transmission_indices.values();
        let weighted: f64 = ALPHA.iter().zip(indices).map(|(alpha, index)| alpha * index).sum();
        let redundant: f64 =
            BETA.iter().zip(indices.windows(2)).map(|(beta, pair)| beta * (pair[0] * pair[1]).sqrt()).sum();
        let value = (weighted - redundant).clamp(0.0, 1.0);
        SpeechTransmission { value, transmission_indices, qualification: QualificationBand::of(value) }
    }
}

/// Octave levels of male speech with an A-weighted level, in dB, from 125 Hz to 8 kHz (IEC 60268-16:2020, A.6.1). Raised speech at
/// 1 m has about 66 dB, normal speech 60 dB.
///
/// ```
/// let levels_db = sabine_acoustics::speech_levels(60.0);
/// assert_eq!(levels_db.at_hz(1000.0), Some(&54.0));
/// ```
pub fn speech_levels(a_weighted_db: f64) -> PerBand<f64> {
    PerBand::from_fn(Bands::T60, |i| a_weighted_db + SPEECH_DB[i])
}

/// The speech transmission index and what it is made of.
///
/// It has no standard error. A response is one of many that the same decay could have: at reverberation times of 0.3 to 4 s its
/// index lies within 0.013 of their mean (`docs/validation/measures.md`).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SpeechTransmission {
    /// STI, 0 to 1.
    pub value: f64,
    /// Modulation transfer index of each octave, 0 to 1.
    pub transmission_indices: PerBand<f64>,
    /// The letter of annex F.
    pub qualification: QualificationBand,
}

/// Qualification bands of the STI, from worst to best (IEC 60268-16:2020, annex F). A step is 0.04: near a limit, half the
/// uncertainty of a measurement, the letter is one of two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)] // letters
pub enum QualificationBand {
    /// Below 0.36.
    U,
    J,
    I,
    H,
    G,
    F,
    E,
    D,
    C,
    B,
    A,
    /// From 0.76 on.
    APlus,
}

impl QualificationBand {
    /// The band in which an STI lies; a lower limit belongs to its band.
    pub fn of(sti: f64) -> Self {
        LIMITS.iter().find(|(limit, _)| sti >= *limit).map_or(Self::U, |(_, band)| *band)
    }
}

impl fmt::Display for QualificationBand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::APlus => f.write_str("A+"),
            other => write!(f, "{other:?}"),
        }
    }
}

/// Level of the masking by the octave below, relative to the level of that octave, in dB (IEC 60268-16:2020, table A.2).
fn masking_db(level_db: f64) -> f64 {
    match level_db {
        l if l < 63.0 => 0.5 * l - 65.0,
        l if l < 67.0 => 1.8 * l - 146.9,
        l if l < 100.0 => 0.5 * l - 59.8,
        _ => -10.0,
    }
}

fn check_levels(field: &'static str, levels_db: &PerBand<f64>) -> Result<(), Error> {
    for &level in levels_db.values() {
        OutOfRange::check(field, level, -200.0, 200.0, "between -200 and 200 dB")?;
    }
    if levels_db.bands() == Bands::T60 {
        Ok(())
    } else {
        Err(Error::BandMismatch { left: levels_db.bands(), right: Bands::T60 })
    }
}

/// Modulation transfer of one octave.
fn transfer(band: &BandEnergy) -> Result<[f64; 14], NoReading> {
    let end = band.trusted_end();
    let (energy, _) = band.total();
    let noise = band.noise * (end - band.first) as f64;
    if let Err(reason) = &band.fit
        && noise > LARGEST_NOISE_SHARE * energy
    {
        return Err(reason.clone());
    }
    if energy <= 0.0 {
        return Err(NoReading::NoOnset);
    }
    let net: Vec<f64> = band.energy[band.first..end].iter().map(|e| e - band.noise).collect();
    let tail_slopes: Vec<(f64, f64)> = match &band.fit {
        Ok(fit) if end == band.end => {
            let end_s = end as f64 * band.step_s;
            fit.slopes()
                .iter()
                .map(|slope| {
                    let rate = 1e6_f64.ln() / slope.t60_s.value;
                    let power = slope.power * (-(end_s - fit.start_s()) * rate).exp();
                    (power / rate / band.step_s, rate)
                })
                .collect()
        }
        _ => Vec::new(),
    };
    Ok(MODULATION_HZ.map(|hz| {
        let turn = std::f64::consts::TAU * hz;
        // Sum of e(t) exp(-j w t): a rotation from sample to sample instead of sines.
        let (step_sin, step_cos) = (turn * band.step_s).sin_cos();
        let (mut re, mut im, mut cos, mut sin) = (0.0, 0.0, 1.0, 0.0);
        for e in &net {
            re += e * cos;
            im -= e * sin;
            (cos, sin) = (cos * step_cos - sin * step_sin, sin * step_cos + cos * step_sin);
        }
        // After the knee each decay goes on: its energy times a / (a + j w), turned by the time at which it starts.
        for &(energy, rate) in &tail_slopes {
            let scale = energy * rate / (rate * rate + turn * turn);
            let (tail_re, tail_im) = (scale * rate, -scale * turn);
            re += tail_re * cos + tail_im * sin;
            im += tail_im * cos - tail_re * sin;
        }
        (re.hypot(im) / energy).min(1.0)
    }))
}
