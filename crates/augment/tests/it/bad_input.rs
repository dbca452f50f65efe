//! What cannot be used is refused or left out by name.

use crate::material::{response, speech};
use sabine_acoustics::{ImpulseResponse, SampleFormat, encode_wav_channels, write_wav};
use sabine_augment::{
    DatasetBuilder, DatasetConfig, DatasetSources, Error, NoiseCorpus, ResponseCorpus, ResponseFilter,
    SpeechCorpus, Worker,
};
use std::path::Path;

fn write(folder: &Path, name: &str, samples: &[f32], rate_hz: u32) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_wav(&path, samples, rate_hz, SampleFormat::Float32).unwrap();
}

#[test]
fn unusable_responses_are_left_out_by_name_with_their_reason() {
    let folder = tempfile::tempdir().unwrap();
    let good = response(0.5, 1.0, 70.0, 16_000, 1).into_samples();
    write(folder.path(), "good/ir/a.wav", &good, 16_000);
    // An odd rate is resampled.
    write(folder.path(), "odd/a.wav", &response(0.5, 1.0, 70.0, 11_025, 2).into_samples(), 11_025);
    let noise = response(1e9, 1.0, 0.0, 16_000, 3).into_samples();
    write(folder.path(), "noise/a.wav", &noise, 16_000);
    write(folder.path(), "silent/a.wav", &vec![0.0; 16_000], 16_000);
    let mut clipped = good.clone();
    clipped[100..106].fill(1.0);
    write(folder.path(), "clipped/a.wav", &clipped, 16_000);
    let mut twice = good.clone();
    twice[8000] = -0.95;
    write(folder.path(), "twice/a.wav", &twice, 16_000);
    write(folder.path(), "brief/a.wav", &good[..300], 16_000);
    let corpus = ResponseCorpus::read(folder.path(), 16_000, &ResponseFilter::default(), &[], &()).unwrap();
    assert_eq!(corpus.rooms(), ["good", "odd"]);
    assert!(corpus.responses().iter().all(|r| r.response.sample_rate_hz() == 16_000));
    let reasons: Vec<(&str, &str)> =
        corpus.left_out().iter().map(|l| (l.path.as_str(), l.reason.as_str())).collect();
    for name in ["noise", "silent", "clipped", "twice", "brief"] {
        let found = reasons.iter().find(|(path, _)| *path == format!("{name}/a.wav#0"));
        assert!(found.is_some_and(|(_, reason)| !reason.is_empty()), "{name}: {reasons:?}");
    }
    let reason = |name: &str| reasons.iter().find(|(p, _)| p.starts_with(name)).unwrap().1.to_owned();
    assert_ne!(reason("noise"), reason("clipped"));
    assert_ne!(reason("twice"), reason("brief"));
}

#[test]
fn of_stereo_responses_both_channels_count_and_stereo_speech_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let pair = [response(0.4, 0.8, 70.0, 16_000, 1), response(0.4, 0.8, 70.0, 16_000, 2)];
    let channels: Vec<&[f32]> = pair.iter().map(ImpulseResponse::samples).collect();
    let bytes = encode_wav_channels(&channels, 16_000, SampleFormat::Float32).unwrap();
    std::fs::create_dir(folder.path().join("hall")).unwrap();
    std::fs::write(folder.path().join("hall/a.wav"), &bytes).unwrap();
    let corpus = ResponseCorpus::read(folder.path(), 16_000, &ResponseFilter::default(), &[], &()).unwrap();
    assert_eq!(corpus.responses().len(), 2);
    let refused = SpeechCorpus::read(folder.path(), 16_000, 0.5, &()).unwrap_err();
    assert!(refused.to_string().contains("a.wav"), "{refused}");
}

#[test]
fn folders_of_nothing_and_files_of_no_sound_are_named() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(NoiseCorpus::read(folder.path(), 16_000, &()), Err(Error::TooFew { .. })));
    std::fs::write(folder.path().join("broken.wav"), b"RIFF?").unwrap();
    for refused in [
        SpeechCorpus::read(folder.path(), 16_000, 4.0, &()).unwrap_err(),
        ResponseCorpus::read(folder.path(), 16_000, &ResponseFilter::default(), &[], &()).unwrap_err(),
        NoiseCorpus::read(folder.path(), 16_000, &()).unwrap_err(),
    ] {
        assert!(refused.to_string().contains("broken.wav"), "{refused}");
    }
}

/// Where a shard cannot be written, the error names it, what was finished stays, and the set is resumed when there is space.
#[test]
fn a_shard_that_cannot_be_written_is_named_and_the_rest_stays() {
    let build = |folder: &Path| {
        let mut voices = SpeechCorpus::default();
        for i in 0..5 {
            voices.add(format!("s{i}"), speech(6.0, 100.0 + 17.0 * i as f64, i), 4.0);
        }
        let config = DatasetConfig {
            clips: [12, 4, 4],
            shard_clips: 4,
            measured_fraction: [0.0; 3],
            ..DatasetConfig::default()
        };
        let sources = DatasetSources { speech: voices, ..DatasetSources::default() };
        DatasetBuilder::new(config, sources).unwrap().build(folder, Worker::default(), true, &())
    };
    let folder = tempfile::tempdir().unwrap();
    let blocked = folder.path().join("train-00002.safetensors");
    // A folder in the way fails at the same place as a full disk: the write of the second shard but one.
    std::fs::create_dir(&blocked).unwrap();
    let refused = build(folder.path()).unwrap_err();
    assert!(refused.to_string().contains("train-00002.safetensors"), "{refused}");
    let mut names: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "plan.json",
            "train-00000.json",
            "train-00000.safetensors",
            "train-00001.json",
            "train-00001.safetensors",
            "train-00002.safetensors"
        ]
    );
    std::fs::remove_dir(&blocked).unwrap();
    let built = build(folder.path()).unwrap();
    assert_eq!((built.kept, built.made), (2, 3));
    assert!(built.manifest.is_some());
}
