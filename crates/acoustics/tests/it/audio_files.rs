//! Sound from and to files, good and bad.

use proptest::prelude::*;
use sabine_acoustics::{Channel, Error, OutOfRange, SampleFormat, probe_audio, read_audio, write_wav};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const TONE: [f32; 8] = [0.0, 0.5, -0.5, 0.25, -1.0, 0.999, 1e-3, -0.125];

/// A WAV file of interleaved samples, written by hound.
fn wav(folder: &TempDir, channels: u16, bits: u16, float: bool, interleaved: &[f32]) -> PathBuf {
    let path = folder.path().join(format!("{channels}_{bits}_{float}.wav"));
    let sample_format = if float { hound::SampleFormat::Float } else { hound::SampleFormat::Int };
    let spec = hound::WavSpec { channels, sample_rate: 48_000, bits_per_sample: bits, sample_format };
    let mut writer = hound::WavWriter::create(&path, spec).unwrap();
    for &s in interleaved {
        if float {
            writer.write_sample(s).unwrap();
        } else {
            writer.write_sample((f64::from(s) * 2f64.powi(i32::from(bits) - 1)) as i32).unwrap();
        }
    }
    writer.finalize().unwrap();
    path
}

fn put(folder: &TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// The message must begin with the file, and the cause be the one expected.
fn refused(path: &Path, channel: Channel, expected: impl Fn(&Error) -> bool) {
    let error = read_audio(path, channel).expect_err("must be refused");
    assert!(error.to_string().starts_with(&path.display().to_string()), "{error}");
    let cause = if let Error::InFile { source, .. } = &error { source } else { &error };
    assert!(expected(cause), "{error:?}");
}

#[test]
fn every_format_comes_back_to_within_its_step() {
    let folder = TempDir::new().unwrap();
    for (bits, float, step) in [
        (8, false, 2f32.powi(-7)),
        (16, false, 2f32.powi(-15)),
        (24, false, 2f32.powi(-23)),
        (32, false, 2f32.powi(-24)),
        (32, true, 0.0),
    ] {
        let read = read_audio(wav(&folder, 1, bits, float, &TONE), Channel::Mono).unwrap();
        assert_eq!(read.sample_rate_hz(), 48_000);
        for (found, wanted) in read.samples().iter().zip(TONE) {
            assert!((found - wanted).abs() <= step, "{bits} bits: {found} != {wanted}");
        }
    }
}

#[test]
fn what_is_written_comes_back() {
    let folder = TempDir::new().unwrap();
    for (format, step) in [
        (SampleFormat::Int16, 2f32.powi(-16)),
        (SampleFormat::Int24, 2f32.powi(-24)),
        (SampleFormat::Float32, 0.0),
    ] {
        let path = folder.path().join("tone.wav");
        write_wav(&path, &TONE, 22_050, format).unwrap();
        let read = read_audio(&path, Channel::Mono).unwrap();
        assert_eq!((read.samples().len(), read.sample_rate_hz()), (TONE.len(), 22_050));
        for (found, wanted) in read.samples().iter().zip(TONE) {
            assert!((found - wanted).abs() <= step, "{format:?}: {found} != {wanted}");
        }
    }
    let full = folder.path().join("full.wav");
    write_wav(&full, &[1.0, -1.0], 8000, SampleFormat::Int16).unwrap();
    assert_eq!(read_audio(&full, Channel::Mono).unwrap().samples(), [32_767.0 / 32_768.0, -1.0]);
}

#[test]
fn channels_are_chosen_never_guessed() {
    let folder = TempDir::new().unwrap();
    let path = wav(&folder, 2, 16, false, &[0.5, 0.25, -0.5, 0.75]);
    refused(&path, Channel::Mono, |e| matches!(e, Error::ManyChannels { channels: 2, .. }));
    refused(&path, Channel::Index(2), |e| matches!(e, Error::Index { index: 2, count: 2, .. }));
    assert_eq!(read_audio(&path, Channel::Index(1)).unwrap().samples(), [0.25, 0.75]);
    assert_eq!(read_audio(&path, Channel::Mean).unwrap().samples(), [0.375, 0.125]);
    assert_eq!(probe_audio(&path).unwrap().frames, 2);
}

#[test]
fn bad_files_are_refused_by_name() {
    let folder = TempDir::new().unwrap();
    refused(&folder.path().join("missing.wav"), Channel::Mono, |e| matches!(e, Error::Io { .. }));
    refused(folder.path(), Channel::Mono, |e| matches!(e, Error::NotAFile { found: "a directory", .. }));
    refused(&put(&folder, "empty.wav", b""), Channel::Mono, |e| matches!(e, Error::Empty { .. }));
    let bare_header = put(&folder, "header.wav", b"RIFF\x04\0\0\0WAVE");
    refused(&bare_header, Channel::Mono, |e| matches!(e, Error::AudioFormat { .. }));
    let nan = wav(&folder, 1, 32, true, &[0.0, f32::NAN]);
    refused(&nan, Channel::Mono, |e| matches!(e, Error::NotFinite { index: 1, .. }));
    let silent = wav(&folder, 2, 16, false, &[]);
    refused(&silent, Channel::Mean, |e| matches!(e, Error::Empty { .. }));
    let mut slow = std::fs::read(wav(&folder, 1, 16, false, &TONE)).unwrap();
    slow[24..28].copy_from_slice(&10u32.to_le_bytes());
    slow[28..32].copy_from_slice(&20u32.to_le_bytes());
    refused(&put(&folder, "slow.wav", &slow), Channel::Mono, |e| {
        matches!(e, Error::OutOfRange(OutOfRange { value: 10.0, .. }))
    });
}

/// Speech as LibriSpeech publishes it, and what is left of it when it is cut.
#[cfg(feature = "symphonia")]
#[test]
fn flac_is_read_whole_or_refused() {
    let speech = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/speech/librispeech/train-clean-100"
    ));
    let Ok(entries) = std::fs::read_dir(speech) else {
        eprintln!("skipped: {} is absent", speech.display());
        return;
    };
    let folder = TempDir::new().unwrap();
    let flac = |path: &PathBuf| path.extension().is_some_and(|e| e == "flac");
    let paths: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).filter(flac).take(3).collect();
    assert!(!paths.is_empty());
    for path in paths {
        let signal = read_audio(&path, Channel::Mono).unwrap();
        assert_eq!(signal.sample_rate_hz(), 16_000);
        assert!(signal.duration_s() > 1.0 && signal.peak() > 0.01 && signal.peak() <= 1.0);
        let bytes = std::fs::read(&path).unwrap();
        for share in [0, 10, 50, 90, 99] {
            let cut = put(&folder, "cut.flac", &bytes[..bytes.len() * share / 100]);
            refused(&cut, Channel::Mono, |e| matches!(e, Error::AudioFormat { .. } | Error::Empty { .. }));
        }
    }
}

#[test]
fn a_header_that_promises_too_much_is_refused_before_memory_is_asked_for() {
    let folder = TempDir::new().unwrap();
    let mut bytes = std::fs::read(wav(&folder, 1, 16, false, &TONE)).unwrap();
    let data = bytes.windows(4).position(|w| w == b"data").unwrap();
    bytes[data + 4..data + 8].copy_from_slice(&0xFFFF_FFFEu32.to_le_bytes());
    let path = put(&folder, "greedy.wav", &bytes);
    refused(&path, Channel::Mono, |e| matches!(e, Error::Truncated { promised_bytes: 0xFFFF_FFFE, .. }));
    let whole = std::fs::read(wav(&folder, 1, 16, false, &TONE)).unwrap();
    for length in 13..whole.len() {
        let path = put(&folder, "cut.wav", &whole[..length]);
        refused(&path, Channel::Mono, |e| matches!(e, Error::Truncated { .. } | Error::AudioFormat { .. }));
    }
}

#[test]
fn what_cannot_be_written_leaves_nothing() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("out.wav");
    for (samples, rate) in
        [(&[][..], 48_000), (&[f32::NAN][..], 48_000), (&[1.5][..], 48_000), (&[0.0][..], 0)]
    {
        let error = write_wav(&path, samples, rate, SampleFormat::Int16).unwrap_err();
        assert!(matches!(&error, Error::InFile { path: named, .. } if *named == path), "{error}");
    }
    let nowhere = folder.path().join("missing").join("out.wav");
    assert!(
        matches!(write_wav(&nowhere, &TONE, 48_000, SampleFormat::Int16), Err(Error::Io { path, .. }) if path == nowhere)
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    /// Whatever the bytes of a header, there is a signal or an error, and no panic.
    #[test]
    fn spoilt_headers_never_panic(changes in prop::collection::vec((0usize..68, any::<u8>()), 1..6), extensible: bool) {
        let folder = TempDir::new().unwrap();
        let (bits, float) = if extensible { (24, false) } else { (32, true) };
        let mut bytes = std::fs::read(wav(&folder, 1, bits, float, &TONE)).unwrap();
        for (at, value) in changes {
            if let Some(byte) = bytes.get_mut(at) {
                *byte = value;
            }
        }
        let path = put(&folder, "spoilt.wav", &bytes);
        if let Ok(signal) = read_audio(&path, Channel::Mean) {
            prop_assert!(signal.samples().len() <= bytes.len());
        }
    }
}
