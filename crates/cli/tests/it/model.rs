//! `sabine model` and what other commands make of an extended model, as a user runs them.

use crate::sabine;
use sabine::diagnose::{ExtendedModel, ModelCause, ModelChange, RigidMotion, read_laws};
use sabine::paths::laws::{Law, LawParameter, LawTarget};
use serde_json::Value;
use std::path::{Path, PathBuf};

const LAW: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/laws/carpet.toml");

fn succeeds(command: &str, arguments: &[&str]) -> String {
    let output = sabine(command).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn fails(command: &str, arguments: &[&str]) -> String {
    let output = sabine(command).args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    String::from_utf8(output.stderr).unwrap()
}

/// A model with a latency, 3 ms within 0.1, and carpet that absorbs 0.3 within 0.05 in all octaves alike.
fn model(folder: &Path) -> PathBuf {
    let octaves = "[125, 250, 500, 1000, 2000, 4000, 8000]";
    let numbers: Vec<String> = (0..7)
        .map(|b| format!("\"/absorption/carpet/{b}\""))
        .chain(["\"/causes/0/changes/0/latency_s\"".to_owned()])
        .collect();
    let row = |i: usize| match i {
        7 => "[0, 0, 0, 0, 0, 0, 0, 1e-8]".to_owned(),
        _ => format!("{:?}", vec![0.0025; i + 1]),
    };
    let rows: Vec<String> = (0..8).map(row).collect();
    let text = format!(
        "version = 2\ncentres_hz = {octaves}\nabsorption.carpet = {:?}\n[[causes]]\nid = \"time_zero\"\n\
         changes = [{{ latency_s = 0.003 }}]\n[uncertainty]\nnumbers = [{}]\ncovariance = [{}]\n",
        [0.3; 7],
        numbers.join(", "),
        rows.join(", ")
    );
    let path = folder.join("model.toml");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_shift_of_all_places_is_shown_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shifted.toml");
    let mut model = ExtendedModel::default();
    model.centres_hz = vec![125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0];
    let motion = RigidMotion::new([0.3, -0.2, 0.05], 2.5, [2.0, 1.5, 1.2]);
    model.causes.push(ModelCause::new("coordinate_shift", vec![ModelChange::CoordinateShift(motion)]));
    model.write(&path).unwrap();
    let shown = succeeds("model", &["show", path.to_str().unwrap()]);
    for words in [
        "[coordinate_shift]",
        "all places: by (+0.300, -0.200, +0.050) m, turned by +2.50 degrees about (2.00, 1.50)",
    ] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
}

#[test]
fn a_model_is_shown_joined_and_taken_apart() {
    let folder = tempfile::tempdir().unwrap();
    let first = model(folder.path());
    let first = first.to_str().unwrap();
    let shown = succeeds("model", &["show", first]);
    for words in ["[time_zero]", "the latency of all responses to 3.000 ms", "0.300 ± 0.082", "8 numbers"] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    let [second, joined, apart] = ["second", "joined", "apart"].map(|name| folder.path().join(name));
    let mut other = ExtendedModel::default();
    other.centres_hz = vec![125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0];
    other.causes.push(ModelCause::new("room_modes", vec![ModelChange::WaveBelow(90.0)]));
    other.causes.push(ModelCause::new("position_error", Vec::new()).about("corner"));
    other.causes.push(ModelCause::new("position_error", Vec::new()).about("microphone"));
    other.write(&second).unwrap();
    let [second, joined, apart] = [&second, &joined, &apart].map(|path| path.to_str().unwrap());
    succeeds("model", &["merge", first, second, "--out", joined]);
    let names: Vec<String> =
        ExtendedModel::read(joined).unwrap().causes.iter().map(ModelCause::name).collect();
    let expected = ["time_zero", "room_modes", "position_error (corner)", "position_error (microphone)"];
    assert_eq!(names, expected);
    let several = fails("model", &["drop", joined, "--cause", "position_error", "--out", apart]);
    assert!(several.contains("say which with --subject"), "{several}");
    let drop = ["drop", joined, "--cause", "position_error", "--subject", "corner", "--out", apart];
    succeeds("model", &drop);
    assert_eq!(ExtendedModel::read(apart).unwrap().causes.len(), 3);
    let unknown = fails("model", &["drop", joined, "--cause", "ghosts", "--out", apart]);
    assert!(unknown.contains("it has time_zero, room_modes"), "{unknown}");
    assert!(fails("model", &["merge", first, joined]).contains("time_zero"));
    assert!(fails("model", &["sample", second]).contains("uncertainty"));
}

#[test]
fn the_page_shows_a_model_that_is_read() {
    let page = include_str!("../../../../docs/how-to/extended-model.md");
    let text = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    std::fs::write(&path, text).unwrap();
    let read = ExtendedModel::read(&path).unwrap();
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");
    let room = sabine::scene::MeasuredRoom::read(fixture).unwrap();
    assert!((read.room(&room).unwrap().air.temperature_c() - 26.1).abs() < 1e-9);
    let desk = page.split("```toml\n").nth(2).unwrap().split("```").next().unwrap();
    std::fs::write(&path, format!("version = 2\ncentres_hz = [500, 1000]\n{desk}")).unwrap();
    let furnished = ExtendedModel::read(&path).unwrap().room(&room).unwrap();
    assert_eq!(furnished.scene.triangles().len(), room.scene().triangles().len() + 12);
    // Every kind of change that the page names is one, and none is left out.
    let kinds = page.split("**Changes** by name: ").nth(1).unwrap().split(". An unknown").next().unwrap();
    std::fs::write(&path, text.replace("temperature_c = 26.1 }", "wishes = 1 }")).unwrap();
    let refused = ExtendedModel::read(&path).unwrap_err().to_string();
    let known = refused.split("expected one of ").nth(1).unwrap();
    let names = |text: &str| -> Vec<String> {
        let mut all: Vec<String> = text.split('`').skip(1).step_by(2).map(str::to_owned).collect();
        all.sort();
        all
    };
    assert_eq!(names(kinds), names(known.lines().next().unwrap()));
}

#[test]
fn draws_are_models_and_open_a_band_about_the_decay() {
    let folder = tempfile::tempdir().unwrap();
    let model = model(folder.path());
    let model = model.to_str().unwrap();
    let draws = folder.path().join("draws");
    succeeds("model", &["sample", model, "--draws", "4", "--out", draws.to_str().unwrap()]);
    let all: Vec<f64> = (1..=4)
        .map(|i| ExtendedModel::read(draws.join(format!("draw_{i}.toml"))).unwrap().absorption["carpet"][3])
        .collect();
    assert!(all.iter().all(|a| (a - 0.3).abs() < 0.25) && all.windows(2).all(|pair| pair[0] != pair[1]));

    let out = folder.path().join("traced");
    let traced = ["--model", model, "--draws", "9", "--rays", "1000", "--duration", "0.8"];
    let told = succeeds("trace", &[&traced[..], &["--out", out.to_str().unwrap()]].concat());
    assert!(told.contains("9 draws from the model: T30 at 1000 Hz"), "{told}");
    let text = std::fs::read_to_string(out.join("parameters.json")).unwrap();
    let parameters: Value = serde_json::from_str(&text).unwrap();
    let t30 = &parameters["draws"]["t30_s_5_50_95"][3];
    let [low, median, high] = [0, 1, 2].map(|i| t30[i].as_f64().unwrap());
    assert!(low < median && median < high && high < 1.5 * low, "{t30}");
    let table = std::fs::read_to_string(out.join("decay_band.csv")).unwrap();
    assert!(table.starts_with("time_s,low_db_125,median_db_125,high_db_125") && table.lines().count() > 50);
    assert!(out.join("decay_band.svg").exists());
    assert!(fails("trace", &["--model", model, "--draws", "9", "--rays", "0"]).contains("rays"));
}

/// The carpet takes more by a law: fitted under it, it absorbs less.
#[test]
fn materials_are_fitted_under_the_laws_of_a_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("law.toml");
    let mut plain = ExtendedModel::default();
    plain.centres_hz = vec![125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0];
    let law = read_laws(LAW).unwrap().remove(0);
    plain.with_law(law).write(&path).unwrap();
    let fitted = |name: &str, more: &[&str]| -> (Value, String) {
        let out = folder.path().join(name);
        let t60 =
            ["--t60", "0.6,0.6,0.6,0.55,0.5,0.45,0.4", "--rays", "2000", "--out", out.to_str().unwrap()];
        let told = succeeds("fit", &[&t60[..], more].concat());
        (serde_json::from_str(&std::fs::read_to_string(out.join("fit.json")).unwrap()).unwrap(), told)
    };
    let under = |name: &str| fitted(name, &["--model", path.to_str().unwrap()]);
    let ((without, _), (with, told)) = (fitted("without", &[]), under("with"));
    assert!(!told.contains("left out"), "{told}");
    let carpet = |fit: &Value, band: usize| fit["materials"]["carpet"]["absorption"][band].as_f64().unwrap();
    assert!((carpet(&without, 1) - carpet(&with, 1)).abs() < 0.02);
    assert!(carpet(&without, 5) > carpet(&with, 5) + 0.01, "{} {}", carpet(&without, 5), carpet(&with, 5));
    // What drifts over the recordings is no matter of the room: it says nothing of their order, and that law is left out.
    let a = ("a", LawParameter::new(3.0, [2.0, 4.0], "dB"));
    let law = Law::new("warmer", LawTarget::Recorder, None, "-a * recording_order", [a]).unwrap();
    ExtendedModel::read(&path).unwrap().with_law(law).write(&path).unwrap();
    let (beside, told) = under("beside");
    assert!(told.contains("the law warmer of") && told.contains("order of the recordings"), "{told}");
    assert_eq!(beside["materials"], with["materials"]);
}

/// Commands that render take the room from the model: here, one in which the carpet swallows nearly all.
#[test]
fn a_walk_and_a_replacement_happen_in_the_room_of_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("soft.toml");
    let mut soft = ExtendedModel::default();
    soft.centres_hz = vec![125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0];
    soft.absorption.insert("carpet".to_owned(), vec![0.95; 7]);
    soft.with_law(read_laws(LAW).unwrap().remove(0)).write(&path).unwrap();
    let model = ["--model", path.to_str().unwrap()];
    // Reverberation time at 2 kHz: 2,000 rays would know it to a fifth.
    let replaced = |name: &str, more: &[&str]| -> f64 {
        let out = folder.path().join(name);
        let few = ["--rays", "40000", "--duration-s", "1.5", "--out", out.to_str().unwrap()];
        succeeds("replace", &[&few[..], more].concat());
        let text = std::fs::read_to_string(out.join("change.json")).unwrap();
        let change: Value = serde_json::from_str(&text).unwrap();
        change["rows"][0]["before"][4].as_f64().unwrap()
    };
    let (stated, modelled) = (replaced("stated", &[]), replaced("modelled", &model));
    assert!(modelled < 0.9 * stated, "{modelled} {stated}");

    let neutral = folder.path().join("neutral.toml");
    let mut stated = ExtendedModel::default();
    stated.centres_hz = vec![1000.0];
    stated.write(&neutral).unwrap();
    let walked = |name: &str, more: &[&str]| -> Vec<u8> {
        let out = folder.path().join(name);
        let room = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");
        let few = ["--room", room, "--rays", "100", "--speed", "20", "--out", out.to_str().unwrap()];
        succeeds("walk", &[&few[..], more].concat());
        std::fs::read(&out).unwrap()
    };
    // Sound is scaled to its peak: it is another one, or the same to the byte.
    let plain = walked("stated.wav", &[]);
    assert!(plain != walked("soft.wav", &model));
    assert!(plain == walked("neutral.wav", &["--model", neutral.to_str().unwrap()]));
    assert!(fails("walk", &model).contains("--model changes the room of --room"));
}
