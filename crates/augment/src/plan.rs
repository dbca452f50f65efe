//! What decides the bytes of a data set.

use crate::clip::ClipConfig;
use crate::corpus::{ResponseCorpus, SpeechCorpus, hash_bytes};
use crate::error::Error;
use crate::manifest::ShardEntry;
use crate::partition::Partition;
use crate::shard::LabelStatistics;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Everything that decides the bytes of the set; kept as `plan.json`, so that a set is resumed with what it was begun.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Plan {
    pub(crate) format: String,
    pub(crate) version: String,
    pub(crate) seed: u64,
    pub(crate) clips: [usize; 3],
    pub(crate) shard_clips: usize,
    pub(crate) clips_per_response: usize,
    pub(crate) measured_fraction: [f64; 3],
    pub(crate) traced_fraction: [f64; 3],
    pub(crate) clip: ClipConfig,
    pub(crate) synthetic: String,
    pub(crate) chain: String,
    pub(crate) rooms: BTreeMap<String, Partition>,
    pub(crate) traced_rooms: BTreeMap<String, Partition>,
    pub(crate) speakers: BTreeMap<String, Partition>,
    pub(crate) noise: BTreeMap<String, Partition>,
    /// Hash of the content of each source as it is used.
    pub(crate) content: BTreeMap<String, String>,
}

/// Beside each shard: what the manifest needs to know of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Sidecar {
    pub(crate) plan_sha256: String,
    pub(crate) entry: ShardEntry,
    pub(crate) statistics: LabelStatistics,
}

/// The same sound under two names must not come into two partitions.
pub(crate) fn check_copies(
    responses: &ResponseCorpus,
    speech: &SpeechCorpus,
    rooms: &BTreeMap<String, Partition>,
    speakers: &BTreeMap<String, Partition>,
) -> Result<(), Error> {
    let of_rooms =
        responses.responses.iter().map(|r| ("room", &r.room, r.response.samples(), rooms.get(&r.room)));
    let of_speakers = speech
        .utterances
        .iter()
        .map(|u| ("speaker", &u.speaker, &u.speech.samples[..], speakers.get(&u.speaker)));
    let mut seen: BTreeMap<String, Partition> = BTreeMap::new();
    for (what, name, samples, partition) in of_rooms.chain(of_speakers) {
        let Some(&second) = partition else { continue };
        match seen.insert(hash_samples(samples), second) {
            Some(first) if first != second => {
                return Err(Error::Leak { what, name: name.clone(), first, second });
            }
            _ => {}
        }
    }
    Ok(())
}

pub(crate) fn hash_samples(samples: &[f32]) -> String {
    let bytes: Vec<u8> = samples.iter().flat_map(|s| s.to_le_bytes()).collect();
    hash_bytes(&bytes)
}
