//! A room: its surfaces, its air, its places, and what was measured in it.

use crate::bands::{bands, centres_hz};
use crate::failure::Failure;
use numpy::PyArray1;
use pyo3::prelude::*;
use sabine::acoustics::{Air, Bands, Material, PerBand, material_library};
use sabine::optimize::{AbsorptionPrior, MaterialFit};
use sabine::scene::{DiffuseRoom, MeasuredRoom, ReadOptions, Receiver, Scene, Source};
use std::path::PathBuf;

/// A room. It does not change: what changes it makes another one.
#[pyclass(frozen)]
pub struct Room {
    /// Mesh and materials.
    pub scene: Scene,
    /// One standard deviation of what is believed of each material's absorption.
    absorption_sd: Vec<PerBand<f64>>,
    /// The air.
    pub air: Air,
    /// Sources by name.
    pub sources: Vec<Source>,
    /// Receivers by name.
    pub receivers: Vec<Receiver>,
    /// The room folder that it was read from, with its responses.
    pub measured: Option<MeasuredRoom>,
}

/// A surface; in Python a dictionary, which `sabine.Surface` takes.
#[derive(IntoPyObject)]
struct Surface<'py> {
    name: String,
    area_m2: f64,
    absorption: Bound<'py, PyArray1<f64>>,
    absorption_sd: Bound<'py, PyArray1<f64>>,
    scattering: Bound<'py, PyArray1<f64>>,
}

/// A place by its name.
type NamedPlace = (String, [f64; 3]);

#[pymethods]
impl Room {
    /// A box, and its six surfaces in the order of [`Scene::shoebox`]; of each absorption and scattering in each band.
    #[staticmethod]
    fn shoebox(
        size_m: [f64; 3],
        bands_hz: Vec<f64>,
        surfaces: [(Vec<f64>, Vec<f64>); 6],
        absorption_sd: f64,
        air: [f64; 3],
        sources: Vec<NamedPlace>,
        receivers: Vec<NamedPlace>,
    ) -> Result<Self, Failure> {
        let bands = bands(&bands_hz)?;
        let material = |(absorption, scattering): (Vec<f64>, Vec<f64>)| -> Result<Material, Failure> {
            Ok(Material::new(PerBand::new(bands, absorption)?, PerBand::new(bands, scattering)?)?)
        };
        let [x0, x1, y0, y1, floor, ceiling] = surfaces.map(material);
        let [temperature_c, humidity_percent, pressure_kpa] = air;
        let source = |(id, position_m)| Ok(Source::omni(id, position_m)?);
        let receiver = |(id, position_m)| Ok(Receiver::omni(id, position_m)?);
        Ok(Self {
            scene: Scene::shoebox(size_m, [x0?, x1?, y0?, y1?, floor?, ceiling?])?,
            absorption_sd: vec![PerBand::uniform(bands, absorption_sd); 6],
            air: Air::new(temperature_c, humidity_percent, pressure_kpa)?,
            sources: sources.into_iter().map(source).collect::<Result<_, Failure>>()?,
            receivers: receivers.into_iter().map(receiver).collect::<Result<_, Failure>>()?,
            measured: None,
        })
    }

    /// A room folder.
    #[staticmethod]
    fn read(
        py: Python<'_>,
        folder: PathBuf,
        materials: Option<PathBuf>,
        allow_outside: bool,
    ) -> Result<Self, Failure> {
        py.detach(|| {
            let room = MeasuredRoom::read_with(folder, &ReadOptions { allow_outside })?;
            Ok(Self::of_measured(match materials {
                Some(file) => room.with_materials_file(file)?,
                None => room,
            }))
        })
    }

    #[getter]
    fn bands_hz(&self) -> Vec<f64> {
        centres_hz(self.bands())
    }

    /// Lowest and highest corner.
    #[getter]
    fn bounds_m(&self) -> [[f64; 3]; 2] {
        self.scene.bounds_m()
    }

    #[getter]
    fn volume_m3(&self) -> f64 {
        self.scene.volume_m3()
    }

    #[getter]
    fn surfaces<'py>(&self, py: Python<'py>) -> Vec<Surface<'py>> {
        let areas = self.scene.material_areas_m2();
        let column = |values: &PerBand<f64>| PyArray1::from_slice(py, values.values());
        let materials = self.scene.materials().iter().zip(&self.absorption_sd).zip(areas);
        materials
            .map(|((named, sd), area_m2)| Surface {
                name: named.name.clone(),
                area_m2,
                absorption: column(named.material.absorption()),
                absorption_sd: column(sd),
                scattering: column(named.material.scattering()),
            })
            .collect()
    }

    #[getter]
    fn sources(&self) -> Vec<NamedPlace> {
        self.sources.iter().map(|source| (source.id.clone(), source.position_m)).collect()
    }

    #[getter]
    fn receivers(&self) -> Vec<NamedPlace> {
        self.receivers.iter().map(|receiver| (receiver.id.clone(), receiver.position_m)).collect()
    }

    /// Number of responses that were measured in it.
    #[getter]
    fn responses(&self) -> usize {
        self.measured.as_ref().map_or(0, |room| room.responses().len())
    }

    /// What should be known before its numbers are believed.
    #[getter]
    fn notes(&self) -> Vec<String> {
        let notes = self.measured.as_ref().map(MeasuredRoom::notes).unwrap_or_default();
        notes.iter().map(ToString::to_string).collect()
    }

    /// Reverberation times by the formulas of Sabine and of Eyring, per band.
    fn diffuse_t60_s(&self) -> Result<[Vec<f64>; 2], Failure> {
        let rooms = DiffuseRoom::of_scene(&self.scene, &self.air, self.bands())?;
        Ok([DiffuseRoom::sabine_t60_s, DiffuseRoom::eyring_t60_s]
            .map(|formula| rooms.values().iter().map(formula).collect()))
    }
}

impl Room {
    /// The room of a folder.
    pub fn of_measured(room: MeasuredRoom) -> Self {
        Self {
            scene: room.scene().clone(),
            absorption_sd: room.priors().iter().map(|prior| prior.absorption_sd.clone()).collect(),
            air: room.air(),
            sources: room.sources().to_vec(),
            receivers: room.receivers().to_vec(),
            measured: Some(room),
        }
    }

    /// The bands of its materials.
    pub fn bands(&self) -> Bands {
        self.scene.materials()[0].material.bands()
    }

    /// Its materials on other bands.
    pub fn materials(&self, bands: Bands) -> Vec<Material> {
        self.scene.materials().iter().map(|named| named.material.resampled(bands)).collect()
    }

    /// Names of its materials.
    pub fn material_names(&self) -> Vec<&str> {
        self.scene.materials().iter().map(|named| named.name.as_str()).collect()
    }

    /// What is believed of its materials before anything is fitted.
    pub fn priors(&self, bands: Bands) -> Vec<AbsorptionPrior> {
        let materials = self.scene.materials().iter().zip(&self.absorption_sd);
        materials
            .map(|(named, sd)| AbsorptionPrior {
                mean: named.material.absorption().averaged(bands),
                standard_deviation: sd.averaged(bands),
            })
            .collect()
    }

    /// The same room with what a fit found.
    ///
    /// # Errors
    /// None in practice: the fit is of this room's materials.
    pub fn with_fit(&self, fit: &MaterialFit) -> Result<Self, Failure> {
        if let Some(room) = &self.measured {
            return Ok(Self::of_measured(room.with_materials(&fit.tables(&self.material_names())?)?));
        }
        Ok(Self {
            scene: self.scene.with_materials(fit.materials.clone())?,
            absorption_sd: fit.absorption_standard_error.clone(),
            air: self.air,
            sources: self.sources.clone(),
            receivers: self.receivers.clone(),
            measured: None,
        })
    }
}

/// A surface of the library in these bands: absorption and scattering.
///
/// # Errors
/// There is none of that name; the message has the nearest ones.
#[pyfunction]
pub fn library_material(name: &str, bands_hz: Vec<f64>) -> Result<(Vec<f64>, Vec<f64>), Failure> {
    let material = sabine::acoustics::library_material(name)?.material(bands(&bands_hz)?)?;
    Ok((material.absorption().values().to_vec(), material.scattering().values().to_vec()))
}

/// Name and description of each surface of the library, and where its absorption was published.
#[pyfunction]
pub fn library() -> Vec<(&'static str, &'static str, &'static str)> {
    material_library().iter().map(|material| (material.name, material.description, material.source)).collect()
}
