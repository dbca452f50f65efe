//! Where predicted specular paths run.

use super::planes::{apart_m, dot};
use super::surfaces::{minus, mirrored_in};
use super::{Survey, SurveyedResponse};

/// A path whose images are farther off than this, in metres, is not that of its surfaces.
const OFF_M: f64 = 0.05;

/// The places from each of which to the next a path goes straight on: source, reflections, receiver. Empty where the surfaces that it meets are
/// not known.
pub(crate) fn path_stops(
    survey: &Survey,
    response: &SurveyedResponse,
    length_m: f64,
    surfaces: &[usize],
) -> Vec<[f64; 3]> {
    let ends = [survey.sources[response.source].position_m, survey.receivers[response.receiver].position_m];
    let plane = |surface: &usize| (survey.surfaces[*surface].axes[0], survey.surfaces[*surface].centre_m);
    let found = stops_over(ends, &surfaces.iter().map(plane).collect::<Vec<_>>());
    let legs = found.windows(2).map(|leg| apart_m(leg[0], leg[1]));
    if (legs.sum::<f64>() - length_m).abs() > OFF_M { Vec::new() } else { found }
}

/// The same of a path that is mirrored in planes (unit normal and a point), from the source on; empty where it does not meet them.
pub(crate) fn stops_over(
    [source, receiver]: [[f64; 3]; 2],
    planes: &[([f64; 3], [f64; 3])],
) -> Vec<[f64; 3]> {
    let mut images = vec![source];
    for (normal, point) in planes {
        images.push(mirrored_in(images[images.len() - 1], *normal, *point));
    }
    // From the receiver back, each place is where the line to the image behind the surface meets it.
    let mut found = vec![receiver];
    for (&(normal, point), image) in planes.iter().zip(&images[1..]).rev() {
        let place = found[found.len() - 1];
        let (before, behind) = (dot(normal, minus(place, point)), dot(normal, minus(*image, point)));
        let share = before / (before - behind);
        if !(0.0..=1.0).contains(&share) {
            return Vec::new();
        }
        found.push(std::array::from_fn(|k| place[k] + share * (image[k] - place[k])));
    }
    found.push(source);
    found.reverse();
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made::Tables;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn a_path_is_as_long_as_its_legs_and_meets_its_surfaces() {
        let tables = Tables::new(Levels::Common, TimeZero::Emission);
        let mut followed = 0;
        for (response, arrivals) in tables.survey.responses.iter().zip(&tables.arrivals) {
            for arrival in arrivals {
                let found = path_stops(&tables.survey, response, arrival.length_m, &arrival.surfaces);
                if found.is_empty() {
                    continue;
                }
                followed += 1;
                assert_eq!(found.len(), arrival.surfaces.len() + 2);
                assert_eq!(found[0], tables.survey.sources[response.source].position_m);
                assert_eq!(found[found.len() - 1], tables.survey.receivers[response.receiver].position_m);
                let legs = found.windows(2).map(|l| dot(minus(l[1], l[0]), minus(l[1], l[0])).sqrt());
                let length: f64 = legs.sum();
                assert!((length - arrival.length_m).abs() < OFF_M, "{length} {}", arrival.length_m);
                for (surface, place) in arrival.surfaces.iter().zip(&found[1..]) {
                    let own = &tables.survey.surfaces[*surface];
                    assert!(dot(own.axes[0], minus(*place, own.centre_m)).abs() < 1e-9);
                }
            }
        }
        assert!(followed > tables.survey.responses.len(), "{followed}");
    }
}
