//! Gains of several channels are wrong at once.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_diagnose::{DiagnoseConfig, Diagnoser};
use sabine_testkit::{Fault, Hidden, LabConfig, Laboratory};

#[test]
fn the_extended_model_holds_the_gain_of_every_channel_that_is_named() {
    let lab = Laboratory::new(LabConfig { seed: 561, receivers: 6, ..LabConfig::default() }).unwrap();
    let wrong = [(1, 8.0), (4, -7.0)];
    let hidden =
        wrong.map(|(response, gain_db)| Hidden::ChannelFault { fault: Fault::Gain { response, gain_db } });
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(&hidden, &folder.path().join("room"), None).unwrap();
    let config = DiagnoseConfig { rays: 500, simulations: 10, ..DiagnoseConfig::default() };
    let only = ["channel_fault".to_owned()];
    let found = Diagnoser::new(config).unwrap().with_only(&only).unwrap().diagnose(&room, &[], &()).unwrap();
    assert_eq!(found.causes.len(), 2, "{:?}", found.causes);
    assert_eq!(
        found.model.applied().response_gain_db.len(),
        2,
        "{:?}",
        found.model.applied().response_gain_db
    );
    for (response, gain_db) in wrong {
        let entry = &room.responses()[response];
        let name = format!("{}-{}", room.sources()[entry.source].id, room.receivers()[entry.receiver].id);
        let kept = found.model.applied().response_gain_db[&name];
        assert!((kept - gain_db).abs() < 1.5, "{name}: {kept} dB for {gain_db} dB");
    }
}
