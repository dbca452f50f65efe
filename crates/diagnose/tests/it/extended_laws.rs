//! Laws in an extended model: as a file, in a room, and what is wrong with them.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_diagnose::{Error, ExtendedModel, read_laws};
use sabine_paths::Propagator;
use sabine_paths::laws::{Law, LawParameter, LawTarget};
use sabine_propagate::{PathTracer, TracerConfig};
use sabine_scene::MeasuredRoom;
use sabine_testkit::{LabConfig, Laboratory};
use std::path::PathBuf;

const MODEL: &str = r#"version = 2
centres_hz = [125, 250, 500, 1000, 2000, 4000, 8000]

[absorption]
carpet = [0.1, 0.1, 0.1, 0.1, 0.2, 0.2, 0.2]

[[causes]]
id = "air_absorption"
changes = [{ relative_humidity_percent = 40.0 }]

[[causes]]
id = "carpet_takes_grazing_sound"
[[causes.changes]]
[causes.changes.law]
id = "carpet_takes_grazing_sound"
target = "reflection"
surface = "carpet"
formula = "-a * (1 - cos_incidence)^2 * above(frequency_hz, f0)"
words = "Each meeting with the carpet takes up to 4.1 dB more the more it grazes, from 2 kHz up."
[causes.changes.law.parameters]
a  = { value = 4.1, low = 2.9, high = 5.4, unit = "dB" }
f0 = { value = 2000, low = 1000, high = 2800, unit = "Hz" }

[[causes]]
id = "near_receivers_are_loud"
[[causes.changes]]
[causes.changes.law]
id = "near_receivers_are_loud"
target = "path"
formula = "a * exp(-distance_m / d)"
parameters = { a = { value = 3, low = 2, high = 4, unit = "dB" }, d = { value = 1.5, low = 1, high = 2, unit = "m" } }
"#;

fn fixture() -> MeasuredRoom {
    MeasuredRoom::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room")).unwrap()
}

fn in_file(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn read(text: &str) -> Result<ExtendedModel, Error> {
    let (_folder, path) = in_file(text);
    ExtendedModel::read(path)
}

#[test]
fn laws_come_back_to_the_byte_with_their_intervals() {
    let model = read(MODEL).unwrap();
    let intervals: Vec<[f64; 2]> =
        model.causes[1].law().unwrap().parameters().map(|(_, p)| [p.low, p.high]).collect();
    assert_eq!(intervals, [[2.9, 5.4], [1000.0, 2800.0]]);
    let written = model.to_toml().unwrap();
    let again = read(&written).unwrap();
    assert_eq!(again, model);
    assert_eq!(again.to_toml().unwrap(), written);
    // A model without laws is written as before there were any.
    let without = ExtendedModel::default().to_toml().unwrap();
    assert!(!without.contains("laws"), "{without}");
}

#[test]
fn a_law_of_the_model_weighs_the_paths_of_each_pair() {
    let (room, model) = (fixture(), read(MODEL).unwrap());
    let mut without = model.clone();
    without.causes.truncate(1);
    let (under, plain) = (model.room(&room).unwrap(), without.room(&room).unwrap());
    let (source, receiver) = (&under.sources[0], &under.receivers[0]);
    let config = TracerConfig { rays: 500, duration_s: 0.3, image_order: 2, ..Default::default() };
    let paths =
        PathTracer::new(config).unwrap().trace(&under.scene, source, receiver, &under.air, &()).unwrap();
    let materials: Vec<_> = under.scene.materials().iter().map(|named| named.material.clone()).collect();
    let energies =
        |room: &sabine_diagnose::ExtendedRoom| paths.energies(&room.conditions(&materials, 0, 0)).unwrap();
    let (under, plain) = (energies(&under), energies(&plain));
    let distance_m =
        (0..3).map(|k| (source.position_m[k] - receiver.position_m[k]).powi(2)).sum::<f64>().sqrt();
    let near_db = 3.0 * (-distance_m / 1.5).exp();
    let carpet = room.scene().materials().iter().position(|named| named.name == "carpet").unwrap() as u32;
    let (mut on_carpet, mut elsewhere) = (0, 0);
    for i in 0..paths.len() {
        let mut hits = 0;
        for mut chain in [paths.chains()[i], paths.tails()[i]] {
            while let Some((before, material, _)) = paths.last_reflection(chain) {
                hits += u32::from(material == carpet);
                chain = before;
            }
        }
        for (band, (under, plain)) in under.iter().zip(&plain).enumerate() {
            if plain[i] < 1e-30 {
                continue;
            }
            let db = 10.0 * f64::from(under[i] / plain[i]).log10() - near_db;
            if hits == 0 || band < 4 {
                assert!(db.abs() < 1e-4, "{db} dB in band {band} after {hits} hits");
                elsewhere += 1;
            } else {
                let range = -4.1 * f64::from(hits) - 1e-4..1e-4;
                assert!(range.contains(&db), "{db} dB in band {band} after {hits} hits");
                on_carpet += usize::from(db < -0.1);
            }
        }
    }
    assert!(on_carpet > 1000 && elsewhere > 1000, "{on_carpet} {elsewhere}");
}

/// What goes with the order of the recordings is rendered as each was recorded; a place that was not measured is heard as first of all.
#[test]
fn a_law_of_the_order_of_recordings_renders_each_response_as_it_was_recorded() {
    let config = LabConfig { seed: 8, receivers: 3, recording_order: true, ..LabConfig::default() };
    let lab = Laboratory::new(config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(&[], &folder.path().join("room"), None).unwrap();
    let order: Vec<f64> = room.responses().iter().map(|r| r.recorded_at.unwrap()).collect();
    let room = room.with_responses(|r| r.receiver != 1);
    let a = ("a", LawParameter::new(3.0, [2.0, 4.0], "dB"));
    let law = Law::new("warmer", LawTarget::Recorder, None, "-a * recording_order", [a]).unwrap();
    let without = read("version = 2\ncentres_hz = [125, 250, 500, 1000, 2000, 4000, 8000]\n").unwrap();
    let model = without.clone().with_law(law);
    let (under, plain) = (model.room(&room).unwrap(), without.room(&room).unwrap());
    let materials: Vec<_> = under.scene.materials().iter().map(|named| named.material.clone()).collect();
    let config = TracerConfig { rays: 50, duration_s: 0.1, image_order: 1, ..Default::default() };
    let tracer = PathTracer::new(config).unwrap();
    let first = order[0].min(order[2]);
    for (receiver, at) in [(0, order[0]), (1, first), (2, order[2])] {
        let (source, place) = (&under.sources[0], &under.receivers[receiver]);
        let paths = tracer.trace(&under.scene, source, place, &under.air, &()).unwrap();
        let energies = |room: &sabine_diagnose::ExtendedRoom| -> f64 {
            let all = paths.energies(&room.conditions(&materials, 0, receiver)).unwrap();
            all[3].iter().map(|e| f64::from(*e)).sum()
        };
        let db = 10.0 * (energies(&under) / energies(&plain)).log10();
        assert!((db + 3.0 * at).abs() < 1e-3, "{receiver}: {db} dB at {at}");
    }
    let unstated = room.unmeasured_at(room.receivers().to_vec());
    assert!(model.room(&unstated).unwrap_err().to_string().contains("in which order"));
}

#[test]
fn a_change_replaces_the_law_of_its_name() {
    let model = read(MODEL).unwrap();
    let stronger = model.causes[2].law().unwrap().with_values(&[3.5, 1.2]).unwrap();
    let model = model.with_law(stronger.clone());
    assert_eq!((model.causes.len(), model.causes[2].law()), (3, Some(&stronger)));
}

#[test]
fn what_is_wrong_with_a_law_names_it() {
    for (from, to, words) in [
        ("cos_incidence)", "cos_incidense)", "law `carpet_takes_grazing_sound`, column 11 of its formula"),
        ("value = 4.1", "value = 6.1", "parameters.a: 6.1 lies outside its interval from 2.9 to 5.4"),
        ("relative_humidity_percent", "relative_humidity", "unknown variant `relative_humidity`"),
        (
            "distance_m / d",
            "distance_m",
            "law `near_receivers_are_loud`, column 5 of its formula: exp needs a pure number",
        ),
    ] {
        assert!(MODEL.contains(from));
        let error = read(&MODEL.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("model.toml"), "{error}");
    }
    let model = read(&MODEL.replacen("surface = \"carpet\"", "surface = \"lawn\"", 1)).unwrap();
    let error = model.room(&fixture()).unwrap_err().to_string();
    assert!(
        error.contains("extended model: laws:") && error.contains("the mesh has no material `lawn`"),
        "{error}"
    );
}

#[test]
fn a_file_of_laws_holds_nothing_else() {
    let is_of_law = |line: &&str| !line.starts_with("[[causes") && !line.starts_with("changes");
    let all: Vec<&str> =
        MODEL[MODEL.find("[[causes.changes]]").unwrap()..].lines().filter(is_of_law).collect();
    let laws =
        all.join("\n").replace("[causes.changes.law]", "[[laws]]").replace("causes.changes.law", "laws")
            + "\n";
    let laws = &laws.replace("id = \"near_receivers_are_loud\"\n[[laws]]", "[[laws]]");
    let (_folder, path) = in_file(laws);
    let model = read(MODEL).unwrap();
    assert!(read_laws(path).unwrap().iter().eq(model.causes.iter().filter_map(|cause| cause.law())));
    let (_folder, path) = in_file(MODEL);
    assert!(read_laws(path).unwrap_err().to_string().contains("unknown field `"));
    let (_folder, path) = in_file(&format!("{laws}{laws}"));
    let error = read_laws(path).unwrap_err().to_string();
    assert!(error.contains("model.toml: laws:") && error.contains("two laws have it"), "{error}");
    let (_folder, path) = in_file(&format!("{laws}# {}", "x".repeat(1 << 20)));
    assert!(read_laws(path).unwrap_err().to_string().contains("at most 1 MiB"));
    assert!(matches!(read_laws("/nowhere/laws.toml").unwrap_err(), Error::Acoustics(_)));
}
