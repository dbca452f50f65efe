#![allow(clippy::unwrap_used)] // a panic is how a test fails
use super::*;
use crate::effect::FittedCase;
use crate::effects::PositionError;
use crate::hand_made::{self, Tables};
use crate::likelihood::arrivals::fit;
use sabine_scene::{Levels, TimeZero};

const SIZE_M: [f64; 3] = [5.0, 4.0, 2.5];

fn survey() -> Survey {
    hand_made::survey(Levels::Common, TimeZero::Emission)
}

/// A path in the box over the walls of an image source (Allen and Berkley): image 2 n L + x or 2 n L - x along each axis.
#[derive(Clone, Copy)]
struct Image {
    rooms: [i32; 3],
    mirrored: [bool; 3],
}

impl Image {
    fn of(&self, source: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| {
            let sign = if self.mirrored[k] { -1.0 } else { 1.0 };
            2.0 * f64::from(self.rooms[k]) * SIZE_M[k] + sign * source[k]
        })
    }

    fn length_m(&self, source: [f64; 3], receiver: [f64; 3]) -> f64 {
        apart_m(self.of(source), receiver)
    }

    /// The path as the effect sees it, over surfaces of the survey or none that are known.
    fn seen<'a>(&self, survey: &'a Survey, pair: usize, surfaces: &'a [usize]) -> ArrivalView<'a> {
        let response = &survey.responses[pair];
        let (source, receiver) = places(survey, pair);
        let way = minus(self.of(source), receiver);
        let length_m = dot(way, way).sqrt();
        let arrival = way.map(|c| c / length_m);
        let departure = std::array::from_fn(|k| if self.mirrored[k] { arrival[k] } else { -arrival[k] });
        let speed_m_s = response.air.speed_of_sound_m_s();
        ArrivalView { survey, pair, length_m, speed_m_s, departure, arrival, surfaces }
    }
}

fn places(survey: &Survey, pair: usize) -> ([f64; 3], [f64; 3]) {
    let response = &survey.responses[pair];
    (survey.sources[response.source].position_m, survey.receivers[response.receiver].position_m)
}

/// Images with the surfaces of the survey that make them: floor 0, ceiling 1, wall x = 0 2, wall y = 4 3.
fn images() -> Vec<(Image, Vec<usize>)> {
    let image = |rooms, mirrored| Image { rooms, mirrored };
    vec![
        (image([0; 3], [false, false, true]), vec![0]),
        (image([0, 0, 1], [false, false, true]), vec![1]),
        (image([0; 3], [true, false, false]), vec![2]),
        (image([0, 1, 0], [false, true, false]), vec![3]),
        (image([0; 3], [true, false, true]), vec![2, 0]),
        (image([0, 1, 1], [true, true, true]), vec![1, 2, 3]),
        // Over the floor, then the ceiling; and once more over the floor.
        (image([0, 0, 1], [false; 3]), vec![0, 1]),
        (image([0, 0, -1], [false, false, true]), vec![0, 1, 0]),
    ]
}

/// Motions of several decimetres and degrees.
const MOTIONS: [[f64; 4]; 4] =
    [[0.3, -0.2, 0.1, 0.0], [0.0, 0.0, 0.0, 5.0], [-0.25, 0.3, -0.2, -4.0], [0.02, 0.0, -0.03, 0.5]];

#[test]
fn a_reflection_is_late_by_what_the_images_of_moved_places_say() {
    let survey = survey();
    let about_m = centre(&survey);
    let term = Shifted { about_m };
    for values in MOTIONS {
        let motion = motion(&values, about_m);
        for pair in 0..survey.responses.len() {
            let (source, receiver) = places(&survey, pair);
            for (image, surfaces) in images() {
                let expected_m = image.length_m(motion.moved(source), motion.moved(receiver))
                    - image.length_m(source, receiver);
                let seen = image.seen(&survey, pair, &surfaces);
                let found_m = term.delay_s(&values, &seen) * seen.speed_m_s();
                assert!(
                    (found_m - expected_m).abs() < 1e-9,
                    "{values:?} {surfaces:?}: {found_m} {expected_m}"
                );
                // Where the surfaces are not known, to second order: what both ends move across the path, over its length.
                let seen = image.seen(&survey, pair, &[]);
                let blind_m = term.delay_s(&values, &seen) * seen.speed_m_s();
                let far = |place| apart_m(motion.moved(place), place);
                let off_m =
                    far(source) * far(receiver) / (image.length_m(source, receiver) + expected_m.min(0.0));
                assert!((blind_m - expected_m).abs() <= 1.05 * off_m + 1e-9, "{values:?} {surfaces:?}");
            }
        }
    }
}

#[test]
fn the_direct_sound_comes_when_it_did() {
    let survey = survey();
    let term = Shifted { about_m: centre(&survey) };
    let direct = Image { rooms: [0; 3], mirrored: [false; 3] };
    for values in MOTIONS {
        for pair in 0..survey.responses.len() {
            assert_eq!(term.delay_s(&values, &direct.seen(&survey, pair, &[])), 0.0);
        }
    }
}

#[test]
fn starts_are_all_over_the_ball_and_leave_all_places_in_the_room() {
    let survey = survey();
    let case = CoordinateShift.cases(&survey).remove(0);
    assert_eq!(case.starts[0], [0.0; 4]);
    let names: Vec<&str> = case.parameters.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["shift_x", "shift_y", "shift_z", "turn"]);
    let about_m = centre(&survey);
    let is_inside = |start: &[f64]| {
        let motion = motion(start, about_m);
        (0..3).all(|pair| {
            let (source, receiver) = places(&survey, pair);
            [source, receiver].iter().all(|p| {
                let moved = motion.moved(*p);
                (0..3).all(|k| moved[k] > 0.0 && moved[k] < SIZE_M[k])
            })
        })
    };
    assert!(case.starts.iter().all(|start| is_inside(start)));
    // Whatever it is, within 0.5 m and 5 degrees, one start is near.
    for i in 0..500 {
        let drawn = [0.618, 0.755, 0.382, 0.445].map(|step| 2.0 * (step * f64::from(i)).fract() - 1.0);
        let shift = [0.5, 0.5, 0.4].iter().zip(drawn).map(|(most, d)| most * d);
        let wanted: Vec<f64> = shift.chain([5.0 * drawn[3]]).collect();
        if !is_inside(&wanted)
            || dot([wanted[0], wanted[1], wanted[2]], [wanted[0], wanted[1], wanted[2]]) > 0.25
        {
            continue;
        }
        let is_near = |start: &Vec<f64>| {
            (0..3).all(|k| (start[k] - wanted[k]).abs() <= START_M)
                && (start[3] - wanted[3]).abs() <= START_TURN_DEG.1
        };
        assert!(case.starts.iter().any(is_near), "{wanted:?}");
    }
}

#[test]
fn places_that_are_shifted_and_turned_are_found_and_no_single_place_explains_as_much() {
    for values in [[0.3, -0.2, 0.15, 0.0], [-0.25, 0.3, -0.2, 3.0], [0.45, 0.1, 0.2, -4.0]] {
        let stated = Tables::new(Levels::Common, TimeZero::Emission);
        let about_m = centre(&stated.survey);
        let tables = stated.with_places_moved(&motion(&values, about_m));
        let data = tables.arrival_data();
        let case = CoordinateShift.cases(&tables.survey).remove(0);
        let (found, firsts) = fit(&data, &[&case], &[true; 3]).unwrap();
        let own = &found.values[firsts[0]..firsts[0] + 4];
        // The peaks made by hand come up to three centimetres of way too late or too early.
        for (k, tolerance) in [0.05, 0.05, 0.05, 1.5].into_iter().enumerate() {
            assert!((own[k] - values[k]).abs() < tolerance, "{own:?} {values:?}");
        }
        for other in PositionError.cases(&tables.survey) {
            let rival = fit(&data, &[&other], &[true; 3]).unwrap().0;
            assert!(rival.log_evidence + 10.0 < found.log_evidence, "{:?}", other.subject);
        }
    }
}

#[test]
fn what_it_changes_in_the_model_is_the_motion_as_it_was_fitted() {
    let survey = survey();
    let case = CoordinateShift.cases(&survey).remove(0);
    let changes = case.model_changes(&FittedCase::of_values(&survey, &[0.1, -0.2, 0.3, 2.0]));
    let [ModelChange::CoordinateShift(motion)] = &changes[..] else { panic!("{changes:?}") };
    assert_eq!((motion.shift_m, motion.turn_deg), ([0.1, -0.2, 0.3], 2.0));
    let expected =
        [(1.0 + 3.0 + 4.0 + 1.5) / 4.0, (1.0 + 1.5 + 3.0 + 3.2) / 4.0, (1.4 + 1.2 + 1.5 + 1.1) / 4.0];
    assert!(apart_m(motion.about_m, expected) < 1e-12);
}
