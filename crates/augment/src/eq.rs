//! The same room through another loudspeaker and microphone.

use crate::augment::Augment;
use crate::eq_statistics::EqStatistics;
use crate::error::{Error, check};
use crate::seed::generator;
use sabine_acoustics::{Bands, ImpulseResponse, NoReading, PerBand, Signal, equalisation};
use sabine_eqfilter::{EqDesigner, EqFilterConfig};

/// Corrections of the filter by what is still missing: a spectrum that is uneven within an octave needs one or two, a target
/// that is steep between octaves more.
const ROUNDS: usize = 12;
/// Good enough, dB.
const TOLERANCE_DB: f64 = 0.1;
/// What is not met within this is refused, dB.
const LARGEST_MISS_DB: f64 = 0.5;
/// The most that an octave is lifted or lowered, dB.
const LARGEST_CHANGE_DB: f64 = 40.0;

/// Settings of [`EqAugment`].
#[derive(Clone, Debug, PartialEq)]
pub struct EqConfig {
    /// From what the equalisation is drawn. Default [`EqStatistics::measured`].
    pub statistics: EqStatistics,
    /// Factor on the standard deviations, 0 to 5: "a larger variance than the recorded" (Tang et al. 2020, 3.3). Default 1.3.
    pub inflation: f64,
}

impl Default for EqConfig {
    fn default() -> Self {
        Self { statistics: EqStatistics::measured(), inflation: 1.3 }
    }
}

/// Gives a response another equalisation, drawn octave by octave from normal distributions, by a linear-phase filter.
/// ```
/// use sabine_acoustics::{Bands, ImpulseResponse, PerBand, equalisation};
/// use sabine_augment::{EqAugment, EqConfig, SyntheticRoomConfig, SyntheticRooms};
/// let room = SyntheticRooms::new(SyntheticRoomConfig::default())?.draw(1)?;
/// let augment = EqAugment::new(EqConfig::default(), room.sample_rate_hz())?;
/// let wanted_db = PerBand::from_fn(Bands::EQ, |band| [3.0, 0.0, -3.0, 2.0, 0.0, -2.0, 4.0][band]);
/// let coloured = augment.to_db(&room, &wanted_db)?;
/// let found_db = equalisation(&coloured, Bands::EQ)?;
/// assert!((found_db.at_hz(4000.0).unwrap().clone()?.value - 4.0).abs() < 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct EqAugment {
    config: EqConfig,
    designer: EqDesigner,
}

impl EqAugment {
    /// Checks the settings and plans the filters for a sample rate.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn new(config: EqConfig, sample_rate_hz: u32) -> Result<Self, Error> {
        check("inflation", config.inflation, 0.0, 5.0, "between 0 and 5")?;
        let designer = EqDesigner::new(Bands::EQ, sample_rate_hz, EqFilterConfig::default())
            .map_err(|e| sabine_acoustics::Error::implementation("equalisation filter", e))?;
        Ok(Self { config, designer })
    }

    /// The response with these levels at 62.5 Hz to 4 kHz in dB re 1 kHz. Above 4 kHz the change goes on as at 4 kHz.
    ///
    /// # Errors
    /// [`Error::NoEqualisation`] where a level cannot be read, [`Error::EqUnreachable`] where an octave cannot be brought
    /// within 0.5 dB (its neighbours leak into it), [`Error::Setting`] for a change of more than 40 dB,
    /// [`Error::Acoustics`] for other bands or another sample rate.
    pub fn to_db(
        &self,
        response: &ImpulseResponse,
        target_db: &PerBand<f64>,
    ) -> Result<ImpulseResponse, Error> {
        let mut gains = PerBand::uniform(Bands::EQ, 0.0);
        let mut changed = response.clone();
        for round in 0..=ROUNDS {
            let missing = target_db.zip_with(&levels(&changed)?, |t, l| t - l)?;
            let worst = |limit_db: f64| missing.iter().find(|(_, d)| d.abs() >= limit_db);
            if worst(TOLERANCE_DB).is_none() {
                break;
            }
            if round == ROUNDS {
                if let Some((centre_hz, &off_db)) = worst(LARGEST_MISS_DB) {
                    return Err(Error::EqUnreachable { centre_hz, off_db });
                }
                break;
            }
            gains = gains.zip_with(&missing, |g, d| g + d)?;
            for &gain in gains.values() {
                check(
                    "change of an octave (dB)",
                    gain,
                    -LARGEST_CHANGE_DB,
                    LARGEST_CHANGE_DB,
                    "within 40 dB",
                )?;
            }
            let filtered = self
                .designer
                .design(&gains)
                .and_then(|filter| filter.apply(&Signal::from(response.clone())))
                .map_err(|e| sabine_acoustics::Error::implementation("equalisation filter", e))?;
            changed = ImpulseResponse::from(filtered);
        }
        Ok(changed)
    }
}

impl Augment for EqAugment {
    fn augment(
        &self,
        response: &ImpulseResponse,
        seed: u64,
    ) -> Result<ImpulseResponse, sabine_acoustics::Error> {
        let target_db = self.config.statistics.draw_db(&mut generator(seed), self.config.inflation);
        Ok(self.to_db(response, &target_db)?)
    }
}

fn levels(response: &ImpulseResponse) -> Result<PerBand<f64>, Error> {
    let readings = equalisation(response, Bands::EQ)?;
    let mut values = Vec::with_capacity(readings.values().len());
    for (centre_hz, reading) in readings.iter() {
        match reading {
            Ok(estimate) => values.push(estimate.value),
            Err(reason) => return Err(no_level(centre_hz, reason)),
        }
    }
    Ok(PerBand::new(Bands::EQ, values)?)
}

fn no_level(centre_hz: f64, reason: &NoReading) -> Error {
    Error::NoEqualisation { centre_hz, reason: reason.clone() }
}
