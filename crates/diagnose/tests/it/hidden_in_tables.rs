//! Rooms of which only a table of parameters is known: the laboratory's responses are read by `sabine-acoustics` and thrown away.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_acoustics::{Bands, ParameterKind, RoomParameters};
use sabine_diagnose::{DiagnoseConfig, Diagnoser, Diagnosis, Error, Verdict};
use sabine_scene::MeasuredRoom;
use sabine_testkit::{Hidden, LabConfig, Laboratory};
use std::fmt::Write as _;
use std::path::Path;

fn lab(seed: u64) -> Laboratory {
    let bands = Bands::octaves(500.0, 2000.0).unwrap();
    let config = LabConfig { seed, receivers: 8, bands, sample_rate_hz: 16_000, ..LabConfig::default() };
    Laboratory::new(config).unwrap()
}

/// The laboratory's room as a folder with a table of what was measured with this hidden in it.
fn table_room(lab: &Laboratory, hidden: &[Hidden], folder: &Path) -> MeasuredRoom {
    lab.write(hidden, folder, None).unwrap();
    let kinds = [
        ParameterKind::Edt,
        ParameterKind::T20,
        ParameterKind::T30,
        ParameterKind::C80,
        ParameterKind::CentreTime,
    ];
    let bands = lab.config().bands;
    let head: Vec<&str> = kinds.iter().map(|kind| kind.column()).collect();
    let mut table = format!("source,receiver,band_hz,{}\n", head.join(","));
    for (receiver, response) in lab.receivers().iter().zip(lab.responses(hidden).unwrap()) {
        let measured = RoomParameters::measure(&response, bands).unwrap();
        for band_hz in bands.iter_hz() {
            write!(table, "{},{},{band_hz}", lab.sources()[0].id, receiver.id).unwrap();
            for kind in kinds {
                match kind.of(&measured).at_hz(band_hz).unwrap() {
                    Ok(estimate) => write!(table, ",{:.4}", estimate.value).unwrap(),
                    Err(_) => table.push_str(",-"),
                }
            }
            table.push('\n');
        }
    }
    std::fs::write(folder.join("table.csv"), table).unwrap();
    let mut file: toml::Table = std::fs::read_to_string(folder.join("room.toml")).unwrap().parse().unwrap();
    file.remove("responses");
    let tables: toml::Table = "[[parameters]]\nfile = \"table.csv\"\n".parse().unwrap();
    file.extend(tables);
    std::fs::write(folder.join("room.toml"), toml::to_string(&file).unwrap()).unwrap();
    MeasuredRoom::read(folder).unwrap()
}

fn diagnose(lab: &Laboratory, hidden: &[Hidden], hold_out: &[&str]) -> Result<Diagnosis, Error> {
    let folder = tempfile::tempdir().unwrap();
    let room = table_room(lab, hidden, &folder.path().join("room"));
    let config = DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() };
    let hold_out: Vec<String> = hold_out.iter().map(|id| (*id).to_owned()).collect();
    Diagnoser::new(config).unwrap().diagnose(&room, &hold_out, &())
}

fn named(found: &Diagnosis) -> Vec<(&str, Option<&str>)> {
    found.causes.iter().map(|cause| (cause.effect.as_str(), cause.subject.as_deref())).collect()
}

#[test]
fn a_table_of_an_unaltered_room_names_nothing() {
    let found = diagnose(&lab(9101), &[], &[]).unwrap();
    assert_eq!(found.verdict, Verdict::Adequate, "{:?} {:?}", named(&found), found.lack_of_fit);
    assert!(found.decays.is_empty() && found.residuals.is_empty());
    // Every value of a receiver is predicted from those of the others.
    assert!(found.values.len() > 80 && found.values.iter().all(|value| value.held_out));
    let held_out = found.held_out.unwrap();
    let [off, ..] = held_out.values_jnd.unwrap();
    assert!(off < 3.0 && held_out.db_rmse[0].is_nan(), "{held_out:?}");
    assert!(found.notes.iter().any(|note| note.contains("no arrival times")), "{:?}", found.notes);
}

#[test]
fn a_material_that_absorbs_more_is_found_in_a_table() {
    let lab = lab(9102);
    let hidden = Hidden::random("surface_absorption", 1.0, &lab, 9102).unwrap();
    let truth = lab.true_scene(std::slice::from_ref(&hidden)).unwrap();
    let stated = lab.scene().materials();
    let changed = |m: usize| {
        let [a, b] = [&truth.materials()[m], &stated[m]].map(|named| named.material.absorption().values());
        (0..a.len()).map(|band| (a[band] - b[band]).abs()).fold(0.0, f64::max) > 0.1
    };
    let material = (0..stated.len()).find(|&m| changed(m)).unwrap();
    let name = stated[material].name.as_str();
    let held = lab.receivers()[0].id.clone();
    let found = diagnose(&lab, &[hidden], &[&held]).unwrap();
    assert_eq!(found.verdict, Verdict::Explained, "{:?} {:?}", named(&found), found.lack_of_fit);
    assert_eq!(named(&found), [("surface_absorption", Some(name))]);
    let (_, fitted) = found.materials.iter().find(|(own, _)| own == name).unwrap();
    for (band, absorption) in truth.materials()[material].material.absorption().values().iter().enumerate() {
        let (value, sd) = (fitted.absorption[band], fitted.absorption_sd[band]);
        assert!((value - absorption).abs() < 3.0 * sd && sd < 0.1, "{band}: {value} +- {sd} {absorption}");
    }
    let held_out = found.held_out.unwrap();
    assert!(held_out.never_fitted && held_out.receivers == [held]);
    let [before, after, _] = held_out.values_jnd.unwrap();
    assert!(after < before, "{before} {after}");
    assert_eq!(found.model.causes.len(), 1);
}

#[test]
fn what_a_table_lacks_is_said() {
    let lab = lab(9101);
    let all: Vec<&str> = lab.receivers().iter().map(|receiver| receiver.id.as_str()).collect();
    assert!(matches!(diagnose(&lab, &[], &all), Err(Error::AllHeldOut)));
    assert!(matches!(diagnose(&lab, &[], &["nobody"]), Err(Error::UnknownHoldOut { id }) if id == "nobody"));
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("room");
    table_room(&lab, &[], &at);
    // Octaves that the room does not have.
    std::fs::write(at.join("table.csv"), "source,receiver,band_hz,t30_s\ns1,r1,63,0.5\ns1,r2,63,0.5\n")
        .unwrap();
    let room = MeasuredRoom::read(&at).unwrap();
    let found = Diagnoser::new(DiagnoseConfig { rays: 200, ..DiagnoseConfig::default() }).unwrap().diagnose(
        &room,
        &[],
        &(),
    );
    assert!(matches!(found, Err(Error::NothingToCompare { responses: 2 })), "{found:?}");
}
