//! The main job as a user runs it: what it writes, and what it says of bad input.

use crate::sabine;
use sabine::acoustics::{Channel, ImpulseResponse, read_audio};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    sabine("match").args(arguments).output().unwrap()
}

fn fixture(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(path)
}

/// A run must fail with exit code 1, name what is wrong, and leave the output folder as it was.
fn refuses(arguments: &[&str], out: &Path, named: &[&str]) {
    let output = run(&[arguments, &["--out", out.to_str().unwrap()]].concat());
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
    for part in named {
        assert!(message.contains(part), "{arguments:?}: \"{part}\" is not in: {message}");
    }
    assert!(!message.contains("panicked"), "{message}");
    assert!(!out.exists(), "{arguments:?} left {}", out.display());
}

fn wav(folder: &Path, name: &str, samples: impl IntoIterator<Item = f32>) -> String {
    let path = folder.join(name);
    let samples: Vec<f32> = samples.into_iter().collect();
    let signal = sabine::acoustics::Signal::new(samples, 16_000).unwrap();
    let bytes = sabine::acoustics::encode_wav(&signal, sabine::acoustics::SampleFormat::Int16).unwrap();
    std::fs::write(&path, bytes).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn the_fixture_is_matched_within_ten_percent_of_every_target() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = run(&["--out", out.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut names: Vec<String> =
        std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let expected = [
        "eq_filter.wav",
        "impulse_response.wav",
        "match.json",
        "matched.wav",
        "materials.toml",
        "report.html",
    ];
    assert_eq!(names, expected);

    let json: Value = serde_json::from_slice(&std::fs::read(out.join("match.json")).unwrap()).unwrap();
    let numbers = |key: &str| -> Vec<Option<f64>> {
        json[key].as_array().unwrap_or_else(|| panic!("{key}")).iter().map(Value::as_f64).collect()
    };
    assert_eq!(numbers("bands_hz").len(), 7);
    assert_eq!(numbers("eq_bands_hz").len(), 6);
    for key in ["t60_target_s", "t60_target_sd_s", "t60_reached_s"] {
        assert_eq!(numbers(key).len(), 7, "{key}");
    }
    let ends = numbers("t60_target_low_s").into_iter().zip(numbers("t60_target_high_s"));
    for (target, (low, high)) in numbers("t60_target_s").into_iter().zip(ends) {
        let (target, low, high) = (target.unwrap(), low.unwrap(), high.unwrap());
        assert!(low > 0.0 && low < target && target < high, "{low} {target} {high}");
        assert!((low * high / (target * target) - 1.0).abs() < 1e-9, "an interval of the logarithm");
    }
    for key in ["eq_db", "eq_sd_db"] {
        assert!(numbers(key).iter().all(Option::is_some), "{key}");
        assert_eq!(numbers(key).len(), 6, "{key}");
    }
    assert_eq!(json["materials"].as_object().unwrap().len(), 8);
    for stage in ["estimate", "trace", "fit", "render", "filter"] {
        assert!(json["seconds"][stage].as_f64().unwrap() > 0.0, "{stage}");
    }
    let unreachable: Vec<f64> =
        json["unreachable"].as_array().unwrap().iter().map(|u| u["band_hz"].as_f64().unwrap()).collect();
    for ((hz, target), reached) in
        numbers("bands_hz").iter().zip(numbers("t60_target_s")).zip(numbers("t60_reached_s"))
    {
        let (hz, target) = (hz.unwrap(), target.unwrap());
        if hz <= 4000.0 && !unreachable.contains(&hz) {
            let miss = reached.unwrap() / target - 1.0;
            assert!(miss.abs() < 0.10, "{hz} Hz: {reached:?} s for {target} s");
        }
    }
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(
        page.contains("<svg class=\"chart\"")
            && page.contains("data:audio/wav")
            && page.contains("data:image/png")
    );
    for outside in ["src=\"http", "href=\"http", "<script", "<link", "url("] {
        assert!(!page.contains(outside), "the page must not need a network: {outside}");
    }
    // What was written can be read again as tables of a room.
    let tables: toml::Table = std::fs::read_to_string(out.join("materials.toml")).unwrap().parse().unwrap();
    assert_eq!(tables["materials"].as_table().unwrap().len(), 8);
}

#[test]
fn waves_take_the_low_end_and_leave_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let heard = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let output = run(&[&["--rays", "4000", "--out", out.to_str().unwrap()], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let json: Value = serde_json::from_slice(&std::fs::read(out.join("match.json")).unwrap()).unwrap();
        let audio = read_audio(out.join("impulse_response.wav"), Channel::Mono).unwrap();
        (json, ImpulseResponse::from(audio))
    };
    let (plain, paths) = heard("paths", &[]);
    let (json, joined) = heard("waves", &["--wave-below", "100"]);
    assert!(plain["waves"].is_null());
    let number = |key: &str| json["waves"][key].as_f64().unwrap();
    assert!(number("below_hz") == 100.0 && number("voxels") > 1000.0, "{}", json["waves"]);
    assert!(number("level_difference_db").abs() < 8.0 && number("gain_db").abs() < 6.1, "{}", json["waves"]);
    assert!(json["seconds"]["waves"].as_f64().unwrap() > 0.0);
    // The fit is to the paths, so the same materials are found.
    assert_eq!(plain["materials"], json["materials"]);
    let energy = |response: &ImpulseResponse, hz: f64| {
        let rate = f64::from(response.sample_rate_hz());
        let turn = |i: usize| std::f64::consts::TAU * hz * i as f64 / rate;
        let sum = response.samples().iter().enumerate().fold((0.0, 0.0), |(re, im), (i, &s)| {
            (re + f64::from(s) * turn(i).cos(), im + f64::from(s) * turn(i).sin())
        });
        sum.0 * sum.0 + sum.1 * sum.1
    };
    let off_db = |from_hz: f64| {
        let at = |i: i32| from_hz + 2.0 * f64::from(i);
        let off = (0..15).map(|i| 10.0 * (energy(&joined, at(i)) / energy(&paths, at(i))).log10().abs());
        off.sum::<f64>() / 15.0
    };
    assert!(off_db(200.0) < 0.2, "{} dB above", off_db(200.0));
    // Two fields that have nothing in common but their energy differ by 6 dB on the average.
    assert!(off_db(35.0) > 2.0, "{} dB below", off_db(35.0));

    let out = folder.path().join("refused");
    refuses(&["--wave-below", "-1"], &out, &["crossover_hz"]);
    refuses(&["--wave-below", "3500"], &out, &["would fit"]);
}

#[test]
fn the_same_seed_gives_the_same_sound_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let matched = |threads: &str, seed: &str| {
        let out = folder.path().join(format!("{threads}-{seed}"));
        let output = sabine("match")
            .env("RAYON_NUM_THREADS", threads)
            .args(["--seed", seed, "--rays", "2000", "--out", out.to_str().unwrap()])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read(out.join("matched.wav")).unwrap()
    };
    let one = matched("1", "7");
    assert!(one == matched("3", "7"), "threads change the sound");
    assert!(one != matched("1", "8"), "the seed changes nothing");
}

#[test]
fn recordings_that_cannot_be_judged_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (folder.path(), folder.path().join("out"));
    let tone = |i: usize, gain: f32| (gain * (i as f32 * 0.07).sin()).clamp(-1.0, 1.0);
    let short = wav(path, "short.wav", (0..8000).map(|i| tone(i, 0.5)));
    let silent = wav(path, "silent.wav", (0..40_000).map(|_| 0.0));
    let clipped = wav(path, "clipped.wav", (0..40_000).map(|i| tone(i, 4.0)));
    refuses(&["--speech", &short], &out, &["short.wav", "0.50 s"]);
    refuses(&["--speech", &silent], &out, &["silent.wav", "silent"]);
    refuses(&["--speech", &clipped], &out, &["clipped.wav", "clipped"]);
    refuses(&["--dry", &silent], &out, &["silent.wav", "silent"]);
    refuses(&["--speech", path.join("absent.wav").to_str().unwrap()], &out, &["absent.wav"]);
    let text = path.join("text.wav");
    std::fs::write(&text, "no sound in here").unwrap();
    refuses(&["--speech", text.to_str().unwrap()], &out, &["text.wav"]);
    let empty = path.join("empty.wav");
    std::fs::write(&empty, "").unwrap();
    refuses(&["--speech", empty.to_str().unwrap()], &out, &["empty.wav"]);
}

#[test]
fn faults_of_the_room_name_file_and_field() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    refuses(&["--source", "nobody"], &out, &["room.toml", "sources", "nobody"]);
    refuses(&["--receiver", "nobody"], &out, &["room.toml", "receivers", "nobody"]);
    refuses(&["--room", folder.path().to_str().unwrap()], &out, &["room.toml"]);

    let text = std::fs::read_to_string(fixture("room/room.toml")).unwrap();
    let broken = |name: &str, text: &str| {
        let room = folder.path().join(name);
        std::fs::create_dir(&room).unwrap();
        std::fs::copy(fixture("room/room.obj"), room.join("room.obj")).unwrap();
        let responses = text.find("[[responses]]").unwrap_or(text.len());
        std::fs::write(room.join("room.toml"), &text[..responses]).unwrap();
        room.to_str().unwrap().to_owned()
    };
    let outside =
        broken("outside", &text.replacen("position_m = [", "position_m = [100.0, 0.0, 1.0] # [", 1));
    refuses(&["--room", &outside], &out, &["outside"]);
    let unknown = broken("unknown", &format!("colour = \"blue\"\n{text}"));
    refuses(&["--room", &unknown], &out, &["room.toml", "colour"]);
    let black = broken("black", &text.replacen("absorption = [", "absorption = [1.5, ", 1));
    refuses(&["--room", &black], &out, &["room.toml", "absorption"]);
}

#[test]
fn a_place_that_cannot_be_written_to_is_named_before_anything_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let output = run(&["--out", file.join("out").to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("file"));
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "in the way");
}

/// A limit on the size of files makes writing fail half-way, as a full disk does.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let script = "trap '' XFSZ; ulimit -f 100; exec \"$0\" \"$1\" --out \"$2\" --speech \"$3/speech/recording.wav\" --dry \"$3/speech/dry_guest.wav\" --room \"$3/room\"";
    let output = Command::new("sh")
        .args(["-c", script])
        .args([env!("CARGO_BIN_EXE_sabine"), "match"])
        .arg(&out)
        .arg(fixture(""))
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("out") && message.contains(".wav"), "{message}");
    assert!(!out.exists(), "something was left in {}", out.display());
}
