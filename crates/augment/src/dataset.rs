//! Building a data set, shard by shard.

use crate::augment::Augment;
use crate::chain::Chain;
use crate::clip::{ClipMaker, ClipScratch};
use crate::corpus::{MeasuredResponse, ResponseCorpus, SpeechCorpus, Utterance, hash_bytes, hash_file};
use crate::dataset_config::{Built, DatasetConfig, DatasetSources, Worker};
use crate::error::{Error, check};
use crate::labels::Labels;
use crate::manifest::{DATASET_FORMAT, Manifest, ShardEntry, read_json, write_json};
use crate::partition::{Partition, PartitionConfig};
use crate::plan::{Plan, Sidecar, check_copies, hash_samples};
use crate::seed::{derive, generator};
use crate::shard::{LabelStatistics, ShardContent};
use crate::synthetic::SyntheticRooms;
use half::f16;
use rand::Rng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use sabine_acoustics::{Bands, ImpulseResponse, Observer, report};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Makes data sets: speech x response x noise -> clips -> shards.
pub struct DatasetBuilder {
    config: DatasetConfig,
    plan: Plan,
    plan_sha256: String,
    maker: ClipMaker,
    synthetic: SyntheticRooms,
    chain: Chain,
    sources: DatasetSources,
    refused: AtomicU64,
}

/// What became of a shard.
enum Outcome {
    Made,
    Kept,
    Mended,
}

impl DatasetBuilder {
    /// Deals out rooms, speakers and noise, and plans the set. Nothing is written.
    ///
    /// # Errors
    /// [`Error::Setting`], [`Error::Leak`], [`Error::Unknown`], [`Error::TooFew`] as [`PartitionConfig::deal`]; a sample rate
    /// of the responses other than that of the features.
    pub fn new(config: DatasetConfig, sources: DatasetSources) -> Result<Self, Error> {
        let DatasetSources { speech, responses, traced, noise } = &sources;
        config.check_settings()?;
        let maker = ClipMaker::new(config.clip.clone(), config.synthetic.longest_s.max(2.5))?;
        let synthetic = SyntheticRooms::new(config.synthetic.clone())?;
        for response in responses.responses.iter().chain(&traced.responses) {
            if response.response.sample_rate_hz() != maker.sample_rate_hz() {
                return Err(Error::SampleRate {
                    expected_hz: maker.sample_rate_hz(),
                    found_hz: response.response.sample_rate_hz(),
                });
            }
        }
        let speakers = config.speakers_of(speech)?;
        let rooms = config.rooms_of(responses)?;
        let traced_rooms = if traced.responses.is_empty() {
            BTreeMap::new()
        } else {
            let seed = derive(config.seed, 14);
            PartitionConfig::default().deal("traced room", "three partitions", &traced.rooms(), seed)?
        };
        let noises = if noise.tracks.is_empty() {
            // All noise is computed then.
            BTreeMap::new()
        } else {
            PartitionConfig::default().deal(
                "noise",
                "three partitions",
                &noise.names(),
                derive(config.seed, 13),
            )?
        };
        let mut content = BTreeMap::new();
        for (i, u) in speech.utterances.iter().enumerate() {
            content.insert(format!("speech {i} {}", u.speaker), hash_samples(&u.speech.samples));
        }
        for r in responses.responses.iter().chain(&traced.responses) {
            content.insert(format!("response {} {}", r.room, r.path), hash_samples(r.response.samples()));
        }
        for (name, samples) in &noise.tracks {
            content.insert(format!("noise {name}"), hash_samples(samples));
        }
        check_copies(responses, speech, &rooms, &speakers)?;
        check_copies(traced, &SpeechCorpus::default(), &traced_rooms, &BTreeMap::new())?;
        let chain = Chain::for_training(maker.sample_rate_hz())?;
        let plan = Plan {
            format: DATASET_FORMAT.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed: config.seed,
            clips: config.clips,
            shard_clips: config.shard_clips,
            clips_per_response: config.clips_per_response,
            measured_fraction: config.measured_fraction,
            traced_fraction: config.traced_fraction,
            clip: config.clip.clone(),
            synthetic: format!("{:?}", config.synthetic),
            chain: chain.describe(),
            rooms,
            traced_rooms,
            speakers,
            noise: noises,
            content,
        };
        let text = serde_json::to_vec(&plan)
            .map_err(|source| Error::Json { path: PathBuf::from("plan.json"), source })?;
        let plan_sha256 = hash_bytes(&text);
        Ok(Self { config, plan, plan_sha256, maker, synthetic, chain, sources, refused: AtomicU64::new(0) })
    }

    /// Partition of each measured room.
    pub fn room_partitions(&self) -> &BTreeMap<String, Partition> {
        &self.plan.rooms
    }

    /// Partition of each speaker.
    pub fn speaker_partitions(&self) -> &BTreeMap<String, Partition> {
        &self.plan.speakers
    }

    /// Partition of each noise track.
    pub fn noise_partitions(&self) -> &BTreeMap<String, Partition> {
        &self.plan.noise
    }

    /// Shards of the whole set: file name, partition, index of the first clip within it, number of clips.
    fn shards(&self) -> Vec<(String, Partition, usize, usize)> {
        let size = self.config.shard_clips;
        Partition::ALL
            .iter()
            .zip(self.config.clips)
            .flat_map(|(&partition, clips)| {
                (0..clips.div_ceil(size)).map(move |i| {
                    let name = format!("{partition}-{i:05}.safetensors");
                    (name, partition, i * size, size.min(clips - i * size))
                })
            })
            .collect()
    }

    /// Makes the worker's shards in `folder`, and the manifest once all shards of all workers are there. With `resume`,
    /// shards that are there and whole are kept; without, the folder must hold no data set.
    ///
    /// Stopping at any moment leaves whole shards only. The bytes depend on the plan alone, not on the number of threads, of
    /// workers, or of interruptions.
    ///
    /// # Errors
    /// [`Error::NotEmpty`], [`Error::OtherPlan`], [`Error::Setting`] for the worker, [`Error::Io`] (a full disk),
    /// [`sabine_acoustics::Error::Cancelled`].
    pub fn build(
        &self,
        folder: &Path,
        worker: Worker,
        resume: bool,
        observer: &dyn Observer,
    ) -> Result<Built, Error> {
        check("worker count", worker.of as f64, 1.0, 1e6, "at least 1")?;
        check(
            "worker index",
            worker.index as f64,
            1.0,
            worker.of as f64,
            "between 1 and the number of workers",
        )?;
        std::fs::create_dir_all(folder).map_err(|source| Error::Io { path: folder.to_owned(), source })?;
        self.begin(folder, worker, resume)?;
        let shards = self.shards();
        let mine: Vec<_> = shards.iter().skip(worker.index - 1).step_by(worker.of).collect();
        let total: usize = mine.iter().map(|s| s.3).sum();
        let mut built = Built { made: 0, kept: 0, mended: 0, refused: 0, manifest: None };
        let mut done = 0;
        report(observer, "making clips", 0, total as u64)?;
        for (name, partition, first, clips) in mine {
            let stage = |clip: u64| report(observer, "making clips", done as u64 + clip, total as u64);
            match self.shard(folder, name, *partition, *first, *clips, &stage)? {
                Outcome::Made => built.made += 1,
                Outcome::Kept => built.kept += 1,
                Outcome::Mended => built.mended += 1,
            }
            done += clips;
            report(observer, "making clips", done as u64, total as u64)?;
        }
        built.refused = self.refused.load(Ordering::Relaxed);
        built.manifest = self.finish(folder, &shards)?;
        Ok(built)
    }

    /// Writes the plan, or holds it against the one that is there.
    fn begin(&self, folder: &Path, worker: Worker, resume: bool) -> Result<(), Error> {
        let path = folder.join("plan.json");
        if !path.exists() {
            return write_json(&path, &self.plan);
        }
        if !resume && worker.of == 1 {
            return Err(Error::NotEmpty { path: folder.to_owned() });
        }
        // Compared as text: a plan of another version may have other fields.
        let found: serde_json::Value = read_json(&path)?;
        let mine =
            serde_json::to_value(&self.plan).map_err(|source| Error::Json { path: path.clone(), source })?;
        if found == mine { Ok(()) } else { Err(Error::OtherPlan { path }) }
    }

    /// Makes a shard unless it is there and whole.
    fn shard(
        &self,
        folder: &Path,
        name: &str,
        partition: Partition,
        first: usize,
        clips: usize,
        observe: &(dyn Fn(u64) -> Result<(), sabine_acoustics::Error> + Sync),
    ) -> Result<Outcome, Error> {
        let path = folder.join(name);
        let sidecar_path = path.with_extension("json");
        let found = path.exists();
        if found && self.is_whole(&path, &sidecar_path) {
            return Ok(Outcome::Kept);
        }
        let per = self.config.clips_per_response;
        let groups: Vec<usize> = (first / per..(first + clips).div_ceil(per)).collect();
        let done = AtomicU64::new(0);
        let parts: Vec<ShardContent> = groups
            .par_iter()
            .map_init(
                || self.maker.scratch(),
                |scratch, &group| {
                    let from = (group * per).max(first);
                    let to = ((group + 1) * per).min(first + clips);
                    let content = self.group(partition, group, from..to, scratch)?;
                    observe(done.fetch_add((to - from) as u64, Ordering::Relaxed) + (to - from) as u64)?;
                    Ok(content)
                },
            )
            .collect::<Result<_, Error>>()?;
        let mut content = ShardContent::default();
        for part in parts {
            content.append(part);
        }
        let bytes = content.encode(self.maker.mels(), self.maker.frames(), &path)?;
        let entry = ShardEntry { file: name.to_owned(), partition, clips, sha256: hash_bytes(&bytes) };
        sabine_acoustics::write_atomically(&path, |file| file.write_all(&bytes))?;
        let sidecar =
            Sidecar { plan_sha256: self.plan_sha256.clone(), entry, statistics: content.statistics };
        write_json(&sidecar_path, &sidecar)?;
        Ok(if found { Outcome::Mended } else { Outcome::Made })
    }

    /// True if a shard belongs to this plan and its bytes are what they were.
    fn is_whole(&self, path: &Path, sidecar: &Path) -> bool {
        let Ok(sidecar) = read_json::<Sidecar>(sidecar) else { return false };
        sidecar.plan_sha256 == self.plan_sha256
            && hash_file(path).is_ok_and(|hash| hash == sidecar.entry.sha256)
    }

    /// Writes the manifest if all shards are there.
    fn finish(
        &self,
        folder: &Path,
        shards: &[(String, Partition, usize, usize)],
    ) -> Result<Option<Manifest>, Error> {
        let mut entries = Vec::new();
        let mut statistics: BTreeMap<Partition, LabelStatistics> = BTreeMap::new();
        for (name, ..) in shards {
            let path = folder.join(name).with_extension("json");
            if !path.exists() {
                return Ok(None);
            }
            let sidecar: Sidecar = read_json(&path)?;
            if sidecar.plan_sha256 != self.plan_sha256 {
                return Ok(None);
            }
            statistics.entry(sidecar.entry.partition).or_default().merge(&sidecar.statistics);
            entries.push(sidecar.entry);
        }
        let manifest = Manifest {
            format: DATASET_FORMAT.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            sample_rate_hz: self.maker.sample_rate_hz(),
            duration_s: self.config.clip.duration_s,
            mels: self.maker.mels(),
            frames: self.maker.frames(),
            t60_bands_hz: Bands::T60.iter_hz().collect(),
            eq_bands_hz: Bands::EQ.iter_hz().filter(|&hz| hz != 1000.0).collect(),
            seed: self.config.seed,
            plan_sha256: self.plan_sha256.clone(),
            shards: entries,
            statistics,
            clip: self.config.clip.clone(),
            room_partitions: self
                .plan
                .rooms
                .iter()
                .chain(&self.plan.traced_rooms)
                .map(|(n, &p)| (n.clone(), p))
                .collect(),
            speaker_partitions: self.plan.speakers.clone(),
            noise_partitions: self.plan.noise.clone(),
            sources: BTreeMap::from([
                ("speech".to_owned(), self.sources.speech.files.clone()),
                ("responses".to_owned(), self.sources.responses.files.clone()),
                ("noise".to_owned(), self.sources.noise.files.clone()),
            ]),
            left_out: BTreeMap::from([
                ("speech".to_owned(), self.sources.speech.left_out.clone()),
                ("responses".to_owned(), self.sources.responses.left_out.clone()),
                ("traced rooms".to_owned(), self.sources.traced.left_out.clone()),
            ]),
            speakers: self.plan.speakers.keys().cloned().collect(),
            rooms: self.room_names(),
        };
        write_json(&folder.join("manifest.json"), &manifest)?;
        Ok(Some(manifest))
    }

    /// Measured rooms, traced ones, then the others of each partition.
    fn room_names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            self.plan.rooms.keys().chain(self.plan.traced_rooms.keys()).cloned().collect();
        for partition in Partition::ALL {
            names.extend(
                (0..self.simulated_before(partition, self.groups(partition)))
                    .map(|i| format!("simulated/{partition}/{i:06}")),
            );
        }
        names
    }

    fn groups(&self, partition: Partition) -> usize {
        self.config.clips[partition as usize].div_ceil(self.config.clips_per_response)
    }

    /// Number of measured responses among the first `groups`: spread evenly.
    fn measured_before(&self, partition: Partition, groups: usize) -> usize {
        (groups as f64 * self.config.measured_fraction[partition as usize] + 1e-9).floor() as usize
    }

    fn simulated_before(&self, partition: Partition, groups: usize) -> usize {
        groups - self.measured_before(partition, groups)
    }

    /// The response of a group of clips, the index of its room, and its labels.
    fn response(
        &self,
        partition: Partition,
        group: usize,
        seed: u64,
    ) -> Result<(ImpulseResponse, usize, Labels), Error> {
        let rng = &mut generator(derive(seed, 1));
        if self.measured_before(partition, group + 1) > self.measured_before(partition, group) {
            return self.augmented(rng, partition, &self.sources.responses, &self.plan.rooms, 0, seed);
        }
        let traced = &self.plan.traced_rooms;
        if !traced.is_empty() && rng.random::<f64>() < self.config.traced_fraction[partition as usize] {
            let before = self.plan.rooms.len();
            return self.augmented(rng, partition, &self.sources.traced, traced, before, seed);
        }
        let response = self.synthetic.draw(seed)?;
        let labels = Labels::measure(&response)?;
        let before: usize = Partition::ALL[..partition as usize]
            .iter()
            .map(|&p| self.simulated_before(p, self.groups(p)))
            .sum();
        let room = self.plan.rooms.len() + traced.len() + before + self.simulated_before(partition, group);
        Ok((response, room, labels))
    }

    /// A response of one of the rooms dealt to this partition, changed unless it is for the test; `before` is the index of
    /// the first of these rooms.
    fn augmented(
        &self,
        rng: &mut Pcg64,
        partition: Partition,
        corpus: &ResponseCorpus,
        rooms: &BTreeMap<String, Partition>,
        before: usize,
        seed: u64,
    ) -> Result<(ImpulseResponse, usize, Labels), Error> {
        let own: Vec<(usize, &String)> = rooms
            .iter()
            .enumerate()
            .filter_map(|(i, (name, &p))| (p == partition).then_some((before + i, name)))
            .collect();
        let (index, room) = own[rng.random_range(0..own.len())];
        let candidates: Vec<&MeasuredResponse> =
            corpus.responses.iter().filter(|r| &r.room == room).collect();
        let measured = candidates[rng.random_range(0..candidates.len())];
        if partition == Partition::Test {
            return Ok((measured.response.clone(), index, measured.labels.clone()));
        }
        for attempt in 0..8 {
            match self.chain.augment(&measured.response, derive(seed, 100 + attempt)) {
                Ok(response) => {
                    let labels = Labels::measure(&response)?;
                    return Ok((response, index, labels));
                }
                Err(_) => {
                    self.refused.fetch_add(1, Ordering::Relaxed);
                }
            }
        }
        // Eight refusals: the response as it was measured is a fair member of the set, too.
        Ok((measured.response.clone(), index, measured.labels.clone()))
    }

    /// The clips that share a response.
    fn group(
        &self,
        partition: Partition,
        group: usize,
        clips: std::ops::Range<usize>,
        scratch: &mut ClipScratch,
    ) -> Result<ShardContent, Error> {
        let seed = derive(derive(self.config.seed, 1 + partition as u64), group as u64);
        let (response, room, labels) = self.response(partition, group, seed)?;
        let prepared = self.maker.prepare(response.samples())?;
        let voices: Vec<&Utterance> = self
            .sources
            .speech
            .utterances
            .iter()
            .filter(|u| self.plan.speakers[&u.speaker] == partition)
            .collect();
        let noises: Vec<&[f32]> = self
            .sources
            .noise
            .tracks
            .iter()
            .filter(|(name, _)| self.plan.noise.get(name) == Some(&partition))
            .map(|(_, samples)| samples.as_slice())
            .collect();
        let size = self.maker.mels() * self.maker.frames();
        let mut features = vec![0.0_f32; size];
        let mut content = ShardContent::default();
        for clip in clips {
            let rng = &mut generator(derive(derive(self.config.seed, 101 + partition as u64), clip as u64));
            let voice = voices[rng.random_range(0..voices.len())];
            let facts = self.maker.make(rng, &voice.speech, &prepared, &noises, scratch, &mut features)?;
            content.features.extend(features.iter().map(|&v| f16::from_f32(v)));
            content.push_labels(&labels, facts.snr_db);
            content.room.push(room as i64);
            content
                .speaker
                .push(self.plan.speakers.keys().position(|s| *s == voice.speaker).unwrap_or_default() as i64);
            content.clips += 1;
        }
        Ok(content)
    }
}
