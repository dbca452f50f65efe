//! A surface that stands elsewhere than the mesh has it.

use crate::survey::planes::dot;
use crate::survey::surfaces::{axes_of, mirrored_in, unit};
use crate::survey::{Survey, SurveyedResponse};
use serde::{Deserialize, Serialize};

/// A planar surface of the mesh that stands elsewhere than stated: moved along its normal, and tilted.
///
/// Which surface it is, a point and the normal say. All refer to the mesh as the room file states it, so that several displaced surfaces do
/// not depend on their order; a surface counts once. With the two unit vectors u and v in the surface, coordinates along them counted from
/// the point, and the tilts a and b, the displaced surface stands farther out by offset + tan(a) u + tan(b) v. The first vector is the
/// coordinate axis that lies most nearly in the surface (x before y before z), projected on it; the second is across it. Both point towards
/// greater coordinates: in a wall at right angles to x they are y and z, in a floor x and y.
///
/// ```
/// use sabine_diagnose::DisplacedSurface;
/// let wall = DisplacedSurface::new([5.0, 2.0, 1.25], [1.0, 0.0, 0.0], 0.4, [0.0, 2.0]);
/// let (normal, point_m) = wall.plane();
/// assert_eq!(point_m, [5.4, 2.0, 1.25]);
/// // It leans outwards: its upper edge, 1.25 m above, is 4 cm farther out than its middle.
/// assert!((normal[2] / normal[0] + 2f64.to_radians().tan()).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct DisplacedSurface {
    /// A point of the surface as stated, in metres: about it, the surface is tilted.
    pub point_m: [f64; 3],
    /// Its normal as stated, out of the room.
    pub normal: [f64; 3],
    /// By how much farther out it stands at that point, in metres, -2 to 2.
    pub offset_m: f64,
    /// Its tilts in degrees, -20 to 20.
    pub tilt_deg: [f64; 2],
}

impl DisplacedSurface {
    /// The surface that holds a point and has a normal there, moved out by an offset in metres and tilted by two angles in degrees.
    pub fn new(point_m: [f64; 3], normal: [f64; 3], offset_m: f64, tilt_deg: [f64; 2]) -> Self {
        Self { point_m, normal, offset_m, tilt_deg }
    }

    /// Unit normal and a point of the plane in which it stands.
    pub fn plane(&self) -> ([f64; 3], [f64; 3]) {
        let [normal, along, across] = axes_of(unit(self.normal));
        let [a, b] = self.tilt_deg.map(|degrees| degrees.to_radians().tan());
        let tilted = unit(std::array::from_fn(|k| normal[k] - a * along[k] - b * across[k]));
        (tilted, std::array::from_fn(|k| self.point_m[k] + self.offset_m * normal[k]))
    }

    /// By how much farther out it stands at a place of the stated surface, in metres.
    pub(crate) fn farther_m(&self, place: [f64; 3]) -> f64 {
        let [_, along, across] = axes_of(unit(self.normal));
        let from: [f64; 3] = std::array::from_fn(|k| place[k] - self.point_m[k]);
        let [a, b] = self.tilt_deg.map(|degrees| degrees.to_radians().tan());
        self.offset_m + a * dot(along, from) + b * dot(across, from)
    }

    /// Whether it is the same surface of the mesh, wherever it stands.
    pub(crate) fn is_same_surface(&self, other: &Self) -> bool {
        self.point_m == other.point_m && self.normal == other.normal
    }
}

/// Puts a displaced surface among others, in the place of what was said of it before.
pub(crate) fn put(all: &mut Vec<DisplacedSurface>, one: DisplacedSurface) {
    match all.iter_mut().find(|other| other.is_same_surface(&one)) {
        Some(before) => *before = one,
        None => all.push(one),
    }
}

/// A surface (index) and the plane in which it stands: its unit normal and a point.
pub(crate) type Mirror = (usize, ([f64; 3], [f64; 3]));

/// The planes of displaced surfaces.
pub(crate) fn mirrors(displaced: &[(usize, DisplacedSurface)]) -> Vec<Mirror> {
    displaced.iter().map(|(surface, one)| (*surface, one.plane())).collect()
}

/// By how much longer the specular path of a response over surfaces (indices, from the source on) is where some of these stand elsewhere,
/// in metres: the distance of the source's image in the mirrors as they stand from the receiver, less that in the mirrors as stated. What is
/// said last of a surface counts.
pub(crate) fn longer_m(survey: &Survey, response: &SurveyedResponse, met: &[usize], moved: &[Mirror]) -> f64 {
    if moved.iter().all(|(own, _)| !met.contains(own)) {
        return 0.0;
    }
    let source = survey.sources[response.source].position_m;
    let receiver = survey.receivers[response.receiver].position_m;
    let (mut stated, mut found) = (source, source);
    for surface in met {
        let own = &survey.surfaces[*surface];
        stated = mirrored_in(stated, own.axes[0], own.centre_m);
        let as_stated = (own.axes[0], own.centre_m);
        let (normal, point) =
            moved.iter().rfind(|(moved, _)| moved == surface).map_or(as_stated, |(_, plane)| *plane);
        found = mirrored_in(found, normal, point);
    }
    let far = |image: [f64; 3]| (0..3).map(|k| (image[k] - receiver[k]).powi(2)).sum::<f64>().sqrt();
    far(found) - far(stated)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::hand_made;
    use crate::survey::surfaces::{Surfaces, minus};
    use sabine_acoustics::{Bands, Material};
    use sabine_scene::{Levels, NamedMaterial, Scene, TimeZero, Triangle};

    /// A survey of a room of these corners and polygons: one source, three receivers within a metre of the middle of 4 m x 3 m x 2 m.
    fn survey(vertices: &[[f64; 3]], polygons: &[&[u32]]) -> Survey {
        let material = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        let fan = |polygon: &&[u32]| -> Vec<Triangle> {
            let corners = |i: usize| [polygon[0], polygon[i], polygon[i + 1]];
            (1..polygon.len() - 1).map(|i| Triangle { vertices: corners(i), material: 0 }).collect()
        };
        let triangles = polygons.iter().flat_map(fan).collect();
        let materials = vec![NamedMaterial { name: "plaster".into(), material }];
        let scene = Scene::new(vertices.to_vec(), triangles, materials).unwrap();
        let mut survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        survey.surfaces = Surfaces::of(&scene).described(&scene);
        survey
    }

    /// Length of the shortest way from the source over a point of each plane to the receiver. By Fermat's principle it is that of the
    /// specular path: the sum of the distances is convex in the points, and each is moved to its best place in turn.
    fn shortest_m(from: [f64; 3], planes: &[([f64; 3], [f64; 3])], to: [f64; 3]) -> f64 {
        let far = |a: [f64; 3], b: [f64; 3]| dot(minus(a, b), minus(a, b)).sqrt();
        let height = |(normal, point): ([f64; 3], [f64; 3]), p: [f64; 3]| dot(normal, minus(p, point));
        let mut points: Vec<[f64; 3]> = planes.iter().map(|(_, point)| *point).collect();
        for _ in 0..20_000 {
            for i in 0..points.len() {
                let before = if i == 0 { from } else { points[i - 1] };
                let after = points.get(i + 1).copied().unwrap_or(to);
                // Where equal angles are: the feet of both ends, weighed by their heights.
                let heights = [before, after].map(|p| height(planes[i], p));
                let feet = [before, after].map(|p| {
                    let h = height(planes[i], p);
                    std::array::from_fn::<f64, 3, _>(|k| p[k] - h * planes[i].0[k])
                });
                let share = heights[0].abs() / (heights[0].abs() + heights[1].abs());
                points[i] = std::array::from_fn(|k| feet[0][k] + share * (feet[1][k] - feet[0][k]));
            }
        }
        let mut stops = vec![from];
        stops.extend(points);
        stops.push(to);
        stops.windows(2).map(|leg| far(leg[0], leg[1])).sum()
    }

    fn numbers_of(survey: &Survey, is: impl Fn([f64; 3], [f64; 3]) -> bool) -> usize {
        survey.surfaces.iter().position(|s| is(s.axes[0], s.centre_m)).unwrap()
    }

    #[test]
    fn in_a_box_a_path_grows_as_its_image_in_the_larger_box_says() {
        let vertices: Vec<[f64; 3]> = (0..8)
            .map(|i: u32| [5.0 * f64::from(i & 1), 4.0 * f64::from(i >> 1 & 1), 2.5 * f64::from(i >> 2)])
            .collect();
        let polygons: [&[u32]; 6] =
            [&[0, 2, 6, 4], &[1, 3, 7, 5], &[0, 1, 5, 4], &[2, 3, 7, 6], &[0, 1, 3, 2], &[4, 5, 7, 6]];
        let survey = survey(&vertices, &polygons);
        let wall = |axis: usize, at: f64| {
            numbers_of(&survey, |normal, centre| normal[axis].abs() > 0.9 && (centre[axis] - at).abs() < 1e-9)
        };
        let (far, near) = (wall(0, 5.0), wall(0, 0.0));
        for response in &survey.responses {
            let source = survey.sources[response.source].position_m;
            let receiver = survey.receivers[response.receiver].position_m;
            let distance = |x: f64| {
                let rest: f64 = (1..3).map(|k| (source[k] - receiver[k]).powi(2)).sum();
                ((x - receiver[0]).powi(2) + rest).sqrt()
            };
            for offset_m in [-0.6, -0.2, 0.35, 0.6] {
                let moved =
                    DisplacedSurface::new(survey.surfaces[far].centre_m, [1.0, 0.0, 0.0], offset_m, [0.0; 2]);
                let found = |met: &[usize]| longer_m(&survey, response, met, &[(far, moved.plane())]);
                // Allen and Berkley: images at 2 n L + x and 2 n L - x.
                let (x, length) = (source[0], 5.0 + offset_m);
                for (met, stated, there) in [
                    (vec![far], 10.0 - x, 2.0 * length - x),
                    (vec![near, far], 10.0 + x, 2.0 * length + x),
                    (vec![far, near], x - 10.0, x - 2.0 * length),
                    (vec![far, near, far], 20.0 - x, 4.0 * length - x),
                ] {
                    let expected = distance(there) - distance(stated);
                    assert!((found(&met) - expected).abs() < 1e-9, "{met:?}: {} {expected}", found(&met));
                }
                assert_eq!(found(&[near, wall(1, 4.0)]), 0.0);
                assert_eq!(found(&[]), 0.0);
            }
        }
    }

    #[test]
    fn in_a_room_with_a_sloping_ceiling_a_path_grows_as_the_shortest_way_does() {
        // 5 m x 4 m; the ceiling rises from 2.4 to 3.4 m along x, and one wall leans.
        let vertices = [
            [0.0, 0.0, 0.0],
            [5.0, 0.0, 0.0],
            [5.0, 4.0, 0.0],
            [0.0, 4.0, 0.0],
            [0.0, -0.3, 2.4],
            [5.0, -0.425, 3.4],
            [5.0, 4.0, 3.4],
            [0.0, 4.0, 2.4],
        ];
        let polygons: [&[u32]; 6] =
            [&[0, 1, 2, 3], &[4, 5, 6, 7], &[0, 1, 5, 4], &[3, 2, 6, 7], &[0, 3, 7, 4], &[1, 2, 6, 5]];
        let survey = survey(&vertices, &polygons);
        assert_eq!(survey.surfaces.len(), 6);
        let ceiling = numbers_of(&survey, |normal, centre| normal[0].abs() > 0.1 && centre[2] > 2.0);
        let floor = numbers_of(&survey, |normal, centre| normal[2].abs() > 0.9 && centre[2] < 0.1);
        let leaning = numbers_of(&survey, |_, centre| centre[1] < 0.1 && centre[2] > 0.1);
        let end = numbers_of(&survey, |_, centre| (centre[0] - 5.0).abs() < 1e-9);
        let out = |number: usize| {
            let own = &survey.surfaces[number];
            let outwards = dot(own.axes[0], minus(own.centre_m, [2.5, 2.0, 1.2]));
            own.axes[0].map(|c| c * outwards.signum())
        };
        let displaced = |number: usize, offset_m: f64, tilt_deg: [f64; 2]| {
            (number, DisplacedSurface::new(survey.surfaces[number].centre_m, out(number), offset_m, tilt_deg))
        };
        let sets = [
            vec![displaced(ceiling, 0.3, [0.0; 2])],
            vec![displaced(ceiling, -0.2, [2.0, -3.0])],
            vec![displaced(end, 0.45, [-1.5, 2.5]), displaced(ceiling, 0.1, [1.0, 1.0])],
            vec![displaced(leaning, 0.25, [3.0, 1.0]), displaced(end, -0.3, [0.0, 0.0])],
        ];
        let ways = [
            vec![ceiling],
            vec![end],
            vec![leaning],
            vec![floor, ceiling],
            vec![ceiling, end],
            vec![leaning, ceiling],
        ];
        let mut checked = 0;
        for response in &survey.responses {
            let source = survey.sources[response.source].position_m;
            let receiver = survey.receivers[response.receiver].position_m;
            for set in &sets {
                for met in &ways {
                    let planes = |moved: bool| -> Vec<([f64; 3], [f64; 3])> {
                        met.iter()
                            .map(|s| {
                                let own = &survey.surfaces[*s];
                                let there = set.iter().find(|(n, _)| moved && n == s);
                                there.map_or((own.axes[0], own.centre_m), |(_, one)| one.plane())
                            })
                            .collect()
                    };
                    let expected = shortest_m(source, &planes(true), receiver)
                        - shortest_m(source, &planes(false), receiver);
                    let found = longer_m(&survey, response, met, &mirrors(set));
                    assert!((found - expected).abs() < 1e-6, "{met:?} {set:?}: {found} {expected}");
                    checked += usize::from(found != 0.0);
                }
            }
        }
        assert!(checked > 30, "{checked}");
    }

    #[test]
    fn a_surface_stands_once_and_where_it_was_said_last() {
        let one = |offset_m: f64| DisplacedSurface::new([1.0, 0.0, 0.0], [1.0, 0.0, 0.0], offset_m, [0.0; 2]);
        let mut all = Vec::new();
        put(&mut all, one(0.1));
        put(&mut all, DisplacedSurface::new([0.0; 3], [-1.0, 0.0, 0.0], 0.2, [0.0; 2]));
        put(&mut all, one(0.3));
        assert_eq!(all.iter().map(|s| s.offset_m).collect::<Vec<_>>(), [0.3, 0.2]);
        // Where it is at a place, two ways: by its height and by its plane.
        let tilted = DisplacedSurface::new([1.0, 2.0, 3.0], [1.0, 0.0, 0.0], 0.2, [3.0, -2.0]);
        let (normal, point) = tilted.plane();
        let farther_m = tilted.farther_m([1.0, 2.7, 1.8]);
        let place = [1.0 + farther_m, 2.7, 1.8];
        assert!(dot(normal, minus(place, point)).abs() < 1e-12, "{farther_m}");
        assert!(
            (farther_m - 0.2 - 0.7 * 3f64.to_radians().tan() - 1.2 * 2f64.to_radians().tan()).abs() < 1e-12
        );
    }
}
