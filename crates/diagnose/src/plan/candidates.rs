//! All measurements that are weighed, each as the room with something moved, turned or at another temperature.

use crate::effect::Nuisance;
use crate::plan::config::PlanConfig;
use crate::plan::error::PlanError;
use crate::plan::measurement::PlannedMeasurement;
use crate::plan::places::{Grid, grid, microphone_height_m};
use sabine_acoustics::Air;
use sabine_propagate::MeshScene;
use sabine_scene::{MeasuredRoom, Receiver, Source};

/// Microphones at which a source elsewhere, a turned source or other air is weighed: more tell hardly more about which is best.
pub(crate) const MAX_MICROPHONES: usize = 6;
/// Turns of a source whose axis is known, in degrees to its left.
const TURNS_DEG: [f64; 2] = [90.0, 180.0];
/// How much warmer other air is, in kelvin.
const WARMER_K: f64 = 6.0;
/// Humidity above which other air is half as humid, and twice as humid below, in per cent.
const HUMID_PERCENT: f64 = 35.0;
/// Of all places of a grid, those that are offered to sources.
const SOURCE_SHARE: usize = 6;

/// What is traced for one measurement: the room's sources and receivers as they would stand, and the responses.
#[derive(Clone)]
pub(crate) struct Variation {
    pub sources: Vec<Source>,
    pub receivers: Vec<Receiver>,
    /// Source, receiver, and the air.
    pub responses: Vec<(usize, usize, Air)>,
    /// The place that is new: how far it is off has nothing to do with what was measured before.
    pub moved: Option<Nuisance>,
}

/// The candidates and the grid on which their microphones stand.
pub(crate) struct Candidates {
    pub all: Vec<(PlannedMeasurement, Variation)>,
    pub grid: Grid,
}

/// The room as stated, all its sources heard at all its receivers: what has been, or will be, measured anyway.
pub(crate) fn stated(room: &MeasuredRoom) -> Variation {
    let (sources, receivers) = (room.sources().to_vec(), room.receivers().to_vec());
    let responses = if room.responses().is_empty() {
        pairs(sources.len(), receivers.len(), room.air())
    } else {
        room.responses().iter().map(|r| (r.source, r.receiver, r.air)).collect()
    };
    Variation { sources, receivers, responses, moved: None }
}

fn pairs(sources: usize, receivers: usize, air: Air) -> Vec<(usize, usize, Air)> {
    (0..sources).flat_map(|s| (0..receivers).map(move |r| (s, r, air))).collect()
}

/// About `most` measurements: three quarters of them microphones. `room` has at least one receiver, which `is_planned` if the room file has
/// none.
pub(crate) fn candidates(
    room: &MeasuredRoom,
    is_planned: bool,
    config: &PlanConfig,
) -> Result<Candidates, PlanError> {
    let (clearance_m, most) = (config.clearance_m, config.candidates);
    let mesh = MeshScene::new(room.scene())?;
    let height_m = microphone_height_m(room);
    let microphones = (3 * most).div_ceil(4).max(1);
    let sources = room.sources().iter().map(|s| s.position_m);
    let receivers = room.receivers().iter().map(|r| r.position_m).filter(|_| !is_planned);
    let taken_m: Vec<[f64; 3]> = sources.chain(receivers).collect();
    let grid_of = |height_m: f64, most: usize| grid((room, &mesh), &taken_m, height_m, clearance_m, most);
    let found = if config.places_m.is_empty() {
        grid_of(height_m, microphones)?
    } else {
        Grid { spacing_m: clearance_m, places_m: config.places_m.clone() }
    };
    let base = stated(room);
    let mut all: Vec<(PlannedMeasurement, Variation)> = found
        .places_m
        .iter()
        .map(|&position_m| {
            let mut one = base.clone();
            one.receivers[0].position_m = position_m;
            one.responses = (0..one.sources.len()).map(|s| (s, 0, room.air())).collect();
            one.moved = Some(Nuisance::ReceiverPosition(0));
            (PlannedMeasurement::Microphone { position_m }, one)
        })
        .collect();
    if !is_planned {
        let heard = room.receivers().len().min(MAX_MICROPHONES);
        let first = &room.sources()[0];
        // As good as none where the loudspeaker's height leaves no place.
        let places = grid_of(first.position_m[2], (most / SOURCE_SHARE).max(1)).map(|grid| grid.places_m);
        for position_m in places.unwrap_or_default() {
            let mut one = base.clone();
            one.sources[0].position_m = position_m;
            one.responses = (0..heard).map(|r| (0, r, room.air())).collect();
            one.moved = Some(Nuisance::SourcePosition(0));
            all.push((PlannedMeasurement::Source { source: first.id.clone(), position_m }, one));
        }
        all.extend(turned(room, &base, heard));
        all.extend(other_air(room, &base, heard));
    }
    Ok(Candidates { all, grid: found })
}

/// The first source turned, where its axis is known and is not vertical.
fn turned(room: &MeasuredRoom, base: &Variation, heard: usize) -> Vec<(PlannedMeasurement, Variation)> {
    let source = &room.sources()[0];
    let Some([x, y, z]) = source.axis.filter(|[x, y, _]| x.hypot(*y) > 1e-3) else { return Vec::new() };
    TURNS_DEG
        .into_iter()
        .map(|degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let mut one = base.clone();
            one.sources[0].axis = Some([cos * x - sin * y, sin * x + cos * y, z]);
            one.responses = (0..heard).map(|r| (0, r, room.air())).collect();
            (PlannedMeasurement::SourceTurned { source: source.id.clone(), degrees }, one)
        })
        .collect()
}

/// Warmer air, and air of another humidity.
fn other_air(room: &MeasuredRoom, base: &Variation, heard: usize) -> Vec<(PlannedMeasurement, Variation)> {
    let air = room.air();
    let humid = air.relative_humidity_percent();
    let other = if humid > HUMID_PERCENT { 0.5 * humid } else { 2.0 * humid.max(5.0) };
    [(air.temperature_c() + WARMER_K, humid), (air.temperature_c(), other)]
        .into_iter()
        .filter_map(|(temperature_c, relative_humidity_percent)| {
            let air = Air::new(temperature_c, relative_humidity_percent, air.pressure_kpa()).ok()?;
            let mut one = base.clone();
            one.responses = (0..heard).map(|r| (0, r, air)).collect();
            Some((PlannedMeasurement::Climate { temperature_c, relative_humidity_percent }, one))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    fn room() -> MeasuredRoom {
        MeasuredRoom::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room")).unwrap()
    }

    fn config(clearance_m: f64) -> PlanConfig {
        PlanConfig { clearance_m, ..PlanConfig::default() }
    }

    #[test]
    fn places_have_clearance_and_lie_in_the_room() {
        let room = room();
        let clearance_m = 0.4;
        let found = candidates(&room, false, &config(clearance_m)).unwrap();
        let [low, high] = room.scene().bounds_m();
        let mut microphones = 0;
        for (measurement, one) in &found.all {
            let Some(place) = measurement.position_m() else { continue };
            microphones += usize::from(matches!(measurement, PlannedMeasurement::Microphone { .. }));
            // The fixture is a box.
            for k in 0..3 {
                assert!(place[k] - low[k] > clearance_m - 1e-9 && high[k] - place[k] > clearance_m - 1e-9);
            }
            let stated = room.sources().iter().map(|s| s.position_m);
            for other in stated.chain(room.receivers().iter().map(|r| r.position_m)) {
                let apart = (0..3).map(|k| (other[k] - place[k]).powi(2)).sum::<f64>().sqrt();
                assert!(apart >= clearance_m);
            }
            assert!(!one.responses.is_empty() && one.moved.is_some());
        }
        assert!((20..=45).contains(&microphones), "{microphones}");
        assert!(found.all.len() > microphones + 4 && found.all.len() <= 64, "{}", found.all.len());
    }

    #[test]
    fn a_room_too_small_has_no_place() {
        let refused = candidates(&room(), false, &config(50.0));
        assert!(matches!(refused, Err(PlanError::NoPlace { .. })));
    }

    #[test]
    fn a_turn_keeps_the_elevation_and_turns_left() {
        let room = room();
        let mut sources = room.sources().to_vec();
        sources[0].axis = Some([0.6, 0.0, 0.8]);
        let room =
            room.with_model(room.scene().clone(), room.air(), sources, room.receivers().to_vec()).unwrap();
        let found = turned(&room, &stated(&room), 1);
        let axis = |k: usize| found[k].1.sources[0].axis.unwrap();
        for (found, expected) in [(axis(0), [0.0, 0.6, 0.8]), (axis(1), [-0.6, 0.0, 0.8])] {
            assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-12), "{found:?}");
        }
    }
}
