//! Single numbers over bands, and means over positions.

use crate::bands::bands;
use crate::failure::Failure;
use crate::readings::{Columns, Single};
use pyo3::prelude::*;
use sabine::acoustics::{
    Estimate, NoReading, PerBand, Reading, SpatialMean, bass_ratio, low_frequency_level, low_frequency_mean,
    mid_frequency_mean,
};

/// Single numbers by name; in Python pairs, which become a dictionary.
pub type SingleNumbers = Vec<(&'static str, Single)>;

/// Those of the parameters of a decay (ISO 3382-1:2009, table A.1), and the bass ratio.
pub fn of_decay(
    edt_s: &PerBand<Reading>,
    t30_s: &PerBand<Reading>,
    c80_db: &PerBand<Reading>,
    d50: &PerBand<Reading>,
    centre_time_s: &PerBand<Reading>,
) -> SingleNumbers {
    vec![
        ("edt_mid_s", (&mid_frequency_mean(edt_s)).into()),
        ("t30_mid_s", (&mid_frequency_mean(t30_s)).into()),
        ("c80_mid_db", (&mid_frequency_mean(c80_db)).into()),
        ("d50_mid", (&mid_frequency_mean(d50)).into()),
        ("centre_time_mid_s", (&mid_frequency_mean(centre_time_s)).into()),
        ("bass_ratio", (&bass_ratio(t30_s)).into()),
    ]
}

/// That of the sound strength.
pub fn of_strength(g_db: &PerBand<Reading>) -> SingleNumbers {
    vec![("g_mid_db", (&mid_frequency_mean(g_db)).into())]
}

/// Those of lateral energy.
pub fn of_lateral(
    fraction: &PerBand<Reading>,
    cosine_fraction: &PerBand<Reading>,
    late_level_db: Option<&PerBand<Reading>>,
) -> SingleNumbers {
    let mut numbers: SingleNumbers = vec![
        ("j_lf_low", (&low_frequency_mean(fraction)).into()),
        ("j_lfc_low", (&low_frequency_mean(cosine_fraction)).into()),
    ];
    numbers.extend(late_level_db.map(|level| ("l_j_low_db", (&low_frequency_level(level)).into())));
    numbers
}

/// A mean over positions; in Python a dictionary.
#[derive(IntoPyObject)]
pub struct Mean<'py> {
    mean: Columns<'py>,
    positions: Vec<usize>,
}

/// Means over positions of readings that were taken apart: values, NaN where there is none, and standard errors.
///
/// A band that no position has read has a reason here that means nothing: the caller knows those of the positions.
///
/// # Errors
/// There are no positions, bands are refused, or lists have other lengths than the bands.
#[pyfunction]
pub fn spatial_mean(
    py: Python<'_>,
    bands_hz: Vec<f64>,
    positions: Vec<(Vec<f64>, Vec<f64>)>,
) -> Result<Mean<'_>, Failure> {
    let bands = bands(&bands_hz)?;
    let reading = |(&value, &standard_error): (&f64, &f64)| match value.is_nan() {
        true => Err(NoReading::NoDecay),
        false => Ok(Estimate { value, standard_error }),
    };
    let readings = |(values, errors): &(Vec<f64>, Vec<f64>)| {
        PerBand::new(bands, values.iter().zip(errors).map(reading).collect())
    };
    let found = SpatialMean::over(&positions.iter().map(readings).collect::<Result<Vec<_>, _>>()?)?;
    Ok(Mean { mean: Columns::of(py, &found.mean), positions: found.positions.values().to_vec() })
}
