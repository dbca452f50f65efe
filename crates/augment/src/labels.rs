//! What a training clip is labelled with.

use crate::error::Error;
use sabine_acoustics::{
    BandParameters, Bands, DecayFit, ImpulseResponse, NoReading, PerBand, Reading, RoomParameters,
    equalisation,
};

/// What is measured on a response: reverberation time, equalisation and ratio of direct to reverberant energy, each a
/// reading with its standard error or the reason why there is none.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels {
    t60_s: PerBand<Reading>,
    eq_db: PerBand<Reading>,
    drr_db: Reading,
}

impl Labels {
    /// Measures a response by [`RoomParameters`] (decay plus noise), [`equalisation`] and [`BandParameters::full_band`].
    ///
    /// A sample rate of 16 kHz holds only the lower part of the 8 kHz octave (5.6 to 11.2 kHz): its reverberation time is
    /// then that of the third octave at 6.3 kHz.
    ///
    /// # Errors
    /// [`Error::Acoustics`] for what [`RoomParameters::measure`] refuses; what cannot be read is no error but a reading that
    /// says why.
    pub fn measure(response: &ImpulseResponse) -> Result<Self, Error> {
        let t60_s = PerBand::new(Bands::T60, decay_times(response)?.t60_s)?;
        Ok(Self {
            t60_s,
            eq_db: equalisation(response, Bands::EQ)?,
            drr_db: BandParameters::full_band(response).drr_db,
        })
    }

    /// Reverberation time at 125 Hz to 8 kHz, in seconds.
    pub fn t60_s(&self) -> &PerBand<Reading> {
        &self.t60_s
    }

    /// Level at 62.5 Hz to 4 kHz relative to 1 kHz, in dB.
    pub fn eq_db(&self) -> &PerBand<Reading> {
        &self.eq_db
    }

    /// Ratio of direct to reverberant energy of the unfiltered response, in dB.
    pub fn drr_db(&self) -> &Reading {
        &self.drr_db
    }
}

/// Reverberation times at 125 Hz to 8 kHz, and the decays of the octaves that the sample rate holds.
pub(crate) struct DecayTimes {
    pub(crate) t60_s: Vec<Reading>,
    pub(crate) fits: Vec<Result<DecayFit, NoReading>>,
}

/// Measures the decays alone.
pub(crate) fn decay_times(response: &ImpulseResponse) -> Result<DecayTimes, Error> {
    let rate = f64::from(response.sample_rate_hz());
    let bands = Bands::T60;
    let held = (0..bands.len()).take_while(|&b| bands.edges_hz(b).1 <= 0.5 * rate).count().max(1);
    let lower = Bands::octaves(125.0, bands.nominal_hz(held - 1))?;
    let measured = RoomParameters::measure(response, lower)?;
    let mut t60_s = measured.t60_s.values().to_vec();
    for band in held..bands.len() {
        t60_s.push(lowest_third(response, bands.exact_hz(band))?);
    }
    Ok(DecayTimes { t60_s, fits: measured.fits.values().to_vec() })
}

/// The reverberation time of the lowest third of an octave.
fn lowest_third(response: &ImpulseResponse, octave_hz: f64) -> Result<Reading, Error> {
    let centre_hz = octave_hz / 10f64.powf(0.1);
    let third = Bands::third_octaves(centre_hz, centre_hz)?;
    Ok(BandParameters::in_bands(response, third).swap_remove(0).t60_s)
}
