//! Sound that bends around a screen, hidden in what finite differences of the wave equation measure: found at receivers in its
//! shadow, and not where there is no screen.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_diagnose::{DiagnoseConfig, Diagnoser, Diagnosis, Verdict};
use sabine_testkit::{ScreenedConfig, ScreenedRoom};

fn diagnose(config: ScreenedConfig) -> Diagnosis {
    let folder = tempfile::tempdir().unwrap();
    let room = ScreenedRoom::new(config).unwrap().write(&folder.path().join("room")).unwrap();
    let config = DiagnoseConfig { rays: 2000, ..DiagnoseConfig::default() };
    Diagnoser::new(config).unwrap().diagnose(&room, &[], &()).unwrap()
}

#[test]
fn what_bends_around_a_screen_is_found() {
    let found = diagnose(ScreenedConfig { seed: 5, receivers: 12, screen: true });
    for c in &found.candidates {
        eprintln!("{} {:?} {:.1} nats, beside {:?}", c.effect, c.subject, c.nats, c.nats_beside_causes);
    }
    eprintln!("{:?} {:?} {:?}", found.verdict, found.lack_of_fit, found.seconds);
    for c in &found.causes {
        eprintln!("{} {:?} {:?} {:?}", c.effect, c.nats, c.parameters, c.held_out_gain);
    }
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert!(named.contains(&"edge_diffraction"), "{:?}", found.verdict);
    let cause = found.causes.iter().find(|c| c.effect == "edge_diffraction").unwrap();
    let gain = cause.held_out_gain.clone().unwrap();
    assert!(gain.low > 0.0, "{gain:?}");
}

#[test]
fn where_there_is_no_screen_nothing_bends() {
    let found = diagnose(ScreenedConfig { seed: 5, receivers: 12, screen: false });
    eprintln!("{:?} {:?} {:?}", found.verdict, found.lack_of_fit, found.seconds);
    for c in &found.candidates {
        eprintln!("{} {:?} {:.1} nats, beside {:?}", c.effect, c.subject, c.nats, c.nats_beside_causes);
    }
    for c in &found.causes {
        eprintln!("{} {:?} {:?} {:?}", c.effect, c.nats, c.parameters, c.held_out_gain);
    }
    assert!(found.causes.iter().all(|c| c.effect != "edge_diffraction"));
    assert_ne!(found.verdict, Verdict::Unexplained);
}
