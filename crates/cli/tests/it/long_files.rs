//! Recordings of any length: the report holds an excerpt, memory is bounded, and the level is stated.

use crate::sabine;
use sabine::acoustics::{Channel, SampleFormat, WavWriter, probe_audio, read_audio};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Output;

/// The dry voice of the demo again and again, at half the level in the first half.
fn long_voice(folder: &Path, seconds: usize) -> PathBuf {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/speech");
    let voice = read_audio(fixtures.join("dry_guest.wav"), Channel::Mono).unwrap();
    let (path, rate) = (folder.join("long.wav"), voice.sample_rate_hz());
    let mut writer = WavWriter::create(&path, 1, rate, SampleFormat::Int16).unwrap();
    let mut sound = voice.samples().iter().cycle();
    for second in 0..seconds {
        let gain = if second < seconds / 2 { 0.5 } else { 1.0 };
        let block: Vec<f32> = sound.by_ref().take(rate as usize).map(|s| gain * s).collect();
        writer.write(&block).unwrap();
    }
    writer.finish().unwrap();
    path
}

fn says(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr].concat();
    String::from_utf8_lossy(&text).into_owned()
}

#[test]
fn a_long_dry_sound_is_rendered_whole_and_shown_in_part() {
    let folder = tempfile::tempdir().unwrap();
    let (dry, out) = (long_voice(folder.path(), 90), folder.path().join("out"));
    let output =
        sabine("match").args(["--rays", "1000", "--dry"]).arg(&dry).arg("--out").arg(&out).output().unwrap();
    assert!(output.status.success(), "{}", says(&output));
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    // Four sounds of 20 s, 1.2 MB each, and the charts.
    assert!(page.len() < 6_000_000, "{} bytes", page.len());
    assert!(
        page.contains("its loudest 20.0 s, from ")
            && page.contains("<a href=\"matched.wav\">matched.wav</a>")
    );
    let json: Value = serde_json::from_slice(&std::fs::read(out.join("match.json")).unwrap()).unwrap();
    let gain_db = json["matched_gain_db"].as_f64().unwrap();
    assert!(gain_db <= 0.0, "{gain_db}");
    let level = if gain_db < 0.0 { "turned down by" } else { "it was not scaled" };
    assert!(page.contains(level) && says(&output).contains(level));
    let written = probe_audio(out.join("matched.wav")).unwrap();
    let seconds = written.frames as f64 / f64::from(written.sample_rate_hz);
    assert!(seconds > 90.0 && seconds < 97.0, "{seconds}");
}

/// 40 minutes in an address space that would not hold them several times over.
#[cfg(unix)]
#[test]
fn memory_does_not_grow_with_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = long_voice(folder.path(), 2400);
    let limited = |command: &str| {
        let script = format!("ulimit -v 400000; exec \"$0\" {command}");
        std::process::Command::new("sh")
            .args(["-c", &script, env!("CARGO_BIN_EXE_sabine")])
            .arg(&path)
            .env("RAYON_NUM_THREADS", "2")
            .output()
            .unwrap()
    };
    let heard = limited("estimate \"$1\"");
    assert!(heard.status.success(), "{}", says(&heard));
    let measured = limited("measure \"$1\"");
    assert!(!measured.status.success());
    let message = says(&measured);
    assert!(message.contains("no impulse response") && message.contains("sabine estimate"), "{message}");
}

#[test]
fn a_finished_model_is_not_replaced_by_accident() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("model.safetensors");
    std::fs::write(&model, b"hours of work").unwrap();
    let output = sabine("train").args(["--data", "nowhere", "--out"]).arg(folder.path()).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let message = says(&output);
    assert!(
        message.contains("model.safetensors is there already") && message.contains("--overwrite"),
        "{message}"
    );
    assert_eq!(std::fs::read(&model).unwrap(), b"hours of work");
}
