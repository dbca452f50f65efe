//! Flat patches merged, against a plain search over the triangles that the scene has.

use crate::tessellations::{Model, PlainSearch, Vec3, cross, dot, minus, unit};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::Air;
use sabine_paths::{PathSet, Propagator, RayScene};
use sabine_propagate::{MeshScene, PathTracer, TracerConfig};
use sabine_scene::{Receiver, Scene, Source};

const SIZE: [Vec3; 2] = [[0.0; 3], [6.0, 5.0, 3.0]];
const TURN: [f64; 2] = [0.7, 0.4];

fn random() -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(7)
}

/// A point of the box that `Model::turned` turns with the walls, so that rays start inside.
fn turned(point: Vec3, angles: [f64; 2]) -> Vec3 {
    Model { vertices: vec![point], triangles: Vec::new() }.turned(angles, false).vertices[0]
}

fn direction(random: &mut impl Rng) -> Vec3 {
    loop {
        let v: Vec3 = std::array::from_fn(|_| random.random_range(-1.0..1.0));
        if (0.01..1.0).contains(&v.iter().map(|c| c * c).sum::<f64>()) {
            return unit(v);
        }
    }
}

/// Rays from points of the box in random directions, at vertices and at points of edges.
fn rays(model: &Model, inside: impl Fn(Vec3) -> Vec3, count: usize) -> Vec<(Vec3, Vec3)> {
    let mut random = random();
    (0..count)
        .map(|i| {
            let origin = inside(std::array::from_fn(|k| random.random_range(0.05..SIZE[1][k] - 0.05)));
            let [a, b] = {
                let t = &model.triangles[random.random_range(0..model.triangles.len())];
                [model.vertices[t.vertices[0] as usize], model.vertices[t.vertices[1] as usize]]
            };
            let share = if i % 8 == 0 { 0.0 } else { random.random::<f64>() };
            let aim = std::array::from_fn(|k| a[k] + share * (b[k] - a[k]));
            (origin, if i % 4 == 0 { unit(minus(aim, origin)) } else { direction(&mut random) })
        })
        .collect()
}

/// How far a ray may get that comes as near to an edge as rounding: as far as one beside it.
fn reach(plain: &PlainSearch, origin: Vec3, direction: Vec3, exact_m: f64) -> f64 {
    let shift = |n: usize, k: usize| if n / 2 == k { [-4.0, 4.0][n % 2] * exact_m } else { 0.0 };
    let nearest = |n: usize| {
        let all = plain.all(std::array::from_fn(|k| origin[k] + shift(n, k)), direction);
        let met = all.iter().filter(|m| m.depth_m >= 0.0).map(|m| m.distance);
        met.fold(f64::INFINITY, f64::min)
    };
    (0..6).map(nearest).fold(0.0, f64::max)
}

/// Every ray meets what the plain search says: a point to `exact_m` in a triangle of the same plane and material, none behind
/// what it meets for certain. Near an edge, either side of it will do; a ray that grazes a wall is near an edge from afar, as
/// it meets the wall anywhere within `exact_m` over the cosine. Returns how many rays met something.
fn check(scene: &Scene, rays: &[(Vec3, Vec3)], exact_m: f64) -> usize {
    let (merged, plain) = (MeshScene::merged(scene).unwrap(), PlainSearch::new(scene));
    let material = |triangle: usize| scene.triangles()[triangle].material;
    let mut hits = 0;
    for &(origin, direction) in rays {
        let all = plain.all(origin, direction);
        let found = merged.closest_hit(origin, direction, f64::INFINITY);
        if let Some(hit) = found {
            let own = hit.triangle as usize;
            let point = std::array::from_fn(|k| origin[k] + hit.distance * direction[k]);
            let there = (0..scene.triangles().len()).any(|t| {
                plain.height_m(t, point) <= exact_m
                    && material(t) == material(own)
                    && dot(plain.normal(t), plain.normal(own)) > 1.0 - 1e-6
                    && plain.depth_m(t, point) > -1e-6
            });
            assert!(there, "{origin:?} {direction:?} meets {hit:?} where nothing such is");
            assert!(plain.height_m(own, point) < 1e3 * exact_m, "{origin:?} {direction:?} meets {hit:?}");
        }
        // What the ray meets for certain: it gets no farther.
        let certain =
            all.iter().filter(|m| m.depth_m > -exact_m).min_by(|a, b| a.distance.total_cmp(&b.distance));
        let reach = match certain {
            Some(m) if m.depth_m > exact_m / m.cosine => m.distance,
            _ => reach(&plain, origin, direction, exact_m),
        };
        // At the rim of an open patch, rounding decides.
        let Some(certain) = certain.filter(|_| reach.is_finite()) else { continue };
        hits += 1;
        let hit = found.unwrap_or_else(|| panic!("lost at {}: {origin:?} {direction:?}", certain.triangle));
        let nearest = hit.distance <= reach.max(certain.distance) + exact_m / certain.cosine;
        assert!(nearest, "{origin:?} {direction:?}: {} behind {reach}", hit.distance);
        assert!(merged.any_hit(origin, direction, hit.distance));
        assert!(!merged.any_hit(origin, direction, hit.distance.next_down()));
    }
    hits
}

/// Checks a model of the box as it stands and turned; says how many triangles are left.
fn check_room(model: &Model, rays_each: usize) -> [usize; 2] {
    [[0.0; 2], TURN].map(|angles| {
        let model = model.clone().turned(angles, false);
        let scene = model.scene();
        let rays = rays(&model, |p| turned(p, angles), rays_each);
        assert_eq!(check(&scene, &rays, 1e-10), rays.len(), "rays are lost");
        MeshScene::merged(&scene).unwrap().tested_triangles()
    })
}

fn fine_box(cells: u32, jitter: f64, material: impl Fn(usize, u32, u32) -> Option<u32>) -> Model {
    let mut model = Model::default();
    model.block(SIZE, cells, jitter, &mut random(), material);
    model
}

#[test]
fn a_finely_meshed_box_becomes_twelve_triangles() {
    assert_eq!(check_room(&fine_box(13, 0.0, |_, _, _| Some(0)), 15_000), [12, 12]);
    assert_eq!(check_room(&fine_box(13, 0.24, |_, _, _| Some(0)), 15_000), [12, 12]);
    let large = fine_box(90, 0.0, |face, _, _| Some(face as u32 % 3)).scene();
    assert_eq!(large.triangles().len(), 97_200);
    assert_eq!(MeshScene::merged(&large).unwrap().tested_triangles(), 12);
}

/// Coordinates as glTF has them: walls are flat, and edges straight, to half a micrometre.
#[test]
fn rounding_to_single_precision_does_not_keep_walls_apart() {
    let model = fine_box(13, 0.24, |_, _, _| Some(0)).turned(TURN, true);
    let scene = model.scene();
    let rays = rays(&model, |p| turned(p, TURN), 15_000);
    assert_eq!(check(&scene, &rays, 1e-6), rays.len());
    assert_eq!(MeshScene::merged(&scene).unwrap().tested_triangles(), 12);
}

#[test]
fn a_window_of_another_material_stays_a_window() {
    let window = |face, i, j| Some(u32::from(face == 1 && (4..9).contains(&i) && (3..8).contains(&j)));
    // A wall about a window has eight vertices and one hole.
    assert_eq!(check_room(&fine_box(12, 0.0, window), 15_000), [20, 20]);
}

#[test]
fn a_room_in_the_shape_of_an_l_keeps_its_shape() {
    let mut model = Model::default();
    let mut random = random();
    // The corner beyond (3, 2) is not part of the room.
    let floor = |i, j| (i < 6 || j < 4).then_some(0);
    let [x, y, z] = SIZE[1];
    let mut wall = |corner, u, v, cells, material: &dyn Fn(u32, u32) -> Option<u32>| {
        model.patch([corner, u, v], cells, 0.2, &mut random, material);
    };
    // Cells of half a metre. The outline of an L that moved vertices lie on would not be straight.
    for (height, swap) in [(0.0, false), (z, true)] {
        let (u, v) = ([x, 0.0, 0.0], [0.0, y, 0.0]);
        let corner = [0.0, 0.0, height];
        if swap {
            wall(corner, v, u, [10, 12], &|j, i| floor(i, j));
        } else {
            wall(corner, u, v, [12, 10], &floor);
        }
    }
    let outline = [[0.0, 0.0], [x, 0.0], [x, 2.0], [3.0, 2.0], [3.0, y], [0.0, y]];
    for (i, a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % 6];
        let cells = ((b[0] - a[0]).abs() + (b[1] - a[1]).abs()) * 2.0;
        let u = [b[0] - a[0], b[1] - a[1], 0.0];
        wall([a[0], a[1], 0.0], u, [0.0, 0.0, z], [cells as u32, 6], &|_, _| Some(1));
    }
    // Jittered vertices on the inner outline bend it: they are put back in place.
    for p in &mut model.vertices {
        let near = |c: f64, to: f64| (c - to).abs() < 0.12;
        if near(p[0], 3.0) && p[1] > 1.8 && (p[2] == 0.0 || p[2] == z) {
            p[0] = 3.0;
            p[1] = (p[1] * 2.0).round() / 2.0;
        } else if near(p[1], 2.0) && p[0] > 2.8 && (p[2] == 0.0 || p[2] == z) {
            p[1] = 2.0;
            p[0] = (p[0] * 2.0).round() / 2.0;
        }
    }
    for angles in [[0.0; 2], TURN] {
        let model = model.clone().turned(angles, false);
        // From the part that all of the L has.
        let rays = rays(&model, |p| turned([p[0] / 2.1, p[1] / 2.6, p[2]], angles), 15_000);
        assert_eq!(check(&model.scene(), &rays, 1e-10), rays.len());
        assert_eq!(MeshScene::merged(&model.scene()).unwrap().tested_triangles(), 20);
    }
}

/// The floor is fine, the walls are not: each vertex on an edge meets a wall that has none there.
#[test]
fn nothing_slips_through_edges_that_only_one_side_divides() {
    let mut model = Model::default();
    for face in 0..6 {
        let cells = [1, 17, 5, 1, 12, 2][face];
        model.block(SIZE, cells, 0.0, &mut random(), |f, _, _| (f == face).then_some(0));
    }
    assert_eq!(check_room(&model, 15_000), [12, 12]);
    // The same in single precision: vertices on edges are off the walls beside them, and stay. A ray between two of them may
    // find a gap that the model has.
    let model = model.turned(TURN, true);
    let scene = model.scene();
    let rays = rays(&model, |p| turned(p, TURN), 15_000);
    let hits = check(&scene, &rays, 1e-6);
    assert!(hits + 10 > rays.len(), "{hits}");
    let left = MeshScene::merged(&scene).unwrap().tested_triangles();
    assert!((12..200).contains(&left), "{left} of {}", scene.triangles().len());
}

/// Vertices moved so far that some cells fold over: what is covered twice cannot be triangulated again.
#[test]
fn a_wall_that_folds_over_itself_is_left_alone() {
    let model = fine_box(13, 0.6, |_, _, _| Some(0));
    let left = check_room(&model, 5_000);
    assert!(left.iter().all(|&n| n > model.triangles.len() / 2), "{left:?}");
}

/// Blocks that stand on the floor, a screen with a hole, a partition on vertices of the floor, and a ball.
fn furnished() -> Model {
    let mut random = random();
    let mut model = fine_box(10, 0.0, |_, _, _| Some(0));
    for k in 0..4 {
        let x = 0.7 + 1.2 * f64::from(k);
        let block = [[x, 1.0, 0.0], [x + 0.6, 1.7, 0.75]];
        model.block(block, 3, 0.3, &mut random, |face, i, j| Some(1 + u32::from(face == 5 && i == j)));
    }
    let hole = |i, j| (!(2..4).contains(&i) || !(1..3).contains(&j)).then_some(2);
    model.patch([[1.0, 3.0, 0.3], [2.0, 0.4, 0.0], [0.0, 0.0, 1.5]], [6, 5], 0.0, &mut random, hole);
    // Between vertices of the floor: x is 3.6 and y runs over cells of half a metre.
    model
        .patch([[3.6, 3.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, 2.0]], [3, 4], 0.0, &mut random, |_, _| Some(1));
    model.ball([4.8, 3.5, 1.5], 0.4, 10);
    model
}

#[test]
fn a_furnished_room_looks_the_same() {
    let model = furnished();
    let left = check_room(&model, 15_000);
    let all = model.triangles.len();
    // The ball keeps its triangles, blocks have 18 and more.
    assert!(left.iter().all(|&n| n < 600), "{left:?} of {all}");
}

fn trace(scene: &Scene, merge_coplanar: bool) -> PathSet {
    let config = TracerConfig {
        rays: 4_000,
        duration_s: 0.3,
        merge_coplanar,
        diffraction: true,
        ..Default::default()
    };
    let (source, receiver) =
        (Source::omni("S", [1.0, 4.0, 1.2]).unwrap(), Receiver::omni("R", [4.9, 2.3, 1.6]).unwrap());
    PathTracer::new(config).unwrap().trace(scene, &source, &receiver, &Air::default(), &()).unwrap()
}

#[test]
fn a_room_without_anything_to_merge_is_traced_to_the_bit() {
    let mut coarse = fine_box(1, 0.0, |face, _, _| Some(face as u32 % 3));
    coarse.block([[1.0, 1.0, 0.0], [2.0, 2.0, 1.0]], 1, 0.0, &mut random(), |_, _, _| Some(1));
    coarse.ball([4.0, 3.5, 1.5], 0.4, 8);
    let scene = coarse.scene();
    let (merged, plain) = (MeshScene::merged(&scene).unwrap(), MeshScene::new(&scene).unwrap());
    assert_eq!(merged.tested_triangles(), plain.tested_triangles());
    for (origin, direction) in rays(&coarse, |p| p, 5_000) {
        let limit = f64::INFINITY;
        assert_eq!(merged.closest_hit(origin, direction, limit), plain.closest_hit(origin, direction, limit));
    }
    assert_eq!(trace(&scene, true), trace(&scene, false));
}

/// Mirror paths and ways around edges are the same; what is drawn at random agrees within its chance.
#[test]
fn a_furnished_room_has_the_same_exact_paths_and_energy() {
    let scene = furnished().scene();
    let (merged, plain) = (trace(&scene, true), trace(&scene, false));
    let exact = |paths: &PathSet| {
        let own = (0..paths.len()).filter(|&i| paths.is_exact(i));
        own.map(|i| (paths.lengths_m()[i] * 1e4).round() as i64).collect::<Vec<_>>()
    };
    assert!(exact(&plain).len() > 20);
    assert_eq!(exact(&merged), exact(&plain));
    let energy =
        |paths: &PathSet| (0..paths.len()).map(|i| f64::from(paths.log_weights()[i]).exp()).sum::<f64>();
    let ratio = energy(&merged) / energy(&plain);
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Any cells of a folded grid, of two materials or open: outlines of any shape, with holes, islands and cells that touch in
    /// a corner only, moved vertices, two planes that meet at any angle.
    #[test]
    fn any_pattern_of_cells_is_met_where_it_was(
        cells in prop::collection::vec(prop::sample::select(vec![None, Some(0), Some(0), Some(0), Some(1)]), 49),
        fold in -1.5f64..1.5,
        jitter in prop::sample::select(vec![0.0f64, 0.2, 0.5]),
        single in any::<bool>(),
        angles in prop::array::uniform2(0.0f64..6.0),
        seed in any::<u64>(),
    ) {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        // Slivers of rounded corners have planes of their own, which the plain search would take at their word.
        let jitter = if single { jitter.min(0.2) } else { jitter };
        let mut model = Model::default();
        let of = |i: u32, j: u32| cells[(7 * j + i) as usize];
        model.patch([[0.0, 0.0, 1.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0]], [7, 7], jitter, &mut random, of);
        let (s, c) = fold.sin_cos();
        model.patch([[3.0, 0.0, 1.0], [2.0 * c, 0.0, 2.0 * s], [0.0, 2.0, 0.0]], [7, 7], 0.0, &mut random, of);
        prop_assume!(!model.triangles.is_empty());
        let model = model.turned(angles, single);
        let scene = model.scene();
        let rays: Vec<_> = (0..400)
            .map(|i| {
                let from: Vec3 = std::array::from_fn(|_| random.random_range(-1.0..5.0));
                let t = &model.triangles[random.random_range(0..model.triangles.len())];
                let [a, b, c] = t.vertices.map(|v| model.vertices[v as usize]);
                let mut shares = [random.random::<f64>(), random.random::<f64>()];
                // On an edge, or about to leave the triangle.
                match i % 3 {
                    0 => shares[1] = 0.0,
                    1 => shares[1] = 10f64.powf(random.random_range(-6.0..-1.0)),
                    _ => {}
                }
                let aim = std::array::from_fn(|k| {
                    a[k] + shares[0] * (b[k] - a[k]) + (1.0 - shares[0]) * shares[1] * (c[k] - a[k])
                });
                // A fifth of them graze the wall.
                let from = if i % 5 == 0 {
                    let normal = unit(cross(minus(b, a), minus(c, a)));
                    let along = unit(cross(normal, minus(from, aim)));
                    let off = 10f64.powf(random.random_range(-4.5..-1.0));
                    std::array::from_fn(|k| aim[k] + 2.0 * along[k] + 2.0 * off * normal[k])
                } else {
                    from
                };
                (from, unit(minus(aim, from)))
            })
            .collect();
        check(&scene, &rays, if single { 1e-6 } else { 1e-10 });
        let merged = MeshScene::merged(&scene).unwrap();
        prop_assert!(merged.tested_triangles() <= scene.triangles().len());
    }
}
