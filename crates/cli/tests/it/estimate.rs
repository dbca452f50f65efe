//! `sabine estimate` of one recording and of several of one room.

use crate::sabine;
use serde_json::Value;

#[test]
fn recordings_of_one_room_are_answered_each_and_together() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("heard.json");
    let speech = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/speech/recording.wav");
    let output =
        sabine("estimate").args([speech, speech, "--one-room", "--json"]).arg(&json).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("2 recordings of one room"));
    let entries: Vec<Value> = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(entries.len(), 3);
    assert_eq!(entries[0]["file"], speech);
    assert!(entries[2].get("file").is_none());
    assert_eq!(entries[2]["combined"].as_array().map(Vec::len), Some(2));
    let sd = |entry: usize| entries[entry]["eq_sd_db"][2].as_f64().unwrap();
    assert!(sd(2) < sd(0), "{} {}", sd(2), sd(0));
    // The same recording twice says the same of the reverberation time.
    let t60_s = |entry: usize| entries[entry]["t60_s"][3].as_f64().unwrap();
    assert!((t60_s(2) / t60_s(0) - 1.0).abs() < 1e-9);
}
