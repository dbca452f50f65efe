//! Rooms of the second laboratory: no boxes, their responses by physics that the engine shares nothing with. Whole catalogue. Seeds were
//! looked at before: rates are those of `polyhedral_rooms` (docs/validation/diagnose.md).
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::rivals::diagnoser_among;
use sabine_diagnose::{DiagnoseConfig, Diagnoser, Diagnosis, Verdict};
use sabine_testkit::{Planted, PolyhedralConfig, PolyhedralRoom, Polyhedron};

fn diagnose(config: PolyhedralConfig, rays: usize) -> (PolyhedralRoom, Diagnosis) {
    let laboratory = PolyhedralRoom::new(config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let room = laboratory.write(&folder.path().join("room")).unwrap();
    let config = DiagnoseConfig { rays, seed: config.seed, ..DiagnoseConfig::default() };
    (laboratory, Diagnoser::new(config).unwrap().diagnose(&room, &[], &()).unwrap())
}

#[test]
fn rooms_as_stated_are_adequate() {
    for (shape, seed) in [(Polyhedron::SlopedCeiling, 701), (Polyhedron::Furnished, 703)] {
        let config = PolyhedralConfig { seed, shape, ..PolyhedralConfig::default() };
        let (_, found) = diagnose(config, 10_000);
        assert_eq!(found.verdict, Verdict::Adequate, "{:?} {:?}", found.causes, found.notes);
    }
}

/// The table of one material is far off in a room where nearly any other could absorb as much: an opening explains as much at most.
#[test]
fn a_table_that_is_wrong_is_named_though_all_tables_can_make_up_for_it() {
    let config = PolyhedralConfig {
        seed: 222,
        shape: Polyhedron::Wedge,
        planted: Planted::Surface,
        nuisances: true,
        receivers: 10,
        ..PolyhedralConfig::default()
    };
    let (laboratory, found) = diagnose(config, 4000);
    let wanted = laboratory.subject().unwrap();
    let named = found.causes.iter().find(|c| c.effect == "surface_absorption").unwrap();
    let mut subjects = named.subject.iter().chain(&named.other_subjects);
    assert!(subjects.any(|s| s == wanted), "{wanted}: {:?}", found.causes);
    // Reflections keep their sign there, and channels differ by 1 dB.
    let others = found.causes.iter().filter(|c| c.effect != "surface_absorption");
    for other in others {
        assert!(["coherent_reflections", "channel_response"].contains(&&*other.effect), "{other:?}");
    }
}

#[test]
fn a_wall_of_an_l_is_found_where_it_stands() {
    let planted = Planted::Wall;
    let config = PolyhedralConfig { seed: 248, planted, receivers: 10, ..PolyhedralConfig::default() };
    let (laboratory, found) = diagnose(config, 4000);
    let wall = laboratory.moved_wall().unwrap();
    let along = |p: [f64; 3]| -> f64 { (0..3).map(|k| wall.normal[k] * p[k]).sum() };
    let [surface] = &found.model.applied().surfaces[..] else { panic!("{:?}", found.causes) };
    assert!(along(surface.normal).abs() > 0.999);
    assert!((along(surface.point_m) - along(wall.point_m)).abs() < 0.01);
    let offset_m = surface.offset_m * along(surface.normal).signum();
    assert!((offset_m - wall.offset_m).abs() < 0.02, "{offset_m} for {}", wall.offset_m);
    assert_eq!(found.causes.len(), 1, "{:?}", found.causes);
}

/// A cupboard that the mesh lacks, in an unkind world: it stands where it was found, and nothing else is named that is not there.
#[test]
fn an_object_that_the_mesh_lacks_is_found_where_it_stands() {
    let config = PolyhedralConfig {
        seed: 275,
        shape: Polyhedron::SlopedCeiling,
        planted: Planted::Object,
        nuisances: true,
        ..PolyhedralConfig::default()
    };
    let laboratory = PolyhedralRoom::new(config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let room = laboratory.write(&folder.path().join("room")).unwrap();
    let settings = DiagnoseConfig { rays: 2000, seed: config.seed, ..DiagnoseConfig::default() };
    let rivals =
        ["extra_reflector", "open_patch", "position_error", "surface_displacement", "missing_object"];
    let found = diagnoser_among(settings, &rivals).diagnose(&room, &[], &()).unwrap();
    let [low, high] = laboratory.object().unwrap();
    let [object] = &found.model.applied().objects[..] else { panic!("{:?} {:?}", found.causes, found.notes) };
    let off = [0, 1].map(|k| object.base_m[k] - 0.5 * (low[k] + high[k]));
    assert!(off[0].hypot(off[1]) < 0.5, "{object:?}");
    let cause = found.causes.iter().find(|c| c.effect == "missing_object").unwrap();
    assert!(cause.explanation.contains("stands with its middle at"), "{}", cause.explanation);
    let height = cause.parameters.iter().find(|p| p.name == "height").unwrap();
    assert!(height.low <= height.value && height.value <= height.high);
    // Reflections keep their sign there, and channels differ by 1 dB.
    let allowed = ["missing_object", "coherent_reflections", "channel_response"];
    assert!(found.causes.iter().all(|c| allowed.contains(&&*c.effect)), "{:?}", found.causes);
}
