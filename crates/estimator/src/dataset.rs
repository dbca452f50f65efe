//! A data set of clips in shards (`sabine-dataset-1`), read clip by clip as it is needed.

use crate::labels::{EQ_COUNT, LABEL_COUNT, T60_COUNT, label_hz};
use crate::{DatasetFault, Error};
use half::f16;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Name and version of the format.
const FORMAT: &str = "sabine-dataset-1";

/// One of the three parts of a data set; no room and no speaker is in two of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Partition {
    /// What the network is fitted to.
    Train,
    /// What decides when to stop, and calibrates.
    Validation,
    /// What is looked at once.
    Test,
}

impl Partition {
    /// Its name in manifests.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Validation => "validation",
            Self::Test => "test",
        }
    }
}

/// The part of `manifest.json` that is read here.
#[derive(Clone, Debug, Deserialize)]
struct Manifest {
    format: String,
    sample_rate_hz: u32,
    mels: usize,
    frames: usize,
    t60_bands_hz: Vec<f64>,
    eq_bands_hz: Vec<f64>,
    shards: Vec<ShardEntry>,
    #[serde(default)]
    rooms: Vec<String>,
    /// Partition of each measured room.
    #[serde(default)]
    room_partitions: BTreeMap<String, Partition>,
}

#[derive(Clone, Debug, Deserialize)]
struct ShardEntry {
    file: String,
    partition: Partition,
    clips: usize,
    sha256: String,
}

/// What is known of a clip besides its features.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// Its part of the data set.
    pub partition: Partition,
    /// Reverberation times in seconds, then levels in dB; NaN where missing.
    pub labels: [f32; LABEL_COUNT],
    /// Signal-to-noise ratio in dB; NaN where unknown.
    pub snr_db: f32,
    /// Ratio of direct to reverberant energy in dB; NaN where unknown.
    pub drr_db: f32,
    /// Index of the room.
    pub room: i64,
    /// Index of the speaker.
    pub speaker: i64,
    shard: usize,
    offset: u64,
}

/// An opened data set. Labels are in memory, features stay on disk.
#[derive(Debug)]
pub struct Dataset {
    mels: usize,
    frames: usize,
    files: Vec<(PathBuf, Mutex<File>)>,
    clips: Vec<Clip>,
    by_partition: BTreeMap<Partition, Vec<usize>>,
    rooms: Vec<String>,
    measured: BTreeSet<String>,
}

impl Dataset {
    /// Opens a folder and checks all of it: hashes, shapes, finite features, that no room or speaker is in two partitions.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Dataset`], naming file and field.
    pub fn open(folder: impl AsRef<Path>) -> Result<Self, Error> {
        let folder = folder.as_ref();
        let path = folder.join("manifest.json");
        let text = std::fs::read(&path).map_err(Error::io(&path))?;
        let manifest: Manifest =
            serde_json::from_slice(&text).map_err(|source| Error::dataset(&path, source.into()))?;
        check_manifest(&manifest).map_err(|fault| Error::dataset(&path, fault))?;
        let mut dataset = Self {
            mels: manifest.mels,
            frames: manifest.frames,
            files: Vec::new(),
            clips: Vec::new(),
            by_partition: BTreeMap::new(),
            measured: manifest.room_partitions.keys().cloned().collect(),
            rooms: manifest.rooms,
        };
        for entry in &manifest.shards {
            dataset.add(folder, entry)?;
        }
        for what in ["room", "speaker"] {
            dataset.check_leak(what).map_err(|fault| Error::dataset(&path, fault))?;
        }
        Ok(dataset)
    }

    /// Mel bands of the features.
    pub fn mels(&self) -> usize {
        self.mels
    }

    /// Frames of a clip.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// All clips.
    pub fn clips(&self) -> &[Clip] {
        &self.clips
    }

    /// Indices of the clips of a partition.
    pub fn partition(&self, partition: Partition) -> &[usize] {
        self.by_partition.get(&partition).map_or(&[], Vec::as_slice)
    }

    /// Name of a room, if the manifest has one.
    pub fn room_name(&self, room: i64) -> Option<&str> {
        usize::try_from(room).ok().and_then(|room| self.rooms.get(room)).map(String::as_str)
    }

    /// Whether a room is a measured one rather than a simulated one.
    pub fn is_measured(&self, room: i64) -> bool {
        self.room_name(room).is_some_and(|name| self.measured.contains(name))
    }

    /// Number of rooms in a partition.
    pub fn room_count(&self, partition: Partition) -> usize {
        self.partition(partition).iter().map(|&clip| self.clips[clip].room).collect::<BTreeSet<_>>().len()
    }

    /// Reads the features of a clip, levels in dB `[mel][frame]`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn read(&self, clip: usize, out: &mut Vec<f32>) -> Result<(), Error> {
        let clip = &self.clips[clip];
        let (path, file) = &self.files[clip.shard];
        let mut bytes = vec![0u8; 2 * self.mels * self.frames];
        {
            let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
            file.seek(SeekFrom::Start(clip.offset)).map_err(Error::io(path))?;
            file.read_exact(&mut bytes).map_err(Error::io(path))?;
        }
        out.clear();
        out.extend(bytes.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()));
        Ok(())
    }

    fn add(&mut self, folder: &Path, entry: &ShardEntry) -> Result<(), Error> {
        let path = folder.join(&entry.file);
        let mut file = File::open(&path).map_err(Error::io(&path))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(Error::io(&path))?;
        let found: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        if !found.eq_ignore_ascii_case(&entry.sha256) {
            return Err(Error::dataset(&path, DatasetFault::Hash { found, expected: entry.sha256.clone() }));
        }
        let clips = self.parse(entry, &bytes).map_err(|fault| Error::dataset(&path, fault))?;
        let list = self.by_partition.entry(entry.partition).or_default();
        list.extend(self.clips.len()..self.clips.len() + clips.len());
        self.clips.extend(clips);
        self.files.push((path, Mutex::new(file)));
        Ok(())
    }

    fn parse(&self, entry: &ShardEntry, bytes: &[u8]) -> Result<Vec<Clip>, DatasetFault> {
        let tensors = SafeTensors::deserialize(bytes)?;
        let n = entry.clips;
        let tensor = |name: &'static str, dtype: Dtype, shape: &[usize]| {
            let expected = format!("{dtype:?} {shape:?}");
            match tensors.tensor(name) {
                Ok(tensor) if tensor.dtype() == dtype && tensor.shape() == shape => Ok(tensor.data()),
                Ok(tensor) => {
                    let found = format!("{:?} {:?}", tensor.dtype(), tensor.shape());
                    Err(DatasetFault::Tensor { tensor: name, found, expected })
                }
                Err(_) => Err(DatasetFault::Tensor { tensor: name, found: "missing".into(), expected }),
            }
        };
        let features = tensor("features", Dtype::F16, &[n, self.mels, self.frames])?;
        let clip_bytes = 2 * self.mels * self.frames;
        for (clip, features) in features.chunks_exact(clip_bytes).enumerate() {
            if features.chunks_exact(2).any(|b| !f16::from_le_bytes([b[0], b[1]]).is_finite()) {
                return Err(DatasetFault::NotFinite { clip });
            }
        }
        let start = features.as_ptr().addr() - bytes.as_ptr().addr();
        let float = |bytes: &[u8], index: usize| {
            let b = &bytes[4 * index..];
            f32::from_le_bytes([b[0], b[1], b[2], b[3]])
        };
        let integer = |bytes: &[u8], index: usize| {
            let mut b = [0; 8];
            b.copy_from_slice(&bytes[8 * index..8 * index + 8]);
            i64::from_le_bytes(b)
        };
        let t60 = tensor("t60_s", Dtype::F32, &[n, T60_COUNT])?;
        let eq = tensor("eq_db", Dtype::F32, &[n, EQ_COUNT])?;
        let snr = tensor("snr_db", Dtype::F32, &[n])?;
        let drr = tensor("drr_db", Dtype::F32, &[n])?;
        let room = tensor("room", Dtype::I64, &[n])?;
        let speaker = tensor("speaker", Dtype::I64, &[n])?;
        let clip = |i: usize| Clip {
            partition: entry.partition,
            labels: std::array::from_fn(|k| {
                if k < T60_COUNT {
                    float(t60, i * T60_COUNT + k)
                } else {
                    float(eq, i * EQ_COUNT + k - T60_COUNT)
                }
            }),
            snr_db: float(snr, i),
            drr_db: float(drr, i),
            room: integer(room, i),
            speaker: integer(speaker, i),
            shard: self.files.len(),
            offset: (start + i * clip_bytes) as u64,
        };
        let clips: Vec<Clip> = (0..n).map(clip).collect();
        for (i, clip) in clips.iter().enumerate() {
            // A T60 must be positive, since its logarithm may be taken; infinities are nobody's label.
            let bad = |k: usize, v: f32| v.is_infinite() || (k < T60_COUNT && v <= 0.0);
            if let Some((k, value)) = clip.labels.iter().enumerate().find(|(k, v)| bad(*k, **v)) {
                return Err(DatasetFault::Tensor {
                    tensor: if k < T60_COUNT { "t60_s" } else { "eq_db" },
                    found: format!("{value} in clip {i}"),
                    expected: "a finite label, positive for a reverberation time, or NaN".into(),
                });
            }
        }
        Ok(clips)
    }

    fn check_leak(&self, what: &'static str) -> Result<(), DatasetFault> {
        let mut seen: BTreeMap<i64, Partition> = BTreeMap::new();
        for clip in &self.clips {
            let index = if what == "room" { clip.room } else { clip.speaker };
            let first = *seen.entry(index).or_insert(clip.partition);
            if first != clip.partition {
                let (first, second) = (first.name(), clip.partition.name());
                return Err(DatasetFault::Leak { what, index, first, second });
            }
        }
        Ok(())
    }
}

fn check_manifest(manifest: &Manifest) -> Result<(), DatasetFault> {
    let field = |field, found: String, expected: String| {
        if found == expected { Ok(()) } else { Err(DatasetFault::Field { field, found, expected }) }
    };
    field("format", manifest.format.clone(), FORMAT.into())?;
    field("sample_rate_hz", manifest.sample_rate_hz.to_string(), "16000".into())?;
    field("mels", manifest.mels.to_string(), "32".into())?;
    field("frames", manifest.frames.to_string(), "499".into())?;
    let bands = |range: std::ops::Range<usize>| range.map(label_hz).collect::<Vec<_>>();
    let (t60, eq) = (bands(0..T60_COUNT), bands(T60_COUNT..LABEL_COUNT));
    field("t60_bands_hz", format!("{:?}", manifest.t60_bands_hz), format!("{t60:?}"))?;
    field("eq_bands_hz", format!("{:?}", manifest.eq_bands_hz), format!("{eq:?}"))
}
