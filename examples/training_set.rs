//! From dry speech to a network: a tiny data set of simulated rooms, two epochs of training, and what came of it.
//!
//! ```text
//! cargo run --example training_set
//! ```
//!
//! It works in a temporary folder. It prints
//! ```text
//! train       64 clips of 32 bands x 499 frames in 16 rooms
//! validation  24 clips of 32 bands x 499 frames in 6 rooms
//! test        24 clips of 32 bands x 499 frames in 6 rooms
//! epoch 1: loss 2.72, validation error 1.38 of a constant guess's
//! epoch 2: loss 2.56, validation error 1.15 of a constant guess's
//! weights of 92 kB
//! T60 of unheard rooms: mean error 0.58 s, of a constant guess 0.50 s
//! ```
//!
//! Two epochs teach nothing of use; the network of the project has seen a thousand times as many clips. In full: `sabine augment`,
//! `sabine train`, `sabine evaluate`. Step by step: `docs/how-to/train-on-my-data.md`.

use sabine::acoustics::{Channel, read_audio, resample};
use sabine::augment::{DatasetBuilder, DatasetConfig, DatasetSources, SpeechCorpus, Worker};
use sabine::estimator::{Dataset, Evaluation, Partition, Selection, TrainConfig, Trainer};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let folder = tempfile::tempdir()?;

    // One speaker for each partition: nobody is heard in two of them.
    let mut config = DatasetConfig {
        clips: [64, 24, 24],
        shard_clips: 64,
        measured_fraction: [0.0; 3], // simulated rooms only
        ..DatasetConfig::default()
    };
    config.speakers.validation = vec!["guest".to_owned()];
    config.speakers.test = vec!["reader".to_owned()];
    let mut speech = SpeechCorpus::default();
    for speaker in ["talker", "guest", "reader"] {
        let dry = read_audio(fixtures.join(format!("speech/dry_{speaker}.wav")), Channel::Mono)?;
        if let Some(reason) = speech.add(speaker, resample(&dry, 16_000)?, config.clip.duration_s) {
            return Err(format!("{speaker}: {reason}").into());
        }
    }
    let sources = DatasetSources { speech, ..DatasetSources::default() };
    let data = folder.path().join("data");
    DatasetBuilder::new(config, sources)?.build(&data, Worker::default(), false, &())?;

    // Each clip: log-mel features of speech in a room, with T60 and EQ of that room as labels.
    let data = Dataset::open(&data)?;
    for partition in [Partition::Train, Partition::Validation, Partition::Test] {
        let (clips, rooms) = (data.partition(partition).len(), data.room_count(partition));
        println!(
            "{:<10} {clips:>3} clips of {} bands x {} frames in {rooms} rooms",
            partition.name(),
            data.mels(),
            data.frames()
        );
    }

    let config = TrainConfig { epochs: 2, batch: 8, ..TrainConfig::default() };
    let trained = Trainer::new(config, &data, None)?.train(false, &())?;
    for epoch in &trained.history {
        println!(
            "epoch {}: loss {:.2}, validation error {:.2} of a constant guess's",
            epoch.epoch, epoch.train_loss, epoch.validation_error
        );
    }

    let weights = trained.model.to_safetensors(true)?;
    let test = Evaluation::new(&trained.model, &data, Partition::Test)?;
    let errors = test.t60(&Selection::all(Partition::Test)).ok_or("no test clip has a label")?;
    println!("weights of {:.0} kB", 1e-3 * weights.len() as f64);
    println!(
        "T60 of unheard rooms: mean error {:.2} s, of a constant guess {:.2} s",
        errors.model.value, errors.constant.value
    );
    Ok(())
}
