#![allow(clippy::unwrap_used)] // a panic is how a test fails

use super::*;
use crate::extend::displaced_surface::longer_m;
use crate::simulate::met_surfaces::MetSurfaces;
use crate::survey::surfaces::mirrored_in;
use sabine_acoustics::{Air, Bands, Material};
use sabine_paths::{PathSet, Propagator};
use sabine_propagate::{PathTracer, TracerConfig};
use sabine_scene::{NamedMaterial, Triangle};

fn room(vertices: &[[f64; 3]], polygons: &[&[u32]]) -> Scene {
    let fan = |polygon: &&[u32]| -> Vec<Triangle> {
        let corners = |i: usize| [polygon[0], polygon[i], polygon[i + 1]];
        (1..polygon.len() - 1).map(|i| Triangle { vertices: corners(i), material: 0 }).collect()
    };
    let material = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
    let materials = vec![NamedMaterial { name: "plaster".into(), material }];
    Scene::new(vertices.to_vec(), polygons.iter().flat_map(fan).collect(), materials).unwrap()
}

/// A prism: polygon of the floor, its height at each corner.
fn prism(floor: &[[f64; 2]], height: impl Fn([f64; 2]) -> f64) -> Scene {
    let n = floor.len() as u32;
    let mut vertices: Vec<[f64; 3]> = floor.iter().map(|[x, y]| [*x, *y, 0.0]).collect();
    vertices.extend(floor.iter().map(|[x, y]| [*x, *y, height([*x, *y])]));
    let mut polygons: Vec<Vec<u32>> = vec![(0..n).rev().collect(), (n..2 * n).collect()];
    polygons.extend((0..n).map(|i| vec![i, (i + 1) % n, (i + 1) % n + n, i + n]));
    let polygons: Vec<&[u32]> = polygons.iter().map(Vec::as_slice).collect();
    room(&vertices, &polygons)
}

fn cuboid() -> Scene {
    prism(&[[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 4.0]], |_| 2.5)
}

/// An L, as fans from its inner corner.
fn l_shape() -> Scene {
    prism(&[[3.0, 2.0], [3.0, 5.0], [0.0, 5.0], [0.0, 0.0], [7.0, 0.0], [7.0, 2.0]], |_| 3.0)
}

fn sloping() -> Scene {
    prism(&[[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 4.0]], |[x, y]| 2.4 + 0.15 * x + 0.05 * y)
}

/// Each triangle with corners of its own, some a little off.
fn unshared(scene: &Scene) -> Scene {
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for (index, triangle) in scene.triangles().iter().enumerate() {
        let first = vertices.len() as u32;
        let off = 1e-5 * (index % 3) as f64;
        vertices.extend(corners(scene, index).map(|c| c.map(|x| x + off)));
        triangles.push(Triangle { vertices: [first, first + 1, first + 2], ..*triangle });
    }
    Scene::new(vertices, triangles, scene.materials().to_vec()).unwrap()
}

/// By the divergence theorem; the faces are turned alike.
fn volume_m3(scene: &Scene) -> f64 {
    let one = |t: usize| {
        let own = corners(scene, t);
        dot(normal_of(own), own[0]) / 6.0
    };
    (0..scene.triangles().len()).map(one).sum::<f64>().abs()
}

fn area_m2(scene: &Scene, surface: usize) -> f64 {
    Surfaces::of(scene).described(scene)[surface].area_m2
}

/// The surface whose outward normal is nearest to a direction at a point.
fn displacement(
    scene: &Scene,
    point_m: [f64; 3],
    normal: [f64; 3],
    offset_m: f64,
    tilt_deg: [f64; 2],
) -> DisplacedSurface {
    let one = DisplacedSurface::new(point_m, normal, offset_m, tilt_deg);
    assert!(surface_at(scene, &Surfaces::of(scene), &one).is_some(), "{one:?}");
    one
}

/// The moved mesh has as many planar surfaces as before, in the planes where they should be.
fn assert_planes(stated: &Scene, found: &Scene, moved: &[DisplacedSurface]) {
    let surfaces = Surfaces::of(stated);
    for (surface, plane) in surfaces.planes.iter().enumerate() {
        let one = moved.iter().find(|m| surface_at(stated, &surfaces, m) == Some(surface));
        let (normal, point) = one.map_or(*plane, DisplacedSurface::plane);
        for t in surfaces.triangles(surface) {
            for corner in corners(found, t) {
                let off = dot(normal, minus(corner, point)).abs();
                assert!(off < 2e-5, "surface {surface}: a corner is {off} m off its plane");
            }
        }
    }
    // Equal positions have stayed equal.
    for (i, a) in stated.vertices().iter().enumerate() {
        for (j, b) in stated.vertices().iter().enumerate().skip(i) {
            if a == b {
                assert_eq!(found.vertices()[i], found.vertices()[j]);
            }
        }
    }
}

#[test]
fn a_wall_of_a_box_that_moves_leaves_a_box() {
    for stated in [cuboid(), unshared(&cuboid())] {
        for offset_m in [-0.6, 0.41] {
            let one = displacement(&stated, [5.0, 2.0, 1.25], [1.0, 0.0, 0.0], offset_m, [0.0; 2]);
            let found = displaced(&stated, std::slice::from_ref(&one)).unwrap();
            assert_planes(&stated, &found, &[one]);
            assert!((volume_m3(&found) - (5.0 + offset_m) * 10.0).abs() < 2e-3, "{}", volume_m3(&found));
        }
    }
}

#[test]
fn a_tilted_wall_adds_the_wedge_that_it_turns_through() {
    let stated = cuboid();
    // About the middle of the wall: what one half adds the other takes.
    let turned = displacement(&stated, [5.0, 2.0, 1.25], [1.0, 0.0, 0.0], 0.3, [4.0, -2.0]);
    let found = displaced(&stated, std::slice::from_ref(&turned)).unwrap();
    assert_planes(&stated, &found, &[turned]);
    assert!((volume_m3(&found) - 53.0).abs() < 1e-9, "{}", volume_m3(&found));
    // The room is wider where y is greater, and lower there.
    let corner = found.vertices().iter().fold([0.0; 3], |a: [f64; 3], b| if b[0] > a[0] { *b } else { a });
    let expected = 5.3 + 2.0 * 4f64.to_radians().tan() + 1.25 * 2f64.to_radians().tan();
    assert!((corner[0] - expected).abs() < 1e-9 && corner[1..] == [4.0, 0.0], "{corner:?}");
}

#[test]
fn two_walls_move_together_in_either_order() {
    let stated = cuboid();
    let one = displacement(&stated, [5.0, 2.0, 1.25], [1.0, 0.0, 0.0], 0.3, [2.0, 0.0]);
    let other = displacement(&stated, [2.5, 4.0, 1.25], [0.0, 1.0, 0.0], -0.25, [0.0, 3.0]);
    let found = displaced(&stated, &[one.clone(), other.clone()]).unwrap();
    assert_planes(&stated, &found, &[one.clone(), other.clone()]);
    let turned = displaced(&stated, &[other.clone(), one.clone()]).unwrap();
    for (a, b) in found.vertices().iter().zip(turned.vertices()) {
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-12));
    }
    assert!(matches!(displaced(&stated, &[one.clone(), one]), Err(DisplacementError::Twice { .. })));
}

#[test]
fn in_an_l_shape_the_inner_corner_follows_the_wall_that_moves() {
    for stated in [l_shape(), unshared(&l_shape())] {
        let before = volume_m3(&stated);
        assert!((before - 69.0).abs() < 1e-2, "{before}");
        // The inner wall at x = 3, outwards of the room in +x: the short arm grows wider, over its 3 m by 3 m.
        let one = displacement(&stated, [3.0, 3.5, 1.5], [1.0, 0.0, 0.0], 0.4, [0.0; 2]);
        let found = displaced(&stated, std::slice::from_ref(&one)).unwrap();
        assert_planes(&stated, &found, &[one]);
        assert!((volume_m3(&found) - before - 0.4 * 9.0).abs() < 2e-3, "{}", volume_m3(&found));
        // The ceiling, all of it.
        let one = displacement(&stated, [1.0, 1.0, 3.0], [0.0, 0.0, 1.0], -0.5, [0.0; 2]);
        let found = displaced(&stated, std::slice::from_ref(&one)).unwrap();
        assert_planes(&stated, &found, &[one]);
        assert!((volume_m3(&found) - before + 0.5 * 23.0).abs() < 2e-3, "{}", volume_m3(&found));
    }
}

#[test]
fn under_a_sloping_ceiling_a_wall_moves_along_the_slope() {
    let stated = sloping();
    let one = displacement(&stated, [5.0, 2.0, 1.0], [1.0, 0.0, 0.0], 0.5, [0.0; 2]);
    let found = displaced(&stated, std::slice::from_ref(&one)).unwrap();
    assert_planes(&stated, &found, &[one]);
    // Height 2.4 + 0.15 x + 0.05 y over 0.5 m by 4 m more floor.
    let more = 0.5 * 4.0 * (2.4 + 0.15 * 5.25 + 0.05 * 2.0);
    assert!((volume_m3(&found) - volume_m3(&stated) - more).abs() < 1e-9);
    assert!((area_m2(&found, 0) - 22.0).abs() < 1e-9);
    // The slope itself, along its normal.
    let normal = unit([-0.15, -0.05, 1.0]);
    let one = displacement(&stated, [2.0, 2.0, 2.8], normal, 0.2, [1.0, -1.0]);
    let found = displaced(&stated, std::slice::from_ref(&one)).unwrap();
    assert_planes(&stated, &found, &[one]);
}

/// A corner of one face in the middle of another's side.
#[test]
fn a_corner_in_the_middle_of_a_side_stays_on_it() {
    // The wall x = 5 is cut at half its length, its neighbours are not.
    let vertices = [
        [0.0, 0.0, 0.0],
        [5.0, 0.0, 0.0],
        [5.0, 4.0, 0.0],
        [0.0, 4.0, 0.0],
        [0.0, 0.0, 2.5],
        [5.0, 0.0, 2.5],
        [5.0, 4.0, 2.5],
        [0.0, 4.0, 2.5],
        [5.0, 2.0, 0.0],
        [5.0, 2.0, 2.5],
    ];
    let polygons: [&[u32]; 7] = [
        &[3, 2, 1, 0],
        &[4, 5, 6, 7],
        &[0, 1, 5, 4],
        &[2, 3, 7, 6],
        &[3, 0, 4, 7],
        &[1, 8, 9, 5],
        &[8, 2, 6, 9],
    ];
    let stated = room(&vertices, &polygons);
    assert_eq!(Surfaces::of(&stated).planes.len(), 6);
    // The ceiling's own triangles know nothing of the corner at (5, 2, 2.5): it goes with them.
    let one = displacement(&stated, [2.0, 2.0, 2.5], [0.0, 0.0, 1.0], 0.3, [2.0, 0.0]);
    let found = displaced(&stated, std::slice::from_ref(&one)).unwrap();
    assert_planes(&stated, &found, &[one]);
    assert!(
        (found.vertices()[9][2] - found.vertices()[5][2] / 2.0 - found.vertices()[6][2] / 2.0).abs() < 1e-9
    );
    assert!((volume_m3(&found) - volume_m3(&stated)).abs() > 1.0);
}

#[test]
fn what_cannot_be_is_refused() {
    let stated = cuboid();
    let wall = |offset_m: f64, tilt_deg: [f64; 2]| {
        DisplacedSurface::new([5.0, 2.0, 1.25], [1.0, 0.0, 0.0], offset_m, tilt_deg)
    };
    let refused = |scene: &Scene, one: DisplacedSurface| displaced(scene, &[one]).unwrap_err();
    // Through the opposite wall.
    assert!(matches!(refused(&stated, wall(-5.5, [0.0; 2])), DisplacementError::TurnedOver { .. }));
    let nowhere = DisplacedSurface::new([4.0, 2.0, 1.25], [1.0, 0.0, 0.0], 0.1, [0.0; 2]);
    assert!(matches!(refused(&stated, nowhere), DisplacementError::NoSurface { .. }));
    // A pyramid: where its four sides meet, no place is in all of them once one has moved.
    let vertices = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0], [2.0, 2.0, 3.0]];
    let pyramid = room(&vertices, &[&[3, 2, 1, 0], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]]);
    let side = DisplacedSurface::new([2.0, 1.0, 1.5], unit([0.0, -3.0, 2.0]), 0.2, [0.0; 2]);
    assert!(matches!(refused(&pyramid, side), DisplacementError::Torn { .. }));
    // A block that hangs in the room, 30 cm below the ceiling: that comes down on it.
    let block = [0.0, 1.0]
        .map(|up| [[2.0, 1.5], [3.0, 1.5], [3.0, 2.5], [2.0, 2.5]].map(|[x, y]| [x, y, 1.7 + 0.5 * up]));
    let mut vertices = stated.vertices().to_vec();
    let mut triangles = stated.triangles().to_vec();
    let first = vertices.len() as u32;
    vertices.extend(block.into_iter().flatten());
    for [a, b, c, d] in [[0, 1, 2, 3], [7, 6, 5, 4], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]] {
        for corners in [[a, b, c], [a, c, d]] {
            triangles.push(Triangle { vertices: corners.map(|v: u32| v + first), material: 0 });
        }
    }
    let furnished = Scene::new(vertices, triangles, stated.materials().to_vec()).unwrap();
    let ceiling = |offset_m: f64| DisplacedSurface::new([1.0, 1.0, 2.5], [0.0, 0.0, 1.0], offset_m, [0.0; 2]);
    assert!(displaced(&furnished, &[ceiling(-0.25)]).is_ok());
    assert!(matches!(refused(&furnished, ceiling(-0.5)), DisplacementError::Pierced { .. }));
}

#[test]
fn a_wall_that_passes_a_receiver_is_refused() {
    let stated = cuboid();
    let sources = [Source::omni("s", [1.0, 1.0, 1.0]).unwrap()];
    let receivers = [Receiver::omni("r", [4.6, 2.0, 1.2]).unwrap()];
    let wall = |offset_m: f64| DisplacedSurface::new([5.0, 2.0, 1.25], [1.0, 0.0, 0.0], offset_m, [0.0; 2]);
    let check = |offset_m: f64| {
        let found = displaced(&stated, &[wall(offset_m)]).unwrap();
        check_places(&stated, &found, &sources, &receivers)
    };
    assert!(check(-0.3).is_ok() && check(0.6).is_ok());
    assert!(matches!(check(-0.6), Err(DisplacementError::Outside { id }) if id == "r"));
}

/// Lengths of exact paths as the tracer finds them in the moved mesh, against those of the stated mesh with the delay of each.
#[test]
fn the_tracer_finds_every_early_path_as_long_in_the_moved_mesh_as_its_delay_says() {
    let air = Air::default();
    let source = Source::omni("s0", [1.2, 0.9, 1.1]).unwrap();
    let receiver = Receiver::omni("r0", [2.1, 1.3, 1.4]).unwrap();
    let config = TracerConfig { rays: 200, duration_s: 0.06, image_order: 3, ..TracerConfig::default() };
    let tracer = PathTracer::new(config).unwrap();
    let exact = |paths: &PathSet| -> Vec<usize> {
        (0..paths.len()).filter(|&i| paths.is_exact(i) && paths.lengths_m()[i] < 12.0).collect()
    };
    for (stated, point, normal) in [
        (cuboid(), [5.0, 2.0, 1.25], [1.0, 0.0, 0.0]),
        (sloping(), [2.0, 2.0, 2.8], unit([-0.15, -0.05, 1.0])),
        (l_shape(), [0.0, 2.5, 1.5], [-1.0, 0.0, 0.0]),
    ] {
        let mut survey =
            crate::hand_made::survey(sabine_scene::Levels::Common, sabine_scene::TimeZero::Emission);
        let surfaces = Surfaces::of(&stated);
        survey.surfaces = surfaces.described(&stated);
        survey.sources[0].position_m = source.position_m;
        survey.receivers[0].position_m = receiver.position_m;
        let one = displacement(&stated, point, normal, 0.3, [2.0, -1.0]);
        let number = surface_at(&stated, &surfaces, &one).unwrap();
        let moved = displaced(&stated, std::slice::from_ref(&one)).unwrap();
        let before = tracer.trace(&stated, &source, &receiver, &air, &()).unwrap();
        let after = tracer.trace(&moved, &source, &receiver, &air, &()).unwrap();
        let lengths: Vec<f64> = exact(&after).into_iter().map(|i| f64::from(after.lengths_m()[i])).collect();
        let met = MetSurfaces::new(&stated, &surfaces).unwrap();
        let after_met = MetSurfaces::new(&moved, &surfaces).unwrap();
        let (mut followed, mut changed, mut gone) = (0, 0, 0);
        let paths = exact(&before);
        for &i in &paths {
            let length_m = f64::from(before.lengths_m()[i]);
            let places = [source.position_m, receiver.position_m];
            let Some(own) = met.of(places, length_m, [before.departure(i), before.arrival(i)]) else {
                continue;
            };
            followed += 1;
            let longer_m = longer_m(&survey, &survey.responses[0], &own, &[(number, one.plane())]);
            // Beside an edge, a path may be gone once one of the surfaces is tilted: what leads from the receiver to its image says so.
            let image = own.iter().fold(source.position_m, |place, &s| {
                let (normal, point) = if s == number { one.plane() } else { surfaces.planes[s] };
                mirrored_in(place, normal, point)
            });
            let way = minus(image, receiver.position_m);
            if after_met.of(places, length_m + longer_m, [[0.0, 0.0, 1.0], unit(way)]).as_ref() != Some(&own)
            {
                gone += 1;
                continue;
            }
            changed += usize::from(longer_m != 0.0);
            let off = |l: &f64| (l - length_m - longer_m).abs();
            let nearest = lengths.iter().map(off).fold(f64::INFINITY, f64::min);
            // Single precision of 12 m.
            assert!(nearest < 5e-6, "{length_m} m over {own:?} should be {longer_m} m longer: {nearest}");
        }
        assert!(5 * gone <= paths.len(), "{gone} of {}", paths.len());
        assert!(followed + 1 >= paths.len() && changed >= 5, "{followed} of {}, {changed}", paths.len());
    }
}
