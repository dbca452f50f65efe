//! A file that was dropped on the page, and the responses in it.

use crate::error::Error;
use sabine_acoustics::{AudioReader, Channel, ImpulseResponse, check_one_onset};
use sabine_scene::{ImportOptions, Measurements, Receiver, Source};
use serde_json::{Value, json};

/// Largest file that is read, in bytes: 90 s of sound in eight channels of 32 bits at 48 kHz, and SOFA files of some hundred responses.
pub const MAX_FILE_BYTES: u64 = 128 << 20;
/// Longest response that is read, in seconds: twice the reverberation of the largest cathedrals and time to see the noise after it.
pub const MAX_RESPONSE_S: f64 = 60.0;

/// First bytes of HDF5, of which SOFA files are made.
const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";

/// One response of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenedResponse {
    /// How it is called.
    pub name: String,
    /// Its samples.
    pub samples: ImpulseResponse,
    /// Where source and receiver stood (m), if the file says so.
    pub places_m: Option<[[f64; 3]; 2]>,
}

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Opened {
    responses: Vec<OpenedResponse>,
    notes: Vec<String>,
    shoebox_m: Option<[[f64; 3]; 2]>,
}

impl Opened {
    /// Reads the bytes of a file: SOFA (known by its first bytes), text of REW (known by its ending `.txt`), else sound.
    ///
    /// Of several channels the first is taken, which a note says.
    ///
    /// # Errors
    /// [`Error::EmptyFile`], [`Error::TooManyBytes`], [`Error::TooLong`], [`Error::Silent`]; what [`AudioReader::of_bytes`],
    /// [`Measurements::single_of_bytes`], [`Measurements::sofa_of_bytes`] and [`check_one_onset`] say.
    pub fn read(name: &str, bytes: Vec<u8>) -> Result<Self, Error> {
        if bytes.is_empty() {
            return Err(Error::EmptyFile { name: name.to_owned() });
        }
        if bytes.len() as u64 > MAX_FILE_BYTES {
            let (name, bytes) = (name.to_owned(), bytes.len() as u64);
            return Err(Error::TooManyBytes { name, bytes, limit: MAX_FILE_BYTES });
        }
        if bytes.starts_with(HDF5) {
            return Self::of_measurements(Measurements::sofa_of_bytes(
                name,
                bytes,
                &ImportOptions::default(),
            )?);
        }
        if name.to_ascii_lowercase().ends_with(".txt") {
            return Self::text(name, bytes);
        }
        Self::sound(name, bytes)
    }

    fn sound(name: &str, bytes: Vec<u8>) -> Result<Self, Error> {
        let reader = AudioReader::of_bytes(name, bytes, Channel::Index(0))?;
        let (channels, rate_hz) = (reader.channels(), reader.sample_rate_hz());
        let samples = short(name, reader)?;
        if samples.iter().all(|&sample| sample == 0.0) {
            return Err(Error::Silent { name: name.to_owned() });
        }
        check_one_onset(&samples, rate_hz)
            .map_err(|source| Error::NotAResponse { name: name.to_owned(), source })?;
        let samples = ImpulseResponse::new(samples, rate_hz)?;
        let note = || format!("The first of {channels} channels is read.");
        let notes = (channels > 1).then(note).into_iter().collect();
        let responses = vec![OpenedResponse { name: name.to_owned(), samples, places_m: None }];
        Ok(Self { responses, notes, shoebox_m: None })
    }

    fn text(name: &str, bytes: Vec<u8>) -> Result<Self, Error> {
        // Such a text does not say where it was measured; these places are not used.
        let (source, receiver) = (Source::omni("s", [0.0; 3])?, Receiver::omni("r", [1.0, 0.0, 0.0])?);
        let set = Measurements::single_of_bytes(name, bytes, source, receiver, &ImportOptions::default())?;
        // What times and levels mean is of no account for one response.
        let found = set.responses.into_iter();
        let responses: Vec<_> = found
            .map(|found| OpenedResponse { name: name.to_owned(), samples: found.samples, places_m: None })
            .collect();
        for response in &responses {
            check_duration(name, response.samples.duration_s())?;
        }
        Ok(Self { responses, notes: Vec::new(), shoebox_m: None })
    }

    fn of_measurements(set: Measurements) -> Result<Self, Error> {
        let mut responses = Vec::new();
        for found in set.responses {
            check_duration(&found.name, found.samples.duration_s())?;
            let source = set.sources.iter().find(|s| s.id == found.source).map(|s| s.position_m);
            let receiver = set.receivers.iter().find(|r| r.id == found.receiver).map(|r| r.position_m);
            let places_m = source.zip(receiver).map(<[_; 2]>::from);
            responses.push(OpenedResponse { name: found.name, samples: found.samples, places_m });
        }
        // The page has fields where the command has options.
        let notes = set.notes.iter().map(|note| note.replace(" (--time-zero, --levels)", "")).collect();
        Ok(Self { responses, notes, shoebox_m: set.shoebox_m })
    }

    /// The responses.
    pub fn responses(&self) -> &[OpenedResponse] {
        &self.responses
    }

    /// The response of this number.
    ///
    /// # Errors
    /// [`Error::NoSuchResponse`].
    pub fn response(&self, index: usize) -> Result<&OpenedResponse, Error> {
        let count = self.responses.len();
        self.responses.get(index).ok_or(Error::NoSuchResponse { index, count })
    }

    /// Names, lengths and places as JSON, for a list on the page.
    pub fn summary(&self) -> Value {
        let response = |response: &OpenedResponse| {
            json!({
                "name": response.name,
                "sample_rate_hz": response.samples.sample_rate_hz(),
                "duration_s": response.samples.duration_s(),
                "places_m": response.places_m,
            })
        };
        let responses: Vec<Value> = self.responses.iter().map(response).collect();
        json!({ "responses": responses, "notes": self.notes, "shoebox_m": self.shoebox_m })
    }
}

/// The samples of a sound, if it is no longer than a response. What its header promises is enough to refuse it.
fn short(name: &str, mut reader: AudioReader) -> Result<Vec<f32>, Error> {
    let rate = f64::from(reader.sample_rate_hz());
    check_duration(name, reader.frames().unwrap_or(0) as f64 / rate)?;
    let (mut samples, mut block) = (Vec::new(), Vec::new());
    while reader.read_block(&mut block, 1 << 16)? > 0 {
        samples.extend_from_slice(&block);
        check_duration(name, samples.len() as f64 / rate)?;
    }
    Ok(samples)
}

fn check_duration(name: &str, duration_s: f64) -> Result<(), Error> {
    if duration_s <= MAX_RESPONSE_S {
        return Ok(());
    }
    Err(Error::TooLong { name: name.to_owned(), duration_s, limit_s: MAX_RESPONSE_S })
}
