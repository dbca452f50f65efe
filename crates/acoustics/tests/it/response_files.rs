//! Which files are impulse responses: those of the fixtures and of published measurements are, speech is not.

use sabine_acoustics::{Channel, Error, SampleFormat, WavWriter, read_response};
use std::path::{Path, PathBuf};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn wav_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            wav_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("wav")) {
            found.push(path);
        }
    }
}

fn files_below(folder: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    wav_files(&Path::new(ROOT).join(folder), &mut found);
    found.sort();
    assert!(!found.is_empty(), "{folder}");
    found
}

fn refused(error: &Error) -> bool {
    matches!(error, Error::InFile { source, .. } if matches!(**source, Error::NotAResponse { .. }))
}

fn is_speech(path: &Path) {
    match read_response(path, Channel::Index(0)) {
        Err(error) if refused(&error) => {
            assert!(error.to_string().contains("sabine estimate"), "{error}");
        }
        other => panic!("{}: {:?}", path.display(), other.map(|found| found.bursts_s)),
    }
}

#[test]
fn fixtures_are_told_apart() {
    files_below("fixtures/speech").iter().for_each(|path| is_speech(path));
    for path in files_below("fixtures/room") {
        assert_eq!(read_response(&path, Channel::Mono).unwrap().bursts_s.len(), 1, "{}", path.display());
    }
}

/// 24 sentences, and more than 200 responses of living rooms, studios, churches and a cathedral.
#[test]
fn published_measurements_are_told_apart() {
    if !Path::new(ROOT).join("../shared/data").exists() {
        eprintln!("skipped: ../shared/data is absent");
        return;
    }
    files_below("../shared/data/speech/vctk").iter().for_each(|path| is_speech(path));
    let mut several = 0;
    for folder in ["rir", "rir_more"] {
        for path in files_below(&format!("../shared/data/{folder}")) {
            match read_response(&path, Channel::Index(0)) {
                Ok(found) => several += usize::from(found.bursts_s.len() > 1),
                Err(error) if refused(&error) => panic!("{error}"),
                Err(error) => eprintln!("left out: {error}"),
            }
        }
    }
    assert!(several <= 2, "{several} responses seem to hold several");
}

/// Noise bursts in three minutes of faint noise: what is kept is bounded, wherever the response is.
#[test]
fn a_response_is_found_in_a_long_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.wav");
    let write = |onsets_s: &[usize]| {
        let (mut state, mut writer) =
            (1_u32, WavWriter::create(&path, 1, 8000, SampleFormat::Float32).unwrap());
        for second in 0..180_usize {
            let block: Vec<f32> = (0..8000)
                .map(|i| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let white = (state >> 8) as f32 / 8_388_608.0 - 1.0;
                    let is_on = onsets_s.contains(&second);
                    white * (1e-3 + if is_on { (-6.9 * i as f32 / 4000.0).exp() } else { 0.0 })
                })
                .collect();
            writer.write(&block).unwrap();
        }
        writer.finish().unwrap();
        read_response(&path, Channel::Mono)
    };
    let found = write(&[150]).unwrap();
    assert!((found.bursts_s[0] - 150.0).abs() < 0.05, "{:?}", found.bursts_s);
    assert!(found.start_s > 148.5 && found.start_s < 149.1, "{}", found.start_s);
    assert_eq!(found.file_duration_s, 180.0);
    let early = write(&[2]).unwrap();
    assert_eq!(early.response.duration_s(), 60.0);
    assert_eq!(write(&[2, 20]).unwrap().bursts_s.len(), 2);
    assert!(refused(&write(&[2, 20, 40, 60]).unwrap_err()));
}
