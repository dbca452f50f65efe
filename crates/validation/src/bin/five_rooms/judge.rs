//! What was measured, what was rendered, and how far they are apart.

use crate::error::Error;
use sabine::acoustics::{
    Bands, Estimate, ImpulseResponse, PerBand, Reading, RoomParameters, RoomTargets, equalisation,
};
use serde::Serialize;

/// Levels below this are no equalisation of a room but a loudspeaker that does not radiate: dB re 1 kHz. The statistics of
/// `sabine-augment` leave them out as well.
const LOWEST_LEVEL_DB: f64 = -30.0;
/// All levels refer to this octave, which is no measure of anything.
const REFERENCE_HZ: f64 = 1000.0;

/// T60 or EQ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Reverberation time in seconds.
    T60,
    /// Level relative to 1 kHz in dB.
    Eq,
}

/// What can be read from a measured response.
pub struct Truth {
    /// T30 of each octave (ISO 3382-1).
    pub t30_s: PerBand<Reading>,
    /// Level of each octave relative to 1 kHz.
    pub eq_db: PerBand<Reading>,
    /// The decays by a fit that needs less range than T30: targets where T30 has none, never a yardstick.
    fitted_t60_s: PerBand<Reading>,
}

impl Truth {
    /// Reads a measured response.
    ///
    /// # Errors
    /// What the measures refuse.
    pub fn read(response: &ImpulseResponse) -> Result<Self, Error> {
        let parameters = RoomParameters::measure(response, Bands::T60)?;
        Ok(Self {
            t30_s: parameters.t30_s,
            fitted_t60_s: parameters.t60_s,
            eq_db: equalisation(response, Bands::EQ)?,
        })
    }

    /// The measured values that count, by octave: all of T60 that T30 has the range for, EQ but at 1 kHz and where nothing is radiated.
    pub fn values(&self, quantity: Quantity) -> Vec<(f64, Option<f64>)> {
        match quantity {
            Quantity::T60 => self.t30_s.iter().map(|(hz, t)| (hz, value(t))).collect(),
            Quantity::Eq => {
                let others = self.eq_db.iter().filter(|(hz, _)| *hz != REFERENCE_HZ);
                others.map(|(hz, level)| (hz, value(level).filter(|l| *l > LOWEST_LEVEL_DB))).collect()
            }
        }
    }

    /// The measured values as targets. An octave without T30 takes the time of the decay fit, one without any value that of the
    /// nearest octave with one.
    ///
    /// # Errors
    /// [`Error::Nothing`] for a response of which nothing can be read.
    pub fn targets(&self) -> Result<RoomTargets, Error> {
        let times = PerBand::from_fn(Bands::T60, |b| {
            value(&self.t30_s.values()[b]).or(value(&self.fitted_t60_s.values()[b]))
        });
        let levels = self.eq_db.map(value);
        Ok(RoomTargets::new(filled(&times)?, filled(&levels)?)?)
    }
}

fn value(reading: &Reading) -> Option<f64> {
    reading.as_ref().ok().map(|estimate| estimate.value)
}

/// Gaps closed by the nearest band that has a value; of two as near, the lower one.
fn filled(values: &PerBand<Option<f64>>) -> Result<PerBand<Estimate>, Error> {
    let count = values.values().len();
    let nearest = |b: usize| {
        let known = (0..count).filter_map(|other| Some((other.abs_diff(b), values.values()[other]?)));
        known.min_by_key(|(distance, _)| *distance).map(|(_, value)| Estimate::exact(value))
    };
    let found: Option<Vec<Estimate>> = (0..count).map(nearest).collect();
    let found = found.ok_or(Error::Nothing { what: "octave that can be read".into() })?;
    Ok(PerBand::new(values.bands(), found)?)
}

/// An octave of a rendered response against the measured one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Octave {
    /// T60 or EQ.
    pub quantity: Quantity,
    /// Nominal centre in Hz.
    pub band_hz: f64,
    /// Measured.
    pub measured: f64,
    /// What the method took it for.
    pub target: f64,
    /// Read from what was rendered, before the filter.
    pub unfiltered: Option<f64>,
    /// Read from what was rendered, behind the filter.
    pub rendered: Option<f64>,
}

impl Octave {
    /// Absolute error of what is heard.
    pub fn error(&self) -> Option<f64> {
        Some((self.rendered? - self.measured).abs())
    }
}

/// Compares a rendered response, before and behind its filter, with the measured one, in every octave that has been measured.
///
/// # Errors
/// What the measures refuse.
pub fn judge(
    truth: &Truth,
    targets: &RoomTargets,
    unfiltered: &ImpulseResponse,
    filtered: &ImpulseResponse,
) -> Result<Vec<Octave>, Error> {
    let (before, behind) = (Reached::read(unfiltered)?, Reached::read(filtered)?);
    let mut octaves = Vec::new();
    for quantity in [Quantity::T60, Quantity::Eq] {
        let aimed = match quantity {
            Quantity::T60 => targets.t60_s(),
            Quantity::Eq => targets.eq_db(),
        };
        for (band_hz, measured) in truth.values(quantity) {
            let (Some(measured), Some(target)) = (measured, aimed.at_hz(band_hz)) else { continue };
            octaves.push(Octave {
                quantity,
                band_hz,
                measured,
                target: target.value,
                unfiltered: before.at(quantity, band_hz),
                rendered: behind.at(quantity, band_hz),
            });
        }
    }
    Ok(octaves)
}

/// What is read from a rendered response.
struct Reached {
    t60_s: PerBand<Option<f64>>,
    eq_db: PerBand<Option<f64>>,
}

impl Reached {
    /// T30; where a decay is too long for the traced time to hold 35 dB of it, the time of the decay fit, so that a method is not
    /// spared what it does worst.
    fn read(response: &ImpulseResponse) -> Result<Self, Error> {
        let parameters = RoomParameters::measure(response, Bands::T60)?;
        let time = |b: usize| value(&parameters.t30_s.values()[b]).or(value(&parameters.t60_s.values()[b]));
        Ok(Self {
            t60_s: PerBand::from_fn(Bands::T60, time),
            eq_db: equalisation(response, Bands::EQ)?.map(value),
        })
    }

    fn at(&self, quantity: Quantity, band_hz: f64) -> Option<f64> {
        let of = match quantity {
            Quantity::T60 => &self.t60_s,
            Quantity::Eq => &self.eq_db,
        };
        of.at_hz(band_hz).copied().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise that decays by 60 dB in the given time, at 48 kHz.
    fn decaying(t60_s: f64, scale: f32) -> ImpulseResponse {
        let mut state = 3_u32;
        let samples = (0..48_000).map(|i| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = (state >> 8) as f32 / 8_388_608.0 - 1.0;
            scale * noise * (-6.9078 * f64::from(i) / (t60_s * 48_000.0)).exp() as f32
        });
        ImpulseResponse::new(samples.collect(), 48_000).unwrap()
    }

    #[test]
    fn a_response_is_no_distance_from_itself_and_its_level_does_not_count() {
        let truth = Truth::read(&decaying(0.5, 1.0)).unwrap();
        let (targets, louder) = (truth.targets().unwrap(), decaying(0.5, 0.1));
        let octaves = judge(&truth, &targets, &louder, &louder).unwrap();
        assert_eq!(octaves.len(), 13, "seven of T60, six of EQ: 1 kHz is the reference");
        for octave in &octaves {
            assert!(octave.error().unwrap() < 1e-3, "{octave:?}");
        }
    }

    #[test]
    fn a_longer_decay_is_its_difference_away() {
        let truth = Truth::read(&decaying(0.4, 1.0)).unwrap();
        let (targets, longer) = (truth.targets().unwrap(), decaying(0.6, 1.0));
        let octaves = judge(&truth, &targets, &longer, &longer).unwrap();
        let times: Vec<f64> =
            octaves.iter().filter(|o| o.quantity == Quantity::T60).filter_map(Octave::error).collect();
        let mean = times.iter().sum::<f64>() / times.len() as f64;
        assert!((mean - 0.2).abs() < 0.02, "{times:?}");
    }

    #[test]
    fn gaps_take_the_nearest_value() {
        let bands = Bands::octaves(125.0, 1000.0).unwrap();
        let known = PerBand::new(bands, vec![None, Some(1.0), None, Some(2.0)]).unwrap();
        let values: Vec<f64> = filled(&known).unwrap().values().iter().map(|e| e.value).collect();
        assert_eq!(values, [1.0, 1.0, 1.0, 2.0]);
        assert!(filled(&PerBand::uniform(bands, None)).is_err());
    }
}
