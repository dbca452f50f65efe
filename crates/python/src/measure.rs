//! Parameters of impulse responses.

use crate::bands::{bands, centres_hz};
use crate::failure::Failure;
use crate::readings::Columns;
use crate::samples::{Samples, response};
use crate::single_numbers::{SingleNumbers, of_decay};
use pyo3::prelude::*;
use sabine::acoustics::{RoomParameters, equalisation};

/// What is read from a response; in Python a dictionary, which `sabine.MeasuredParameters` takes.
#[derive(IntoPyObject)]
pub struct Measured<'py> {
    bands_hz: Vec<f64>,
    onset_s: Option<f64>,
    edt_s: Columns<'py>,
    t20_s: Columns<'py>,
    t30_s: Columns<'py>,
    t60_s: Columns<'py>,
    c50_db: Columns<'py>,
    c80_db: Columns<'py>,
    d50: Columns<'py>,
    centre_time_s: Columns<'py>,
    drr_db: Columns<'py>,
    eq_db: Columns<'py>,
    single_numbers: SingleNumbers,
}

/// Reads the parameters of ISO 3382-1 from a response.
///
/// # Errors
/// Samples, sample rate or bands are refused.
#[pyfunction]
pub fn measure<'py>(
    py: Python<'py>,
    samples: Samples<'py>,
    sample_rate: f64,
    bands_hz: Vec<f64>,
) -> Result<Measured<'py>, Failure> {
    let (response, bands) = (response(&samples, sample_rate)?, bands(&bands_hz)?);
    let (room, eq_db) = py.detach(|| -> Result<_, Failure> {
        Ok((RoomParameters::measure(&response, bands)?, equalisation(&response, bands)?))
    })?;
    let columns = |readings| Columns::of(py, readings);
    Ok(Measured {
        bands_hz: centres_hz(bands),
        onset_s: room.onset.as_ref().ok().map(|onset| onset.time_s),
        edt_s: columns(&room.edt_s),
        t20_s: columns(&room.t20_s),
        t30_s: columns(&room.t30_s),
        t60_s: columns(&room.t60_s),
        c50_db: columns(&room.c50_db),
        c80_db: columns(&room.c80_db),
        d50: columns(&room.d50),
        centre_time_s: columns(&room.centre_time_s),
        drr_db: columns(&room.drr_db),
        eq_db: columns(&eq_db),
        single_numbers: of_decay(&room.edt_s, &room.t30_s, &room.c80_db, &room.d50, &room.centre_time_s),
    })
}
