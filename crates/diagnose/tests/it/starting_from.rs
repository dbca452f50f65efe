//! A diagnosis that starts from an extended model, and a model that is fitted anew: one laboratory room, measured on several days.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::rivals::diagnoser_among;
use sabine_diagnose::{DiagnoseConfig, Diagnoser, Error, ExtendedModel, ModelCause, Verdict};
use sabine_scene::MeasuredRoom;
use sabine_testkit::{Hidden, LabConfig, Laboratory};

const WARM: Hidden = Hidden::SoundSpeed { temperature_offset_k: 8.0 };
const LATE: Hidden = Hidden::TimeZero { latency_s: 4e-3 };

fn lab() -> Laboratory {
    Laboratory::new(LabConfig { seed: 25_110, receivers: 8, ..LabConfig::default() }).unwrap()
}

fn room(hidden: &[Hidden]) -> (tempfile::TempDir, MeasuredRoom) {
    let folder = tempfile::tempdir().unwrap();
    let room = lab().write(hidden, &folder.path().join("room"), None).unwrap();
    (folder, room)
}

fn among(effects: &[&str]) -> Diagnoser {
    diagnoser_among(DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() }, effects)
}

/// The model of a warm day, saved and read.
fn warm_model() -> ExtendedModel {
    let (folder, room) = room(&[WARM]);
    let found = among(&["sound_speed", "time_zero", "position_error"]).diagnose(&room, &[], &()).unwrap();
    assert_eq!(found.model.causes.len(), 1, "{:?}", found.causes);
    let path = folder.path().join("extended_model.toml");
    found.model.write(&path).unwrap();
    let model = ExtendedModel::read(&path).unwrap();
    assert_eq!(model, found.model);
    // Numbers of the model stand in the parameters' intervals, and vary by as much.
    let parameter = &model.causes[0].parameters[0];
    let intervals = model.intervals_90();
    let own = intervals.iter().find(|(place, _)| *place == "/causes/0/changes/0/temperature_c").unwrap().1;
    assert!((own[0] - parameter.low).abs() < 1e-3 && (own[1] - parameter.high).abs() < 1e-3, "{own:?}");
    model
}

#[test]
fn a_model_is_carried_on_or_falls_where_the_data_do_not_need_it() {
    let model = warm_model();
    // As warm, and late as well: what was known stays, what is new is found beside it.
    let (_folder, both) = room(&[WARM, LATE]);
    let found = among(&["time_zero"]).starting_from(&model).unwrap().diagnose(&both, &[], &()).unwrap();
    let names: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!((found.verdict, &names[..]), (Verdict::Explained, &["sound_speed", "time_zero"][..]));
    assert!(found.causes.iter().all(|cause| cause.probability > 0.95));
    // On a day as stated nothing is left of it, and the notes say so.
    let (_folder, plain) = room(&[]);
    let found = among(&["time_zero"]).starting_from(&model).unwrap().diagnose(&plain, &[], &()).unwrap();
    assert!(found.verdict == Verdict::Adequate && found.model.causes.is_empty(), "{:?}", found.causes);
    assert!(
        found.notes.iter().any(|note| note.contains("sound_speed is not at work here")),
        "{:?}",
        found.notes
    );
}

#[test]
fn a_model_is_fitted_anew_and_keeps_its_causes() {
    let mut model = ExtendedModel::default();
    model.causes = vec![ModelCause::new("sound_speed", Vec::new()), ModelCause::new("time_zero", Vec::new())];
    let (_folder, cold) = room(&[Hidden::SoundSpeed { temperature_offset_k: -4.0 }]);
    let refitted = among(&[]).starting_from(&model).unwrap().refit(&cold, &()).unwrap();
    let applied = refitted.applied();
    let stated = cold.air().temperature_c();
    assert!((applied.temperature_c.unwrap() - stated + 4.0).abs() < 0.8, "{applied:?}");
    // Nothing is late, and the model still says how late: within its interval, nothing.
    let latency = &refitted.causes[1].parameters[0];
    assert!(latency.low < 0.0 && latency.high > 0.0, "{latency:?}");

    model.causes.push(ModelCause::new("position_error", Vec::new()).about("nobody"));
    let error = among(&[]).starting_from(&model).unwrap().refit(&cold, &()).unwrap_err();
    assert!(matches!(&error, Error::UnknownCause { cause } if cause == "position_error (nobody)"), "{error}");
}
