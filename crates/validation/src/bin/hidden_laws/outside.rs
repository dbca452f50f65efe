//! What a model says of places outside the range that it was fitted in: nearer to the source, and farther from it, than all that were.

use sabine::diagnose::Diagnosis;
use sabine::scene::MeasuredRoom;
use sabine_validation::AnyError;
use sabine_validation::comparison::{Gain, compare};
use sabine_validation::heard::{Heard, measured, rendered};
use sabine_validation::models::as_stated;

/// Receivers that are left out, half of them nearer and half farther.
pub const OUTSIDE: usize = 8;

/// Receivers (indices) that are left out: by their distance from the source, as the room file states it.
pub fn receivers(room: &MeasuredRoom) -> Vec<usize> {
    let source_m = room.sources()[0].position_m;
    let square = |index: &usize| -> f64 {
        let place_m = room.receivers()[*index].position_m;
        (0..3).map(|k| (place_m[k] - source_m[k]).powi(2)).sum()
    };
    let mut all: Vec<usize> = (0..room.receivers().len()).collect();
    all.sort_by(|a, b| square(a).total_cmp(&square(b)));
    let farther = all.split_off(all.len() - OUTSIDE / 2);
    all.truncate(OUTSIDE / 2);
    all.into_iter().chain(farther).collect()
}

/// How far off models are there.
#[derive(Clone, Copy, Debug)]
pub struct Outside {
    /// Root mean square error of decay curves in dB: of the room as stated, and of the model found.
    pub stated_db: f64,
    pub found_db: f64,
    /// What the model found gains over the room as stated, in nats for each level of an octave in a stretch of time.
    pub nats: f64,
}

/// Renders both models at all places of a room and compares them with what was measured at those left out.
pub fn errors(
    found: &Diagnosis,
    room: &MeasuredRoom,
    outside: &[usize],
    (rays, seed): (usize, u64),
) -> Result<Outside, AnyError> {
    let (left_out, mut order): (Vec<usize>, Vec<usize>) =
        (0..room.responses().len()).partition(|&index| outside.contains(&room.responses()[index].receiver));
    let fitted = order.len();
    order.extend(left_out);
    // The first are those that were fitted.
    let ordered = |all: Vec<Heard>| -> Vec<Heard> { order.iter().map(|&index| all[index].clone()).collect() };
    let models = [&as_stated(found), &found.model];
    let heard: Vec<Vec<Heard>> = models
        .iter()
        .map(|m| Ok(ordered(rendered(m, room, rays, seed)?)))
        .collect::<Result<_, AnyError>>()?;
    let views: Vec<&[Heard]> = heard.iter().map(Vec::as_slice).collect();
    let predictions = compare(&ordered(measured(room)?), &views, fitted, false);
    let [stated, found] = &predictions[..] else { return Err("two models have two predictions".into()) };
    let nats = Gain::of(&found.decay_nats, &stated.decay_nats, &stated.levels).nats;
    Ok(Outside { stated_db: stated.curve_db, found_db: found.curve_db, nats })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine::diagnose::{DiagnoseConfig, Diagnoser};
    use sabine_testkit::{Hidden, LabConfig, Laboratory};

    #[test]
    fn all_that_is_fitted_lies_between_what_is_left_out() {
        let lab = Laboratory::new(LabConfig { seed: 5, receivers: 13, ..LabConfig::default() }).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let room = lab.write(&[], &folder.path().join("room"), None).unwrap();
        let outside = receivers(&room);
        let distance_m = |index: usize| -> f64 {
            let (a, b) = (room.sources()[0].position_m, room.receivers()[index].position_m);
            (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
        };
        let (near, far) = outside.split_at(OUTSIDE / 2);
        for inside in (0..13).filter(|index| !outside.contains(index)).map(distance_m) {
            assert!(near.iter().all(|&own| distance_m(own) < inside), "{outside:?}");
            assert!(far.iter().all(|&own| distance_m(own) > inside), "{outside:?}");
        }
    }

    /// A loudspeaker that is not flat is so everywhere.
    #[test]
    fn a_model_that_is_right_is_right_outside() {
        let config = LabConfig { seed: 5, receivers: 14, ..LabConfig::default() };
        let lab = Laboratory::new(config).unwrap();
        let gains_db = (0..lab.config().bands.len()).map(|band| 3.0 * band as f64).collect();
        let folder = tempfile::tempdir().unwrap();
        let hidden = [Hidden::TransducerResponse { gains_db }];
        let room = lab.write(&hidden, &folder.path().join("room"), None).unwrap();
        let outside = receivers(&room);
        let fitted = room.with_responses(|response| !outside.contains(&response.receiver));
        let config = DiagnoseConfig { rays: 300, ..DiagnoseConfig::default() };
        let effects = ["transducer_response".to_owned()];
        let diagnoser = Diagnoser::new(config).unwrap().with_only(&effects).unwrap();
        let found = diagnoser.diagnose(&fitted, &[], &()).unwrap();
        let off = errors(&found, &room, &outside, (300, 1)).unwrap();
        assert!(off.nats > 0.5 && off.found_db < off.stated_db + 0.2, "{off:?}");
    }
}
