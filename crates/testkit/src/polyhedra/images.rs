//! Image sources in any mesh: mirrored in planes, kept where the path meets each of them with nothing between.

use super::shape::Plane;
use crate::geometry::{Vec3, dot, first_hit, norm, scale, sub};

/// A path leaves a plane this far away, in metres.
const LIFT_OFF_M: f64 = 1e-7;

/// A specular path, or the direct line.
pub(super) struct Image {
    pub length_m: f64,
    /// Triangles that it meets, from the receiver on.
    pub met: Vec<usize>,
}

/// All specular paths with so many reflections at most.
pub(super) fn images(
    triangles: &[[Vec3; 3]],
    planes: &[Plane],
    [source, receiver]: [Vec3; 2],
    order: usize,
) -> Vec<Image> {
    let of_triangle = |triangle: usize| planes.iter().position(|p| p.triangles.contains(&triangle));
    let mut found = Vec::new();
    // Mirrored places of the source, with the planes that mirrored them, oldest first.
    let mut open: Vec<(Vec<usize>, Vec<Vec3>)> = vec![(Vec::new(), vec![source])];
    while let Some((mirrors, places)) = open.pop() {
        if let Some(met) = trace_back(triangles, &of_triangle, receiver, (&mirrors, &places)) {
            found.push(Image { length_m: norm(sub(places[mirrors.len()], receiver)), met });
        }
        if mirrors.len() == order {
            continue;
        }
        for (index, plane) in planes.iter().enumerate() {
            if mirrors.last() == Some(&index) {
                continue;
            }
            let last = places[mirrors.len()];
            let image = sub(last, scale(plane.normal, 2.0 * (dot(plane.normal, last) - plane.offset)));
            open.push(([&mirrors[..], &[index]].concat(), [&places[..], &[image]].concat()));
        }
    }
    found
}

/// The triangles that the path from the receiver back to the source meets, if it is one.
fn trace_back(
    triangles: &[[Vec3; 3]],
    of_triangle: &impl Fn(usize) -> Option<usize>,
    receiver: Vec3,
    (mirrors, places): (&[usize], &[Vec3]),
) -> Option<Vec<usize>> {
    let mut from = receiver;
    let mut met = Vec::with_capacity(mirrors.len());
    for k in (0..mirrors.len()).rev() {
        let way = sub(places[k + 1], from);
        let length = norm(way);
        let direction = scale(way, 1.0 / length);
        let (triangle, distance) = first_hit(triangles, from, direction, LIFT_OFF_M, length)?;
        if of_triangle(triangle) != Some(mirrors[k]) {
            return None;
        }
        met.push(triangle);
        from = std::array::from_fn(|i| from[i] + distance * direction[i]);
    }
    let way = sub(places[0], from);
    let length = norm(way);
    first_hit(triangles, from, scale(way, 1.0 / length), LIFT_OFF_M, length).is_none().then_some(met)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::super::shape::planes;
    use super::*;
    use crate::ShoeboxImages;
    use sabine_acoustics::{Air, Bands, Material};
    use sabine_scene::{Receiver, Scene, Source};

    #[test]
    fn in_a_box_they_are_those_of_the_lattice() {
        let material = Material::uniform(Bands::octaves(1000.0, 1000.0).unwrap(), 0.1, 0.0).unwrap();
        let room = Scene::shoebox([6.0, 4.5, 2.8], std::array::from_fn(|_| material.clone())).unwrap();
        let triangles = crate::brute_force::corners(&room);
        let (source, receiver) = ([1.0, 1.2, 1.5], [4.4, 3.1, 1.2]);
        let mut found: Vec<f64> = images(&triangles, &planes(&triangles), [source, receiver], 3)
            .iter()
            .map(|i| i.length_m)
            .collect();
        found.sort_by(f64::total_cmp);
        let lattice = ShoeboxImages::new(0.2).unwrap();
        let all = lattice
            .images(
                &room,
                &Source::omni("s", source).unwrap(),
                &Receiver::omni("r", receiver).unwrap(),
                &Air::default(),
            )
            .unwrap();
        let mut expected: Vec<f64> =
            all.iter().filter(|i| i.hits.iter().sum::<u32>() <= 3).map(|i| i.length_m).collect();
        expected.sort_by(f64::total_cmp);
        assert_eq!(found.len(), expected.len());
        assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}
