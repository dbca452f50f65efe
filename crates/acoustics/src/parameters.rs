//! Room-acoustic parameters of a measured response (ISO 3382-1, ISO 3382-2).

use crate::band_energy::{BandEnergy, Prepared};
use crate::bands::Bands;
use crate::decay_fit::DecayFit;
use crate::energy::EnergyDecayCurve;
use crate::error::Error;
use crate::estimate::{Estimate, NoReading, Reading};
use crate::onset::Onset;
use crate::per_band::PerBand;
use crate::signal::ImpulseResponse;

/// The noise must lie this far below the lowest level that a regression uses (ISO 3382-1, 5.3.3), in dB.
const NOISE_MARGIN_DB: f64 = 10.0;
/// Least product of bandwidth and decay time. ISO 3382-2, 7.3 asks for 16 with ordinary filters and 4 with time-reversed
/// ones; with these filters, which ring alike on both sides, ideal decays are read without bias from 8 on.
const LEAST_BANDWIDTH_TIME: f64 = 8.0;
/// Largest relative standard error of a decay time that is still an answer: beyond a half, two of them reach zero. The
/// reverberation time of the fit has no need of a margin to the noise, and must be surer instead.
const LARGEST_RELATIVE_ERROR: f64 = 0.5;
const LARGEST_RELATIVE_ERROR_OF_FIT: f64 = 0.25;

/// The parameters of one band, or of the whole response.
///
/// Standard errors of decay times are those with which the random nature of reverberation lets one response tell the decay
/// of the room; standard errors of the energy ratios and of the centre time are what the background noise adds to them.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BandParameters {
    /// Early decay time, 0 to -10 dB of the decay curve, in seconds.
    pub edt_s: Reading,
    /// Reverberation time from -5 to -25 dB, in seconds.
    pub t20_s: Reading,
    /// Reverberation time from -5 to -35 dB, in seconds.
    pub t30_s: Reading,
    /// Reverberation time from the decay-plus-noise fit ([`DecayFit::t60_s`]), in seconds: the most accurate of them.
    pub t60_s: Reading,
    /// Early-to-late energy ratio at 50 ms, in dB.
    pub c50_db: Reading,
    /// Early-to-late energy ratio at 80 ms, in dB.
    pub c80_db: Reading,
    /// Definition: share of the energy within 50 ms, 0 to 1.
    pub d50: Reading,
    /// Centre time, in seconds after the onset.
    pub centre_time_s: Reading,
    /// Direct-to-reverberant energy ratio, in dB: what lies within 2.5 ms of the largest sample of the unfiltered response
    /// against what follows.
    pub drr_db: Reading,
    /// The decays and the noise floor.
    pub fit: Result<DecayFit, NoReading>,
}

impl BandParameters {
    /// The parameters of the unfiltered response.
    ///
    /// ```
    /// use sabine_acoustics::{BandParameters, ImpulseResponse};
    /// // Alternating signs under an envelope that falls by 60 dB in 0.4 s.
    /// let samples = (0..16000).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 } * (-6.9078 * i as f32 / 6400.0).exp());
    /// let response = ImpulseResponse::new(samples.collect(), 16000)?;
    /// let t60 = BandParameters::full_band(&response).t60_s.unwrap();
    /// assert!((t60.value - 0.4).abs() < 0.001);
    /// # Ok::<(), sabine_acoustics::Error>(())
    /// ```
    pub fn full_band(response: &ImpulseResponse) -> Self {
        match Prepared::new(response).full_band() {
            Ok(band) => Self::read(&band),
            Err(reason) => Self::absent(&reason),
        }
    }

    /// The parameters in each band, lowest first.
    pub fn in_bands(response: &ImpulseResponse, bands: Bands) -> Vec<Self> {
        Prepared::new(response)
            .bands((0..bands.len()).map(|i| bands.edges_hz(i)))
            .into_iter()
            .map(|band| band.map_or_else(|reason| Self::absent(&reason), |band| Self::read(&band)))
            .collect()
    }

    fn absent(reason: &NoReading) -> Self {
        let none = || Err(reason.clone());
        Self {
            edt_s: none(),
            t20_s: none(),
            t30_s: none(),
            t60_s: none(),
            c50_db: none(),
            c80_db: none(),
            d50: none(),
            centre_time_s: none(),
            drr_db: none(),
            fit: Err(reason.clone()),
        }
    }

    fn read(band: &BandEnergy) -> Self {
        let decay = band.fit.as_ref().map_err(NoReading::clone).map(|_| Decay::new(band));
        let time =
            |from_db: f64, to_db: f64| decay.as_ref().map_err(NoReading::clone)?.time_s(from_db, to_db);
        let (c50_db, d50) = clarity(band, 0.050);
        Self {
            edt_s: time(0.0, -10.0),
            t20_s: time(-5.0, -25.0),
            t30_s: time(-5.0, -35.0),
            t60_s: band
                .fit
                .as_ref()
                .map_err(NoReading::clone)
                .and_then(|fit| trusted(band, fit.t60_s(), LARGEST_RELATIVE_ERROR_OF_FIT)),
            c50_db,
            c80_db: clarity(band, 0.080).0,
            d50,
            centre_time_s: centre_time(band),
            drr_db: direct_to_reverberant(band),
            fit: band.fit.clone(),
        }
    }
}

/// The parameters of a response in octave bands.
///
/// ```
/// use sabine_acoustics::{Bands, ImpulseResponse, NoReading, RoomParameters};
/// // White noise under an envelope that falls by 60 dB in 0.5 s.
/// let mut state = 7u32;
/// let samples = (0..16000).map(|i| {
///     state = state.wrapping_mul(1664525).wrapping_add(1013904223);
///     ((state >> 8) as f32 / 8388608.0 - 1.0) * (-6.9078 * i as f32 / 8000.0).exp()
/// });
/// let response = ImpulseResponse::new(samples.collect(), 16000)?;
/// let room = RoomParameters::measure(&response, Bands::T60)?;
/// let t60 = room.t60_s.at_hz(1000.0).unwrap().as_ref().unwrap();
/// assert!((t60.value - 0.5).abs() < 4.0 * t60.standard_error);
/// // The 8 kHz octave reaches up to 11.2 kHz, which a sample rate of 16 kHz cannot hold.
/// assert!(matches!(room.t60_s.at_hz(8000.0), Some(Err(NoReading::AboveNyquist { .. }))));
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RoomParameters {
    /// Time zero.
    pub onset: Result<Onset, NoReading>,
    /// Early decay time, 0 to -10 dB, in seconds.
    pub edt_s: PerBand<Reading>,
    /// Reverberation time from -5 to -25 dB, in seconds.
    pub t20_s: PerBand<Reading>,
    /// Reverberation time from -5 to -35 dB, in seconds.
    pub t30_s: PerBand<Reading>,
    /// Reverberation time from the decay-plus-noise fit, in seconds.
    pub t60_s: PerBand<Reading>,
    /// Early-to-late energy ratio at 50 ms, in dB.
    pub c50_db: PerBand<Reading>,
    /// Early-to-late energy ratio at 80 ms, in dB.
    pub c80_db: PerBand<Reading>,
    /// Share of the energy within 50 ms, 0 to 1.
    pub d50: PerBand<Reading>,
    /// Centre time, in seconds after the onset.
    pub centre_time_s: PerBand<Reading>,
    /// Direct-to-reverberant energy ratio, in dB.
    pub drr_db: PerBand<Reading>,
    /// The decays and the noise floor of each band.
    pub fits: PerBand<Result<DecayFit, NoReading>>,
}

impl RoomParameters {
    /// Measures a response. What cannot be read in a band says why in its place.
    ///
    /// # Errors
    /// None at present: an [`ImpulseResponse`] is checked when it is made.
    pub fn measure(response: &ImpulseResponse, bands: Bands) -> Result<Self, Error> {
        let prepared = Prepared::new(response);
        let read: Vec<BandParameters> = prepared
            .bands((0..bands.len()).map(|i| bands.edges_hz(i)))
            .into_iter()
            .map(|band| {
                band.map_or_else(|reason| BandParameters::absent(&reason), |band| BandParameters::read(&band))
            })
            .collect();
        let pick =
            |field: fn(&BandParameters) -> &Reading| PerBand::from_fn(bands, |i| field(&read[i]).clone());
        Ok(Self {
            onset: prepared.onset.clone(),
            edt_s: pick(|band| &band.edt_s),
            t20_s: pick(|band| &band.t20_s),
            t30_s: pick(|band| &band.t30_s),
            t60_s: pick(|band| &band.t60_s),
            c50_db: pick(|band| &band.c50_db),
            c80_db: pick(|band| &band.c80_db),
            d50: pick(|band| &band.d50),
            centre_time_s: pick(|band| &band.centre_time_s),
            drr_db: pick(|band| &band.drr_db),
            fits: PerBand::from_fn(bands, |i| read[i].fit.clone()),
        })
    }

    /// The bands.
    pub fn bands(&self) -> Bands {
        self.t60_s.bands()
    }
}

/// A decay time, unless the filter made it or it is too uncertain.
fn trusted(band: &BandEnergy, time_s: Estimate, largest: f64) -> Reading {
    let bandwidth_time = band.energy_bandwidth_hz * time_s.value;
    if bandwidth_time < LEAST_BANDWIDTH_TIME {
        return Err(NoReading::FilterRinging { bandwidth_time, needed: LEAST_BANDWIDTH_TIME });
    }
    let relative_error = time_s.standard_error / time_s.value;
    // Written so that NaN fails.
    if relative_error <= largest { Ok(time_s) } else { Err(NoReading::Uncertain { relative_error, largest }) }
}

/// The backward-integrated decay of a band from its onset on, free of noise.
struct Decay<'a> {
    band: &'a BandEnergy,
    remaining: EnergyDecayCurve,
    range_db: f64,
}

impl<'a> Decay<'a> {
    fn new(band: &'a BandEnergy) -> Self {
        let energy = &band.energy[band.onset..band.end];
        let remaining = EnergyDecayCurve::without_noise(energy, band.step_s, band.noise, band.tail);
        let curve = remaining.remaining();
        let (first, last) = (curve.first().copied().unwrap_or(0.0), curve.last().copied().unwrap_or(0.0));
        let range_db = 10.0 * (first / last.max(f64::MIN_POSITIVE)).log10();
        Self { band, remaining, range_db }
    }

    /// Decay time from the least-squares line between two levels. Its standard error is that of a linear function of
    /// the squared samples, each of which varies like a squared Gaussian.
    fn time_s(&self, start_db: f64, end_db: f64) -> Reading {
        let needed_db = NOISE_MARGIN_DB - end_db;
        if self.range_db < needed_db {
            return Err(NoReading::DynamicRange { needed_db, available_db: self.range_db });
        }
        let value = self.remaining.decay_time_s(start_db, end_db)?;
        let curve = self.remaining.remaining();
        let total = curve[0];
        let level = |db: f64| total * 10f64.powf(0.1 * db);
        let from = curve.iter().position(|&e| e <= level(start_db)).unwrap_or(0);
        let to = curve.iter().position(|&e| e < level(end_db)).unwrap_or(curve.len());
        let step_s = self.band.step_s;
        let count = (to - from) as f64;
        let middle = 0.5 * (from + to - 1) as f64;
        let sum_squares = count * (count * count - 1.0) / 12.0 * step_s * step_s;
        // Each squared sample enters the curve at all earlier times, the line weights each of those by its distance from the
        // middle: the sensitivity grows along the range and stays after it.
        let per_db = 10.0 / std::f64::consts::LN_10;
        let energy = &self.band.energy[self.band.onset..self.band.end];
        let (mut sensitivity, mut variance) = (0.0, 0.0);
        for (i, &e) in energy.iter().enumerate().skip(from) {
            if i < to {
                sensitivity += per_db * (i as f64 - middle) * step_s / (sum_squares * curve[i]);
            }
            // The mean of the square of a squared Gaussian is three times its squared mean.
            variance += sensitivity * sensitivity * e * e / 3.0;
        }
        variance /= self.band.statistical_bandwidth_hz * step_s;
        // T = -60 / slope.
        trusted(
            self.band,
            Estimate::new(value, value * value / 60.0 * variance.sqrt()),
            LARGEST_RELATIVE_ERROR,
        )
    }
}

/// Early-to-late ratio in dB and the early share, at a time after the onset.
fn clarity(band: &BandEnergy, limit_s: f64) -> (Reading, Reading) {
    let limit = band.onset + (limit_s / band.step_s).round() as usize;
    if limit >= band.energy.len() {
        let start_s = band.onset as f64 * band.step_s;
        let reason = NoReading::TooShort {
            needed_s: limit_s,
            available_s: band.energy.len() as f64 * band.step_s - start_s,
        };
        return (Err(reason.clone()), Err(reason));
    }
    let (early, early_variance) = band.net(band.first, limit.min(band.end));
    let (mut late, late_variance) = band.net(limit, band.end.max(limit));
    late += match &band.fit {
        Ok(fit) if limit > band.end => fit.decay_energy_after(limit as f64 * band.step_s, band.step_s),
        _ => band.tail,
    };
    // Either part may drown in the noise: the late one of a dry response, the early one of a late rise.
    let total = early.max(0.0) + late.max(0.0);
    let (early, late) = match (positive(early, early_variance, total), positive(late, late_variance, total)) {
        (Ok(early), Ok(late)) => (early, late),
        (Err(reason), _) | (_, Err(reason)) => return (Err(reason.clone()), Err(reason)),
    };
    // Relative variances add up in the logarithm of the ratio.
    let relative = (early_variance / (early * early) + late_variance / (late * late)).sqrt();
    let definition = early / (early + late);
    (
        Ok(Estimate::new(10.0 * (early / late).log10(), 10.0 / std::f64::consts::LN_10 * relative)),
        Ok(Estimate::new(definition, definition * (1.0 - definition) * relative)),
    )
}

/// Less than this share of the energy is arithmetic, not sound: no converter has 200 dB of range.
const LEAST_SHARE: f64 = 1e-20;

/// An energy that stands out of its uncertainty, or how far it sinks below the total.
pub(crate) fn positive(energy: f64, variance: f64, total: f64) -> Result<f64, NoReading> {
    let least = (2.0 * variance.sqrt()).max(LEAST_SHARE * total);
    if energy > least {
        return Ok(energy);
    }
    let below_db = |e: f64| if e > 0.0 { 10.0 * (total / e).log10() } else { f64::INFINITY };
    Err(NoReading::DynamicRange { needed_db: below_db(energy), available_db: below_db(least) })
}

fn centre_time(band: &BandEnergy) -> Reading {
    let fit = band.fit.as_ref().map_err(NoReading::clone)?;
    let (mut energy, mut moment, mut spread) = (band.tail, 0.0, 0.0);
    let end_s = (band.end - band.onset) as f64 * band.step_s;
    // What is left after the end comes one time constant later on average.
    moment += band.tail * (end_s + fit.t60_s().value / 13.8155);
    for (i, &e) in band.energy[band.first..band.end].iter().enumerate() {
        let t = ((i + band.first) as f64 - band.onset as f64) * band.step_s;
        energy += e - band.noise;
        moment += (e - band.noise) * t;
    }
    if energy <= 0.0 {
        return Err(NoReading::NoDecay);
    }
    let centre_s = moment / energy;
    for (i, &e) in band.energy[band.first..band.end].iter().enumerate() {
        let t = ((i + band.first) as f64 - band.onset as f64) * band.step_s;
        let signal = (e - band.noise).max(0.0);
        spread += (t - centre_s).powi(2) * (2.0 * signal * band.noise + band.noise.powi(2));
    }
    let variance = spread / (band.statistical_bandwidth_hz * band.step_s) / (energy * energy);
    Ok(Estimate::new(centre_s, variance.sqrt()))
}

fn direct_to_reverberant(band: &BandEnergy) -> Reading {
    let (total, variance) = band.net(band.first, band.end);
    // What is left when the direct sound is taken out of the pressure: |x - d|^2 = |x|^2 - 2 x d + |d|^2.
    let late = positive(total + band.tail - 2.0 * band.direct_in_all + band.direct, variance, total)?;
    if band.direct <= 0.0 {
        return Err(NoReading::NoOnset);
    }
    Ok(Estimate::new(
        10.0 * (band.direct / late).log10(),
        10.0 / std::f64::consts::LN_10 * variance.sqrt() / late,
    ))
}
