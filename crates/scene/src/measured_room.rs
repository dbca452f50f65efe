//! A room as it was measured: mesh, materials as far as they are known, places and responses, from a folder.

mod catt;
mod drawn_room;
mod file;
pub(crate) mod materials;
mod model;
mod notes;
mod odeon;
mod other_model;
mod parameter_tables;
mod position_sd;
mod prior;
mod recording_order;
pub(crate) mod response_check;
mod tables;
mod turned;
mod write;

pub use drawn_room::DrawnRoom;
pub use model::RoomModel;
pub use notes::RoomNote;
pub use parameter_tables::ParameterEntry;
pub use position_sd::PositionSd;
pub use prior::MaterialPrior;
pub use write::{NewResponse, NewRoom};

use crate::error::Error;
use crate::inside_folder::check_inside;
use crate::mesh_file::Mesh;
use crate::mesh_file::mesh_options::MeshOptions;
use crate::mesh_file::up_axis::UpAxis;
use crate::scene::{Receiver, Scene, Source};
use file::{AirTable, MaterialTable, ResponseTable, RoomFile};
use sabine_acoustics::{
    Air, Bands, Channel, Error as ValueError, ImpulseResponse, OutOfRange, PerBand, library_material,
    probe_audio, read_audio, read_text,
};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tables::{bands, materials, places};

/// Largest number that may stand for a time of recording: milliseconds of 30,000 years, and exact in steps of one.
const MAX_TIME: f64 = 1e15;

/// When a response's first sample was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum TimeZero {
    /// At the instant of emission.
    Emission,
    /// Unknown, but the same latency for all responses.
    Common,
    /// Unknown for each response.
    PerResponse,
}

/// What the responses' levels mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Levels {
    /// Calibrated: the direct sound at 1 m has amplitude 1.
    Absolute,
    /// One unknown gain for all responses.
    Common,
    /// An unknown gain for each response.
    PerResponse,
}

impl TimeZero {
    /// The word that stands for it in `room.toml`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Emission => "emission",
            Self::Common => "common",
            Self::PerResponse => "per_response",
        }
    }

    /// What a word of `room.toml` stands for.
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Emission, Self::Common, Self::PerResponse].into_iter().find(|meaning| meaning.word() == word)
    }
}

impl Levels {
    /// The word that stands for it in `room.toml`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Absolute => "absolute",
            Self::Common => "common",
            Self::PerResponse => "per_response",
        }
    }

    /// What a word of `room.toml` stands for.
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Absolute, Self::Common, Self::PerResponse].into_iter().find(|meaning| meaning.word() == word)
    }
}

/// What the measurement says about time and level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Measurement {
    /// When the first sample was taken.
    pub time_zero: TimeZero,
    /// What levels mean.
    pub levels: Levels,
}

/// A measured response: where it lies and between which places it was taken. Its samples are read by
/// [`MeasuredRoom::load_response`].
#[derive(Clone, Debug, PartialEq)]
pub struct ResponseEntry {
    /// Index of the source.
    pub source: usize,
    /// Index of the receiver.
    pub receiver: usize,
    /// The WAV file.
    pub path: PathBuf,
    /// The air when it was taken.
    pub air: Air,
    /// The measuring session, where the file names one.
    pub session: Option<String>,
    /// A number that rises with the time of recording, in any unit, where the file states it.
    pub recorded_at: Option<f64>,
    /// Its sample rate.
    pub sample_rate_hz: u32,
    /// Its length in seconds.
    pub duration_s: f64,
    /// Its samples, where they came from memory and not from the file.
    samples: Option<Arc<ImpulseResponse>>,
}

/// How [`MeasuredRoom::read_with`] reads a room.
///
/// ```
/// use sabine_scene::ReadOptions;
/// // Only files below the room's folder are read, unless asked.
/// assert!(!ReadOptions::default().allow_outside);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Read a mesh, its buffers and responses that lie outside the room's folder, too: only for rooms that you trust.
    pub allow_outside: bool,
}

/// A room on disk: `room.toml`, its mesh and its responses, checked.
///
/// ```
/// use sabine_scene::{Levels, MeasuredRoom, TimeZero};
/// let folder = tempfile::tempdir()?;
/// let text = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
/// text("room.toml", r#"
///     room = { mesh = "room.obj" }
///     bands = { centres_hz = [500, 1000] }
///     materials.wall = { absorption = [0.10, 0.12] }
///     materials.floor = {}
/// "#)?;
/// text("room.obj", "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nusemtl floor\nf 1 2 3\nusemtl wall\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")?;
/// let room = MeasuredRoom::read(folder.path())?;
/// assert!((room.scene().volume_m3() - 32.0 / 3.0).abs() < 1e-9);
/// assert_eq!(room.scene().materials()[1].name, "wall");
/// assert_eq!(room.priors()[0].absorption, None); // the floor is to be fitted
/// assert!(room.air_assumed());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredRoom {
    file: PathBuf,
    scene: Scene,
    faces_without_area: usize,
    up_axis: UpAxis,
    /// Whether the file states the units and the axis of its mesh: then they are not questioned.
    stated: [bool; 2],
    named_as_in_library: Vec<String>,
    /// Materials whose tables are those of the mesh file.
    described_by_mesh: Vec<String>,
    priors: Vec<MaterialPrior>,
    air: Air,
    air_assumed: bool,
    measurement: Measurement,
    position_sd: PositionSd,
    sources: Vec<Source>,
    receivers: Vec<Receiver>,
    responses: Vec<ResponseEntry>,
    parameters: Vec<ParameterEntry>,
}

impl MeasuredRoom {
    /// Reads `room.toml` and the mesh of a folder, and the headers of its responses: files below that folder only.
    ///
    /// # Errors
    /// As [`MeasuredRoom::read_with`].
    pub fn read(folder: impl AsRef<Path>) -> Result<Self, Error> {
        Self::read_with(folder, &ReadOptions::default())
    }

    /// Reads `room.toml` and the mesh of a folder, and the headers of its responses.
    ///
    /// Materials stand in the order in which the mesh first uses them, in the bands of the file. What takes rays to find out
    /// (a place outside the mesh, a mesh that leaks) is for the tracer to say.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Io`] and [`Error::Toml`] (grammar, unknown or missing keys, wrong types);
    /// for the mesh as [`Mesh::read`] and [`Mesh::into_scene`]; [`Error::InFile`] naming file and field, with the cause
    /// [`Error::TableWithoutMaterial`], [`sabine_acoustics::Error::BandCount`], [`sabine_acoustics::Error::Length`], [`sabine_acoustics::Error::OutOfRange`],
    /// [`sabine_acoustics::Error::UnknownBand`], [`sabine_acoustics::Error::BandOrder`], [`Error::DuplicateId`], [`sabine_acoustics::Error::UnknownId`], [`sabine_acoustics::Error::UnknownMaterial`],
    /// [`Error::TwoTables`], [`Error::TurnedMesh`], [`Error::OutsideFolder`] or [`sabine_acoustics::Error::Empty`]; for
    /// the responses what [`probe_audio`] gives and, where sample 0 is the emission,
    /// [`Error::ShorterThanDirectSound`].
    pub fn read_with(folder: impl AsRef<Path>, options: &ReadOptions) -> Result<Self, Error> {
        let folder = folder.as_ref();
        let path = folder.join("room.toml");
        let text = read_text(&path)?;
        let file: RoomFile = toml::from_str(&text).map_err(|source| Error::toml(&path, &text, source))?;
        let named = |field: String, name: &Path| -> Result<PathBuf, Error> {
            let file = folder.join(name);
            if !options.allow_outside {
                check_inside(folder, &file).map_err(|error| error.in_file(&path, field))?;
            }
            Ok(file)
        };
        let mesh_options = MeshOptions {
            unit: file.room.units.unwrap_or_default(),
            up_axis: file.room.up_axis,
            folder: Some(folder.to_owned()),
            allow_outside: options.allow_outside,
        };
        let mesh_path = named("room.mesh".into(), &file.room.mesh)?;
        let mut room = Self::assemble(&path, &file, || Mesh::read_with(mesh_path, &mesh_options))?;
        for (i, table) in file.responses.iter().enumerate() {
            let wav = named(format!("responses[{i}].file"), &table.file)?;
            let entry = room.entry(&file, i, table, wav, None)?;
            room.responses.push(entry);
        }
        for (i, table) in file.parameters.iter().enumerate() {
            room.read_parameters(i, table, &named(format!("parameters[{i}].file"), &table.file)?)?;
        }
        Ok(room)
    }

    /// Everything but responses and tables of parameters.
    fn assemble(
        path: &Path,
        file: &RoomFile,
        mesh: impl FnOnce() -> Result<Mesh, Error>,
    ) -> Result<Self, Error> {
        let bands = bands(&file.bands.centres_hz).map_err(|e| e.in_file(path, "bands.centres_hz"))?;
        let mesh = mesh()?;
        if let Some(name) = file.materials.keys().find(|name| !mesh.material_names().contains(name)) {
            let error = Error::TableWithoutMaterial { mesh: mesh.path().to_owned() };
            return Err(error.in_file(path, format!("materials.{name}")));
        }
        let mut tables = file.materials.clone();
        let described =
            |name: &&String| !file.materials.contains_key(*name) && mesh.surfaces().contains_key(*name);
        let described_by_mesh: Vec<String> =
            mesh.material_names().iter().filter(described).cloned().collect();
        for name in &described_by_mesh {
            let surface = &mesh.surfaces()[name];
            let column = |values: &PerBand<f64>| Some(values.averaged(bands).values().to_vec());
            let (absorption, scattering) = (column(surface.absorption()), column(surface.scattering()));
            tables.insert(name.clone(), MaterialTable { absorption, scattering, ..Default::default() });
        }
        let in_library = |name: &&String| !tables.contains_key(*name) && library_material(name).is_ok();
        let named_as_in_library: Vec<String> =
            mesh.material_names().iter().filter(in_library).cloned().collect();
        for name in &named_as_in_library {
            tables.insert(name.clone(), MaterialTable { library: Some(name.clone()), ..Default::default() });
        }
        let (materials, mut priors) = materials(path, bands, &tables)?;
        let (faces_without_area, up_axis) = (mesh.faces_without_area(), mesh.up_axis());
        let scene = mesh.into_scene(&materials)?;
        let priors = scene.materials().iter().filter_map(|named| priors.remove(&named.name)).collect();
        let air = match &file.air {
            Some(AirTable { temperature_c, relative_humidity_percent, pressure_kpa }) => {
                Air::new(*temperature_c, *relative_humidity_percent, *pressure_kpa)
                    .map_err(|error| error.in_file(path, "air"))?
            }
            None => Air::default(),
        };
        let measurement = match &file.measurement {
            Some(table) => Measurement { time_zero: table.time_zero, levels: table.levels },
            None if file.responses.is_empty() => {
                Measurement { time_zero: TimeZero::PerResponse, levels: Levels::PerResponse }
            }
            None => {
                let error = ValueError::Empty {
                    what: "the table that says what the responses' times and levels mean",
                };
                return Err(error.in_file(path, "measurement").into());
            }
        };
        let position_sd = PositionSd::read(path, file.measurement.as_ref(), &file.sources, &file.receivers)?;
        let sources: Vec<Source> = places(path, "sources", &file.sources)?
            .into_iter()
            .map(|Receiver { id, position_m, axis }| Source { id, position_m, axis })
            .collect();
        let receivers = places(path, "receivers", &file.receivers)?;
        turned::check(path, &scene, up_axis, &sources, &receivers)?;
        Ok(Self {
            file: path.to_owned(),
            scene,
            faces_without_area,
            up_axis,
            stated: [file.room.units.is_some(), file.room.up_axis.is_some()],
            named_as_in_library,
            described_by_mesh,
            priors,
            air,
            air_assumed: file.air.is_none(),
            measurement,
            position_sd,
            sources,
            receivers,
            responses: Vec::new(),
            parameters: Vec::new(),
        })
    }

    fn entry(
        &self,
        file: &RoomFile,
        index: usize,
        table: &ResponseTable,
        path: PathBuf,
        samples: Option<&ImpulseResponse>,
    ) -> Result<ResponseEntry, Error> {
        let field = |name: &str| format!("responses[{index}].{name}");
        let in_file = |name: &'static str| move |error: Error| error.in_file(&self.file, field(name));
        let (source, receiver, air) = self.ends(table).map_err(|(name, error)| in_file(name)(error))?;
        if let Some(time) = table.recorded_at {
            OutOfRange::check("recorded_at", time, -MAX_TIME, MAX_TIME, "finite and within 1e15")
                .map_err(|error| in_file("recorded_at")(error.into()))?;
        }
        if file.responses[..index].iter().any(|other| other.file == table.file) {
            let id = table.file.display().to_string();
            return Err(in_file("file")(Error::DuplicateId { id }));
        }
        let info = samples.map_or_else(|| probe_audio(&path), |samples| Ok(write::info(samples)))?;
        if info.channels != 1 {
            return Err(ValueError::ManyChannels { path, channels: info.channels }.into());
        }
        let duration_s = info.frames as f64 / f64::from(info.sample_rate_hz.max(1));
        let entry = ResponseEntry {
            source,
            receiver,
            path,
            air,
            session: table.session.clone(),
            recorded_at: table.recorded_at,
            sample_rate_hz: info.sample_rate_hz,
            duration_s,
            samples: samples.cloned().map(Arc::new),
        };
        self.check_length(&entry)?;
        Ok(entry)
    }

    /// Source, receiver and air of a response, or the offending field.
    fn ends(&self, table: &ResponseTable) -> Result<(usize, usize, Air), (&'static str, Error)> {
        let source = self.source_index(&table.source).map_err(|e| ("source", e))?;
        let receiver = self.receiver_index(&table.receiver).map_err(|e| ("receiver", e))?;
        let temperature_c = table.temperature_c.unwrap_or(self.air.temperature_c());
        let humidity = table.relative_humidity_percent.unwrap_or(self.air.relative_humidity_percent());
        let air = Air::new(temperature_c, humidity, self.air.pressure_kpa()).map_err(|e| match e {
            ValueError::OutOfRange(OutOfRange { field, .. }) => (field, e.into()),
            other => ("temperature_c", other.into()),
        })?;
        Ok((source, receiver, air))
    }

    /// A response whose clock starts at the emission must last until the direct sound has come.
    fn check_length(&self, entry: &ResponseEntry) -> Result<(), Error> {
        if self.measurement.time_zero != TimeZero::Emission {
            return Ok(());
        }
        let (from, to) = (self.sources[entry.source].position_m, self.receivers[entry.receiver].position_m);
        let distance_m = (0..3).map(|k| (from[k] - to[k]).powi(2)).sum::<f64>().sqrt();
        let direct_s = distance_m / entry.air.speed_of_sound_m_s();
        if entry.duration_s > direct_s {
            return Ok(());
        }
        let error = Error::ShorterThanDirectSound { duration_s: entry.duration_s, direct_s };
        Err(error.in_file(&entry.path, "samples"))
    }

    /// Mesh and materials, in the bands of the file.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Faces of the mesh file that are lines or points: left out, since nothing can be reflected by them.
    pub fn faces_without_area(&self) -> usize {
        self.faces_without_area
    }

    /// How well each material of the scene is known, in the same order.
    pub fn priors(&self) -> &[MaterialPrior] {
        &self.priors
    }

    /// The bands of the material tables.
    pub fn bands(&self) -> Bands {
        self.scene.materials()[0].material.bands()
    }

    /// The air, unless a response says otherwise.
    pub fn air(&self) -> Air {
        self.air
    }

    /// Whether the file is silent about the air, so that 20 C, 50 % and 101.325 kPa are assumed: worth a word in a report.
    pub fn air_assumed(&self) -> bool {
        self.air_assumed
    }

    /// What times and levels of the responses mean.
    pub fn measurement(&self) -> Measurement {
        self.measurement
    }

    /// How well places are known, as far as the file states it.
    pub fn position_sd(&self) -> &PositionSd {
        &self.position_sd
    }

    /// Sources.
    pub fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// Receivers.
    pub fn receivers(&self) -> &[Receiver] {
        &self.receivers
    }

    /// Measured responses.
    pub fn responses(&self) -> &[ResponseEntry] {
        &self.responses
    }

    /// The source of this name.
    ///
    /// # Errors
    /// [`Error::InFile`] with the cause [`sabine_acoustics::Error::UnknownId`].
    pub fn source(&self, id: &str) -> Result<&Source, Error> {
        let index = self.source_index(id).map_err(|error| error.in_file(&self.file, "sources"))?;
        Ok(&self.sources[index])
    }

    /// The receiver of this name.
    ///
    /// # Errors
    /// [`Error::InFile`] with the cause [`sabine_acoustics::Error::UnknownId`].
    pub fn receiver(&self, id: &str) -> Result<&Receiver, Error> {
        let index = self.receiver_index(id).map_err(|error| error.in_file(&self.file, "receivers"))?;
        Ok(&self.receivers[index])
    }

    /// Reads the samples of a response, as they stand in its file, or those that it was made with ([`NewRoom::in_memory`]).
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Index`] if there is no such response; [`Error::InFile`] with the cause [`Error::Silent`],
    /// [`Error::NoDirectSound`] or [`sabine_acoustics::Error::NotAResponse`] for what is no impulse response; else as [`read_audio`].
    pub fn load_response(&self, index: usize) -> Result<ImpulseResponse, Error> {
        let count = self.responses.len();
        let entry = self.responses.get(index).ok_or(ValueError::Index { what: "response", index, count })?;
        let response = match &entry.samples {
            Some(samples) => ImpulseResponse::clone(samples),
            None => read_audio(&entry.path, Channel::Mono)?.into(),
        };
        response_check::check(response.samples(), response.sample_rate_hz())
            .map_err(|error| error.in_file(&entry.path, format!("responses[{index}].file")))?;
        Ok(response)
    }

    fn source_index(&self, id: &str) -> Result<usize, Error> {
        Ok(self
            .sources
            .iter()
            .position(|s| s.id == id)
            .ok_or_else(|| ValueError::UnknownId { id: id.to_owned() })?)
    }

    fn receiver_index(&self, id: &str) -> Result<usize, Error> {
        Ok(self
            .receivers
            .iter()
            .position(|r| r.id == id)
            .ok_or_else(|| ValueError::UnknownId { id: id.to_owned() })?)
    }
}
