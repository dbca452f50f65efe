//! What a training clip is labelled with.

use crate::error::Error;
use sabine_acoustics::{
    BandParameters, ImpulseResponse, OctaveBands, PerBand, Reading, RoomParameters, ThirdOctaveBands,
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
        let rate = f64::from(response.sample_rate_hz());
        let bands = OctaveBands::T60;
        let held = (0..bands.len()).take_while(|&b| bands.edges_hz(b).1 <= 0.5 * rate).count();
        let t60_s = if held == bands.len() {
            RoomParameters::measure(response, bands)?.t60_s
        } else {
            let lower = OctaveBands::new(125.0, bands.nominal_hz(held.max(1) - 1))?;
            let mut readings = RoomParameters::measure(response, lower)?.t60_s.values().to_vec();
            for band in held.max(1)..bands.len() {
                readings.push(lowest_third(response, bands.exact_hz(band))?);
            }
            PerBand::new(bands, readings)?
        };
        Ok(Self {
            t60_s,
            eq_db: equalisation(response, OctaveBands::EQ)?,
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

/// The reverberation time of the lowest third of an octave.
fn lowest_third(response: &ImpulseResponse, octave_hz: f64) -> Result<Reading, Error> {
    let centre_hz = octave_hz / 10f64.powf(0.1);
    let third = ThirdOctaveBands::new(centre_hz, centre_hz)?;
    Ok(BandParameters::third_octaves(response, third).swap_remove(0).t60_s)
}
