//! How the equalisation of real responses spreads.

use crate::error::Error;
use crate::labels::Labels;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use sabine_acoustics::{Bands, PerBand};

/// Mean and standard deviation per octave of the equalisation of a collection of responses, 62.5 Hz to 4 kHz, dB re 1 kHz
/// ([`Bands::EQ`]).
#[derive(Clone, Debug, PartialEq)]
pub struct EqStatistics {
    mean_db: PerBand<f64>,
    standard_deviation_db: PerBand<f64>,
    responses: usize,
}

impl EqStatistics {
    /// The statistics of 90 measured responses of six rooms with their loudspeakers and microphones, every room weighing the
    /// same: Arni (flamo), Surrey room A, two of DecayFitNet, BinauralSDM, dEchorate 011111. The four rooms in which
    /// `docs/validation/estimator.md` tests the estimator are **not** among them; `docs/validation/augment.md` has the
    /// figures with and without.
    pub fn measured() -> Self {
        let bands = Bands::EQ;
        let values = |v: [f64; 7]| PerBand::from_fn(bands, |i| v[i]);
        Self {
            mean_db: values(MEASURED_MEAN_DB),
            standard_deviation_db: values(MEASURED_SD_DB),
            responses: MEASURED_RESPONSES,
        }
    }

    /// Fits a normal distribution per octave to labels of responses grouped by room, every room weighing the same. Missing
    /// readings are left out, and levels below -30 dB: there the loudspeaker does not radiate, and one such room would set
    /// the spread of all.
    ///
    /// # Errors
    /// [`Error::TooFew`] where an octave has fewer than two rooms with a reading.
    pub fn fit<'a>(rooms: impl IntoIterator<Item = &'a [Labels]>) -> Result<Self, Error> {
        let bands = Bands::EQ;
        let rooms: Vec<&[Labels]> = rooms.into_iter().collect();
        let responses = rooms.iter().map(|r| r.len()).sum();
        let (mut mean, mut deviation) = (Vec::new(), Vec::new());
        for band in 0..bands.len() {
            let per_room: Vec<f64> = rooms
                .iter()
                .filter_map(|room| {
                    let read: Vec<f64> = room
                        .iter()
                        .filter_map(|l| l.eq_db().values()[band].as_ref().ok())
                        .map(|e| e.value)
                        .filter(|&level_db| level_db > LEAST_LEVEL_DB)
                        .collect();
                    (!read.is_empty()).then(|| read.iter().sum::<f64>() / read.len() as f64)
                })
                .collect();
            if per_room.len() < 2 {
                return Err(Error::TooFew {
                    what: "rooms",
                    purpose: "the spread of the equalisation",
                    needed: 2,
                    found: per_room.len(),
                });
            }
            let n = per_room.len() as f64;
            let m = per_room.iter().sum::<f64>() / n;
            mean.push(m);
            deviation.push((per_room.iter().map(|v| (v - m).powi(2)).sum::<f64>() / (n - 1.0)).sqrt());
        }
        Ok(Self {
            mean_db: PerBand::new(bands, mean)?,
            standard_deviation_db: PerBand::new(bands, deviation)?,
            responses,
        })
    }

    /// Mean per octave in dB re 1 kHz.
    pub fn mean_db(&self) -> &PerBand<f64> {
        &self.mean_db
    }

    /// Standard deviation per octave in dB; 0 at 1 kHz.
    pub fn standard_deviation_db(&self) -> &PerBand<f64> {
        &self.standard_deviation_db
    }

    /// Number of responses behind the statistics.
    pub fn responses(&self) -> usize {
        self.responses
    }

    /// Levels drawn independently per octave with the standard deviation times `inflation` (Tang et al. 2020, 3.3),
    /// within two and a half standard deviations.
    pub(crate) fn draw_db(&self, rng: &mut Pcg64, inflation: f64) -> PerBand<f64> {
        PerBand::from_fn(self.mean_db.bands(), |band| {
            let normal: f64 = StandardNormal.sample(rng);
            self.mean_db.values()[band]
                + inflation * self.standard_deviation_db.values()[band] * normal.clamp(-2.5, 2.5)
        })
    }
}

/// Levels below this are left out of a fit, dB re 1 kHz.
const LEAST_LEVEL_DB: f64 = -30.0;
/// Mean over rooms at 62.5 Hz to 4 kHz, dB re 1 kHz.
const MEASURED_MEAN_DB: [f64; 7] = [-7.48, -1.62, 0.54, -0.01, 0.0, 0.30, -2.37];
/// Standard deviation between rooms, dB.
const MEASURED_SD_DB: [f64; 7] = [11.64, 4.59, 4.05, 2.62, 0.0, 2.19, 4.21];
/// Responses behind them.
const MEASURED_RESPONSES: usize = 90;
