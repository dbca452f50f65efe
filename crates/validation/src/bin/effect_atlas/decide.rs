//! Whether the measurement that a set of causes asks for does decide between them.

use crate::task::Task;
use rand::seq::IndexedRandom;
use rand::{SeedableRng, rngs::SmallRng};
use sabine::diagnose::{
    Diagnosis, EffectInfo, NextMeasurement, Verdict, catalogue, discriminating_measurement,
};
use sabine_testkit::{Hidden, LabConfig, Laboratory};
use sabine_validation::AnyError;
use sabine_validation::hiding::named;
use std::path::Path;

/// All that can be done in the laboratory.
const ALL: [NextMeasurement; 17] = [
    NextMeasurement::ClockOrThermometer,
    NextMeasurement::OtherHumidity,
    NextMeasurement::LouderAndLonger,
    NextMeasurement::DoorsClosed,
    NextMeasurement::LongerWithSilence,
    NextMeasurement::TurnedSource,
    NextMeasurement::Loopback,
    NextMeasurement::Distances,
    NextMeasurement::DistancesToWalls,
    NextMeasurement::ExchangedChannel,
    NextMeasurement::Quieter,
    NextMeasurement::AlongWalls,
    NextMeasurement::PatchClosed,
    NextMeasurement::ObjectsRemoved,
    NextMeasurement::OtherSourcePlace,
    NextMeasurement::MorePositions,
    NextMeasurement::MorePositionsAndSource,
];

/// Two measurements, and whether the right name comes out alone after each.
pub struct FollowUp {
    pub asked: (NextMeasurement, bool),
    pub other: (NextMeasurement, bool),
}

/// What a measurement is in the laboratory.
enum Extra {
    /// The room measured again and more, all of it diagnosed together.
    More(LabConfig),
    /// The room measured once more without what these effects stand for: if nothing is wrong any more, it was that one.
    Without(Vec<&'static str>),
}

fn extra(measurement: NextMeasurement, lab: &LabConfig, set: &[String]) -> Extra {
    // Twice as many positions, and another source, as far as the laboratory goes.
    let receivers = (2 * lab.receivers).min(40);
    let (more, sources) = (LabConfig { receivers, ..lab.clone() }, (2 * lab.sources).min(8));
    let is_among = |id: &str| set.iter().any(|s| s == id);
    match measurement {
        NextMeasurement::ClockOrThermometer => Extra::Without(vec!["sampling_clock"]),
        NextMeasurement::OtherHumidity => Extra::More(LabConfig { sessions: 2, ..more }),
        NextMeasurement::LouderAndLonger => Extra::Without(vec!["background_noise"]),
        NextMeasurement::DoorsClosed => Extra::Without(vec!["coupled_volume"]),
        NextMeasurement::LongerWithSilence if is_among("truncation") => Extra::Without(vec!["truncation"]),
        NextMeasurement::LongerWithSilence => Extra::Without(vec!["background_noise"]),
        NextMeasurement::TurnedSource => Extra::More(LabConfig { turned: true, ..lab.clone() }),
        NextMeasurement::Loopback => Extra::Without(vec!["time_zero"]),
        NextMeasurement::Distances => {
            Extra::Without(vec!["position_error", "room_dimensions", "surface_displacement"])
        }
        NextMeasurement::DistancesToWalls => Extra::Without(vec!["coordinate_shift"]),
        NextMeasurement::ExchangedChannel => Extra::Without(vec!["channel_fault"]),
        NextMeasurement::Quieter => Extra::Without(vec!["nonlinear_distortion"]),
        NextMeasurement::PatchClosed => Extra::Without(vec!["open_patch"]),
        NextMeasurement::ObjectsRemoved => Extra::Without(vec!["extra_reflector"]),
        NextMeasurement::OtherSourcePlace => Extra::More(LabConfig { sources, ..lab.clone() }),
        NextMeasurement::MorePositions => Extra::More(more),
        _ => Extra::More(LabConfig { sources, ..more }),
    }
}

/// Follows a set of causes up by what would decide between the hidden one and the first of the others, and by a measurement drawn from
/// the rest.
pub fn follow_up(
    task: &Task,
    lab: &LabConfig,
    hidden: &Hidden,
    set: &[String],
    folder: &Path,
) -> Result<FollowUp, AnyError> {
    let rival = set.iter().find(|s| *s != hidden.id()).ok_or("a set of one")?;
    let effects = catalogue();
    let info = |id: &str| effects.iter().map(|e| e.info()).find(|info| info.id == id);
    let info = |id: &str| info(id).unwrap_or(EffectInfo::new("", "", ""));
    let asked = discriminating_measurement(&info(hidden.id()), &info(rival));
    let rest: Vec<NextMeasurement> = ALL.into_iter().filter(|m| *m != asked).collect();
    let mut random = SmallRng::seed_from_u64(task.seed);
    let other = *rest.choose(&mut random).ok_or("no other measurement")?;
    let decides = |measurement| -> Result<(NextMeasurement, bool), AnyError> {
        let name = concluded(task, extra(measurement, lab, set), lab, hidden, set, folder)?;
        Ok((measurement, name.as_deref() == Some(hidden.id())))
    };
    Ok(FollowUp { asked: decides(asked)?, other: decides(other)? })
}

/// The one name that comes out.
fn concluded(
    task: &Task,
    extra: Extra,
    lab: &LabConfig,
    hidden: &Hidden,
    set: &[String],
    folder: &Path,
) -> Result<Option<String>, AnyError> {
    let one = |found: &Diagnosis| match (&found.verdict, &named(found)[..]) {
        (Verdict::Explained | Verdict::Incomplete, [name]) => Some((*name).to_owned()),
        _ => None,
    };
    match extra {
        Extra::More(config) => {
            let (stated, lab) = (Laboratory::new(lab.clone())?, Laboratory::new(config)?);
            if stated.scene() != lab.scene() {
                // More places do not fit into this room, and the laboratory has drawn another.
                return Ok(None);
            }
            Ok(one(&task.diagnose(&lab, std::slice::from_ref(hidden), folder)?))
        }
        Extra::Without(effects) => {
            let left: Vec<Hidden> =
                [hidden].into_iter().filter(|h| !effects.contains(&h.id())).cloned().collect();
            let found = task.diagnose(&Laboratory::new(lab.clone())?, &left, folder)?;
            let mut gone = set.iter().filter(|s| effects.contains(&s.as_str()));
            match (found.verdict, gone.next(), gone.next()) {
                (Verdict::Adequate, Some(name), None) => Ok(Some(name.clone())),
                // What has not gone cannot be it.
                (Verdict::Ambiguous, ..) => {
                    let mut rest = found.alternatives.iter().filter(|a| !effects.contains(&a.as_str()));
                    Ok(rest.next().filter(|_| rest.next().is_none()).cloned())
                }
                _ => Ok(one(&found)),
            }
        }
    }
}
