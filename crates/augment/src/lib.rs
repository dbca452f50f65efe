//! Augmentation of room impulse responses and training sets in shards.
//!
//! Under construction: the front page follows.

mod band_split;
mod chain;
mod clip;
mod corpus;
mod dataset;
mod direct;
mod drr;
mod eq;
mod eq_statistics;
mod error;
mod labels;
mod manifest;
mod noise;
mod partition;
mod seed;
mod shard;
mod spectral_shape;
mod synthetic;
mod t60;

pub use chain::{AugmentedResponse, Chain};
pub use clip::ClipConfig;
pub use corpus::{LeftOut, MeasuredResponse, NoiseCorpus, ResponseCorpus, ResponseFilter, SourceFile, SpeechCorpus};
pub use dataset::{Built, DatasetBuilder, DatasetConfig, Worker};
pub use drr::{DrrAugment, DrrConfig};
pub use eq::{EqAugment, EqConfig};
pub use eq_statistics::EqStatistics;
pub use error::Error;
pub use labels::Labels;
pub use manifest::{DATASET_FORMAT, Manifest, ShardEntry};
pub use partition::{Partition, PartitionConfig};
pub use shard::{Distribution, LabelStatistics};
pub use synthetic::{SyntheticRoomConfig, SyntheticRooms};
pub use t60::{T60Augment, T60Config};
