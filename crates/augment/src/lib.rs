//! Makes many room responses out of few, and training sets out of responses, speech and noise.
//!
//! `augment` stands between measurement and learning: it takes responses measured or drawn, changes them in ways that keep
//! them plausible, **measures** the result with [`sabine_acoustics`], hears speech in them through [`sabine_features`], and
//! writes clips with labels for the trainer of `sabine-estimator`.
//!
//! - [`T60Augment`], [`DrrAugment`], [`EqAugment`]: another reverberation time, distance, equalisation (Bryan 2020; Tang et
//!   al. 2020). Each is a [`Augment`]; a [`Chain`] of them is one, too. [`AugmentedResponse`] keeps the
//!   labels with the response.
//! - [`SyntheticRooms`]: synthetic room impulse responses, some hundreds a second.
//! - [`TracedRooms`]: responses of random polyhedral rooms ([`PolyhedralRoom`]: slanted walls, L-shapes, screens, furniture,
//!   surfaces of the material library), traced by a [`sabine_paths::Propagator`] that the caller brings.
//! - [`EqStatistics`]: how the equalisation of real responses spreads.
//! - [`DatasetBuilder`]: clips of 4 s in shards, for any number of threads, workers and interruptions the same bytes; rooms
//!   and speakers are dealt out to the partitions first, and a leak is an error.
//!
//! ```toml
//! [dependencies]
//! sabine-augment = "0.1"
//! ```
//!
//! ```
//! use sabine_acoustics::ImpulseResponse;
//! use sabine_augment::{SyntheticRoomConfig, SyntheticRooms, T60Augment, T60Config};
//! // A room of about 0.4 s, ...
//! let plain = SyntheticRoomConfig { t60_s: (0.4, 0.4), long_fraction: 0.0, ..SyntheticRoomConfig::default() };
//! let room = SyntheticRooms::new(plain)?.draw(1)?;
//! // ... made twice as reverberant.
//! let augment = T60Augment::new(T60Config::default())?;
//! let longer = augment.by_factor(&room, 2.0, 7)?;
//! let t60_s = |r: &ImpulseResponse| augment.full_band_s(r);
//! assert!((t60_s(&longer)? / t60_s(&room)? - 2.0).abs() < 0.1);
//! // Its direct sound is what it was.
//! let peak = room.samples().iter().position(|s| s.abs() == room.peak()).unwrap();
//! assert_eq!(longer.samples()[..peak + 40], room.samples()[..peak + 40]);
//! # Ok::<(), sabine_augment::Error>(())
//! ```
//!
//! # What it does not do
//!
//! It does not solve rooms: [`SyntheticRooms`] imitates what responses have in common, and a box with image sources up to the
//! second order is all its geometry; [`TracedRooms`] draws rooms and leaves the tracing to others. It does not move sources or listeners, model talkers' directivity beyond a random tilt of
//! the direct sound, simulate clipping, codecs or packet loss, or reverberate the noise. It does not clean recordings: speech
//! that is itself reverberant adds its own room. What is left out of a corpus is listed with its reason, not repaired.
//!
//! # Units
//!
//! Seconds, hertz, decibels; samples with full scale 1. Reverberation times are decay-plus-noise fits
//! ([`sabine_acoustics::DecayFit`]) at 125 Hz to 8 kHz; at 16 kHz sample rate the 8 kHz octave is read in its lowest third.
//! Equalisation is power density in dB re the 1 kHz octave at 62.5 Hz to 4 kHz. DRR counts 2.5 ms about the largest sample as
//! direct. SNR is the power of the reverberant speech over that of the noise, over the whole clip.
//!
//! # Accuracy
//!
//! | what | figure | test |
//! |---|---|---|
//! | T60 asked for against measured, per octave: noise with a floor | median 3 %, 95th percentile 10 % | `tests/it/t60.rs` |
//! | the same on measured responses, where bandwidth times T60 is 16 or more | 0.3 % and 3.9 %; 250 Hz to 8 kHz each within 3 % and 10 %, **125 Hz 0.6 % and 15 %** | `tests/it/real_responses.rs` |
//! | decay below the old noise floor | as above it | `tests/it/t60.rs`, `tests/it/real_responses.rs` |
//! | DRR | 0.2 dB, or refused | `tests/it/drr_and_eq.rs`, `tests/it/real_responses.rs` |
//! | EQ per octave | 0.5 dB, or refused | `tests/it/drr_and_eq.rs`, `tests/it/real_responses.rs` |
//! | threads, workers, interruptions | not a byte | `tests/it/dataset.rs`, `tests/it/traced_rooms.rs` |
//!
//! `docs/validation/augment.md` has the tables; `docs/how-to/dataset-on-a-cluster.md` tells how to make a set on many machines.
//!
//! # References
//!
//! - N. J. Bryan, Impulse response data augmentation and deep neural networks for blind room acoustic parameter estimation,
//!   ICASSP 2020 (arXiv:1909.03642).
//! - Z. Tang, N. J. Bryan, D. Li, T. R. Langlois, D. Manocha, Scene-aware audio rendering via deep acoustic analysis, IEEE TVCG
//!   26(5), 2020.
//! - M. Karjalainen et al., Estimation of modal decay parameters from noisy response measurements, JAES 50(11), 2002.
//! - H. Kuttruff, Room Acoustics, 6th ed., 2016.

mod augment;
mod band_split;
mod chain;
mod clip;
mod corpus;
mod dataset;
mod dataset_config;
mod direct;
mod drr;
mod eq;
mod eq_statistics;
mod error;
mod floor_plan;
mod labels;
mod manifest;
mod noise;
mod partition;
mod plan;
mod polyhedral_room;
mod seed;
mod shard;
mod spectral_shape;
mod synthetic;
mod t60;
mod traced_rooms;

pub use augment::Augment;
pub use chain::{AugmentedResponse, Chain};
pub use clip::ClipConfig;
pub use corpus::{
    LeftOut, MeasuredResponse, NoiseCorpus, ResponseCorpus, ResponseFilter, SourceFile, SpeechCorpus,
};
pub use dataset::DatasetBuilder;
pub use dataset_config::{Built, DatasetConfig, DatasetSources, Worker};
pub use drr::{DrrAugment, DrrConfig};
pub use eq::{EqAugment, EqConfig};
pub use eq_statistics::EqStatistics;
pub use error::Error;
pub use labels::Labels;
pub use manifest::{DATASET_FORMAT, Manifest, ShardEntry};
pub use partition::{Partition, PartitionConfig};
pub use polyhedral_room::{PolyhedralRoom, PolyhedralRoomConfig};
pub use shard::{Distribution, LabelStatistics};
pub use synthetic::{SyntheticRoomConfig, SyntheticRooms};
pub use t60::{T60Augment, T60Config};
pub use traced_rooms::{RenderPaths, RoomCache, TracedRooms};
