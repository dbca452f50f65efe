//! Single numbers over bands, and means over positions (ISO 3382-1:2009, table A.1; ISO 3382-2:2008, clause 8).

use crate::error::Error;
use crate::estimate::{Estimate, NoReading, Reading};
use crate::per_band::PerBand;

/// Octaves of the single number of G, EDT, C80, D50 and the centre time (ISO 3382-1, table A.1), nominal centres in Hz.
const MID_HZ: (f64, f64) = (500.0, 1000.0);
/// Octaves of the single numbers of lateral energy (ISO 3382-1, table A.1).
const LATERAL_HZ: (f64, f64) = (125.0, 1000.0);
/// Octaves of the bass ratio's numerator (Beranek 2004).
const BASS_HZ: (f64, f64) = (125.0, 250.0);

/// Mean over the octaves 500 Hz and 1 kHz: the single number of G, EDT, T, C80, D50 and the centre time (ISO 3382-1:2009, table
/// A.1). Where the quantity is in third octaves, over the six from 400 Hz to 1.25 kHz.
///
/// ```
/// use sabine_acoustics::{Bands, Estimate, PerBand, mid_frequency_mean};
/// let t30_s = PerBand::from_fn(Bands::T60, |i| Ok(Estimate::exact(2.0 - 0.1 * i as f64)));
/// assert!((mid_frequency_mean(&t30_s)?.value - 1.75).abs() < 1e-12);
/// # Ok::<(), sabine_acoustics::NoReading>(())
/// ```
///
/// # Errors
/// [`NoReading::NoBand`] if a band is not in the run, or the reason why one of them has no reading.
pub fn mid_frequency_mean(readings: &PerBand<Reading>) -> Reading {
    Ok(mean(&within(readings, MID_HZ)?))
}

/// Mean over the octaves 125 Hz to 1 kHz: the single number of J_LF and J_LFC (ISO 3382-1:2009, table A.1).
///
/// # Errors
/// As [`mid_frequency_mean`].
pub fn low_frequency_mean(readings: &PerBand<Reading>) -> Reading {
    Ok(mean(&within(readings, LATERAL_HZ)?))
}

/// Mean of the energies over the octaves 125 Hz to 1 kHz, in dB: the single number of L_J (ISO 3382-1:2009, A.2.5 and table A.1).
///
/// # Errors
/// As [`mid_frequency_mean`].
pub fn low_frequency_level(readings: &PerBand<Reading>) -> Reading {
    let per_db = 10.0 / std::f64::consts::LN_10;
    let energies: Vec<Estimate> = within(readings, LATERAL_HZ)?
        .iter()
        .map(|level| {
            let energy = (level.value / per_db).exp();
            Estimate::new(energy, energy * level.standard_error / per_db)
        })
        .collect();
    let energy = mean(&energies);
    Ok(Estimate::new(per_db * energy.value.ln(), per_db * energy.standard_error / energy.value))
}

/// Bass ratio of reverberation times: the octaves 125 and 250 Hz over 500 Hz and 1 kHz, means of both (L. Beranek: Concert Halls
/// and Opera Houses, 2nd edition, 2004; not in ISO 3382-1).
///
/// # Errors
/// As [`mid_frequency_mean`].
pub fn bass_ratio(times_s: &PerBand<Reading>) -> Reading {
    let (low, mid) = (mean(&within(times_s, BASS_HZ)?), mean(&within(times_s, MID_HZ)?));
    let ratio = low.value / mid.value;
    let relative = |e: Estimate| e.standard_error / e.value;
    Ok(Estimate::new(ratio, ratio * relative(low).hypot(relative(mid))))
}

/// The readings of all bands of a run from one octave to another.
fn within(readings: &PerBand<Reading>, (first_hz, last_hz): (f64, f64)) -> Result<Vec<Estimate>, NoReading> {
    let bands = readings.bands();
    // Half an octave below the first centre to half an octave above the last one; octaves are 10^0.3 apart.
    let half = 10f64.powf(0.15);
    let found: Vec<&Reading> = (0..bands.len())
        .filter(|&i| (first_hz / half..last_hz * half).contains(&bands.exact_hz(i)))
        .map(|i| &readings.values()[i])
        .collect();
    let octaves = (last_hz / first_hz).log2().round() as usize + 1;
    if found.len() < octaves * bands.per_octave() {
        return Err(NoReading::NoBand { first_hz, last_hz });
    }
    found.into_iter().cloned().collect()
}

/// Mean of values whose errors are independent.
fn mean(values: &[Estimate]) -> Estimate {
    let count = values.len() as f64;
    let sum: f64 = values.iter().map(|e| e.value).sum();
    let variance: f64 = values.iter().map(|e| e.standard_error.powi(2)).sum();
    Estimate::new(sum / count, variance.sqrt() / count)
}

/// Mean over positions in a room (ISO 3382-2:2008, clause 8: arithmetic mean of the reverberation times).
///
/// ```
/// use sabine_acoustics::{Bands, Estimate, NoReading, PerBand, SpatialMean};
/// let at = |t30_s: f64| PerBand::uniform(Bands::T60, Ok(Estimate::exact(t30_s)));
/// let silent = PerBand::uniform(Bands::T60, Err(NoReading::NoOnset));
/// let mean = SpatialMean::over(&[at(1.8), at(2.0), at(2.2), silent])?;
/// let at_1_khz = mean.mean.at_hz(1000.0).unwrap().as_ref().unwrap();
/// assert!((at_1_khz.value - 2.0).abs() < 1e-12);
/// // Standard deviation 0.2 s over the root of three positions.
/// assert!((at_1_khz.standard_error - 0.2 / 3f64.sqrt()).abs() < 1e-12);
/// assert_eq!(mean.positions.at_hz(1000.0), Some(&3));
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SpatialMean {
    /// Mean of the positions that have a reading. Its standard error is that of the mean over positions: their standard deviation
    /// over the root of their number; for a single position its own. Where none has a reading, the first one's reason.
    pub mean: PerBand<Reading>,
    /// Positions that have a reading.
    pub positions: PerBand<usize>,
}

impl SpatialMean {
    /// The mean of readings, one set for each position.
    ///
    /// # Errors
    /// [`Error::Empty`] without positions, [`Error::BandMismatch`] where their bands differ.
    pub fn over(positions: &[PerBand<Reading>]) -> Result<Self, Error> {
        let first = positions.first().ok_or(Error::Empty { what: "the list of positions" })?;
        let bands = first.bands();
        if let Some(other) = positions.iter().find(|position| position.bands() != bands) {
            return Err(Error::BandMismatch { left: bands, right: other.bands() });
        }
        let read = |band: usize| -> Vec<Estimate> {
            positions.iter().filter_map(|position| position.values()[band].as_ref().ok().copied()).collect()
        };
        let mean_of = |band: usize| {
            let values = read(band);
            let Some(&only) = values.first() else { return first.values()[band].clone() };
            if values.len() == 1 {
                return Ok(only);
            }
            let (count, centre) = (values.len() as f64, mean(&values).value);
            let squares: f64 = values.iter().map(|e| (e.value - centre).powi(2)).sum();
            Ok(Estimate::new(centre, (squares / (count - 1.0) / count).sqrt()))
        };
        Ok(Self {
            mean: PerBand::from_fn(bands, mean_of),
            positions: PerBand::from_fn(bands, |band| read(band).len()),
        })
    }
}
