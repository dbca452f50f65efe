//! A room measured with the command: a sweep written, "played" through a known chain, deconvolved, measured.

use crate::sabine;
use sabine::acoustics::{Channel, SampleFormat, read_audio, write_wav_channels};
use serde_json::Value;
use std::path::Path;
use std::process::Output;
use tempfile::TempDir;

const RATE: u32 = 32_000;

fn run(folder: &Path, job: &str, arguments: &[&str]) -> Output {
    sabine(job).args(arguments).current_dir(folder).output().unwrap()
}

fn printed(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn refused(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Three sweeps of a second, played.
fn sweep(folder: &Path) -> Vec<f32> {
    let arguments =
        "--from 50 --to 15900 --duration 1 --silence 0.6 --repetitions 3 --rate 32000 --out sweep.wav";
    printed(&run(folder, "sweep", &arguments.split(' ').collect::<Vec<_>>()));
    let signal = read_audio(folder.join("sweep.wav"), Channel::Mono).unwrap();
    assert_eq!((signal.samples().len(), signal.sample_rate_hz()), (3 * 51_200, RATE));
    signal.into_samples()
}

/// Copies of a sound, each with a delay in samples and an amplitude.
fn copies(sound: &[f32], copies: &[(usize, f32)]) -> Vec<f32> {
    let mut sum = vec![0.0; sound.len() + 12_800];
    for (delay, amplitude) in copies {
        for (y, x) in sum[*delay..].iter_mut().zip(sound) {
            *y += amplitude * x;
        }
    }
    sum
}

fn write(folder: &Path, name: &str, channels: &[&[f32]]) {
    write_wav_channels(folder.join(name), channels, RATE, SampleFormat::Float32).unwrap();
}

#[test]
fn a_sweep_becomes_a_response_that_is_measured() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let played = sweep(folder);
    // Two ears: the right one hears the direct sound later, and a reflection with the other sign.
    let left = copies(&played, &[(3200, 0.5), (4800, 0.2)]);
    let right = copies(&played, &[(3210, 0.5), (4800, -0.2)]);
    write(folder, "recording.wav", &[&left, &right]);
    let text = printed(&run(
        folder,
        "deconvolve",
        &["recording.wav", "--sweep", "sweep.json", "--out", "response.wav"],
    ));
    assert!(text.contains("2 channels") && text.contains("direct sound arrives 0."), "{text}");
    let response = read_audio(folder.join("response.wav"), Channel::Index(0)).unwrap();
    let peak = (0..response.samples().len())
        .max_by(|&a, &b| response.samples()[a].total_cmp(&response.samples()[b]));
    assert_eq!(peak, Some(3200));
    let text = printed(&run(
        folder,
        "measure",
        &["response.wav", "--binaural", "--sti", "--snr", "15", "--json", "result.json", "--from", "500"],
    ));
    assert!(
        text.contains("iacc_early") && text.contains("STI 0.") && text.contains("single numbers"),
        "{text}"
    );
    let result: Value = serde_json::from_slice(&std::fs::read(folder.join("result.json")).unwrap()).unwrap();
    // Direct sound equal but for 10 samples, the reflection opposite: (0.25 - 0.04 c) / 0.29 with |c| up to 1.
    let iacc = result[0]["iacc_early"][2].as_f64().unwrap();
    assert!((0.72..=1.0).contains(&iacc), "{iacc}");
    // m = |0.25 + 0.04 exp(-2 pi i F 0.05 s)| / 0.29 / (1 + 10^-1.5) in every octave.
    let sti = result[0]["sti"]["value"].as_f64().unwrap();
    assert!((sti - 0.8332).abs() < 0.01, "{sti}");
}

#[test]
fn the_strength_and_lateral_energy_of_known_sounds() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let pulses = |list: &[(usize, f32)]| {
        let mut samples = vec![0.0; 32_000];
        list.iter().for_each(|(at, amplitude)| samples[*at] = *amplitude);
        samples
    };
    write(folder, "room.wav", &[&pulses(&[(3200, 0.4), (4480, 0.2)])]);
    write(folder, "side.wav", &[&pulses(&[(4480, 0.2)])]);
    write(folder, "free.wav", &[&pulses(&[(3200, 0.5)])]);
    let arguments =
        "room.wav --lateral side.wav --reference free.wav --reference-distance 2 --json r.json --from 500";
    printed(&run(folder, "measure", &arguments.split(' ').collect::<Vec<_>>()));
    let result: Value = serde_json::from_slice(&std::fs::read(folder.join("r.json")).unwrap()).unwrap();
    // At 10 m 0.1: 10 lg(0.2 / 0.01), and 0.04 of 0.2.
    let at_1_khz = |name: &str| result[0][name][1].as_f64().unwrap();
    assert!((at_1_khz("g_db") - 13.01).abs() < 0.1, "{}", at_1_khz("g_db"));
    assert!((at_1_khz("j_lf") - 0.2).abs() < 0.01, "{}", at_1_khz("j_lf"));
    assert!((result[0]["single_numbers"]["g_mid_db"].as_f64().unwrap() - 13.01).abs() < 0.1);
    let several = run(folder, "measure", &["room.wav", "free.wav", "--lateral", "side.wav"]);
    assert!(refused(&several).contains("--lateral"));
}

#[test]
fn recordings_that_are_no_measurement_are_refused_and_leave_nothing() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let played = sweep(folder);
    let good = copies(&played, &[(3200, 0.5)]);
    let clipped: Vec<f32> = good.iter().map(|x| (6.0 * x).clamp(-1.0, 1.0)).collect();
    write(folder, "clipped.wav", &[&clipped]);
    write(folder, "short.wav", &[&good[..100_000]]);
    write(folder, "backwards.wav", &[&good.iter().rev().copied().collect::<Vec<_>>()]);
    write(folder, "silent.wav", &[&vec![0.0; good.len()]]);
    std::fs::write(folder.join("broken.json"), "{\"peak\": 2").unwrap();
    let text = std::fs::read_to_string(folder.join("sweep.json")).unwrap();
    std::fs::write(folder.join("range.json"), text.replace("15900.0", "99.0")).unwrap();
    for (recording, settings, said) in [
        ("clipped.wav", "sweep.json", "clipped"),
        ("short.wav", "sweep.json", "lasts 3.12 s"),
        ("backwards.wav", "sweep.json", "backwards.wav"),
        ("silent.wav", "sweep.json", "silent"),
        ("nothing.wav", "sweep.json", "nothing.wav"),
        ("clipped.wav", "broken.json", "broken.json"),
        ("clipped.wav", "range.json", "to_hz"),
        ("clipped.wav", "clipped.wav", "no settings"),
    ] {
        let output = run(folder, "deconvolve", &[recording, "--sweep", settings, "--out", "response.wav"]);
        let error = refused(&output);
        assert!(error.contains(said) && error.lines().count() == 1, "{recording}: {error}");
        assert!(!folder.join("response.wav").exists());
    }
    let output = run(folder, "sweep", &["--to", "30000", "--out", "other.wav"]);
    assert!(refused(&output).contains("to_hz"));
    assert!(!folder.join("other.wav").exists() && !folder.join("other.json").exists());
}
