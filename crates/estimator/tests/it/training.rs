//! Training on a small synthetic set: it learns, it is the same however it is run, and it refuses what it must.

use crate::support;
use crate::support::Shard;
use sabine_acoustics::Error as AcousticsError;
use sabine_estimator::{
    Block, Dataset, DatasetFault, Error, Evaluation, Loss, NetworkConfig, Partition, PerturbConfig, Schedule,
    Selection, Summary, T60Scale, TrainConfig, Trained, Trainer,
};
use std::ops::ControlFlow;
use std::path::Path;

fn config(epochs: usize) -> TrainConfig {
    let block = |channels, kernel, pool| Block { channels, kernel, pool };
    TrainConfig {
        // Small, so that the test is quick: the pools shrink 499 frames early.
        network: NetworkConfig {
            blocks: vec![
                block(4, [1, 2], [1, 4]),
                block(8, [1, 2], [1, 2]),
                block(8, [1, 2], [2, 2]),
                block(8, [2, 2], [2, 2]),
            ],
            summary: Summary::TimeMean,
            spectrum: true,
            hidden: Some(16),
            dropout: 0.1,
            ..NetworkConfig::small()
        },
        epochs,
        batch: 16,
        learning_rate: 5e-3,
        schedule: Schedule::Cosine,
        perturb: Some(PerturbConfig { eq_db: 1.0, level_db: 6.0, rotate: true }),
        ..TrainConfig::default()
    }
}

fn train(data: &Path, out: Option<&Path>, epochs: usize, resume: bool) -> Result<Trained, Error> {
    Trainer::new(config(epochs), &Dataset::open(data)?, out)?.train(resume, &())
}

#[test]
fn decays_and_colours_are_learned() {
    let folder = tempfile::tempdir().unwrap();
    support::usual(folder.path());
    let dataset = Dataset::open(folder.path()).unwrap();
    let trained = Trainer::new(config(25), &dataset, None).unwrap().train(false, &()).unwrap();
    let evaluation = Evaluation::new(&trained.model, &dataset, Partition::Test).unwrap();
    let all = Selection::all(Partition::Test);
    // The decay and the colour are all there is in these features: a network that learns anything halves the errors of a
    // constant on rooms that it has not seen.
    for errors in [evaluation.t60(&all).unwrap(), evaluation.eq(&all).unwrap()] {
        assert!(errors.model.value < 0.5 * errors.constant.value, "{errors:?}");
        assert!(errors.gain.high < 0.0, "{errors:?}");
        assert!(errors.best_constant.value <= errors.constant.value + 1e-9);
    }
    // The level of a clip is removed before the network hears it.
    assert!(trained.model.normalisation.remove_level);
    assert!(trained.best_epoch >= 1 && trained.history.len() == 25);
}

#[test]
fn the_result_is_the_same_on_any_number_of_threads_and_after_an_interruption() {
    let (data, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    support::usual(data.path());
    let bytes = |trained: Result<Trained, Error>| trained.unwrap().model.to_safetensors(false).unwrap();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bytes(train(data.path(), None, 3, false)))
    };
    let one = on(1);
    assert!(one == on(3));
    // Stopped in the second epoch, then resumed.
    let stop = |stage: &str, done: u64, _: u64| {
        if stage.starts_with("epoch 2 of") && done == 2 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let dataset = Dataset::open(data.path()).unwrap();
    let trainer = Trainer::new(config(3), &dataset, Some(out.path())).unwrap();
    let stopped = trainer.train(false, &stop);
    assert!(matches!(stopped, Err(Error::Acoustics(AcousticsError::Cancelled { .. }))));
    assert!(one == bytes(trainer.train(true, &())));
    // A checkpoint of another training is refused.
    let other = TrainConfig { seed: 2, ..config(3) };
    let other = Trainer::new(other, &dataset, Some(out.path())).unwrap();
    assert!(matches!(other.train(true, &()), Err(Error::Checkpoint { field: "seed", .. })));
    assert!(!out.path().join("checkpoint.safetensors.part").exists());
}

#[test]
fn missing_labels_are_left_out_and_a_band_without_any_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut shard = Shard::synthetic(16, 0, 1);
    shard.t60_s.iter_mut().step_by(7).take(10).for_each(|t| *t = f32::NAN);
    support::write(folder.path(), &[("train", shard.clone()), ("validation", Shard::synthetic(4, 500, 2))]);
    assert!(train(folder.path(), None, 1, false).is_ok());
    shard.t60_s.iter_mut().step_by(7).for_each(|t| *t = f32::NAN);
    support::write(folder.path(), &[("train", shard), ("validation", Shard::synthetic(4, 500, 2))]);
    let Err(Error::Dataset { fault, .. }) = train(folder.path(), None, 1, false) else { panic!() };
    assert!(matches!(*fault, DatasetFault::NoLabels { ref label, .. } if label == "T60 125 Hz"), "{fault}");
    // Nothing would calibrate the intervals of this band.
    let mut validation = Shard::synthetic(4, 500, 2);
    validation.t60_s.iter_mut().step_by(7).for_each(|t| *t = f32::NAN);
    support::write(folder.path(), &[("train", Shard::synthetic(16, 0, 1)), ("validation", validation)]);
    let Err(Error::Dataset { fault, .. }) = train(folder.path(), None, 1, false) else { panic!() };
    let DatasetFault::NoLabels { partition, ref label } = *fault else { panic!("{fault}") };
    assert_eq!((partition, label.as_str()), ("validation", "T60 125 Hz"));
}

#[test]
fn sets_that_would_flatter_or_cannot_be_read_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let fault = |shards: &[(&str, Shard)]| {
        support::write(folder.path(), shards);
        match train(folder.path(), None, 1, false) {
            Err(Error::Dataset { fault, .. }) => *fault,
            other => panic!("{other:?}"),
        }
    };
    let (train_part, validation) = (Shard::synthetic(8, 0, 1), Shard::synthetic(4, 500, 2));
    let mut one_room = train_part.clone();
    one_room.room.fill(0);
    assert!(matches!(
        fault(&[("train", one_room), ("validation", validation.clone())]),
        DatasetFault::Rooms { found: 1, needed: 2, .. }
    ));
    assert!(matches!(fault(&[("train", train_part.clone())]), DatasetFault::Rooms { found: 0, .. }));
    let leak = fault(&[("train", train_part.clone()), ("validation", Shard::synthetic(4, 2, 2))]);
    assert!(matches!(leak, DatasetFault::Leak { what: "room", .. }), "{leak}");
    let mut speaker = validation.clone();
    speaker.speaker.fill(1);
    let leak = fault(&[("train", train_part.clone()), ("validation", speaker)]);
    assert!(matches!(leak, DatasetFault::Leak { what: "speaker", index: 1, .. }), "{leak}");
    let mut broken = train_part.clone();
    broken.features[3 * 32 * 499 + 5] = f32::NAN;
    assert!(matches!(
        fault(&[("train", broken), ("validation", validation.clone())]),
        DatasetFault::NotFinite { clip: 3 }
    ));
    let mut negative = train_part.clone();
    negative.t60_s[9] = -1.0;
    assert!(matches!(
        fault(&[("train", negative), ("validation", validation.clone())]),
        DatasetFault::Tensor { tensor: "t60_s", .. }
    ));
    // A flipped bit, and a truncated file.
    support::write(folder.path(), &[("train", train_part), ("validation", validation)]);
    let path = folder.path().join("train-00000.safetensors");
    let mut bytes = std::fs::read(&path).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    let Err(Error::Dataset { fault, path: named }) = Dataset::open(folder.path()) else { panic!() };
    assert!(matches!(*fault, DatasetFault::Hash { .. }) && named == path);
    std::fs::write(&path, &bytes[..1000]).unwrap();
    assert!(Dataset::open(folder.path()).is_err());
    std::fs::write(folder.path().join("manifest.json"), "{}").unwrap();
    let Err(Error::Dataset { fault, .. }) = Dataset::open(folder.path()) else { panic!() };
    assert!(matches!(*fault, DatasetFault::Manifest { .. }));
    assert!(matches!(Dataset::open(folder.path().join("nowhere")), Err(Error::Io { .. })));
}

#[test]
fn a_loss_that_is_no_number_stops_the_training_and_keeps_the_last_checkpoint() {
    let (data, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    support::usual(data.path());
    let dataset = Dataset::open(data.path()).unwrap();
    let good = TrainConfig { epochs: 1, ..config(1) };
    Trainer::new(good, &dataset, Some(out.path())).unwrap().train(false, &()).unwrap();
    let before = std::fs::read(out.path().join("checkpoint.safetensors")).unwrap();
    // Gains of 1e30 dB leave nothing of any number.
    let wild = PerturbConfig { eq_db: 1e30, level_db: 0.0, rotate: false };
    let wild = TrainConfig { perturb: Some(wild), loss: Loss::Squared, t60: T60Scale::Linear, ..config(2) };
    let found = Trainer::new(wild, &dataset, Some(out.path())).unwrap().train(false, &());
    assert!(matches!(found, Err(Error::Diverged { epoch: 1, .. })), "{found:?}");
    assert_eq!(before, std::fs::read(out.path().join("checkpoint.safetensors")).unwrap());
}

#[test]
fn settings_out_of_range_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    support::usual(folder.path());
    let dataset = Dataset::open(folder.path()).unwrap();
    for (field, config) in [
        ("batch", TrainConfig { batch: 1, ..config(1) }),
        ("epochs", TrainConfig { epochs: 0, ..config(1) }),
        ("learning_rate", TrainConfig { learning_rate: f64::NAN, ..config(1) }),
        (
            "rows and columns left after pooling",
            TrainConfig {
                network: NetworkConfig {
                    blocks: vec![Block { channels: 4, kernel: [5, 5], pool: [4, 4] }; 3],
                    ..NetworkConfig::small()
                },
                ..config(1)
            },
        ),
    ] {
        let found = Trainer::new(config, &dataset, None).err();
        assert!(matches!(found, Some(Error::Config { field: f, .. }) if f == field), "{field}: {found:?}");
    }
}

#[test]
fn a_checkpoint_with_a_flipped_bit_is_refused() {
    let (data, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    support::usual(data.path());
    let dataset = Dataset::open(data.path()).unwrap();
    let trainer = Trainer::new(TrainConfig { epochs: 1, ..config(1) }, &dataset, Some(out.path())).unwrap();
    trainer.train(false, &()).unwrap();
    let path = out.path().join("checkpoint.safetensors");
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() - 1000;
    bytes[middle] ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    let error = trainer.train(true, &()).unwrap_err().to_string();
    assert!(error.contains("checkpoint.safetensors") && error.contains("SHA-256"), "{error}");
}
