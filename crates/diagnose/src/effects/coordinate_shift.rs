//! `coordinate_shift`: all places are stated in coordinates that are not those of the mesh.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{ArrivalTerm, Case, Effect, Parameter};
use crate::extend::model_change::ModelChange;
use crate::extend::rigid_motion::RigidMotion;
use crate::simulate::views::ArrivalView;
use crate::survey::planes::{apart_m, dot};
use crate::survey::surfaces::{minus, mirrored_in};
use crate::survey::{Place, Survey};

/// Sources and receivers were measured from another origin and heading than those of the mesh: a shift along each axis, and a turn about
/// the vertical through the centre of all stated places ([`RigidMotion`]). Distances between places are as stated.
///
/// The delay of a reflection is exact: the distance of the moved source's image in the surfaces that the path meets from the moved
/// receiver, less that of the stated ones. Where a path cannot be followed over its surfaces, its component along the stated path is exact,
/// and both ends are taken to move across it at right angles to each other. Reflections that the motion hides or makes are those of the
/// stated places until the cause is named; then the room is traced again.
///
/// Mark: all reflections come elsewhere than predicted, those over one surface by what the shift towards it says, by the same rule at all places; the
/// direct sound comes when it should. Mimicked by: another size of the room with a shift of its own (`room_dimensions`), one wall that
/// stands elsewhere (`surface_displacement`) where the shift is along its normal, and wrong places (`position_error`), which change
/// distances between places.
///
/// Source: J. B. Allen and D. A. Berkley, JASA 65, 1979 (images); J. Borish, JASA 75, 1984 (images in rooms of any shape).
#[derive(Clone, Copy, Debug, Default)]
pub struct CoordinateShift;

/// Usual shift along an axis in metres, and turn in degrees: one standard deviation.
const SHIFT_SD_M: f64 = 0.3;
const TURN_SD_DEG: f64 = 3.0;
/// Greatest shift along an axis in metres, and greatest turn in degrees.
const MAX_SHIFT_M: f64 = 1.5;
const MAX_TURN_DEG: f64 = 15.0;
/// Shifts from which a search starts are so far from each other along each axis, in metres: for one of them a reflection over one surface
/// then lies about a standard deviation of the search's first width off at most. Turns move the outermost place by as much.
const START_M: f64 = 0.16;
/// They reach so far, in metres and degrees.
const START_REACH_M: f64 = 0.65;
const START_REACH_DEG: f64 = 5.0;
/// Turns from which it starts are so far from each other, in degrees.
const START_TURN_DEG: (f64, f64) = (1.25, 4.0);
/// A path that cannot be followed is the direct sound if it is no longer than this share beyond the distance of its ends.
const DIRECT: f64 = 1e-4;

impl Effect for CoordinateShift {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "coordinate_shift",
            "Places stated in other coordinates than the mesh",
            "All loudspeakers and microphones are shifted together, or turned, against the walls: the origin or the heading of their coordinates is not that of the model.",
        )
        .decided_by(18, NextMeasurement::DistancesToWalls)
        .against(&[
            ("position_error", NextMeasurement::DistancesToWalls),
            ("room_dimensions", NextMeasurement::DistancesToWalls),
            ("surface_displacement", NextMeasurement::DistancesToWalls),
        ])
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let about_m = centre(survey);
        let shift = |name: String| {
            let bounds = (-MAX_SHIFT_M, MAX_SHIFT_M);
            Parameter::new(name, "m", 0.0, SHIFT_SD_M, bounds).typically(0.2)
        };
        let turn = Parameter::new("turn", "deg", 0.0, TURN_SD_DEG, (-MAX_TURN_DEG, MAX_TURN_DEG));
        let shifts = ["x", "y", "z"].map(|axis| shift(format!("shift_{axis}")));
        let parameters = shifts.into_iter().chain([turn.typically(2.0)]).collect();
        vec![
            Case::arrivals(parameters, Shifted { about_m })
                .starting(starts(survey, about_m))
                .changing(move |fitted| vec![ModelChange::CoordinateShift(motion(fitted.values(), about_m))]),
        ]
    }
}

/// The mean of all stated places.
fn centre(survey: &Survey) -> [f64; 3] {
    let places = || survey.sources().iter().chain(survey.receivers());
    let count = places().count().max(1) as f64;
    std::array::from_fn(|k| places().map(|p| p.position_m[k]).sum::<f64>() / count)
}

fn motion(values: &[f64], about_m: [f64; 3]) -> RigidMotion {
    RigidMotion::new([values[0], values[1], values[2]], values[3], about_m)
}

/// Shifts all over a ball, each at several turns, that leave all places within the room.
fn starts(survey: &Survey, about_m: [f64; 3]) -> Vec<Vec<f64>> {
    let places: Vec<&Place> = survey.sources().iter().chain(survey.receivers()).collect();
    let from_axis = |p: &&Place| (p.position_m[0] - about_m[0]).hypot(p.position_m[1] - about_m[1]);
    let radius_m = places.iter().map(from_axis).fold(1e-3, f64::max);
    let (least, most) = START_TURN_DEG;
    let turn_deg = (START_M / radius_m).to_degrees().clamp(least, most);
    let turns = (START_REACH_DEG / turn_deg).round() as i32;
    let steps = (START_REACH_M / START_M).floor() as i32;
    let [low, high] = survey.box_m();
    let is_inside = |start: &Vec<f64>| {
        let motion = motion(start, about_m);
        places.iter().all(|p| {
            let moved = motion.moved(p.position_m);
            (0..3).all(|k| low[k] < moved[k] && moved[k] < high[k])
        })
    };
    let mut starts = vec![vec![0.0; 4]];
    for turn in -turns..=turns {
        for x in -steps..=steps {
            for y in -steps..=steps {
                for z in -steps..=steps {
                    let shift = [x, y, z].map(|steps| START_M * f64::from(steps));
                    if (turn, x, y, z) != (0, 0, 0, 0) && dot(shift, shift).sqrt() <= START_REACH_M {
                        starts.push(vec![shift[0], shift[1], shift[2], turn_deg * f64::from(turn)]);
                    }
                }
            }
        }
    }
    starts.retain(is_inside);
    starts
}

/// All places, moved together.
struct Shifted {
    about_m: [f64; 3],
}

impl ArrivalTerm for Shifted {
    fn delay_s(&self, values: &[f64], arrival: &ArrivalView<'_>) -> f64 {
        let (survey, pair) = (arrival.survey(), arrival.pair());
        let stated = [survey.sources()[pair.source].position_m, survey.receivers()[pair.receiver].position_m];
        let motion = motion(values, self.about_m);
        let moved = motion.all_moved(stated);
        let longer_m = if arrival.surfaces().is_empty() {
            longer_by_directions_m(stated, moved, arrival)
        } else {
            let image = |[source, receiver]: [[f64; 3]; 2]| {
                let mirrored = |place, &surface: &usize| {
                    let own = &survey.surfaces()[surface];
                    mirrored_in(place, own.axes[0], own.centre_m)
                };
                apart_m(arrival.surfaces().iter().fold(source, mirrored), receiver)
            };
            image(moved) - image(stated)
        };
        longer_m / arrival.speed_m_s()
    }
}

/// By how much a path grows whose directions alone are known. From its end, each end sees the image of the other in its direction; the path
/// shrinks by what both move along these, and how the two motions across it lie to each other is not known.
fn longer_by_directions_m(stated: [[f64; 3]; 2], moved: [[f64; 3]; 2], arrival: &ArrivalView<'_>) -> f64 {
    let length_m = arrival.length_m();
    if length_m <= (1.0 + DIRECT) * apart_m(stated[0], stated[1]) {
        return 0.0;
    }
    let (mut along_m, mut across2) = (length_m, 0.0);
    for (end, direction) in [arrival.departure(), arrival.arrival()].into_iter().enumerate() {
        let way = minus(moved[end], stated[end]);
        let towards = dot(way, direction);
        along_m -= towards;
        across2 += (dot(way, way) - towards * towards).max(0.0);
    }
    along_m.hypot(across2.sqrt()) - length_m
}

#[cfg(test)]
mod tests;
