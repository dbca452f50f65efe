//! A stream matched as a user runs it: what it prints, what it writes, and that haste changes nothing.

use crate::sabine;
use sabine::acoustics::{
    Bands, Channel, ImpulseResponse, RoomParameters, SampleFormat, equalisation, read_audio, write_wav,
};
use sabine::estimator::Estimator;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::{Duration, Instant};

fn run(arguments: &[&str], threads: &str) -> Output {
    sabine("live").env("RAYON_NUM_THREADS", threads).args(arguments).output().unwrap()
}

fn fixture(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(path)
}

/// The line that begins so, and the numbers in it.
fn numbers(printed: &str, start: &str) -> Vec<f64> {
    let line = printed.lines().find(|line| line.trim_start().starts_with(start));
    let line = line.unwrap_or_else(|| panic!("no line begins with \"{start}\": {printed}"));
    let rest = &line[line.find(start).unwrap() + start.len()..];
    rest.split(|c: char| !c.is_ascii_digit() && c != '.' && c != '-').filter_map(|w| w.parse().ok()).collect()
}

#[test]
fn the_fixture_is_matched_while_it_is_heard() {
    let folder = tempfile::tempdir().unwrap();
    let (out, heard) = (folder.path().join("matched.wav"), folder.path().join("heard.wav"));
    let output = run(&["--fast", "--out", out.to_str().unwrap(), "--heard", heard.to_str().unwrap()], "2");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).unwrap();

    // Estimates as windows fill, each refit or settled.
    let recording = read_audio(fixture("speech/recording.wav"), Channel::Mono).unwrap();
    for at in ["4.0 s", "6.0 s", "8.0 s"] {
        assert_eq!(numbers(&printed, at).len(), 7 + 7, "{at}: {printed}");
    }
    let decisions = printed.matches("refitted in").count() + printed.matches("settled").count();
    assert_eq!(decisions, 3, "{printed}");
    assert!(printed.contains("first estimate after 4.0 s"), "{printed}");
    let blocks = numbers(&printed, "8.0 s of speech in");
    assert_eq!(blocks[0], (recording.duration_s() / 0.02).ceil());
    // Blocks are short work; what a refit takes depends on the machine.
    let block_ms = numbers(&printed, "block:");
    assert!(block_ms[0] < 5.0, "{printed}");
    assert!(numbers(&printed, "real-time factor:")[0] > 0.0);

    // The last line of estimates is what the estimator says of the whole recording.
    let heard_s = numbers(&printed, "T60 heard");
    let whole = Estimator::pretrained().unwrap().estimate_detailed(&recording).unwrap().targets;
    for (printed, value) in heard_s.iter().zip(whole.t60_s().values()) {
        assert!((printed - value.value).abs() < 0.006, "{heard_s:?} and {:?}", whole.t60_s());
    }
    // The fit meets it within one just-noticeable difference (ISO 3382-1, Annex A).
    let reached_s = numbers(&printed, "T60 reached");
    for (reached, heard) in reached_s.iter().zip(&heard_s) {
        assert!((reached / heard - 1.0).abs() < 0.05, "{reached_s:?} s for {heard_s:?} s");
    }

    // What is written sounds like what was heard and like the room as it is.
    let matched: ImpulseResponse = read_audio(&out, Channel::Mono).unwrap().into();
    let t30_s = RoomParameters::measure(&matched, Bands::T60).unwrap().t30_s;
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(fixture("truth.json")).unwrap()).unwrap();
    let truth_s = |hz: f64| {
        let place = truth["bands_hz"].as_array().unwrap().iter().position(|b| b == hz).unwrap();
        truth["t60_s"][place].as_f64().unwrap()
    };
    for (hz, t30) in t30_s.iter().filter(|(hz, _)| (250.0..=4000.0).contains(hz)) {
        let t30 = t30.as_ref().unwrap().value;
        assert!((t30 / truth_s(hz) - 1.0).abs() < 0.15, "{hz} Hz: {t30} s for {} s", truth_s(hz));
    }
    let eq_db = equalisation(&matched, Bands::EQ).unwrap();
    for ((hz, eq), target) in eq_db.iter().zip(whole.eq_db().values()) {
        let eq = eq.as_ref().unwrap().value;
        assert!((eq - target.value).abs() < 1.0, "{hz} Hz: {eq} dB for {} dB", target.value);
    }
    // The room was heard from the first block on, for as long as the speech came in whole blocks.
    let sound = read_audio(&heard, Channel::Mono).unwrap();
    assert_eq!(sound.samples().len(), blocks[0] as usize * 960);
    assert!(sound.samples().chunks(48_000).all(|second| second.iter().any(|s| s.abs() > 1e-4)));
}

/// In real time refits run beside the stream and come when they come; the end is the same.
#[test]
fn real_time_and_haste_and_threads_end_alike() {
    let folder = tempfile::tempdir().unwrap();
    let recording = read_audio(fixture("speech/recording.wav"), Channel::Mono).unwrap();
    let speech = folder.path().join("speech.wav");
    let rate = recording.sample_rate_hz();
    write_wav(&speech, &recording.samples()[..5 * rate as usize], rate, SampleFormat::Int16).unwrap();
    let matched = |name: &str, options: &[&str], threads: &str| {
        let out = folder.path().join(name);
        let arguments =
            ["--speech", speech.to_str().unwrap(), "--rays", "2000", "--out", out.to_str().unwrap()];
        let output = run(&[&arguments, options].concat(), threads);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        (std::fs::read(out).unwrap(), String::from_utf8(output.stdout).unwrap())
    };
    let (hasty, _) = matched("hasty.wav", &["--fast"], "1");
    assert!(hasty == matched("threads.wav", &["--fast"], "3").0, "threads change the response");
    assert!(
        hasty == matched("blocks.wav", &["--fast", "--block-ms", "7"], "2").0,
        "blocks change the response"
    );
    let start = Instant::now();
    let (patient, printed) = matched("patient.wav", &[], "2");
    assert!(start.elapsed() >= Duration::from_secs(5), "5 s of speech in {:?}", start.elapsed());
    assert!(hasty == patient, "haste changes the response");
    assert!(numbers(&printed, "streamed in")[0] >= 5.0, "{printed}");
}

#[test]
fn bad_input_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("matched.wav");
    let refuses = |arguments: &[&str], named: &str| {
        let output = run(&[arguments, &["--fast", "--out", out.to_str().unwrap()]].concat(), "2");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && message.contains(named), "{arguments:?}: {message}");
        assert!(!message.contains("panicked") && !out.exists(), "{message}");
    };
    let wav = |name: &str, samples: Vec<f32>| {
        let path = folder.path().join(name);
        write_wav(&path, &samples, 16_000, SampleFormat::Int16).unwrap();
        path.to_str().unwrap().to_owned()
    };
    refuses(&["--speech", &wav("short.wav", vec![0.1; 8000])], "short.wav");
    refuses(&["--speech", &wav("silent.wav", vec![0.0; 80_000])], "silent.wav");
    refuses(&["--dry", &wav("quiet.wav", vec![0.0; 80_000])], "quiet.wav");
    refuses(&["--speech", folder.path().join("absent.wav").to_str().unwrap()], "absent.wav");
    refuses(&["--source", "nobody"], "nobody");
    refuses(&["--block-ms", "0"], "block-ms");
    refuses(&["--room", folder.path().to_str().unwrap()], "room.toml");
}
