//! Runs of bands from nominal centres.

use super::{Bands, Width};
use crate::error::Error;

impl Width {
    fn index_of(self, centre_hz: f64) -> Result<usize, Error> {
        self.position(centre_hz).ok_or(Error::UnknownBand { centre_hz })
    }
}

impl Bands {
    /// The octaves from one nominal centre to another, both included.
    ///
    /// # Errors
    /// [`Error::UnknownBand`] if either is not a nominal octave centre from 31.5 Hz to 16 kHz, [`Error::BandOrder`] if
    /// `last_hz < first_hz`.
    pub fn octaves(first_hz: f64, last_hz: f64) -> Result<Self, Error> {
        Self::new(Width::Octave, first_hz, last_hz)
    }

    /// The third octaves from one nominal centre to another, both included.
    ///
    /// # Errors
    /// [`Error::UnknownBand`] if either is not a nominal third-octave centre from 25 Hz to 20 kHz, [`Error::BandOrder`] if
    /// `last_hz < first_hz`.
    pub fn third_octaves(first_hz: f64, last_hz: f64) -> Result<Self, Error> {
        Self::new(Width::Third, first_hz, last_hz)
    }

    fn new(width: Width, first_hz: f64, last_hz: f64) -> Result<Self, Error> {
        let (first, last) = (width.index_of(first_hz)?, width.index_of(last_hz)?);
        if last < first {
            return Err(Error::BandOrder { first_hz, last_hz });
        }
        Ok(Self { width, first: first as u8, count: (last - first + 1) as u8 })
    }

    /// The run with exactly these nominal centres, octaves or third octaves; a single centre that names both is an octave.
    ///
    /// # Errors
    /// [`Error::UnknownBand`] for a centre that is not nominal, [`Error::BandOrder`] if they do not rise octave by octave
    /// or third by third, [`Error::Empty`] if there are none.
    pub fn from_centres_hz(centres_hz: &[f64]) -> Result<Self, Error> {
        let (Some(&first_hz), Some(&last_hz)) = (centres_hz.first(), centres_hz.last()) else {
            return Err(Error::Empty { what: "the list of centres" });
        };
        for &centre_hz in centres_hz {
            // Every nominal octave centre is one of a third octave, too.
            Width::Third.index_of(centre_hz)?;
        }
        let same = |bands: &Self| {
            bands.len() == centres_hz.len()
                && centres_hz.iter().enumerate().all(|(i, &hz)| bands.index_of(hz) == Some(i))
        };
        [Self::octaves(first_hz, last_hz), Self::third_octaves(first_hz, last_hz)]
            .into_iter()
            .flatten()
            .find(same)
            .ok_or(Error::BandOrder { first_hz, last_hz })
    }
}
