//! `plan` as a user runs it: what it writes before and after a diagnosis, and what it says of bad input.

use crate::sabine;
use sabine::scene::MeasuredRoom;
use serde_json::{Value, json};
use std::path::Path;

const ROOM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");
const FEW: [&str; 4] = ["--rays", "300", "--candidates", "8"];

fn succeeds(arguments: &[&str], out: &Path) -> (String, Value) {
    let output = sabine("plan").args(arguments).args(FEW).arg("--out").arg(out).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    let json = serde_json::from_slice(&std::fs::read(out.join("plan.json")).unwrap()).unwrap();
    (String::from_utf8_lossy(&output.stdout).into_owned(), json)
}

/// A run must fail with exit code 1, name what is wrong, and leave no output folder.
fn refuses(arguments: &[&str], out: &Path, named: &str) {
    let few = FEW.chunks(2).filter(|option| !arguments.contains(&option[0])).flatten();
    let output = sabine("plan").args(arguments).args(few).arg("--out").arg(out).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
    assert!(message.contains(named) && !message.contains("panicked"), "{arguments:?}: {message}");
    assert!(!out.exists(), "{arguments:?} left {}", out.display());
}

/// A diagnosis of a room with these materials that leaves two causes open.
fn diagnosis(materials: &[String], bands_hz: &[f64], effects: [&str; 2]) -> Value {
    let materials: serde_json::Map<String, Value> =
        materials.iter().map(|name| (name.clone(), json!({}))).collect();
    let candidates: Vec<Value> = effects.iter().map(|e| json!({ "effect": e, "subject": null })).collect();
    json!({
        "room": "room", "bands_hz": bands_hz, "materials": materials, "candidates": candidates,
        "causes": [{ "effect": effects[0], "subject": null, "probability": 0.6 }],
        "alternatives": effects,
    })
}

#[test]
fn a_campaign_and_an_open_question_are_planned() {
    let folder = tempfile::tempdir().unwrap();
    let new_room = ["--size", "5x4x2.6", "--floor", "parquet_on_concrete", "--source", "1,1,1.5"];
    let room = folder.path().join("room");
    let made = sabine("new-room").args(new_room).arg("--out").arg(&room).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let out = folder.path().join("campaign");
    let room = room.to_str().unwrap();
    let (told, plan) = succeeds(&["--room", room, "--microphones", "2"], &out);
    assert!(told.contains("1. a microphone at (") && told.contains("2. a microphone at ("), "{told}");
    assert!(plan["question"].is_null() && plan["stated_responses"] == 0);
    let page = std::fs::read_to_string(out.join("plan.html")).unwrap();
    for part in ["Nothing stands in it yet", "svg class=\"chart\"", "How large a cause must be to be named"] {
        assert!(page.contains(part), "{part}");
    }
    for outside in ["src=\"http", "href=\"http", "<script", "<link", "NaN", ">inf"] {
        assert!(!page.contains(outside), "the page must not hold {outside}");
    }

    let fixture = MeasuredRoom::read(ROOM).unwrap();
    let materials: Vec<String> = fixture.scene().materials().iter().map(|m| m.name.clone()).collect();
    let bands: Vec<f64> = fixture.bands().iter_hz().collect();
    let file = folder.path().join("diagnosis.json");
    let open = diagnosis(&materials, &bands, ["sound_speed", "transducer_response"]);
    std::fs::write(&file, open.to_string()).unwrap();
    let out = folder.path().join("question");
    let cost = folder.path().join("cost.toml");
    std::fs::write(&cost, "microphone_min = 4.0\n").unwrap();
    let paths = [file.to_str().unwrap(), cost.to_str().unwrap()];
    let (told, plan) = succeeds(
        &[
            "--room",
            ROOM,
            "--diagnosis",
            paths[0],
            "--cost",
            paths[1],
            "--microphones",
            "1",
            "--clearance",
            "0.4",
        ],
        &out,
    );
    assert!(told.contains("which is it: "), "{told}");
    assert_eq!(plan["question"]["leading"].as_array().unwrap().len(), 2);
    for one in plan["candidates"].as_array().unwrap() {
        let (nats, minutes) = (one["nats"].as_f64().unwrap(), one["minutes"].as_f64().unwrap());
        assert!(nats > -1e-6 && (one["nats_per_minute"].as_f64().unwrap() - nats / minutes).abs() < 1e-9);
        assert_eq!(minutes == 4.0, one["measurement"]["kind"] == "microphone");
    }
}

/// A law of the user, and one that a search found, are hypotheses as any other.
#[test]
fn laws_are_planned_for() {
    let folder = tempfile::tempdir().unwrap();
    let fixture = MeasuredRoom::read(ROOM).unwrap();
    let materials: Vec<String> = fixture.scene().materials().iter().map(|m| m.name.clone()).collect();
    let bands: Vec<f64> = fixture.bands().iter_hz().collect();
    let haze = "id = \"haze\"\ntarget = \"path\"\nformula = \"-a * length_m\"\n";
    let laws = folder.path().join("laws.toml");
    let parameters = "parameters = { a = { value = 0.1, low = 0, high = 1, unit = \"dB/m\" } }";
    std::fs::write(&laws, format!("[[laws]]\n{haze}{parameters}\n")).unwrap();
    let mut open = diagnosis(&materials, &bands, ["haze", "transducer_response"]);
    let file = folder.path().join("diagnosis.json");
    let asks = |open: &Value, out: &str, more: &[&str]| -> Value {
        std::fs::write(&file, open.to_string()).unwrap();
        let common = ["--room", ROOM, "--diagnosis", file.to_str().unwrap(), "--microphones", "1"];
        let (_, plan) =
            succeeds(&[&common[..], &["--clearance", "0.4"], more].concat(), &folder.path().join(out));
        assert!(plan["candidates"][0]["nats"].as_f64().unwrap() > 0.0);
        plan["question"]["leading"].clone()
    };
    let leading = asks(&open, "given", &["--laws", laws.to_str().unwrap()]);
    assert_eq!(leading[0]["effect"], "haze");
    // As `diagnosis.json` has a law that a search found; the planner is told of no other.
    open["causes"] = json!([{ "effect": "unknown_law", "subject": "reflections go with an angle" }]);
    open["alternatives"] = json!([]);
    open["candidates"] = json!([{ "effect": "haze", "subject": null }, { "effect": "unknown_law", "subject": null },
        { "effect": "air_absorption", "subject": null }]);
    open["laws"] = json!([{ "id": "grazing", "target": "reflection", "surface": materials[0], "words": "Says so.",
        "formula": "-a * (1 - cos_incidence)^2", "evidence_nats": 20.0, "points": [],
        "parameters": { "a": { "value": 5.0, "low": 3.0, "high": 7.0, "unit": "dB" } } }]);
    let leading = asks(&open, "found", &[]);
    assert_eq!(leading.as_array().unwrap().len(), 2, "{leading}");
    assert_eq!((&leading[0]["effect"], &leading[1]["effect"]), (&json!("grazing"), &json!("air_absorption")));
    // A law that the diagnosis names and nobody gives.
    let open = diagnosis(&materials, &bands, ["haze", "transducer_response"]);
    std::fs::write(&file, open.to_string()).unwrap();
    let out = folder.path().join("out");
    refuses(&["--room", ROOM, "--diagnosis", file.to_str().unwrap()], &out, "a law that is not given here");
}

#[test]
fn bad_input_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let cost = write("cost.toml", "microphone_min = -2.0");
    refuses(&["--room", ROOM, "--cost", &cost], &out, "microphone_min");
    refuses(&["--room", ROOM, "--cost", "/nowhere/cost.toml"], &out, "/nowhere/cost.toml");
    refuses(&["--room", ROOM, "--clearance", "5"], &out, "no place at a height of");
    refuses(&["--room", ROOM, "--microphones", "20"], &out, "20 microphones are asked for");
    refuses(&["--room", ROOM, "--candidates", "0"], &out, "candidates");
    let text = write("text.json", "verdict");
    refuses(&["--room", ROOM, "--diagnosis", &text], &out, "no diagnosis.json");
    let bands = [500.0, 1000.0];
    let other = diagnosis(&["curtain".to_owned()], &bands, ["sound_speed", "time_zero"]).to_string();
    let other = write("other.json", &other);
    refuses(&["--room", ROOM, "--diagnosis", &other], &out, "of another room: it has curtain");
}
