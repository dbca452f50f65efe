//! What data set to build, and what came of it.

use crate::clip::ClipConfig;
use crate::corpus::{NoiseCorpus, ResponseCorpus, SpeechCorpus};
use crate::error::{Error, check};
use crate::manifest::Manifest;
use crate::partition::{Partition, PartitionConfig};
use crate::seed::derive;
use crate::synthetic::SyntheticRoomConfig;
use std::collections::BTreeMap;

/// What to build.
#[derive(Clone, Debug, PartialEq)]
pub struct DatasetConfig {
    /// Seed of everything.
    pub seed: u64,
    /// Clips for training, validation and test. Default 56,500, 19,500 and 18,500 (Tang et al. 2020).
    pub clips: [usize; 3],
    /// Clips in a shard, 1 to 65,536. Default 512.
    pub shard_clips: usize,
    /// Clips that share a response (with other speech and noise), 1 to 64. Default 4.
    pub clips_per_response: usize,
    /// Fraction of the responses that are measured ones, in each partition; the others are simulated. Default 0.3, 0.5, 1:
    /// the test is real.
    pub measured_fraction: [f64; 3],
    /// Fraction of the simulated responses, in each partition, that come from [`DatasetSources::traced`], if there are any;
    /// the others from [`crate::SyntheticRooms`]. Default 0.5. Traced responses are changed like measured ones.
    pub traced_fraction: [f64; 3],
    /// How clips are made.
    pub clip: ClipConfig,
    /// How rooms are simulated.
    pub synthetic: SyntheticRoomConfig,
    /// How rooms are dealt out.
    pub rooms: PartitionConfig,
    /// How speakers are dealt out.
    pub speakers: PartitionConfig,
}

impl Default for DatasetConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            clips: [56_500, 19_500, 18_500],
            shard_clips: 512,
            clips_per_response: 4,
            measured_fraction: [0.3, 0.5, 1.0],
            traced_fraction: [0.5; 3],
            clip: ClipConfig::default(),
            synthetic: SyntheticRoomConfig::default(),
            rooms: PartitionConfig::default(),
            speakers: PartitionConfig::default(),
        }
    }
}

impl DatasetConfig {
    /// Checks the settings, and that speakers and measured rooms can be dealt out: before rooms are traced, which takes long.
    ///
    /// # Errors
    /// Those that [`DatasetBuilder::new`](crate::DatasetBuilder::new) would have for the same speech and responses.
    pub fn check(&self, speech: &SpeechCorpus, responses: &ResponseCorpus) -> Result<(), Error> {
        self.check_settings()?;
        self.speakers_of(speech)?;
        self.rooms_of(responses).map(|_| ())
    }

    pub(crate) fn check_settings(&self) -> Result<(), Error> {
        check("shard_clips", self.shard_clips as f64, 1.0, 65_536.0, "between 1 and 65536")?;
        check("clips_per_response", self.clips_per_response as f64, 1.0, 64.0, "between 1 and 64")?;
        for fraction in self.measured_fraction {
            check("measured_fraction", fraction, 0.0, 1.0, "between 0 and 1")?;
        }
        for fraction in self.traced_fraction {
            check("traced_fraction", fraction, 0.0, 1.0, "between 0 and 1")?;
        }
        for clips in self.clips {
            check("clips", clips as f64, 0.0, 1e9, "at most a thousand million")?;
        }
        Ok(())
    }

    /// Partition of each speaker.
    pub(crate) fn speakers_of(&self, speech: &SpeechCorpus) -> Result<BTreeMap<String, Partition>, Error> {
        self.speakers.deal("speaker", "three partitions", &speech.speakers(), derive(self.seed, 11))
    }

    /// Partition of each measured room; none where no response is to be measured.
    pub(crate) fn rooms_of(&self, responses: &ResponseCorpus) -> Result<BTreeMap<String, Partition>, Error> {
        if self.measured_fraction.iter().all(|&f| f == 0.0) {
            return Ok(BTreeMap::new());
        }
        self.rooms.deal("room", "three partitions", &responses.rooms(), derive(self.seed, 12))
    }
}

/// What to build it from.
#[derive(Clone, Debug, Default)]
pub struct DatasetSources {
    /// Speech, dealt out by speaker.
    pub speech: SpeechCorpus,
    /// Measured responses, dealt out by room.
    pub responses: ResponseCorpus,
    /// Traced responses ([`crate::TracedRooms::corpus`]), dealt out by room: 70, 15 and 15 %. None at all is fine; else
    /// three rooms at least.
    pub traced: ResponseCorpus,
    /// Noise, dealt out by track. Without any, all noise is computed.
    pub noise: NoiseCorpus,
}

/// Which shards to make: every `of`-th, from the `index`-th (counted from 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Worker {
    /// 1 to `of`.
    pub index: usize,
    /// Number of workers.
    pub of: usize,
}

impl Default for Worker {
    /// All of them.
    fn default() -> Self {
        Self { index: 1, of: 1 }
    }
}

/// What was built.
#[derive(Clone, Debug, PartialEq)]
pub struct Built {
    /// Shards made by this call.
    pub made: usize,
    /// Shards found whole and kept.
    pub kept: usize,
    /// Shards found damaged and made again.
    pub mended: usize,
    /// Augmentations that a response refused; another was drawn each time.
    pub refused: u64,
    /// The manifest, if all shards are there.
    pub manifest: Option<Manifest>,
}
