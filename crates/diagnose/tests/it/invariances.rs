//! What means nothing may change nothing: the scale of files under a free gain, their time axis under a free latency, names, order, the
//! unit of the mesh, and where the room lies in its coordinates.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::rivals::diagnoser_among;
use sabine_acoustics::{Bands, ImpulseResponse};
use sabine_diagnose::{DiagnoseConfig, Diagnosis, Verdict};
use sabine_scene::{Levels, MeasuredRoom, NamedMaterial, NewResponse, NewRoom, Scene, TimeZero};
use sabine_testkit::{Hidden, LabConfig, Laboratory, at_night};
use std::path::Path;

/// A small room in two octaves; latency and gain are unknown, the same for all responses.
fn lab(seed: u64) -> Laboratory {
    let bands = Bands::octaves(1000.0, 2000.0).unwrap();
    let config = LabConfig {
        seed,
        receivers: 5,
        bands,
        sample_rate_hz: 16_000,
        time_zero: TimeZero::Common,
        levels: Levels::Common,
        ..LabConfig::default()
    };
    Laboratory::new(config).unwrap()
}

/// Of arrival times, of levels and of decays.
const RIVALS: [&str; 7] = [
    "position_error",
    "time_zero",
    "room_dimensions",
    "source_directivity",
    "channel_fault",
    "surface_absorption",
    "scattering",
];

fn diagnose(room: &MeasuredRoom) -> Diagnosis {
    let config =
        DiagnoseConfig { rays: 300, simulations: 10, wave_solutions: false, ..DiagnoseConfig::default() };
    diagnoser_among(config, &RIVALS).diagnose(room, &[], &()).unwrap()
}

/// The verdict, and the named causes with their subjects, in alphabetical order.
type Answer = (Verdict, Vec<(String, Option<String>)>);

fn answer(found: &Diagnosis) -> Answer {
    let mut causes: Vec<_> = found.causes.iter().map(|c| (c.effect.clone(), c.subject.clone())).collect();
    causes.sort();
    (found.verdict, causes)
}

/// The room once more, to be changed.
pub(crate) fn copy(room: &MeasuredRoom) -> NewRoom {
    let response = |(i, entry): (usize, &sabine_scene::ResponseEntry)| NewResponse {
        source: room.sources()[entry.source].id.clone(),
        receiver: room.receivers()[entry.receiver].id.clone(),
        name: format!("response_{i}"),
        air: None,
        session: None,
        recorded_at: None,
        samples: room.load_response(i).unwrap(),
    };
    NewRoom {
        scene: room.scene().clone(),
        priors: room.priors().to_vec(),
        air: Some(room.air()),
        measurement: room.measurement(),
        position_sd: room.position_sd().clone(),
        sources: room.sources().to_vec(),
        receivers: room.receivers().to_vec(),
        responses: room.responses().iter().enumerate().map(response).collect(),
    }
}

fn scaled(room: &mut NewRoom) {
    let factor = 10f32.powf(-9.6 / 20.0);
    for response in &mut room.responses {
        let samples = response.samples.samples().iter().map(|s| s * factor).collect();
        response.samples = ImpulseResponse::new(samples, response.samples.sample_rate_hz()).unwrap();
    }
}

fn later(room: &mut NewRoom) {
    for response in &mut room.responses {
        let rate_hz = response.samples.sample_rate_hz();
        let mut samples = vec![0.0; (0.0371 * f64::from(rate_hz)) as usize];
        samples.extend(response.samples.samples());
        response.samples = ImpulseResponse::new(samples, rate_hz).unwrap();
    }
}

/// Names whose alphabetical order is another one.
fn renamed(id: &str) -> String {
    let number: usize = id.chars().filter(char::is_ascii_digit).collect::<String>().parse().unwrap_or(0);
    let kind: String = id.chars().filter(|c| !c.is_ascii_digit()).collect();
    format!("{}{kind}", char::from(b'z' - number as u8))
}

fn under_other_names(room: &mut NewRoom) {
    let name = |named: &NamedMaterial| NamedMaterial { name: renamed(&named.name), ..named.clone() };
    let materials = room.scene.materials().iter().map(name).collect();
    room.scene =
        Scene::new(room.scene.vertices().to_vec(), room.scene.triangles().to_vec(), materials).unwrap();
    room.sources.iter_mut().for_each(|s| s.id = renamed(&s.id));
    room.receivers.iter_mut().for_each(|r| r.id = renamed(&r.id));
    for response in &mut room.responses {
        (response.source, response.receiver) = (renamed(&response.source), renamed(&response.receiver));
    }
}

fn reordered(room: &mut NewRoom) {
    room.receivers.rotate_left(2);
    room.responses.reverse();
}

/// By a right angle about the vertical, and elsewhere.
fn turned(room: &mut NewRoom) {
    let turn = |[x, y, z]: [f64; 3]| [-y, x, z];
    let place = |p: [f64; 3]| {
        let [x, y, z] = turn(p);
        [x + 12.5, y - 3.25, z + 1.5]
    };
    let vertices = room.scene.vertices().iter().map(|&v| place(v)).collect();
    room.scene =
        Scene::new(vertices, room.scene.triangles().to_vec(), room.scene.materials().to_vec()).unwrap();
    for source in &mut room.sources {
        (source.position_m, source.axis) = (place(source.position_m), source.axis.map(turn));
    }
    for receiver in &mut room.receivers {
        (receiver.position_m, receiver.axis) = (place(receiver.position_m), receiver.axis.map(turn));
    }
}

/// The mesh of a written room in millimetres.
fn in_millimetres(folder: &Path) -> MeasuredRoom {
    let mesh = folder.join("room.obj");
    let scaled = |line: &str| match line.strip_prefix("v ") {
        Some(corner) => {
            let corner = corner.split_whitespace().map(|c| (1e3 * c.parse::<f64>().unwrap()).to_string());
            format!("v {}\n", corner.collect::<Vec<_>>().join(" "))
        }
        None => format!("{line}\n"),
    };
    let text: String = std::fs::read_to_string(&mesh).unwrap().lines().map(scaled).collect();
    std::fs::write(&mesh, text).unwrap();
    let file = folder.join("room.toml");
    let text = std::fs::read_to_string(&file).unwrap().replace("[room]", "[room]\nunits = \"mm\"");
    std::fs::write(&file, text).unwrap();
    MeasuredRoom::read(folder).unwrap()
}

/// Asserts that nothing of what means nothing changes the answer, which is returned.
fn unchanged_by_what_means_nothing(lab: &Laboratory, hidden: &[Hidden]) -> Diagnosis {
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(hidden, &folder.path().join("room"), None).unwrap();
    let found = diagnose(&room);
    let expected = answer(&found);
    type Change = fn(&mut NewRoom);
    let changes: [(&str, Change); 5] = [
        ("scaled", scaled),
        ("later", later),
        ("renamed", under_other_names),
        ("turned", turned),
        ("reordered", reordered),
    ];
    for (name, change) in changes.into_iter().skip(if at_night() { 0 } else { 4 }) {
        let mut other = copy(&room);
        change(&mut other);
        let found = diagnose(&other.write(folder.path().join(name)).unwrap());
        let expected = if name == "renamed" { answer_renamed(&expected) } else { expected.clone() };
        assert_eq!(answer(&found), expected, "{name}: {:?} {:?}", found.notes, found.lack_of_fit);
    }
    let unit = folder.path().join("unit");
    copy(&room).write(&unit).unwrap();
    assert_eq!(answer(&diagnose(&in_millimetres(&unit))), expected, "in millimetres");
    found
}

fn answer_renamed((verdict, causes): &Answer) -> Answer {
    let subject = |s: &String| s.split('-').map(renamed).collect::<Vec<_>>().join("-");
    let mut causes: Vec<_> =
        causes.iter().map(|(effect, s)| (effect.clone(), s.as_ref().map(subject))).collect();
    causes.sort();
    (*verdict, causes)
}

#[test]
#[ignore = "nightly: seven diagnoses, and so many of a room with a cause are not ignored"]
fn an_unaltered_room_stays_one() {
    let found = unchanged_by_what_means_nothing(&lab(561), &[]);
    assert_eq!(found.verdict, Verdict::Adequate, "{:?}", found.causes);
}

#[test]
fn a_source_that_stands_elsewhere_stays_found() {
    let lab = lab(562);
    let hidden = Hidden::random("position_error", 1.0, &lab, 562).unwrap();
    let found = unchanged_by_what_means_nothing(&lab, &[hidden]);
    assert_eq!(found.verdict, Verdict::Explained, "{:?}", found.causes);
    assert_eq!(found.causes[0].effect, "position_error");
}
