//! Recordings that data sets are made of: speech, responses, noise.

use crate::clip::ActiveSpeech;
use crate::direct::Direct;
use crate::error::Error;
use crate::labels::Labels;
use sabine_acoustics::{
    Channel, ImpulseResponse, Observer, Signal, probe_audio, read_audio, report, resample, resample_response,
};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A file that was used, and its content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourceFile {
    /// Path relative to its folder.
    pub path: String,
    /// SHA-256 of the file, in hexadecimal.
    pub sha256: String,
}

/// A file that was not used, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Path relative to its folder.
    pub path: String,
    /// Why, in words.
    pub reason: String,
}

/// Utterances by speakers.
#[derive(Clone, Debug, Default)]
pub struct SpeechCorpus {
    pub(crate) utterances: Vec<Utterance>,
    pub(crate) files: Vec<SourceFile>,
    pub(crate) left_out: Vec<LeftOut>,
}

#[derive(Clone, Debug)]
pub(crate) struct Utterance {
    pub(crate) speaker: String,
    pub(crate) speech: ActiveSpeech,
}

impl SpeechCorpus {
    /// Reads all sound files below a folder, resampled. The speaker is the file name up to the first `-` or `_`, as in
    /// LibriSpeech (`103-1240-0000.flac`) and VCTK (`p225_003.wav`). Utterances that are silent or shorter than
    /// `least_s` are left out, and said so.
    ///
    /// # Errors
    /// [`Error::TooFew`] if nothing remains; [`Error::Io`]; what [`read_audio`] refuses (several channels among it), naming
    /// the file; [`sabine_acoustics::Error::Cancelled`].
    pub fn read(
        folder: &Path,
        sample_rate_hz: u32,
        least_s: f64,
        observer: &dyn Observer,
    ) -> Result<Self, Error> {
        let mut corpus = Self::default();
        let files = sound_files(folder)?;
        for (done, file) in files.iter().enumerate() {
            report(observer, "reading speech", done as u64, files.len() as u64)?;
            let signal = resample(&read_audio(file, Channel::Mono)?, sample_rate_hz)?;
            let path = relative(folder, file);
            let stem = file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
            let speaker = stem.split(['-', '_']).next().unwrap_or(&stem).to_owned();
            match corpus.add(speaker, signal, least_s) {
                None => corpus.files.push(SourceFile { path, sha256: hash_file(file)? }),
                Some(reason) => corpus.left_out.push(LeftOut { path, reason }),
            }
        }
        if corpus.utterances.is_empty() {
            return Err(Error::TooFew { what: "utterances", purpose: "a data set", needed: 1, found: 0 });
        }
        Ok(corpus)
    }

    /// Adds an utterance, or says why not.
    pub fn add(&mut self, speaker: impl Into<String>, speech: Signal, least_s: f64) -> Option<String> {
        if speech.duration_s() < least_s {
            return Some(format!("{:.2} s of speech; {least_s:.2} s are needed", speech.duration_s()));
        }
        if speech.peak() < 1e-4 {
            return Some("silent".to_owned());
        }
        self.utterances
            .push(Utterance { speaker: speaker.into(), speech: ActiveSpeech::new(speech.into_samples()) });
        None
    }

    /// Names of the speakers, sorted.
    pub fn speakers(&self) -> Vec<String> {
        self.utterances.iter().map(|u| u.speaker.clone()).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Speaker and samples of each utterance, in the order in which they were added.
    pub fn utterances(&self) -> impl ExactSizeIterator<Item = (&str, &[f32])> {
        self.utterances.iter().map(|u| (u.speaker.as_str(), u.speech.samples.as_slice()))
    }

    /// What was left out, and why.
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }
}

/// Measured responses by room.
#[derive(Clone, Debug, Default)]
pub struct ResponseCorpus {
    pub(crate) responses: Vec<MeasuredResponse>,
    pub(crate) files: Vec<SourceFile>,
    pub(crate) left_out: Vec<LeftOut>,
}

/// A response and what can be read from it.
#[derive(Clone, Debug)]
pub struct MeasuredResponse {
    /// Name of the room.
    pub room: String,
    /// File and channel.
    pub path: String,
    /// The response.
    pub response: ImpulseResponse,
    /// What was measured on it.
    pub labels: Labels,
}

/// Which responses to leave out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResponseFilter {
    /// Rooms that are not wanted.
    pub excluded_rooms: Vec<String>,
    /// The longest reverberation time in any octave, in seconds. Default 3.
    pub longest_t60_s: f64,
    /// Octaves at 125 Hz to 8 kHz in which a decay must be readable, 0 to 7. Default 4.
    pub least_octaves: usize,
}

impl Default for ResponseFilter {
    fn default() -> Self {
        Self { excluded_rooms: Vec::new(), longest_t60_s: 3.0, least_octaves: 4 }
    }
}

impl ResponseCorpus {
    /// Reads all WAV files below a folder, resampled. The room is the folder of the file relative to `folder` (a last
    /// part `ir` is dropped), or the file itself where `folder/NAME` holds responses of several rooms and is listed in
    /// `rooms_by_file`. Of a stereo file both channels are taken, of more than two the first.
    ///
    /// # Errors
    /// As [`SpeechCorpus::read`]; responses that cannot be used are left out instead, and said so.
    pub fn read(
        folder: &Path,
        sample_rate_hz: u32,
        filter: &ResponseFilter,
        rooms_by_file: &[String],
        observer: &dyn Observer,
    ) -> Result<Self, Error> {
        let mut corpus = Self::default();
        let files: Vec<PathBuf> =
            sound_files(folder)?.into_iter().filter(|f| f.extension().is_some_and(|e| e == "wav")).collect();
        for (done, file) in files.iter().enumerate() {
            report(observer, "reading responses", done as u64, files.len() as u64)?;
            let path = relative(folder, file);
            let mut parts: Vec<&str> = path.split('/').collect();
            let name = parts.pop().unwrap_or_default();
            if parts.last() == Some(&"ir") {
                parts.pop();
            }
            let mut room = parts.join("/");
            if room.is_empty() || rooms_by_file.contains(&room) {
                let stem = name.trim_end_matches(".wav");
                room = if room.is_empty() { stem.to_owned() } else { format!("{room}/{stem}") };
            }
            if filter.excluded_rooms.contains(&room) {
                corpus.left_out.push(LeftOut { path, reason: "excluded by request".to_owned() });
                continue;
            }
            let channels = probe_audio(file)?.channels;
            let mut used = false;
            for channel in 0..if channels <= 2 { channels } else { 1 } {
                let native = ImpulseResponse::from(read_audio(file, Channel::Index(channel))?);
                let response = resample_response(&native, sample_rate_hz)?;
                match corpus.add(room.clone(), format!("{path}#{channel}"), response, filter) {
                    Ok(()) => used = true,
                    Err(reason) => corpus
                        .left_out
                        .push(LeftOut { path: format!("{path}#{channel}"), reason: reason.to_string() }),
                }
            }
            if used {
                corpus.files.push(SourceFile { path, sha256: hash_file(file)? });
            }
        }
        if corpus.responses.is_empty() {
            return Err(Error::TooFew {
                what: "usable responses",
                purpose: "a data set",
                needed: 1,
                found: 0,
            });
        }
        Ok(corpus)
    }

    /// Measures a response and adds it.
    ///
    /// # Errors
    /// Why it cannot be used: no direct sound, two of them, clipped, or [`Error::TooFew`] octaves with a readable decay.
    pub fn add(
        &mut self,
        room: impl Into<String>,
        path: impl Into<String>,
        response: ImpulseResponse,
        filter: &ResponseFilter,
    ) -> Result<(), Error> {
        Direct::find(&response)?;
        let labels = Labels::measure(&response)?;
        let readable =
            labels.t60_s().values().iter().flatten().filter(|t| t.value <= filter.longest_t60_s).count();
        if readable < filter.least_octaves {
            return Err(Error::TooFew {
                what: "octaves with a readable decay in range",
                purpose: "labels",
                needed: filter.least_octaves,
                found: readable,
            });
        }
        self.responses.push(MeasuredResponse { room: room.into(), path: path.into(), response, labels });
        Ok(())
    }

    /// Adds the responses of another folder.
    pub fn extend(&mut self, other: Self) {
        self.responses.extend(other.responses);
        self.files.extend(other.files);
        self.left_out.extend(other.left_out);
    }

    /// The responses.
    pub fn responses(&self) -> &[MeasuredResponse] {
        &self.responses
    }

    /// Names of the rooms, sorted.
    pub fn rooms(&self) -> Vec<String> {
        self.responses.iter().map(|r| r.room.clone()).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// What was left out, and why.
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }
}

/// Recorded noise.
#[derive(Clone, Debug, Default)]
pub struct NoiseCorpus {
    pub(crate) tracks: Vec<(String, Vec<f32>)>,
    pub(crate) files: Vec<SourceFile>,
}

impl NoiseCorpus {
    /// Reads the first channel of all sound files below a folder, resampled.
    ///
    /// # Errors
    /// As [`SpeechCorpus::read`].
    pub fn read(folder: &Path, sample_rate_hz: u32, observer: &dyn Observer) -> Result<Self, Error> {
        let mut corpus = Self::default();
        let files = sound_files(folder)?;
        for (done, file) in files.iter().enumerate() {
            report(observer, "reading noise", done as u64, files.len() as u64)?;
            let signal = resample(&read_audio(file, Channel::Index(0))?, sample_rate_hz)?;
            let path = relative(folder, file);
            corpus.add(path.clone(), signal);
            corpus.files.push(SourceFile { path, sha256: hash_file(file)? });
        }
        if corpus.tracks.is_empty() {
            return Err(Error::TooFew {
                what: "noise files",
                purpose: "a data set with noise",
                needed: 1,
                found: 0,
            });
        }
        Ok(corpus)
    }

    /// Adds a track.
    pub fn add(&mut self, name: impl Into<String>, noise: Signal) {
        self.tracks.push((name.into(), noise.into_samples()));
    }

    /// Names of the tracks.
    pub fn names(&self) -> Vec<String> {
        self.tracks.iter().map(|(name, _)| name.clone()).collect()
    }
}

/// Sound files below a folder, sorted by path.
fn sound_files(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        let failed = |source| Error::Io { path: next.clone(), source };
        for entry in std::fs::read_dir(&next).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| ["wav", "flac", "ogg", "aiff"].iter().any(|k| e == *k))
            {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

fn relative(folder: &Path, file: &Path) -> String {
    let parts = file.strip_prefix(folder).unwrap_or(file).components();
    parts.map(|p| p.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}

/// SHA-256 of a file, in hexadecimal.
pub(crate) fn hash_file(path: &Path) -> Result<String, Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    Ok(hash_bytes(&bytes))
}

/// SHA-256, in hexadecimal.
pub(crate) fn hash_bytes(bytes: &[u8]) -> String {
    use std::fmt::Write;
    let mut hex = String::with_capacity(64);
    for byte in Sha256::digest(bytes) {
        // Writing to a String cannot fail.
        let _ = write!(hex, "{byte:02x}");
    }
    hex
}
