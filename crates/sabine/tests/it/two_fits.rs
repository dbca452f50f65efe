//! The absorption of one room by two likelihoods that share no code: the fit to responses of `sabine-optimize` and the baseline of
//! `sabine-diagnose`. Where both determine a value, their intervals must overlap; where they do not, the test says so.

use sabine::acoustics::{Bands, Material};
use sabine::diagnose::{DiagnoseConfig, Diagnoser};
use sabine::optimize::{AbsorptionPrior, FitConfig, FitProblem, MaterialFitter, MeasuredDecay, MeasuredPair};
use sabine::paths::{PathSet, Propagator};
use sabine::propagate::{PathTracer, TracerConfig};
use sabine::scene::MeasuredRoom;
use sabine_testkit::{LabConfig, Laboratory};
use std::path::Path;

/// Specular paths of cuboids in closed form, as the diagnosis takes them: few rays miss the late decay of a box of mirrors, and the fits
/// shall differ in nothing but what they make of the paths.
const CUBOID_PATHS: usize = 150_000;
/// Rays of most comparisons.
const RAYS: usize = 5000;
/// The data say something of a value if its standard deviation has fallen to this share of the prior's.
const DETERMINED: f64 = 0.9;
/// Half the width of a 90 % interval, in standard deviations.
const QUANTILE_90: f64 = 1.645;

/// Absorption and its standard deviation, by material and band.
type Found = Vec<Vec<(f64, f64)>>;

fn by_optimize(room: &MeasuredRoom, bands: Bands, rays: usize) -> Found {
    let materials: Vec<Material> =
        room.scene().materials().iter().map(|named| named.material.resampled(bands)).collect();
    let priors = AbsorptionPrior::of_room(room, bands);
    let scene = room.scene().with_materials(materials.clone()).unwrap();
    let config = TracerConfig {
        rays,
        duration_s: 1.25,
        seed: 1,
        cuboid_paths: CUBOID_PATHS,
        ..TracerConfig::default()
    };
    let tracer = PathTracer::new(config).unwrap();
    let measured: Vec<(MeasuredDecay, PathSet)> = room
        .responses()
        .iter()
        .enumerate()
        .map(|(i, entry)| {
            let (source, receiver) = (&room.sources()[entry.source], &room.receivers()[entry.receiver]);
            let decay = MeasuredDecay::new(&room.load_response(i).unwrap(), bands).unwrap();
            (decay, tracer.trace(&scene, source, receiver, &entry.air, &()).unwrap())
        })
        .collect();
    let pairs: Vec<MeasuredPair<'_>> =
        measured.iter().map(|(measured, paths)| MeasuredPair { measured, paths }).collect();
    let fitter = MaterialFitter::new(FitConfig::default()).unwrap();
    let done = fitter
        .fit_responses(&pairs, room.measurement(), &FitProblem::new(&materials, &priors, &room.air()), &())
        .unwrap();
    assert_eq!(done.fit.unconverged_hz(), [0.0; 0]);
    let of = |k: usize| {
        let sd = done.fit.absorption_standard_error[k].values();
        done.fit.materials[k].absorption().values().iter().copied().zip(sd.iter().copied()).collect()
    };
    (0..materials.len()).map(of).collect()
}

fn by_diagnose(room: &MeasuredRoom, rays: usize) -> (Bands, Found) {
    let config = DiagnoseConfig { rays, simulations: 10, wave_solutions: false, ..Default::default() };
    let found = Diagnoser::new(config).unwrap().with_only(&[]).unwrap().diagnose(room, &[], &()).unwrap();
    assert!(found.causes.is_empty());
    let of = |(_, fitted): &(String, sabine::diagnose::FittedMaterial)| {
        fitted.absorption.iter().copied().zip(fitted.absorption_sd.iter().copied()).collect()
    };
    (found.bands, found.materials.iter().map(of).collect())
}

/// What both determine: material and band, with the distance in half widths of both intervals together, 1 where they only touch.
fn distances(
    room: &MeasuredRoom,
    rays: usize,
    truth: Option<&dyn Fn(usize, usize) -> f64>,
) -> Vec<(String, f64)> {
    let (bands, diagnosed) = by_diagnose(room, rays);
    let optimised = by_optimize(room, bands, rays);
    let priors = AbsorptionPrior::of_room(room, bands);
    let mut distances = Vec::new();
    for (k, prior) in priors.iter().enumerate() {
        for (b, hz) in bands.iter_hz().enumerate() {
            let ((one, one_sd), (other, other_sd)) = (optimised[k][b], diagnosed[k][b]);
            let limit = DETERMINED * prior.standard_deviation.values()[b];
            if one_sd > limit || other_sd > limit {
                continue;
            }
            let distance = (one - other).abs() / (QUANTILE_90 * (one_sd + other_sd));
            let name = format!("{} at {hz} Hz", room.scene().materials()[k].name);
            let truth = truth.map_or(String::new(), |truth| format!(", true {:.3}", truth(k, b)));
            println!(
                "{name}: optimize {one:.3} +- {one_sd:.3}, diagnose {other:.3} +- {other_sd:.3}{truth}: {distance:.2}"
            );
            distances.push((name, distance));
        }
    }
    distances
}

/// Those whose intervals do not overlap.
fn apart(distances: &[(String, f64)]) -> Vec<&str> {
    distances.iter().filter(|(_, distance)| *distance >= 1.0).map(|(name, _)| name.as_str()).collect()
}

#[test]
fn both_fits_agree_on_the_fixture() {
    let room = MeasuredRoom::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room")).unwrap();
    // Each fit draws rays of its own. With 5,000 they disagree on one value of 44, the window at 4 kHz.
    let distances = distances(&room, 20_000, None);
    assert!(!distances.is_empty(), "nothing is determined by both");
    assert!(apart(&distances).is_empty(), "{distances:.2?}");
}

/// A room of image sources by code that neither fit knows, drawn from a seed.
fn laboratory(seed: u64) -> Vec<(String, f64)> {
    let lab = Laboratory::new(LabConfig { seed, receivers: 6, ..LabConfig::default() }).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(&[], &folder.path().join("room"), None).unwrap();
    let scene = lab.true_scene(&[]).unwrap();
    let truth = |k: usize, b: usize| scene.materials()[k].material.absorption().values()[b];
    distances(&room, RAYS, Some(&truth))
}

#[test]
fn both_fits_agree_on_a_laboratory_room() {
    // One wall absorbs half of all energy and more, and some octaves ring twice as long as their neighbours.
    let distances = laboratory(501);
    assert!(distances.len() > 20, "{} are determined by both", distances.len());
    assert!(apart(&distances).is_empty(), "{distances:.2?}");
}

#[test]
#[ignore = "nightly: half a minute, and two other rooms are not ignored"]
fn both_fits_agree_on_another_but_for_a_value_at_8_khz() {
    // A seed looked at once. The true value at 8 kHz lies between the two, two standard deviations from one and 1.4 from the other.
    let distances = laboratory(7019);
    assert!(distances.len() > 15, "{} are determined by both", distances.len());
    assert!(apart(&distances).iter().all(|name| *name == "cork at 8000 Hz"), "{distances:.2?}");
    assert!(distances.iter().all(|(_, distance)| *distance < 1.1), "{distances:.2?}");
}

/// The room's folder with the first responses only.
fn with_first_responses(folder: &Path, count: usize, to: &Path) -> MeasuredRoom {
    let text = std::fs::read_to_string(folder.join("room.toml")).unwrap();
    let mut parts = text.split("[[responses]]");
    let mut shorter = parts.next().unwrap().to_owned();
    parts.take(count).for_each(|entry| shorter += &format!("[[responses]]{entry}"));
    std::fs::create_dir_all(to.join("ir")).unwrap();
    std::fs::write(to.join("room.toml"), shorter).unwrap();
    std::fs::copy(folder.join("room.obj"), to.join("room.obj")).unwrap();
    for entry in std::fs::read_dir(folder.join("ir")).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), to.join("ir").join(entry.file_name())).unwrap();
    }
    MeasuredRoom::read(to).unwrap()
}

#[test]
fn both_fits_agree_on_dechorate_but_for_the_floor_in_two_octaves() {
    let rooms = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms");
    let dechorate = Path::new(rooms).join("dechorate_011111");
    if !dechorate.exists() {
        eprintln!("skipped: {} is absent", dechorate.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let room = with_first_responses(&dechorate, 4, folder.path());
    let distances = distances(&room, RAYS, None);
    assert!(distances.len() > 10, "{} are determined by both", distances.len());
    // The source is a directional loudspeaker of unknown axis. Gains that are free in each octave of each response take that up; the
    // diagnosis has one gain for all octaves, and makes up for the rest with the surface that absorbs most.
    let apart = apart(&distances);
    assert!(apart.iter().all(|name| ["floor at 4000 Hz", "floor at 8000 Hz"].contains(name)), "{apart:?}");
}
