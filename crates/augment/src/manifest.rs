//! What a data set says about itself.

use crate::clip::ClipConfig;
use crate::corpus::{LeftOut, SourceFile};
use crate::error::Error;
use crate::partition::Partition;
use crate::shard::LabelStatistics;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// The name and version of the format.
pub const DATASET_FORMAT: &str = "sabine-dataset-1";

/// A shard of a data set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShardEntry {
    /// File name within the folder.
    pub file: String,
    /// To which partition its clips belong.
    pub partition: Partition,
    /// Number of clips.
    pub clips: usize,
    /// SHA-256 of the file, in hexadecimal.
    pub sha256: String,
}

/// `manifest.json`: everything that is needed to read a data set and to make it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`DATASET_FORMAT`].
    pub format: String,
    /// Version of the crate that made it.
    pub version: String,
    /// Sample rate of the clips in Hz.
    pub sample_rate_hz: u32,
    /// Length of a clip in seconds.
    pub duration_s: f64,
    /// Features in a frame.
    pub mels: usize,
    /// Frames in a clip.
    pub frames: usize,
    /// Nominal centres of the columns of `t60_s`.
    pub t60_bands_hz: Vec<f64>,
    /// Nominal centres of the columns of `eq_db`.
    pub eq_bands_hz: Vec<f64>,
    /// Seed of everything.
    pub seed: u64,
    /// SHA-256 of the plan (settings, sources, partitions): two sets with the same one are the same.
    pub plan_sha256: String,
    /// Shards in order.
    pub shards: Vec<ShardEntry>,
    /// Label statistics of each partition.
    pub statistics: BTreeMap<Partition, LabelStatistics>,
    /// How the clips were made.
    pub clip: ClipConfig,
    /// Partition of each measured room; simulated rooms carry theirs in the name.
    pub room_partitions: BTreeMap<String, Partition>,
    /// Partition of each speaker.
    pub speaker_partitions: BTreeMap<String, Partition>,
    /// Partition of each noise track.
    pub noise_partitions: BTreeMap<String, Partition>,
    /// Files used.
    pub sources: BTreeMap<String, Vec<SourceFile>>,
    /// Files not used, and why.
    pub left_out: BTreeMap<String, Vec<LeftOut>>,
    /// Names of the speakers, by index.
    pub speakers: Vec<String>,
    /// Names of the rooms, by index.
    pub rooms: Vec<String>,
}

impl Manifest {
    /// Reads `manifest.json` of a folder.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Json`], naming the file.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        read_json(&folder.join("manifest.json"))
    }
}

pub(crate) fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, Error> {
    let text = std::fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    serde_json::from_slice(&text).map_err(|source| Error::Json { path: path.to_owned(), source })
}

pub(crate) fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<(), Error> {
    use std::io::Write;
    let mut text =
        serde_json::to_vec_pretty(value).map_err(|source| Error::Json { path: path.to_owned(), source })?;
    text.push(b'\n');
    Ok(sabine_acoustics::write_atomically(path, |file| file.write_all(&text))?)
}
