//! Rooms that are not as they should be: few responses, other rates and lengths, copies, responses of another room, everything wrong.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::hidden_effects::ON_LEVELS;
use crate::rivals::diagnoser_among;
use sabine_acoustics::{Bands, Channel, SampleFormat, read_audio, write_wav};
use sabine_diagnose::{DiagnoseConfig, Diagnoser, Diagnosis, Error, Verdict};
use sabine_scene::MeasuredRoom;
use sabine_testkit::{Hidden, LabConfig, Laboratory, at_night};
use std::path::{Path, PathBuf};

/// Three octaves, recorded at 16 kHz: what is odd shows in them. At night all.
fn few_octaves(seed: u64, receivers: usize) -> LabConfig {
    if at_night() {
        return LabConfig { seed, receivers, ..LabConfig::default() };
    }
    let bands = Bands::octaves(500.0, 2000.0).unwrap();
    LabConfig { seed, receivers, bands, sample_rate_hz: 16_000, ..LabConfig::default() }
}

fn lab(seed: u64, receivers: usize) -> Laboratory {
    Laboratory::new(few_octaves(seed, receivers)).unwrap()
}

fn config() -> DiagnoseConfig {
    DiagnoseConfig { rays: 1500, ..DiagnoseConfig::default() }
}

fn diagnoser() -> Diagnoser {
    Diagnoser::new(config()).unwrap()
}

fn diagnose(room: &MeasuredRoom, hold_out: &[&str]) -> Result<Diagnosis, Error> {
    let hold_out: Vec<String> = hold_out.iter().map(ToString::to_string).collect();
    diagnoser().diagnose(room, &hold_out, &())
}

/// Weighs these effects, and all at night.
fn diagnose_among(room: &MeasuredRoom, effects: &[&str]) -> Diagnosis {
    diagnoser_among(config(), effects).diagnose(room, &[], &()).unwrap()
}

fn notes_hold(found: &Diagnosis, words: &str) {
    assert!(found.notes.iter().any(|n| n.contains(words)), "\"{words}\" is not in {:?}", found.notes);
}

/// The response of a receiver, by its number from 1.
fn response(folder: &Path, receiver: usize) -> PathBuf {
    let room = MeasuredRoom::read(folder).unwrap();
    let wanted = room.responses().iter().find(|r| r.receiver + 1 == receiver).unwrap();
    wanted.path.clone()
}

#[test]
fn one_response_says_what_it_can() {
    let folder = tempfile::tempdir().unwrap();
    let lab = lab(541, 1);
    let hidden = Hidden::random("background_noise", 1.0, &lab, 541).unwrap();
    let room = lab.write(&[hidden], &folder.path().join("room"), None).unwrap();
    let found = diagnose(&room, &[]).unwrap();
    notes_hold(&found, "One response only");
    notes_hold(&found, "Too few receivers to hold any out");
    assert!(found.held_out.is_none());
    assert!(found.causes.iter().all(|c| c.held_out_gain.is_none()));
    // A floor of noise is seen in a single response, and nothing confirms it.
    assert_eq!(found.verdict, Verdict::Unconfirmed);
    assert_eq!(found.causes[0].effect, "background_noise");
    let receiver = room.receivers()[0].id.clone();
    assert!(matches!(diagnose(&room, &[&receiver]), Err(Error::AllHeldOut)));
    assert!(matches!(diagnose(&room, &["r77"]), Err(Error::UnknownHoldOut { id }) if id == "r77"));
}

#[test]
fn rates_and_lengths_may_differ() {
    let folder = tempfile::tempdir().unwrap();
    let (one, other) = (folder.path().join("one"), folder.path().join("other"));
    lab(542, 6).write(&[], &one, None).unwrap();
    // The same room, recorded by another machine.
    let other_rate =
        LabConfig { sample_rate_hz: if at_night() { 32_000 } else { 24_000 }, ..few_octaves(542, 6) };
    Laboratory::new(other_rate).unwrap().write(&[], &other, None).unwrap();
    for receiver in [2, 5] {
        std::fs::copy(response(&other, receiver), response(&one, receiver)).unwrap();
    }
    let path = response(&one, 3);
    let whole = read_audio(&path, Channel::Mono).unwrap();
    let rate = whole.sample_rate_hz();
    let kept = &whole.samples()[..whole.samples().len() * 4 / 5];
    write_wav(&path, kept, rate, SampleFormat::Float32).unwrap();
    let found = diagnose(&MeasuredRoom::read(&one).unwrap(), &[]).unwrap();
    assert_eq!(found.verdict, Verdict::Adequate, "{:?} {:?}", found.causes, found.lack_of_fit);
    assert_eq!(found.held_out.unwrap().receivers.len(), 6);
}

#[test]
fn a_copy_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let room = folder.path().join("room");
    lab(543, 5).write(&[], &room, None).unwrap();
    std::fs::copy(response(&room, 1), response(&room, 2)).unwrap();
    let found = diagnose(&MeasuredRoom::read(&room).unwrap(), &[]).unwrap();
    notes_hold(&found, "is a copy of");
    // What was measured elsewhere does not fit the place.
    assert_ne!(found.verdict, Verdict::Adequate);
}

#[test]
fn a_response_of_another_room_is_not_passed() {
    let folder = tempfile::tempdir().unwrap();
    let (one, other) = (folder.path().join("one"), folder.path().join("other"));
    lab(544, 6).write(&[], &one, None).unwrap();
    lab(545, 6).write(&[], &other, None).unwrap();
    std::fs::copy(response(&other, 4), response(&one, 4)).unwrap();
    let found = diagnose(&MeasuredRoom::read(&one).unwrap(), &[]).unwrap();
    assert_ne!(found.verdict, Verdict::Adequate);
    // Whatever is named concerns that response alone.
    for cause in &found.causes {
        let subject = cause.subject.clone().unwrap_or_default();
        assert!(subject.contains("r4") || subject.contains("r04"), "{} {subject}", cause.effect);
    }
}

#[test]
fn where_everything_is_wrong_nothing_is_called_adequate() {
    let folder = tempfile::tempdir().unwrap();
    let (lab, folder) = (lab(546, 5), folder.path().join("room"));
    let hidden: Vec<Hidden> = Hidden::CATALOGUE
        .iter()
        .zip(546..)
        .map(|(id, seed)| Hidden::random(id, 1.0, &lab, seed).unwrap())
        .collect();
    let room = lab.write(&hidden, &folder, None).unwrap();
    let found = diagnose(&room, &[]).unwrap();
    assert_ne!(found.verdict, Verdict::Adequate);
    if found.verdict == Verdict::Explained {
        notes_hold(&found, "misfit is left");
    }
}

/// Microphones that each have a response of their own, and no effect at hand that says so.
#[test]
fn levels_that_no_effect_explains_are_not_put_down_to_chance() {
    let folder = tempfile::tempdir().unwrap();
    let lab = lab(547, 6);
    let hidden = Hidden::random("channel_response", 1.0, &lab, 547).unwrap();
    let room = lab.write(&[hidden], &folder.path().join("room"), None).unwrap();
    let few = diagnoser().with_only(&["time_zero".to_owned()]).unwrap();
    let found = few.diagnose(&room, &[], &()).unwrap();
    assert_eq!(found.verdict, Verdict::Unexplained);
    notes_hold(&found, "Levels of single responses by octave");
}

/// Tables and diagnosis in third octaves: a loudspeaker with a hollow that one octave would smear.
#[test]
fn third_octaves_show_what_octaves_smear() {
    let folder = tempfile::tempdir().unwrap();
    let bands = Bands::third_octaves(500.0, 2500.0).unwrap();
    let config = LabConfig { seed: 544, receivers: 8, bands, sample_rate_hz: 16_000, ..LabConfig::default() };
    let lab = Laboratory::new(config).unwrap();
    let truth_db = [0.0, 0.0, 0.0, 0.0, -6.0, 0.0, 0.0, 0.0];
    let hidden = Hidden::TransducerResponse { gains_db: truth_db.to_vec() };
    let room = lab.write(&[hidden], &folder.path().join("room"), None).unwrap();
    assert_eq!(room.bands(), bands);
    let found = diagnose_among(&room, &ON_LEVELS);
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(named, ["transducer_response"], "{:?}", found.lack_of_fit);
    let hollow = found.causes[0].parameters.iter().find(|p| p.name == "gain_1250_hz").unwrap();
    assert!((hollow.value + 6.0).abs() < 1.5, "{hollow:?}");
    for beside in found.causes[0].parameters.iter().filter(|p| !p.name.contains("1250")) {
        assert!(beside.value.abs() < 2.0, "{beside:?}");
    }
}

/// A loudspeaker that turns from a point to a figure of eight within two octaves, more steeply than the pattern allows.
#[test]
fn a_parameter_at_the_end_of_its_range_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let bands = Bands::octaves(1000.0, 8000.0).unwrap();
    let lab = Laboratory::new(LabConfig { seed: 545, receivers: 8, bands, ..LabConfig::default() }).unwrap();
    let hidden = Hidden::SourceDirectivity { omni_share: vec![1.0, 1.0, 0.5, 0.0], axis: None };
    let room = lab.write(&[hidden], &folder.path().join("room"), None).unwrap();
    let found = diagnose_among(&room, &ON_LEVELS);
    assert_eq!(found.causes[0].effect, "source_directivity", "{:?}", found.causes);
    notes_hold(
        &found,
        "source_directivity: the end of the range that is allowed is reached by directed_share_per_octave = 0.300.",
    );
}
