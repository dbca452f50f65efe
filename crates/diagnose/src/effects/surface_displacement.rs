//! `surface_displacement`: a wall, floor or ceiling stands elsewhere than modelled.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{ArrivalTerm, Case, Effect, Parameter};
use crate::extend::displaced_surface::DisplacedSurface;
use crate::extend::model_change::ModelChange;
use crate::simulate::views::ArrivalView;
use crate::survey::Survey;
use crate::survey::surfaces::{Surface, largest};

/// One planar surface of the mesh is moved along its normal, and may be tilted ([`DisplacedSurface`]). Two cases for each surface that early
/// predicted reflections meet: with its direction as stated, and with two tilts beside the offset. A box thus stays one unless the data
/// say otherwise, and its images exact.
///
/// The delay of each reflection is exact: that of the source's image in the mirrors as they stand, over all reflections of the path, in a
/// room of any shape. What it leaves out: reflections that the displaced surface hides or makes are those of the stated room until the cause
/// is named; then the room is traced again.
///
/// Mark: all reflections over one surface come late or early, by what the cosine of their incidence says, first and higher orders alike;
/// those over other surfaces alone, and the direct sound, come as predicted. Mimicked by: another size of the room (`room_dimensions`), which
/// moves opposite surfaces; a wrong place (`position_error`), which moves the direct sound; a hole (`open_patch`), for where a reflection
/// was predicted there is none.
///
/// Source: J. B. Allen and D. A. Berkley, JASA 65, 1979 (images); J. Borish, JASA 75, 1984 (images in rooms of any shape).
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfaceDisplacement;

/// Usual displacement in metres, and tilt in degrees: one standard deviation.
const OFFSET_SD_M: f64 = 0.15;
const TILT_SD_DEG: f64 = 1.5;
/// Greatest tilt in degrees.
const MAX_TILT_DEG: f64 = 6.0;
/// Offsets from which a search starts are so far from each other, in metres: the nearest reflections then lie within a standard deviation
/// of the search's second width, there and back.
const START_M: f64 = 0.04;
/// Tilts from which it starts at every second of the offsets, in degrees: they move reflections a metre and a half from the centre by as
/// much as three offsets.
const START_TILTS_DEG: [[f64; 2]; 12] = [
    [2.5, 0.0],
    [-2.5, 0.0],
    [0.0, 2.5],
    [0.0, -2.5],
    [5.0, 0.0],
    [-5.0, 0.0],
    [0.0, 5.0],
    [0.0, -5.0],
    [3.0, 3.0],
    [3.0, -3.0],
    [-3.0, 3.0],
    [-3.0, -3.0],
];
/// Reflections that must meet a surface: as many as there are parameters.
const MIN_REFLECTIONS: usize = 3;
/// A surface that can be moved less than this, in metres, either way, is left out.
const MIN_RANGE_M: f64 = 0.05;
/// Surfaces at most: those that most reflections meet.
const MAX_SURFACES: usize = 24;
/// A surface is level, or upright, if its normal is within 6 degrees of it.
const LEVEL: f64 = 0.995;
/// Floor and ceiling are at the end of the room's box, in metres.
const END_M: f64 = 0.05;

impl Effect for SurfaceDisplacement {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "surface_displacement",
            "A surface stands elsewhere than modelled",
            "One wall, the floor or the ceiling is not where the model has it: moved along its normal, or tilted.",
        )
        .decided_by(6, NextMeasurement::Distances)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let can_move = |s: &Surface| s.range_m[1] - s.range_m[0] > MIN_RANGE_M;
        let mut met: Vec<usize> = (0..survey.surfaces().len())
            .filter(|&s| survey.surfaces()[s].reflections >= MIN_REFLECTIONS)
            .filter(|&s| can_move(&survey.surfaces()[s]))
            .collect();
        met.sort_by_key(|&s| std::cmp::Reverse(survey.surfaces()[s].reflections));
        met.truncate(MAX_SURFACES);
        let names: Vec<String> = met.iter().map(|&s| name(survey, &survey.surfaces()[s])).collect();
        let both = |(number, own): (&usize, &String)| {
            let surface = survey.surfaces()[*number].clone();
            let twice = names.iter().filter(|other| *other == own).count() > 1;
            let subject =
                if twice { format!("{own}, about {}", place(surface.centre_m)) } else { own.clone() };
            let tilted = OneSurface { number: *number, surface, is_tilted: true };
            let moved = OneSurface { is_tilted: false, ..tilted.clone() };
            [tilted.case().about(format!("{subject}, tilted")), moved.case().about(subject)]
        };
        met.iter().zip(&names).flat_map(both).collect()
    }
}

/// Where a point is, in metres.
fn place([x, y, z]: [f64; 3]) -> String {
    format!("{x:.1}, {y:.1}, {z:.1} m")
}

/// What a surface is, where, and of what.
fn name(survey: &Survey, surface: &Surface) -> String {
    let [normal, ..] = surface.axes;
    let axis = largest(normal);
    let at = surface.centre_m[axis];
    let level = axis == 2 && normal[2].abs() > LEVEL;
    let [low, high] = survey.box_m().map(|corner| corner[2]);
    let kind = if level && normal[2] < 0.0 && at - low < END_M {
        "floor"
    } else if level && normal[2] > 0.0 && high - at < END_M {
        "ceiling"
    } else if level {
        "level surface"
    } else if normal[2].abs() < (1.0 - LEVEL * LEVEL).sqrt() {
        "wall"
    } else {
        "sloping surface"
    };
    let materials: Vec<&str> = surface.materials.iter().map(|&m| survey.materials()[m].as_str()).collect();
    let materials = match &materials[..] {
        [one, two, three, _, ..] => format!("{one}, {two}, {three} and others"),
        all => all.join(", "),
    };
    if normal[axis].abs() > LEVEL {
        let axis = ["x", "y", "z"][axis];
        format!("{kind} at {axis} = {at:.2} m ({materials})")
    } else {
        format!("{kind} about {} ({materials})", place(surface.centre_m))
    }
}

/// One surface of the survey.
#[derive(Clone)]
struct OneSurface {
    number: usize,
    surface: Surface,
    is_tilted: bool,
}

impl OneSurface {
    fn case(self) -> Case {
        let [least, most] = self.surface.range_m;
        let typical = if most >= -least { most.min(0.2) } else { least.max(-0.2) };
        let offset = Parameter::new("offset", "m", 0.0, OFFSET_SD_M, (least, most)).typically(typical);
        let tilt = |axis: [f64; 3]| {
            let name = format!("tilt_{}", ["x", "y", "z"][largest(axis)]);
            let bounds = (-MAX_TILT_DEG, MAX_TILT_DEG);
            Parameter::new(name, "deg", 0.0, TILT_SD_DEG, bounds).typically(1.0)
        };
        let [_, along, across] = self.surface.axes;
        let parameters = if self.is_tilted { vec![offset, tilt(along), tilt(across)] } else { vec![offset] };
        let (starts, wall) = (self.starts(), self.clone());
        Case::arrivals(parameters, self)
            .starting(starts)
            .changing(move |fitted| vec![ModelChange::SurfaceDisplacement(wall.displaced(fitted.values()))])
    }

    /// Offsets over the whole range, and tilts at some of them.
    fn starts(&self) -> Vec<Vec<f64>> {
        let [least, most] = self.surface.range_m;
        let steps = (most.max(-least) / START_M).floor() as i32;
        let at = |offset_m: f64, [a, b]: [f64; 2]| {
            if self.is_tilted { vec![offset_m, a, b] } else { vec![offset_m] }
        };
        let mut starts = vec![at(0.0, [0.0; 2])];
        for step in -steps..=steps {
            let offset_m = START_M * f64::from(step);
            if !(least..=most).contains(&offset_m) {
                continue;
            }
            if step != 0 {
                starts.push(at(offset_m, [0.0; 2]));
            }
            if self.is_tilted && step % 2 == 0 {
                for tilt_deg in START_TILTS_DEG {
                    starts.push(at(offset_m, tilt_deg));
                }
            }
        }
        starts
    }

    fn displaced(&self, values: &[f64]) -> DisplacedSurface {
        let Surface { axes: [normal, ..], centre_m, .. } = self.surface;
        let tilt_deg = if self.is_tilted { [values[1], values[2]] } else { [0.0; 2] };
        DisplacedSurface::new(centre_m, normal, values[0], tilt_deg)
    }
}

impl ArrivalTerm for OneSurface {
    fn delay_s(&self, values: &[f64], arrival: &ArrivalView<'_>) -> f64 {
        arrival.delay_by_displaced_s(&[(self.number, self.displaced(values))])
    }

    fn displaces(&self, values: &[f64]) -> Option<(usize, DisplacedSurface)> {
        Some((self.number, self.displaced(values)))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::hand_made::{self, Tables};
    use crate::likelihood::arrivals::{at_fit, fit};
    use sabine_scene::{Levels, TimeZero};

    fn survey() -> Survey {
        hand_made::survey(Levels::Common, TimeZero::Emission)
    }

    #[test]
    fn each_surface_that_reflections_meet_has_two_cases_by_its_name() {
        let subjects = |survey: &Survey| -> Vec<String> {
            SurfaceDisplacement.cases(survey).into_iter().filter_map(|c| c.subject).collect()
        };
        let mut survey = survey();
        let expected = [
            "floor at z = 0.00 m (carpet)",
            "ceiling at z = 2.50 m (carpet)",
            "wall at x = 0.00 m (carpet)",
            "wall at y = 4.00 m (plaster)",
        ];
        let both = |name: &&str| [format!("{name}, tilted"), (*name).to_owned()];
        assert_eq!(subjects(&survey), expected.iter().flat_map(both).collect::<Vec<_>>());
        // None that hardly any reflection meets, or that cannot be moved.
        survey.surfaces[0].reflections = 2;
        survey.surfaces[1].range_m = [0.0, 0.04];
        assert_eq!(subjects(&survey).len(), 4);
        // Two of one name are told apart by where they are; what is neither level nor upright is said to slope.
        survey.surfaces[0] = survey.surfaces[2].clone();
        survey.surfaces[0].centre_m[1] = 9.0;
        survey.surfaces[1].range_m = [-0.5, 0.5];
        survey.surfaces[1].axes = crate::survey::surfaces::axes_of([0.6, 0.0, 0.8]);
        let found = subjects(&survey);
        assert!(
            found.contains(&"wall at x = 0.00 m (carpet), about 0.0, 9.0, 1.2 m".to_owned()),
            "{found:?}"
        );
        assert!(found.contains(&"sloping surface about 2.5, 2.0, 2.5 m (carpet)".to_owned()), "{found:?}");
    }

    #[test]
    fn starts_reach_over_the_whole_range_and_stay_within_it() {
        for case in SurfaceDisplacement.cases(&survey()) {
            let (least, most) = case.parameters[0].bounds;
            assert_eq!((least, most), (-0.5, 0.8));
            let offsets: Vec<f64> = case.starts.iter().map(|s| s[0]).collect();
            assert!(offsets.iter().all(|o| (least..=most).contains(o)));
            let mut at = least;
            while at <= most {
                assert!(offsets.iter().any(|o| (o - at).abs() <= START_M), "{at} m");
                at += 0.01;
            }
            assert!(case.starts.iter().all(|s| s.len() == case.parameters.len()));
        }
    }

    /// Peaks where the room has its ceiling 45 cm higher, and nothing else changed.
    #[test]
    fn a_ceiling_far_from_its_place_is_found_and_another_surface_is_not() {
        let mut tables = Tables::new(Levels::Common, TimeZero::Emission);
        let ceiling = OneSurface { number: 1, surface: tables.survey.surfaces[1].clone(), is_tilted: false };
        let cases = SurfaceDisplacement.cases(&tables.survey);
        let late = {
            let data = tables.arrival_data();
            let case = ceiling.clone().case();
            let model = at_fit(&data, &[&case], &[true; 3]);
            let mut values = vec![0.0; model.terms[0].first];
            values.push(0.45);
            tables
                .arrivals
                .iter()
                .enumerate()
                .map(|(pair, arrivals)| {
                    arrivals[1..].iter().map(|a| model.arrival_s(&values, pair, a)).collect::<Vec<f64>>()
                })
                .collect::<Vec<_>>()
        };
        for (measured, times) in tables.measured.iter_mut().zip(late) {
            measured.peaks_s = times;
        }
        let data = tables.arrival_data();
        let evidence = |cases: &[&Case]| fit(&data, cases, &[true; 3]).unwrap();
        let none = evidence(&[]).0.log_evidence;
        let gains: Vec<f64> = cases.iter().map(|c| evidence(&[c]).0.log_evidence - none).collect();
        let best = (0..gains.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b])).unwrap();
        assert_eq!(cases[best].subject.as_deref(), Some("ceiling at z = 2.50 m (carpet)"), "{gains:?}");
        let (found, firsts) = evidence(&[&cases[best]]);
        assert!((found.values[firsts[0]] - 0.45).abs() < 0.01, "{}", found.values[firsts[0]]);
    }

    #[test]
    fn what_it_changes_in_the_model_is_the_surface_as_it_was_fitted() {
        let survey = survey();
        let cases = SurfaceDisplacement.cases(&survey);
        let changes = |case: &Case, values: &[f64]| {
            case.model_changes(&crate::effect::FittedCase::of_values(&survey, values))
        };
        let wall = |offset_m: f64, tilt_deg: [f64; 2]| {
            let one = DisplacedSurface::new([2.5, 4.0, 1.25], [0.0, 1.0, 0.0], offset_m, tilt_deg);
            vec![ModelChange::SurfaceDisplacement(one)]
        };
        assert_eq!(changes(&cases[6], &[0.3, 1.0, -2.0]), wall(0.3, [1.0, -2.0]));
        assert_eq!(changes(&cases[7], &[0.3]), wall(0.3, [0.0; 2]));
        let names: Vec<&str> = cases[6].parameters.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["offset", "tilt_x", "tilt_z"]);
    }
}
