//! Writing a measured room.

use super::file::{
    AirTable, BandsTable, MaterialTable, MeasurementTable, PlaceTable, ResponseTable, RoomFile, RoomTable,
};
use super::{MaterialPrior, MeasuredRoom, Measurement, PositionSd};
use crate::error::Error;
use crate::mesh_file::Mesh;
use crate::mesh_file::mesh_options::MeshOptions;
use crate::scene::{Receiver, Scene, Source};
use sabine_acoustics::{
    Air, AudioInfo, Error as ValueError, ImpulseResponse, SampleFormat, create_folder_beside,
    write_atomically, write_wav,
};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A room to be written to disk.
/// Responses that lie in a folder become a measured room:
/// ```
/// use sabine_acoustics::*;
/// use sabine_scene::*;
/// let bands = Bands::octaves(500.0, 1000.0)?;
/// let wall = Material::uniform(bands, 0.1, 0.1)?;
/// let prior = MaterialPrior { absorption: Some(wall.absorption().clone()), absorption_sd: PerBand::uniform(bands, 0.05) };
/// let mut samples = vec![0.0; 4800];
/// samples[420] = 0.33; // 3 m at 343 m/s and 48 kHz
/// let room = NewRoom {
///     scene: Scene::shoebox([6.0, 5.0, 3.0], std::array::from_fn(|_| wall.clone()))?,
///     priors: vec![prior; 6],
///     air: Some(Air::default()),
///     measurement: Measurement { time_zero: TimeZero::Emission, levels: Levels::Absolute },
///     position_sd: PositionSd { all_m: Some(0.02), ..PositionSd::default() },
///     sources: vec![Source::omni("s1", [1.0, 2.0, 1.5])?],
///     receivers: vec![Receiver::omni("r1", [4.0, 2.0, 1.5])?],
///     responses: vec![NewResponse {
///         source: "s1".into(),
///         receiver: "r1".into(),
///         name: "s1_r1".into(),
///         air: None,
///         session: None,
///         recorded_at: None,
///         samples: ImpulseResponse::new(samples, 48_000)?,
///     }],
/// };
/// # let folder = std::env::temp_dir().join(format!("sabine_new_room_{}", std::process::id()));
/// # std::fs::remove_dir_all(&folder).ok();
/// let read = room.write(&folder)?; // room.toml, room.obj, ir/s1_r1.wav
/// assert_eq!(read.load_response(0)?.samples()[420], 0.33);
/// assert_eq!(room.in_memory()?.load_response(0)?, read.load_response(0)?);
/// # std::fs::remove_dir_all(&folder).ok();
/// # Ok::<(), sabine_scene::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct NewRoom {
    /// Mesh and materials; their scattering is written as it stands.
    pub scene: Scene,
    /// Absorption as the file is to state it (or not), for each material of the scene.
    pub priors: Vec<MaterialPrior>,
    /// The air, if the file is to state it.
    pub air: Option<Air>,
    /// What times and levels mean.
    pub measurement: Measurement,
    /// How well places are known, as far as the file is to state it.
    pub position_sd: PositionSd,
    /// Sources.
    pub sources: Vec<Source>,
    /// Receivers.
    pub receivers: Vec<Receiver>,
    /// Responses.
    pub responses: Vec<NewResponse>,
}

/// A response to be written to disk.
#[derive(Clone, Debug, PartialEq)]
pub struct NewResponse {
    /// Source, by name.
    pub source: String,
    /// Receiver, by name.
    pub receiver: String,
    /// File name below `ir/`, without its ending.
    pub name: String,
    /// The air, where it differs from the room's; its pressure is the room's.
    pub air: Option<Air>,
    /// The measuring session.
    pub session: Option<String>,
    /// A number that rises with the time of recording, in any unit.
    pub recorded_at: Option<f64>,
    /// The samples, written in 32-bit floating point.
    pub samples: ImpulseResponse,
}

impl NewRoom {
    /// Writes the room as a new folder, and reads it back. The folder appears when it is complete, or not at all; it must not
    /// exist before, or be empty.
    ///
    /// # Errors
    /// As [`MeasuredRoom::read`]; [`sabine_acoustics::Error::MaterialCount`] unless there is a prior for each material;
    /// [`sabine_acoustics::Error::UnknownId`] for a name in [`NewRoom::position_sd`] that no place has; [`sabine_acoustics::Error::Io`] if
    /// something cannot be written.
    pub fn write(&self, folder: impl AsRef<Path>) -> Result<MeasuredRoom, Error> {
        self.check()?;
        write_folder(folder.as_ref(), &self.tables(), &self.scene.to_obj(), &self.responses)
    }

    /// The room as [`NewRoom::write`] would read it back, without a folder: where there is no disk, as in a browser.
    ///
    /// # Errors
    /// As [`NewRoom::write`], but for files that cannot be written.
    pub fn in_memory(&self) -> Result<MeasuredRoom, Error> {
        self.check()?;
        let (file, obj) = (self.tables(), self.scene.to_obj());
        let mesh = || Mesh::obj_of_bytes("room.obj", obj.as_bytes(), &MeshOptions::default());
        let mut room = MeasuredRoom::assemble(Path::new("room.toml"), &file, mesh)?;
        for (i, (table, response)) in file.responses.iter().zip(&self.responses).enumerate() {
            let entry = room.entry(&file, i, table, table.file.clone(), Some(&response.samples))?;
            room.responses.push(entry);
        }
        Ok(room)
    }

    fn check(&self) -> Result<(), Error> {
        if self.priors.len() != self.scene.materials().len() {
            let (expected, found) = (self.scene.materials().len(), self.priors.len());
            return Err(ValueError::MaterialCount { expected, found }.into());
        }
        let names =
            (self.sources.iter().map(|s| s.id.as_str()), self.receivers.iter().map(|r| r.id.as_str()));
        self.position_sd.check_names(names.0, names.1)
    }

    fn tables(&self) -> RoomFile {
        let material = |(named, prior): (&crate::NamedMaterial, &MaterialPrior)| {
            let values = |column: &sabine_acoustics::PerBand<f64>| Some(column.values().to_vec());
            let table = MaterialTable {
                library: None,
                absorption: prior.absorption.as_ref().and_then(values),
                absorption_sd: values(&prior.absorption_sd),
                scattering: values(named.material.scattering()),
            };
            (named.name.clone(), table)
        };
        let response = |response: &NewResponse| ResponseTable {
            source: response.source.clone(),
            receiver: response.receiver.clone(),
            file: PathBuf::from("ir").join(format!("{}.wav", response.name)),
            temperature_c: response.air.map(|air| air.temperature_c()),
            relative_humidity_percent: response.air.map(|air| air.relative_humidity_percent()),
            session: response.session.clone(),
            recorded_at: response.recorded_at,
        };
        RoomFile {
            room: RoomTable { mesh: "room.obj".into(), units: None, up_axis: None },
            air: self.air.map(|air| AirTable {
                temperature_c: air.temperature_c(),
                relative_humidity_percent: air.relative_humidity_percent(),
                pressure_kpa: air.pressure_kpa(),
            }),
            measurement: Some(MeasurementTable {
                time_zero: self.measurement.time_zero,
                levels: self.measurement.levels,
                position_sd_m: self.position_sd.all_m,
            }),
            bands: BandsTable { centres_hz: self.scene.materials()[0].material.bands().iter_hz().collect() },
            materials: self.scene.materials().iter().zip(&self.priors).map(material).collect(),
            sources: self
                .sources
                .iter()
                .map(|s| place(&s.id, s.position_m, s.axis, self.position_sd.sources_m.get(&s.id)))
                .collect(),
            receivers: self
                .receivers
                .iter()
                .map(|r| place(&r.id, r.position_m, r.axis, self.position_sd.receivers_m.get(&r.id)))
                .collect(),
            responses: self.responses.iter().map(response).collect(),
            parameters: Vec::new(),
        }
    }
}

/// What the header of a file with these samples would say.
pub(super) fn info(samples: &ImpulseResponse) -> AudioInfo {
    let (sample_rate_hz, frames) = (samples.sample_rate_hz(), samples.samples().len() as u64);
    AudioInfo { sample_rate_hz, channels: 1, frames }
}

/// Writes a room as a new folder, and reads it back.
pub(super) fn write_folder(
    folder: &Path,
    file: &RoomFile,
    obj: &str,
    responses: &[NewResponse],
) -> Result<MeasuredRoom, Error> {
    let draft =
        create_folder_beside(folder).map_err(|source| ValueError::Io { path: folder.to_owned(), source })?;
    let written = fill(&draft, file, obj, responses).and_then(|()| {
        Ok(std::fs::rename(&draft, folder)
            .map_err(|source| ValueError::Io { path: folder.to_owned(), source })?)
    });
    if let Err(error) = written {
        // The error that counts is the first.
        let _ = std::fs::remove_dir_all(&draft);
        return Err(error);
    }
    MeasuredRoom::read(folder)
}

fn fill(draft: &Path, file: &RoomFile, obj: &str, responses: &[NewResponse]) -> Result<(), Error> {
    let ir = draft.join("ir");
    if !responses.is_empty() {
        std::fs::create_dir(&ir).map_err(|source| ValueError::Io { path: ir.clone(), source })?;
    }
    for response in responses {
        let path = ir.join(format!("{}.wav", response.name));
        let (samples, rate) = (response.samples.samples(), response.samples.sample_rate_hz());
        write_wav(&path, samples, rate, SampleFormat::Float32)?;
    }
    // Atomic within the draft for the sake of the disk: it is told of each file before the folder gets its name.
    write_atomically(&draft.join("room.obj"), |file| file.write_all(obj.as_bytes()))?;
    let path = draft.join("room.toml");
    let text =
        toml::to_string(file).map_err(|error| sabine_acoustics::Error::implementation("room.toml", error))?;
    write_atomically(&path, |file| file.write_all(text.as_bytes()))?;
    // What cannot be read back is refused before the folder gets its name.
    MeasuredRoom::read(draft).map(|_| ())
}

/// A source or receiver as the file has it.
pub(super) fn place(
    id: &str,
    position_m: [f64; 3],
    axis: Option<[f64; 3]>,
    position_sd_m: Option<&f64>,
) -> PlaceTable {
    PlaceTable {
        id: id.to_owned(),
        position_m: position_m.to_vec(),
        orientation: axis.map(|a| a.to_vec()),
        position_sd_m: position_sd_m.copied(),
    }
}
