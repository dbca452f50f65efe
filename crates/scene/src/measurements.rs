//! Measured responses and the places between which they were taken, from files of other programs and to them.

mod file_names;
#[cfg(any(feature = "sofa", feature = "tables"))]
mod places;
mod rew;
#[cfg(feature = "rew-http")]
mod rew_http;
#[cfg(feature = "sofa")]
mod sofa;
#[cfg(feature = "tables")]
mod table;

#[cfg(feature = "sofa")]
pub use sofa::SofaConvention;

use crate::error::Error;
use crate::measured_room::response_check;
use crate::measured_room::{
    Levels, MeasuredRoom, Measurement, NewResponse, NewRoom, PositionSd, RoomModel, TimeZero,
};
use crate::scene::{Receiver, Source};
use sabine_acoustics::{Air, AudioReader, Channel, ImpulseResponse, Signal, read_audio};
use std::path::Path;

/// Measured responses without a room around them: what SOFA files and tables of positions hold.
///
/// [`Measurements::into_room`] puts them into a model; what comes out is written as a folder by [`NewRoom::write`].
///
/// ```
/// use sabine_acoustics::{Air, ImpulseResponse};
/// use sabine_scene::*;
/// let mut samples = vec![0.0; 4800];
/// samples[420] = 0.33; // 3 m at 343 m/s and 48 kHz
/// let set = Measurements {
///     sources: vec![Source::omni("s1", [1.0, 2.0, 1.5])?],
///     receivers: vec![Receiver::omni("r1", [4.0, 2.0, 1.5])?],
///     air: Some(Air::default()),
///     measurement: Measurement { time_zero: TimeZero::Emission, levels: Levels::Absolute },
///     shoebox_m: None,
///     responses: vec![NewResponse {
///         source: "s1".into(),
///         receiver: "r1".into(),
///         name: "s1_r1".into(),
///         air: None,
///         session: None,
///         recorded_at: None,
///         samples: ImpulseResponse::new(samples, 48_000)?,
///     }],
///     notes: Vec::new(),
/// };
/// # #[cfg(feature = "sofa")] {
/// let folder = tempfile::tempdir().unwrap();
/// let path = folder.path().join("room.sofa");
/// set.write_sofa(&path, SofaConvention::Pairs, "2026-11-24 12:00:00")?;
/// assert_eq!(Measurements::read_sofa(&path, &ImportOptions::default())?.responses, set.responses);
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Measurements {
    /// Sources.
    pub sources: Vec<Source>,
    /// Receivers.
    pub receivers: Vec<Receiver>,
    /// The air, as far as it is stated.
    pub air: Option<Air>,
    /// What times and levels mean.
    pub measurement: Measurement,
    /// Two corners of the room in metres, the lower first, where the file says that it is a box.
    pub shoebox_m: Option<[[f64; 3]; 2]>,
    /// Responses.
    pub responses: Vec<NewResponse>,
    /// What should be known before numbers are believed.
    pub notes: Vec<String>,
}

/// What a file does not say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportOptions {
    /// When a response's first sample was taken; `None`: as the file says, else [`TimeZero::Common`].
    pub time_zero: Option<TimeZero>,
    /// What levels mean; `None`: as the file says, else [`Levels::Common`].
    pub levels: Option<Levels>,
    /// Relative humidity where the file has a temperature only, 0 to 100 %.
    pub relative_humidity_percent: f64,
    /// Read sounds that a table names outside its folder, too: only for tables that you trust.
    pub allow_outside: bool,
}

impl Default for ImportOptions {
    fn default() -> Self {
        let humidity = Air::default().relative_humidity_percent();
        Self { time_zero: None, levels: None, relative_humidity_percent: humidity, allow_outside: false }
    }
}

impl Measurements {
    /// Reads a SOFA file (AES69-2022) of the convention SingleRoomSRIR or SingleRoomMIMOSRIR, versions 1.
    ///
    /// A source is an emitter at its place and with its view, a receiver likewise; what is mentioned again is counted once. Views
    /// that are (1, 0, 0) throughout are taken as not stated, since SOFA demands one. `Data.Delay` becomes zeros before a
    /// response. Samples are rounded to 32 bits, which a note says where it changes them.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Io`]; else [`Error::InFile`] naming the variable, with the cause [`Error::Hdf5`] for what is no HDF5,
    /// is cut short or damaged, [`Error::SofaConvention`], [`Error::Missing`], [`Error::Shape`], [`Error::Unit`],
    /// [`Error::TooManyValues`] (before memory is taken), [`sabine_acoustics::Error::NotFinite`], [`sabine_acoustics::Error::OutOfRange`], or
    /// what [`MeasuredRoom::load_response`] says of sound that is no response.
    #[cfg(feature = "sofa")]
    pub fn read_sofa(path: impl AsRef<Path>, options: &ImportOptions) -> Result<Self, Error> {
        sofa::read(path.as_ref(), options)
    }

    /// As [`Measurements::read_sofa`], from the bytes of a file; `name` stands in messages.
    ///
    /// # Errors
    /// As [`Measurements::read_sofa`], without those of opening a file.
    #[cfg(feature = "sofa")]
    pub fn sofa_of_bytes(
        name: impl AsRef<Path>,
        bytes: Vec<u8>,
        options: &ImportOptions,
    ) -> Result<Self, Error> {
        sofa::of_bytes(name.as_ref(), bytes, options)
    }

    /// Reads a table of measurements: a line for each response, with its file and its places.
    ///
    /// Columns stand in any order under their names: `file` (sound, or text of REW; below the table's folder), `source_x_m`,
    /// `source_y_m`, `source_z_m`, `receiver_x_m`, `receiver_y_m`, `receiver_z_m`, and if wanted `source` and `receiver` (names),
    /// `temperature_c`, `session`, `recorded_at`. Commas, semicolons or tabs divide them; with the latter two a comma may be the
    /// point of a number.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Io`]; else [`Error::InFile`] naming line and column, with the cause [`Error::Missing`] (a gap),
    /// [`Error::TextLine`], [`Error::Unit`] for an unknown column, [`Error::Shape`] for a line with too few or too many cells,
    /// [`Error::DuplicateId`] for a file that is named twice, [`Error::MovedPlace`], [`Error::SamePlace`], [`Error::OutsideFolder`],
    /// [`Error::TooManyValues`], or what [`Measurements::read_single`] says of a sound.
    #[cfg(feature = "tables")]
    pub fn read_table(path: impl AsRef<Path>, options: &ImportOptions) -> Result<Self, Error> {
        table::read(path.as_ref(), options)
    }

    /// Reads one response: a sound file with one channel, or a text that the Room EQ Wizard (REW) exported (`.txt`), in any locale.
    ///
    /// With [`TimeZero::Emission`] a text is shifted by its start time: its time zero is the emission where the measurement had a
    /// timing reference. A text that is normalised gets its level back from the peak that it states.
    ///
    /// # Errors
    /// As [`read_audio`]; [`Error::InFile`] naming the line or the field of a text, with the cause [`Error::TextLine`], [`Error::Missing`],
    /// [`Error::Unit`] for a minimum-phase version, [`sabine_acoustics::Error::Length`] for a text that is cut short, [`sabine_acoustics::Error::NotFinite`]
    /// or [`sabine_acoustics::Error::OutOfRange`]; what [`MeasuredRoom::load_response`] says of sound that is no response.
    pub fn read_single(
        path: impl AsRef<Path>,
        source: Source,
        receiver: Receiver,
        options: &ImportOptions,
    ) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::single(path, Sound::read(path)?, source, receiver, options)
    }

    /// Fetches one response from the Room EQ Wizard (REW) while it runs, through its local interface.
    ///
    /// `address` is `http://127.0.0.1:4735/measurements/ID` with the index of the measurement in the list, from 1, or its identifier
    /// (UUID). Without `/ID` the error lists what is loaded. Samples are in full scale, as REW's text has them; time zero is as in
    /// [`Measurements::read_single`]. Nothing in REW is changed. At most 128 MiB are taken and a minute is waited; redirections are
    /// not followed, and no proxy is asked.
    ///
    /// # Errors
    /// [`Error::Http`] where nobody answers, [`Error::HttpStatus`] for an answer that is a refusal; [`Error::InFile`] naming the address
    /// and the field, with the cause [`Error::Unit`] for an address of something else, an answer that is no JSON, another unit than
    /// percent or data that are not base64, [`Error::Missing`], [`Error::Shape`] for data that are cut short, [`Error::TooManyValues`],
    /// [`sabine_acoustics::Error::NotFinite`], [`sabine_acoustics::Error::OutOfRange`]; what [`MeasuredRoom::load_response`] says of sound
    /// that is no response.
    #[cfg(feature = "rew-http")]
    pub fn read_rew(
        address: &str,
        source: Source,
        receiver: Receiver,
        options: &ImportOptions,
    ) -> Result<Self, Error> {
        let fetched = Sound::Text(rew_http::fetch(address)?);
        Self::single(Path::new(address), fetched, source, receiver, options)
    }

    /// As [`Measurements::read_single`], from the bytes of a file; `name` is its name, whose ending counts.
    ///
    /// ```
    /// use sabine_scene::{ImportOptions, Measurements, Receiver, Source};
    /// let text = "1.25E-4 // Sample interval (seconds)\n* Data start\n0.0\n1.0\n0.5\n";
    /// let (source, receiver) = (Source::omni("s", [0.0; 3])?, Receiver::omni("r", [1.0, 0.0, 0.0])?);
    /// let set = Measurements::single_of_bytes("dropped.txt", text.into(), source, receiver, &ImportOptions::default())?;
    /// assert_eq!((set.responses[0].samples.samples(), set.responses[0].samples.sample_rate_hz()), (&[0.0, 1.0, 0.5][..], 8000));
    /// # Ok::<(), sabine_scene::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Measurements::read_single`], without those of opening a file.
    pub fn single_of_bytes(
        name: impl AsRef<Path>,
        bytes: Vec<u8>,
        source: Source,
        receiver: Receiver,
        options: &ImportOptions,
    ) -> Result<Self, Error> {
        let path = name.as_ref();
        Self::single(path, Sound::of_bytes(path, bytes)?, source, receiver, options)
    }

    fn single(
        path: &Path,
        sound: Sound,
        source: Source,
        receiver: Receiver,
        options: &ImportOptions,
    ) -> Result<Self, Error> {
        let (samples, mut notes) = sound.response(path, options)?;
        let (measurement, note) = meaning(options.time_zero, options.levels, "The file");
        notes.extend(note);
        let name = file_names::Names::default().unique(&format!("{}_{}", source.id, receiver.id));
        let (from, to) = (source.id.clone(), receiver.id.clone());
        let response = NewResponse {
            source: from,
            receiver: to,
            name,
            air: None,
            session: None,
            recorded_at: None,
            samples,
        };
        let (sources, receivers) = (vec![source], vec![receiver]);
        Ok(Self {
            sources,
            receivers,
            air: None,
            measurement,
            shoebox_m: None,
            responses: vec![response],
            notes,
        })
    }

    /// Writes a SOFA file, whole or not at all; `created` is the date and time as `2026-11-24 12:00:00`.
    ///
    /// Identifiers and the meaning of times and levels go into attributes of our own (`Identifiers` of the positions, `TimeZero`,
    /// `Levels`). Sessions, times of recording, humidity and pressure are left out: SOFA has no place for them.
    ///
    /// # Errors
    /// [`Error::InFile`] with the cause [`sabine_acoustics::Error::Empty`] without responses, [`sabine_acoustics::Error::SampleRates`] or
    /// [`sabine_acoustics::Error::Length`] for responses that differ in rate or length, [`Error::TooManyValues`] for identifiers of more than
    /// 64 kB; for [`SofaConvention::Grid`] also [`Error::MissingPair`] and [`Error::DuplicateId`];
    /// [`sabine_acoustics::Error::Io`] if it cannot be written.
    #[cfg(feature = "sofa")]
    pub fn write_sofa(
        &self,
        path: impl AsRef<Path>,
        convention: SofaConvention,
        created: &str,
    ) -> Result<(), Error> {
        sofa::write(self, path.as_ref(), convention, created)
    }

    /// The responses of a room, read.
    ///
    /// # Errors
    /// As [`MeasuredRoom::load_response`].
    pub fn of_room(room: &MeasuredRoom) -> Result<Self, Error> {
        let response = |(index, entry): (usize, &crate::measured_room::ResponseEntry)| {
            let stem = entry.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            Ok(NewResponse {
                source: room.sources()[entry.source].id.clone(),
                receiver: room.receivers()[entry.receiver].id.clone(),
                name: stem,
                air: Some(entry.air).filter(|&air| air != room.air()),
                session: entry.session.clone(),
                recorded_at: entry.recorded_at,
                samples: room.load_response(index)?,
            })
        };
        Ok(Self {
            sources: room.sources().to_vec(),
            receivers: room.receivers().to_vec(),
            air: Some(room.air()).filter(|_| !room.air_assumed()),
            measurement: room.measurement(),
            shoebox_m: None,
            responses: room.responses().iter().enumerate().map(response).collect::<Result<_, Error>>()?,
            notes: Vec::new(),
        })
    }

    /// Cuts every response to its first samples.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Empty`] for a length of zero.
    pub fn cut_to(&mut self, length: usize) -> Result<(), Error> {
        for response in &mut self.responses {
            let (samples, rate_hz) = (response.samples.samples(), response.samples.sample_rate_hz());
            let kept = samples[..length.min(samples.len())].to_vec();
            response.samples = ImpulseResponse::new(kept, rate_hz)?;
        }
        Ok(())
    }

    /// The responses in a model of their room, ready to be written.
    pub fn into_room(self, model: RoomModel, position_sd_m: Option<f64>) -> NewRoom {
        NewRoom {
            scene: model.scene,
            priors: model.priors,
            air: self.air,
            measurement: self.measurement,
            position_sd: PositionSd { all_m: position_sd_m, ..PositionSd::default() },
            sources: self.sources,
            receivers: self.receivers,
            responses: self.responses,
        }
    }
}

/// What a file with one response holds.
enum Sound {
    Text(rew::RewResponse),
    Audio(Signal),
}

impl Sound {
    fn read(path: &Path) -> Result<Self, Error> {
        if is_text(path) {
            return Ok(Self::Text(rew::read(path)?));
        }
        Ok(Self::Audio(read_audio(path, Channel::Mono)?))
    }

    fn of_bytes(name: &Path, bytes: Vec<u8>) -> Result<Self, Error> {
        if is_text(name) {
            return Ok(Self::Text(rew::of_bytes(name, &bytes)?));
        }
        Ok(Self::Audio(AudioReader::of_bytes(name, bytes, Channel::Mono)?.read_to_end()?))
    }

    /// A response and what should be known of it.
    fn response(self, path: &Path, options: &ImportOptions) -> Result<(ImpulseResponse, Vec<String>), Error> {
        let (samples, notes) = match self {
            Self::Text(mut read) => {
                let notes = std::mem::take(&mut read.notes);
                let emission = options.time_zero == Some(TimeZero::Emission);
                (if emission { read.starting_at_zero()? } else { read.samples }, notes)
            }
            Self::Audio(signal) => (signal.into(), Vec::new()),
        };
        response_check::check(samples.samples(), samples.sample_rate_hz())
            .map_err(|error| error.in_file(path, "samples"))?;
        Ok((samples, notes))
    }
}

/// Whether a file is text by its ending.
fn is_text(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("txt"))
}

/// What times and levels mean where `what` may not say it: the weakest that one set-up allows, with a note.
fn meaning(time_zero: Option<TimeZero>, levels: Option<Levels>, what: &str) -> (Measurement, Option<String>) {
    let note = (time_zero.is_none() || levels.is_none()).then(|| {
        format!("{what} does not say what sample 0 and the levels mean: one unknown latency and gain for all is assumed (--time-zero, --levels)")
    });
    let time_zero = time_zero.unwrap_or(TimeZero::Common);
    (Measurement { time_zero, levels: levels.unwrap_or(Levels::Common) }, note)
}

/// A number with a point, or with a comma in its place.
fn number(text: &str) -> Option<f64> {
    match (text.contains(','), text.contains('.')) {
        // Groups of thousands in one locale are decimals in another.
        (true, true) => None,
        (true, false) => text.replace(',', ".").parse().ok(),
        _ => text.parse().ok(),
    }
}
