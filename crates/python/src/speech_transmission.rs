//! Speech transmission index.

use crate::bands::centres_hz;
use crate::failure::Failure;
use crate::samples::{Samples, response};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use sabine::acoustics::{Bands, Error, MODULATION_HZ, ModulationTransfer, NoReading, PerBand, speech_levels};

/// Speech transmission; in Python a dictionary, which `sabine.SpeechTransmission` takes.
#[derive(IntoPyObject)]
pub struct Speech<'py> {
    value: f64,
    reason: Option<String>,
    qualification: Option<String>,
    bands_hz: Vec<f64>,
    modulation_hz: [f64; 14],
    transmission_indices: Bound<'py, PyArray1<f64>>,
    modulation_transfer: Bound<'py, PyArray2<f64>>,
}

/// What lowers the modulation beside the room.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Disturbance {
    /// Signal-to-noise ratios.
    snr_db: Option<Vec<f64>>,
    /// A-weighted level of the speech.
    speech_level_db: Option<f64>,
    noise_db: Option<Vec<f64>>,
}

impl Disturbance {
    fn applied(&self, transfer: ModulationTransfer) -> Result<ModulationTransfer, Error> {
        let octaves = |values: &Vec<f64>| PerBand::new(Bands::T60, values.clone());
        let noise_db = self.noise_db.as_ref().map(octaves).transpose()?;
        match (&self.snr_db, self.speech_level_db) {
            (Some(snr_db), _) => transfer.with_snr(&octaves(snr_db)?),
            (None, Some(level_db)) => transfer.at_levels(&speech_levels(level_db), noise_db.as_ref()),
            (None, None) => Ok(transfer),
        }
    }
}

/// Reads the speech transmission index from a response.
///
/// # Errors
/// Samples, sample rate or levels are refused.
#[pyfunction]
pub fn speech_transmission<'py>(
    py: Python<'py>,
    samples: Samples<'py>,
    sample_rate: f64,
    disturbance: Disturbance,
) -> Result<Speech<'py>, Failure> {
    let response = response(&samples, sample_rate)?;
    match py.detach(|| ModulationTransfer::of_response(&response)) {
        Ok(transfer) => Speech::of(py, &disturbance.applied(transfer)?),
        Err(reason) => Speech::missing(py, &reason),
    }
}

/// The speech transmission index of modulation transfer that was found elsewhere: 14 values for each of the seven octaves.
///
/// # Errors
/// A value or a level is refused.
#[pyfunction]
pub fn speech_transmission_of(
    py: Python<'_>,
    modulation_transfer: [[f64; 14]; 7],
    disturbance: Disturbance,
) -> Result<Speech<'_>, Failure> {
    let transfer = ModulationTransfer::new(modulation_transfer)?;
    Speech::of(py, &disturbance.applied(transfer)?)
}

impl<'py> Speech<'py> {
    fn of(py: Python<'py>, transfer: &ModulationTransfer) -> Result<Self, Failure> {
        let index = transfer.index();
        let indices = index.transmission_indices.values();
        Ok(Self {
            value: index.value,
            qualification: Some(index.qualification.to_string()),
            ..Self::with_octaves(py, indices, transfer.values().values())?
        })
    }

    fn missing(py: Python<'py>, reason: &NoReading) -> Result<Self, Failure> {
        let octaves = Self::with_octaves(py, &[f64::NAN; 7], &[[f64::NAN; 14]; 7])?;
        Ok(Self { reason: Some(reason.to_string()), ..octaves })
    }

    /// What there is of each octave, without an index.
    fn with_octaves(py: Python<'py>, indices: &[f64], transfer: &[[f64; 14]]) -> Result<Self, Failure> {
        let rows: Vec<Vec<f64>> = transfer.iter().map(|row| row.to_vec()).collect();
        Ok(Self {
            value: f64::NAN,
            reason: None,
            qualification: None,
            bands_hz: centres_hz(Bands::T60),
            modulation_hz: MODULATION_HZ,
            transmission_indices: PyArray1::from_slice(py, indices),
            modulation_transfer: PyArray2::from_vec2(py, &rows)?,
        })
    }
}
