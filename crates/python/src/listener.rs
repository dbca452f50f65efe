//! What a listener has of a room beside its decay: strength, lateral energy, and the correlation of both ears.

use crate::bands::{bands, centres_hz};
use crate::failure::{Failure, refused};
use crate::readings::Columns;
use crate::samples::{Samples, rate_hz, response};
use crate::single_numbers::{SingleNumbers, of_lateral, of_strength};
use pyo3::prelude::*;
use sabine::acoustics::{
    Error, InterauralCorrelation, LateralEnergy, LateralNormalisation, PerBand, SoundStrength,
};

/// What the source makes in the free field at 10 m.
#[pyclass(frozen)]
pub struct FreeFieldReference(sabine::acoustics::FreeFieldReference);

#[pymethods]
impl FreeFieldReference {
    /// Of responses in which 1 is the direct sound at 1 m.
    #[staticmethod]
    fn unit_source(sample_rate: f64, bands_hz: Vec<f64>) -> Result<Self, Failure> {
        let (bands, rate_hz) = (bands(&bands_hz)?, rate_hz(sample_rate)?);
        Ok(Self(sabine::acoustics::FreeFieldReference::unit_source(bands, rate_hz)?))
    }

    /// Of responses that were measured in the free field.
    #[staticmethod]
    fn measured(
        py: Python<'_>,
        responses: Vec<Samples<'_>>,
        sample_rate: f64,
        distance_m: f64,
        bands_hz: Vec<f64>,
    ) -> Result<Self, Failure> {
        let bands = bands(&bands_hz)?;
        let responses =
            responses.iter().map(|samples| response(samples, sample_rate)).collect::<Result<Vec<_>, _>>()?;
        let made =
            py.detach(|| sabine::acoustics::FreeFieldReference::measured(&responses, distance_m, bands));
        Ok(Self(made?))
    }

    /// Of sound exposure levels at 10 m.
    #[staticmethod]
    fn from_exposure_levels(
        levels_db: Vec<f64>,
        sample_rate: f64,
        bands_hz: Vec<f64>,
    ) -> Result<Self, Failure> {
        let levels_db = PerBand::new(bands(&bands_hz)?, levels_db)?;
        let rate_hz = rate_hz(sample_rate)?;
        Ok(Self(sabine::acoustics::FreeFieldReference::from_exposure_levels(&levels_db, rate_hz)?))
    }

    #[getter]
    fn bands_hz(&self) -> Vec<f64> {
        centres_hz(self.0.bands())
    }
}

/// Sound strength; in Python a dictionary, which `sabine.SoundStrength` takes.
#[derive(IntoPyObject)]
pub struct Strength<'py> {
    bands_hz: Vec<f64>,
    g_db: Columns<'py>,
    g_early_db: Columns<'py>,
    g_late_db: Columns<'py>,
    single_numbers: SingleNumbers,
}

/// Reads the sound strength in the bands of the reference.
///
/// # Errors
/// Samples or sample rate are refused, or the reference has another sample rate.
#[pyfunction]
pub fn sound_strength<'py>(
    py: Python<'py>,
    samples: Samples<'py>,
    sample_rate: f64,
    reference: &FreeFieldReference,
) -> Result<Strength<'py>, Failure> {
    let response = response(&samples, sample_rate)?;
    let found = py.detach(|| SoundStrength::measure(&response, &reference.0)).map_err(of_reference)?;
    Ok(Strength {
        bands_hz: centres_hz(found.g_db.bands()),
        g_db: Columns::of(py, &found.g_db),
        g_early_db: Columns::of(py, &found.early_db),
        g_late_db: Columns::of(py, &found.late_db),
        single_numbers: of_strength(&found.g_db),
    })
}

/// Lateral energy; in Python a dictionary, which `sabine.LateralEnergy` takes.
#[derive(IntoPyObject)]
pub struct Lateral<'py> {
    bands_hz: Vec<f64>,
    j_lf: Columns<'py>,
    j_lfc: Columns<'py>,
    l_j_db: Option<Columns<'py>>,
    single_numbers: SingleNumbers,
}

/// Reads lateral energy from an omnidirectional channel and a figure of eight.
///
/// # Errors
/// Samples, sample rate, bands or normalisation are refused; channels differ in length; the reference has other bands or another rate.
#[pyfunction]
pub fn lateral_energy<'py>(
    py: Python<'py>,
    channels: [Samples<'py>; 2],
    sample_rate: f64,
    normalisation: &str,
    bands_hz: Vec<f64>,
    reference: Option<&FreeFieldReference>,
) -> Result<Lateral<'py>, Failure> {
    let bands = bands(&bands_hz)?;
    let normalisation = match normalisation {
        "equal" => LateralNormalisation::Equal,
        "n3d" => LateralNormalisation::N3d,
        "fuma" => LateralNormalisation::FuMa,
        other => return Err(refused(format!("normalisation: {other:?} is none of equal, n3d, fuma"))),
    };
    let [omni, eight] = [response(&channels[0], sample_rate)?, response(&channels[1], sample_rate)?];
    let reference = reference.map(|reference| &reference.0);
    let found = py
        .detach(|| LateralEnergy::measure(&omni, &eight, normalisation, bands, reference))
        .map_err(of_reference)?;
    Ok(Lateral {
        bands_hz: centres_hz(bands),
        j_lf: Columns::of(py, &found.fraction),
        j_lfc: Columns::of(py, &found.cosine_fraction),
        l_j_db: found.late_level_db.as_ref().map(|level| Columns::of(py, level)),
        single_numbers: of_lateral(&found.fraction, &found.cosine_fraction, found.late_level_db.as_ref()),
    })
}

/// Correlation of both ears; in Python a dictionary, which `sabine.InterauralCorrelation` takes.
#[derive(IntoPyObject)]
pub struct Ears<'py> {
    bands_hz: Vec<f64>,
    iacc_early: Columns<'py>,
    iacc_late: Columns<'py>,
    iacc: Columns<'py>,
}

/// Reads the interaural cross-correlation from the responses at the left and the right ear.
///
/// # Errors
/// Samples, sample rate or bands are refused, or the ears differ in length.
#[pyfunction]
pub fn interaural_correlation<'py>(
    py: Python<'py>,
    ears: [Samples<'py>; 2],
    sample_rate: f64,
    bands_hz: Vec<f64>,
) -> Result<Ears<'py>, Failure> {
    let bands = bands(&bands_hz)?;
    let [left, right] = [response(&ears[0], sample_rate)?, response(&ears[1], sample_rate)?];
    let found = py.detach(|| InterauralCorrelation::measure(&left, &right, bands))?;
    Ok(Ears {
        bands_hz: centres_hz(bands),
        iacc_early: Columns::of(py, &found.early),
        iacc_late: Columns::of(py, &found.late),
        iacc: Columns::of(py, &found.all),
    })
}

/// Sample rates and bands that differ from the response's are the reference's.
fn of_reference(error: Error) -> Failure {
    match error {
        Error::SampleRates { .. } | Error::BandMismatch { .. } => refused(format!("reference: {error}")),
        other => other.into(),
    }
}
