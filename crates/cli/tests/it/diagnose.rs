//! `diagnose` as a user runs it: what it writes, that others render from it, and what it says of bad input.

use crate::sabine;
use sabine::acoustics::{Bands, Channel, FilterBank, read_audio};
use sabine::diagnose::{ExtendedModel, catalogue};
use sabine_testkit::{Hidden, LabConfig, Laboratory};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

fn run(name: &str, arguments: &[&str]) -> Output {
    sabine(name).args(arguments).output().unwrap()
}

fn succeeds(name: &str, arguments: &[&str]) -> String {
    let output = run(name, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A run must fail with exit code 1, name what is wrong, and leave the output folder as it was.
fn refuses(arguments: &[&str], out: &Path, named: &str) {
    let output = run("diagnose", &[arguments, &["--out", out.to_str().unwrap()]].concat());
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
    assert!(message.contains(named), "{arguments:?}: \"{named}\" is not in: {message}");
    assert!(!message.contains("panicked"), "{message}");
    assert!(!out.exists(), "{arguments:?} left {}", out.display());
}

fn is_between(value: &Value, low: f64, high: f64) -> bool {
    value.as_f64().is_some_and(|v| (low..=high).contains(&v))
}

fn is_base64(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || "+/=".contains(letter)
}

/// The contract of `diagnosis.json`, which holds for any verdict.
fn checked(out: &Path) -> Value {
    let mut names: Vec<String> =
        std::fs::read_dir(out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(
        names,
        ["diagnosis.json", "extended_mesh.glb", "extended_mesh.obj", "extended_model.toml", "report.html"]
    );
    let json: Value = serde_json::from_slice(&std::fs::read(out.join("diagnosis.json")).unwrap()).unwrap();
    let verdict = json["verdict"].as_str().unwrap();
    assert!(
        ["adequate", "explained", "incomplete", "unconfirmed", "ambiguous", "unexplained"].contains(&verdict)
    );
    assert!(is_between(&json["lack_of_fit"]["p_value"], 0.0, 1.0));
    let catalogue = catalogue();
    let known = |id: &Value| catalogue.iter().any(|e| id.as_str() == Some(&*e.id()));
    for cause in json["causes"].as_array().unwrap() {
        assert!(known(&cause["effect"]) && is_between(&cause["probability"], 0.0, 1.0));
        for parameter in cause["parameters"].as_object().unwrap().values() {
            assert!(parameter["low"].as_f64() <= parameter["value"].as_f64());
            assert!(parameter["value"].as_f64() <= parameter["high"].as_f64());
            assert!(parameter["unit"].is_string());
        }
        if let Some(gain) = cause["held_out_gain"].as_object() {
            for key in ["nats_per_bin", "db_rmse_before", "db_rmse_after", "low", "high"] {
                assert!(gain[key].is_f64(), "{key}");
            }
        }
    }
    assert!(json["alternatives"].as_array().unwrap().iter().all(known));
    assert!(json["would_decide"].as_array().unwrap().iter().all(Value::is_string));
    assert!(json["candidates"].as_array().unwrap().iter().all(|c| known(&c["effect"])));
    for pair in json["isolability"].as_array().unwrap() {
        assert!(is_between(&pair["cosine"], 0.0, 1.0 + 1e-9));
    }
    assert!(!json["materials"].as_object().unwrap().is_empty() && json.get("held_out").is_some());
    if verdict == "explained" {
        assert!(!json["causes"].as_array().unwrap().is_empty());
    }
    if verdict == "ambiguous" {
        assert!(json["alternatives"].as_array().unwrap().len() > 1);
        assert!(!json["would_decide"].as_array().unwrap().is_empty());
    }

    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    for part in [
        format!("class=\"verdict {verdict}\"").as_str(),
        "<h2>Where it is wrong</h2>",
        "<h2>What speaks for each cause</h2>",
        if json["causes"].as_array().unwrap().is_empty() {
            "<h2>How well new positions are predicted</h2>"
        } else {
            "<h2>What mending it gains</h2>"
        },
        "<h2>Absorption of each material</h2>",
        "<h2>What these positions cannot tell apart</h2>",
        "svg class=\"map\"",
        "svg class=\"chart\"",
        "A smooth correction without a name",
    ] {
        assert!(page.contains(part), "{part}");
    }
    // Letters of sounds and pictures are not text.
    let text: String = page.split("base64,").map(|part| part.trim_start_matches(is_base64)).collect();
    for outside in ["src=\"http", "href=\"http", "<script", "<link", "url(", "NaN", "inf dB"] {
        assert!(!text.contains(outside), "the page must not hold {outside}");
    }
    ExtendedModel::read(out.join("extended_model.toml")).unwrap();
    json
}

#[test]
fn two_responses_say_what_they_can() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let told = succeeds("diagnose", &["--rays", "1500", "--out", out.to_str().unwrap()]);
    let json = checked(&out);
    assert!(told.contains(&format!("verdict: {}", json["verdict"].as_str().unwrap())));
    assert_eq!(json["materials"].as_object().unwrap().len(), 8);
    let model = out.join("extended_model.toml");
    let traced = folder.path().join("traced");
    let options = ["--rays", "2000", "--rate", "16000", "--model"];
    let paths = [model.to_str().unwrap(), "--out", traced.to_str().unwrap()];
    succeeds("trace", &[&options[..], &paths].concat());
    let response = read_audio(traced.join("impulse_response.wav"), Channel::Mono).unwrap();
    assert!(response.peak() > 0.01 && response.samples().iter().all(|s| s.is_finite()));
    let matched = folder.path().join("matched");
    let paths = ["--model", model.to_str().unwrap(), "--out", matched.to_str().unwrap()];
    succeeds("match", &[&["--rays", "4000"], &paths[..]].concat());
    assert!(matched.join("matched.wav").exists());
}

/// Energy by octave of a response, in dB.
fn levels_db(wav: &Path) -> Vec<f64> {
    let sound = read_audio(wav, Channel::Mono).unwrap();
    let bank = FilterBank::new(Bands::T60, sound.sample_rate_hz()).unwrap();
    let energy = |band: &Vec<f32>| band.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>();
    bank.analyse(sound.samples()).values().iter().map(|b| 10.0 * energy(b).log10()).collect()
}

#[test]
fn a_hidden_loudspeaker_response_is_named_and_rendered() {
    let folder = tempfile::tempdir().unwrap();
    let room = folder.path().join("room");
    let gains_db = vec![-4.0, -2.0, 5.0, 0.0, -5.0, -1.0, 4.0];
    let lab = Laboratory::new(LabConfig { seed: 4711, receivers: 6, ..LabConfig::default() }).unwrap();
    lab.write(&[Hidden::TransducerResponse { gains_db: gains_db.clone() }], &room, None).unwrap();
    let out = folder.path().join("out");
    let (room, out_name) = (room.to_str().unwrap(), out.to_str().unwrap());
    let options = ["--hold-out", "r2,r5", "--rays", "1500"];
    let told = succeeds("diagnose", &[&["--room", room, "--out", out_name], &options[..]].concat());
    let json = checked(&out);
    let cause = &json["causes"][0];
    assert_eq!(cause["effect"], "transducer_response", "{told}");
    assert!(cause["held_out_gain"]["low"].as_f64().unwrap() > 0.0, "{cause}");
    assert_eq!(json["held_out"]["receivers"], serde_json::json!(["r2", "r5"]));
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    for part in
        ["Loudspeaker or microphone not flat", "gain at 500 Hz", "Decays at positions that were predicted"]
    {
        assert!(page.contains(part), "{part}");
    }

    // What is rendered from the model has the colour that was hidden; one gain is open.
    let rendered = |name: &str, more: &[&str]| {
        let traced = folder.path().join(name);
        let common = ["--room", room, "--rays", "4000", "--duration", "1", "--out", traced.to_str().unwrap()];
        succeeds("trace", &[&common[..], more].concat());
        levels_db(&traced.join("impulse_response.wav"))
    };
    let model = out.join("extended_model.toml");
    let with = rendered("with", &["--model", model.to_str().unwrap()]);
    let measured = levels_db(&Path::new(room).join("ir/s1_r1.wav"));
    let without = rendered("without", &[]);
    let spread = |levels: &[f64]| {
        let off: Vec<f64> = levels.iter().zip(&measured).map(|(l, m)| l - m).collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        (off.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / off.len() as f64).sqrt()
    };
    assert!(spread(&with) < 0.5 * spread(&without), "{} dB, {} dB", spread(&with), spread(&without));
}

#[test]
fn bad_input_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let empty = folder.path().join("no_room");
    let silent = folder.path().join("silent_room");
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/room");
    std::fs::create_dir(&silent).unwrap();
    std::fs::copy(fixture.join("room.obj"), silent.join("room.obj")).unwrap();
    let text = std::fs::read_to_string(fixture.join("room.toml")).unwrap();
    std::fs::write(silent.join("room.toml"), text.split("[[responses]]").next().unwrap()).unwrap();
    for (arguments, named) in [
        (&["--hold-out", "nobody"][..], "nobody"),
        (&["--hold-out", "microphone,corner"], "all responses are held out"),
        (&["--effects", "air_absorption,ghosts"], "ghosts"),
        (&["--rays", "1"], "rays"),
        (&["--room", empty.to_str().unwrap()], "room.toml"),
        (&["--room", silent.to_str().unwrap()], "no measured responses"),
    ] {
        refuses(arguments, &out, named);
    }
    for (program, model, named) in [
        (
            "trace",
            "version = 2\ncentres_hz = [1000]\n[[causes]]\nid = \"a\"\nchanges = [{ gain_db = [1, 2] }]",
            "gain_db",
        ),
        ("trace", "version = 2\ncentres_hz = [1000]\nabsorption.velvet = [1]", "velvet"),
        ("match", "version = 2\n", "centres_hz"),
        ("match", "centres_hz = [1000]\n", "version"),
    ] {
        let path = folder.path().join("model.toml");
        std::fs::write(&path, model).unwrap();
        let paths = ["--model", path.to_str().unwrap(), "--out", out.to_str().unwrap()];
        let output = run(program, &paths);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains(named) && !message.contains("panicked"), "{message}");
        assert!(!out.exists());
    }
}

/// A diagnosis that is stopped says at what stage it was, and writes nothing.
fn stops(output: &Output, out: &Path, cause: &str) {
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(
        message.contains(&format!("stopped {cause} after")) && message.contains(", during "),
        "{message}"
    );
    assert!(message.contains("nothing was written") && !message.contains("panicked"), "{message}");
    assert!(!out.exists(), "{} was written", out.display());
}

#[test]
fn the_time_limit_stops_a_diagnosis_that_says_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    // More rays than a second can trace.
    let arguments = ["--rays", "20000", "--time-limit", "1", "--out", out.to_str().unwrap()];
    stops(&run("diagnose", &arguments), &out, "by the time limit");
}

#[cfg(unix)]
#[test]
fn an_interrupt_stops_a_diagnosis_that_says_where_it_was() {
    use std::process::{Command, Stdio};
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut child = sabine("diagnose")
        .args(["--rays", "20000", "--out", out.to_str().unwrap()])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The folder is made just before the work begins, and signals are listened for then.
    while !out.exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it began");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    std::thread::sleep(std::time::Duration::from_millis(700));
    let signalled = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(signalled.success());
    stops(&child.wait_with_output().unwrap(), &out, "on request");
}
