//! Plans of rooms, through the public interface.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_diagnose::{
    DiagnoseConfig, Hypothesis, OpenQuestion, Plan, PlanConfig, PlanError, PlannedMeasurement, Planner,
};
use sabine_scene::MeasuredRoom;
use sabine_testkit::{Hidden, LabConfig, Laboratory};

fn config() -> PlanConfig {
    let diagnose = DiagnoseConfig { rays: 500, simulations: 10, ..DiagnoseConfig::default() };
    PlanConfig { diagnose, candidates: 8, microphones: 2, ..PlanConfig::default() }
}

fn room(hidden: &[Hidden], receivers: usize) -> (tempfile::TempDir, MeasuredRoom) {
    let lab = Laboratory::new(LabConfig { seed: 31, receivers, ..LabConfig::default() }).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(hidden, &folder.path().join("room"), None).unwrap();
    (folder, room)
}

fn plan(room: &MeasuredRoom, question: Option<&OpenQuestion>) -> Plan {
    Planner::new(config()).unwrap().plan(room, question, &()).unwrap()
}

fn question(effects: &[&str]) -> OpenQuestion {
    let leading = effects.iter().copied().map(Hypothesis::of).collect();
    OpenQuestion { leading, ..OpenQuestion::default() }
}

#[test]
fn a_campaign_is_planned_where_nothing_is_measured_and_nothing_stands() {
    let (_folder, room) = room(&[], 3);
    let bare = plan(&room.unmeasured_at(Vec::new()), None);
    assert_eq!((bare.chosen.len(), bare.stated_responses), (2, 0));
    let only_microphones =
        bare.candidates.iter().all(|c| matches!(c.measurement, PlannedMeasurement::Microphone { .. }));
    assert!(only_microphones && bare.candidates.len() >= 3);
    for effect in &bare.effects {
        assert!(effect.named_from[0] == f64::INFINITY && effect.d_prime[0] == 0.0, "{effect:?}");
        assert!(effect.d_prime[1].is_finite());
    }
    // A loudspeaker that is directional shows in any response; numbers are those of a plan, not of chance.
    let shown = |id: &str| bare.effects.iter().find(|e| e.effect == id).unwrap();
    assert!(shown("source_directivity").d_prime[1] > 1.0 && shown("scattering").d_prime[1] > 0.5);
    assert!(bare.candidates.windows(2).all(|w| w[0].nats >= w[1].nats));
    assert!(bare.chosen[0].candidate == 0 && bare.chosen[1].adds_nats > 0.0);
    // Nothing of one microphone that is not there yet.
    assert!(bare.effects.iter().all(|e| e.subject.as_deref() != Some("microphone")));
    // Stated positions count as measured: less is left to learn, and no effect shows less with more positions.
    let stated = plan(&room.unmeasured_at(room.receivers().to_vec()), None);
    assert_eq!(stated.stated_responses, 3);
    assert!(stated.candidates[0].nats < bare.candidates[0].nats);
    for effect in &stated.effects {
        assert!(effect.d_prime[1] >= effect.d_prime[0] * (1.0 - 1e-9), "{effect:?}");
        assert!(effect.named_from[1] <= effect.named_from[0] * (1.0 + 1e-9), "{effect:?}");
    }
}

#[test]
fn turning_the_source_tells_a_directional_one_from_a_wrong_table() {
    let lab = Laboratory::new(LabConfig { seed: 31, receivers: 3, ..LabConfig::default() }).unwrap();
    let hidden = Hidden::random("source_directivity", 0.5, &lab, 31).unwrap();
    let (_folder, room) = room(&[hidden], 3);
    let question = question(&["source_directivity", "transducer_response"]);
    let found = plan(&room, Some(&question));
    assert_eq!(found.question.as_ref(), Some(&question));
    let of = |turned: bool| {
        let own = |c: &&sabine_diagnose::Weighing| match c.measurement {
            PlannedMeasurement::SourceTurned { .. } => turned,
            PlannedMeasurement::Climate { .. } => !turned,
            _ => false,
        };
        found.candidates.iter().filter(own).map(|c| c.nats).fold(f64::NEG_INFINITY, f64::max)
    };
    // Other air says nothing of a loudspeaker that the old air did not say: chance is all that is new.
    assert!(of(true) > 2.0 * of(false) && of(true) > 1.0, "{} {}", of(true), of(false));
    assert!(found.candidates.iter().all(|c| c.nats > -1e-6 && c.nats.is_finite()));
    assert_eq!(found.candidates[0].decides[0].what, "source_directivity or transducer_response");
}

#[test]
fn the_same_plan_on_any_number_of_threads() {
    let (_folder, room) = room(&[], 2);
    let question = question(&["surface_absorption", "sound_speed"]);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut found = pool.install(|| plan(&room, Some(&question)));
        found.seconds.clear();
        found
    };
    assert_eq!(on(1), on(3));
}

/// A diagnosis often has standing waves among what comes next; for a plan they are not solved.
#[test]
fn what_no_plan_weighs_is_left_out_of_the_question() {
    let (_folder, room) = room(&[], 2);
    let mut with_waves = question(&["surface_absorption", "room_modes", "sound_speed"]);
    with_waves.sure = question(&["room_modes"]).leading;
    let found = plan(&room, Some(&with_waves));
    assert_eq!(found.question, Some(question(&["surface_absorption", "sound_speed"])));
    assert_eq!(found.candidates[0].decides[0].what, "surface_absorption or sound_speed");
    assert_eq!(found.not_planned, ["room_modes"]);
    // A cause that is sure is not left out in silence either.
    with_waves.leading = question(&["surface_absorption", "sound_speed"]).leading;
    assert_eq!(plan(&room, Some(&with_waves)).not_planned, ["room_modes"]);
}

#[test]
fn what_cannot_be_planned_is_refused() {
    let (_folder, room) = room(&[], 2);
    let refused = |config: PlanConfig, room: &MeasuredRoom, question: Option<&OpenQuestion>| {
        Planner::new(config).and_then(|planner| planner.plan(room, question, &())).unwrap_err()
    };
    let found = refused(PlanConfig { clearance_m: 9.0, ..config() }, &room, None);
    assert!(matches!(found, PlanError::NoPlace { clearance_m, .. } if clearance_m == 9.0), "{found}");
    let found = refused(PlanConfig { microphones: 20, ..config() }, &room, None);
    assert!(matches!(found, PlanError::FewPlaces { asked: 20, .. }), "{found}");
    let nobody = room.unmeasured_at(Vec::new());
    let found = refused(PlanConfig { sources: 1, ..config() }, &nobody, None);
    assert!(matches!(found, PlanError::NoReceiver), "{found}");
    let found = refused(PlanConfig { clearance_m: f64::NAN, ..config() }, &room, None);
    assert!(matches!(found, PlanError::OutOfRange(_)), "{found}");
    let found = refused(config(), &room, Some(&question(&["sound_speed"])));
    assert!(matches!(found, PlanError::OneHypothesis { found: 1 }), "{found}");
    let found = refused(config(), &room, Some(&question(&["sound_speed", "ghosts"])));
    assert!(matches!(found, PlanError::UnknownHypothesis { .. }), "{found}");
    let found = refused(config(), &room, Some(&question(&["sound_speed", "room_modes"])));
    assert!(matches!(&found, PlanError::NotPlanned { names } if names == "room_modes"), "{found}");
    let found = refused(config(), &room, Some(&question(&["channel_fault", "channel_fault"])));
    assert!(matches!(found, PlanError::NotPredicted { .. }), "{found}");
    let found = refused(config(), &nobody, Some(&question(&["sound_speed", "sampling_clock"])));
    assert!(matches!(found, PlanError::Diagnose(sabine_diagnose::Error::NoResponses)), "{found}");
}
