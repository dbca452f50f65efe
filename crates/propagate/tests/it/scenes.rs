//! The hierarchy against plain search, and both against parry.

use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use sabine_acoustics::{Bands, Material};
use sabine_paths::RayScene;
use sabine_propagate::{BruteForceScene, MeshScene};
use sabine_scene::{NamedMaterial, Scene, Triangle};

type Corners = [[f64; 3]; 3];

fn soup(triangles: &[Corners]) -> Scene {
    let material = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
    let indices = (0..triangles.len() as u32)
        .map(|i| Triangle { vertices: [3 * i, 3 * i + 1, 3 * i + 2], material: 0 });
    Scene::new(
        triangles.as_flattened().to_vec(),
        indices.collect(),
        vec![NamedMaterial { name: "any".into(), material }],
    )
    .unwrap()
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    v.map(|c| c / length)
}

/// Both scenes see the same triangle at the same distance, to the bit, and shadow rays agree, at any limit.
fn check_agreement(scene: &Scene, origin: [f64; 3], direction: [f64; 3]) -> Result<(), TestCaseError> {
    let (Ok(fast), Ok(plain)) = (MeshScene::new(scene), BruteForceScene::new(scene)) else {
        return Ok(()); // no triangle with an area
    };
    let nearest = plain.closest_hit(origin, direction, f64::INFINITY);
    prop_assert_eq!(fast.closest_hit(origin, direction, f64::INFINITY), nearest);
    let reach = nearest.map_or(1.0, |hit| hit.distance);
    for limit in [reach, reach.next_down(), 0.5 * reach, 2.0 * reach, 0.0, -1.0, f64::INFINITY] {
        let expected = plain.closest_hit(origin, direction, limit);
        prop_assert_eq!(fast.closest_hit(origin, direction, limit), expected, "limit {}", limit);
        prop_assert_eq!(fast.any_hit(origin, direction, limit), expected.is_some(), "limit {}", limit);
    }
    Ok(())
}

/// Triangles and rays on a coarse grid: most share corners, edges and planes, many have no area, some are there twice; rays
/// run along axes, edges and planes, and through corners.
fn on_a_grid() -> impl Strategy<Value = (Vec<Corners>, [f64; 3], [f64; 3])> {
    let point = || prop::array::uniform3((-2i32..=2).prop_map(f64::from));
    let start = prop::array::uniform3((-6i32..=6).prop_map(|c| f64::from(c) / 2.0));
    let heading = point().prop_filter("a direction", |d| d.iter().any(|&c| c != 0.0));
    (prop::collection::vec(prop::array::uniform3(point()), 1..80), start, heading)
}

proptest! {
    /// Any triangles, any ray, anywhere.
    #[test]
    fn the_hierarchy_finds_what_plain_search_finds(
        corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-5.0f64..5.0)), 1..60),
        origin in prop::array::uniform3(-8.0f64..8.0),
        z in -1.0f64..1.0,
        azimuth in 0.0f64..std::f64::consts::TAU,
        shift_m in prop::sample::select(vec![0.0, 1e4]),
    ) {
        let shifted = |[x, y, z]: [f64; 3]| [x + shift_m, y, z];
        let scene = soup(&corners.iter().map(|c| c.map(shifted)).collect::<Vec<_>>());
        let r = (1.0 - z * z).sqrt();
        check_agreement(&scene, shifted(origin), [r * azimuth.cos(), r * azimuth.sin(), z])?;
    }

    #[test]
    fn they_agree_on_shared_corners_edges_and_planes(
        (corners, origin, heading) in on_a_grid(),
        scale in prop::sample::select(vec![1.0, 1.0 / 3.0, 1e-4, 3e4]),
        shift_m in prop::sample::select(vec![0.0, 0.1, 1e4 / 3.0]),
    ) {
        let moved = |p: [f64; 3]| p.map(|c| c * scale + shift_m);
        let scene = soup(&corners.iter().map(|c| c.map(moved)).collect::<Vec<_>>());
        check_agreement(&scene, moved(origin), unit(heading))?;
    }

    /// Triangles of a millimetre beside triangles of kilometres, slivers, and rays from far outside.
    #[test]
    fn they_agree_from_tiny_to_huge(
        shapes in prop::collection::vec(
            (
                prop::array::uniform3(-3.0f64..3.0),
                prop::array::uniform2(prop::array::uniform3(-1.0f64..1.0)),
                prop::array::uniform2(-6.0f64..4.0),
            ),
            1..40,
        ),
        target in any::<prop::sample::Index>(),
        (u, v) in prop::sample::select(vec![(0.0, 0.0), (1.0, 0.0), (0.5, 0.5), (0.0, 0.3), (0.3, 0.3)]),
        side in prop::array::uniform3(-1.0f64..1.0),
        away in -3.0f64..6.0,
    ) {
        let corners: Vec<Corners> = shapes
            .iter()
            .map(|&(a, edges, powers)| {
                let to = |k: usize| std::array::from_fn(|i| a[i] + edges[k][i] * 10f64.powf(powers[k]));
                [a, to(0), to(1)]
            })
            .collect();
        let [a, b, c] = corners[target.index(corners.len())];
        let aim: [f64; 3] = std::array::from_fn(|i| a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]));
        let origin = std::array::from_fn(|i| aim[i] + side[i] * 10f64.powf(away));
        let line: [f64; 3] = std::array::from_fn(|i| aim[i] - origin[i]);
        prop_assume!(line.iter().any(|&c| c != 0.0));
        check_agreement(&soup(&corners), origin, unit(line))?;
    }
}

#[test]
fn axis_parallel_rays_and_limits_agree() {
    let m = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
    let scene = Scene::shoebox([4.0, 3.0, 2.0], std::array::from_fn(|_| m.clone())).unwrap();
    let (fast, plain) = (MeshScene::new(&scene).unwrap(), BruteForceScene::new(&scene).unwrap());
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let mut direction = [0.0; 3];
            direction[axis] = sign;
            for (limit, expected) in [(f64::INFINITY, true), (0.4, false)] {
                let a = fast.closest_hit([1.0, 1.0, 0.5], direction, limit);
                assert_eq!(a, plain.closest_hit([1.0, 1.0, 0.5], direction, limit));
                assert_eq!(a.is_some(), expected);
            }
        }
    }
}

#[test]
fn a_ray_that_is_no_ray_hits_nothing() {
    let m = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
    let scene = Scene::shoebox([4.0, 3.0, 2.0], std::array::from_fn(|_| m.clone())).unwrap();
    let mesh = MeshScene::new(&scene).unwrap();
    let nan = f64::NAN;
    for (origin, direction, limit) in [
        ([1.0, 1.0, 1.0], [0.0; 3], f64::INFINITY),
        ([nan, 1.0, 1.0], [1.0, 0.0, 0.0], f64::INFINITY),
        ([1.0, 1.0, 1.0], [nan; 3], f64::INFINITY),
        ([f64::INFINITY, 1.0, 1.0], [1.0, 0.0, 0.0], f64::INFINITY),
        ([1.0, 1.0, 1.0], [1.0, 0.0, 0.0], nan),
    ] {
        assert_eq!(mesh.closest_hit(origin, direction, limit), None);
        assert!(!mesh.any_hit(origin, direction, limit));
    }
}

/// Rays at every vertex and along every edge of a fine mesh, from inside: none is lost.
#[test]
fn no_ray_at_an_edge_or_a_vertex_is_lost() {
    let cells = 12;
    let at = |i: usize, j: usize| -> [f64; 3] {
        let (polar, azimuth) = (
            std::f64::consts::PI * i as f64 / f64::from(cells),
            std::f64::consts::TAU * (j % 24) as f64 / 24.0,
        );
        [3.0 * polar.sin() * azimuth.cos(), 2.0 * polar.sin() * azimuth.sin(), polar.cos()]
    };
    let ball: Vec<Corners> = (0..cells as usize)
        .flat_map(|i| (0..24).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
        })
        .collect();
    let mesh = MeshScene::new(&soup(&ball)).unwrap();
    for from in [[0.0, 0.0, 0.0], [0.1, -0.3, 0.2], [-1.0, 0.7, 0.1]] {
        for [a, b, c] in &ball {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                for step in 0..=16 {
                    let t = f64::from(step) / 16.0;
                    let line: [f64; 3] = std::array::from_fn(|k| p[k] + t * (q[k] - p[k]) - from[k]);
                    let hit = mesh.closest_hit(from, unit(line), f64::INFINITY);
                    assert!(hit.is_some(), "lost between {p:?} and {q:?}");
                }
            }
        }
    }
}

/// Triangles that no plane divides, and triangles that planes divide one by one: neither exhausts the stack, and all are
/// there.
#[test]
fn hierarchies_that_cannot_be_balanced_are_built() {
    let one: Corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let piled = soup(&vec![one; 200_000]);
    let hit = MeshScene::new(&piled).unwrap().closest_hit([0.2, 0.2, 1.0], [0.0, 0.0, -1.0], 10.0).unwrap();
    assert_eq!((hit.distance, hit.triangle), (1.0, 0));

    let shrinking: Vec<Corners> = (0..4_000)
        .map(|i| {
            let size = 0.97f64.powi(i).max(1e-5);
            let x = 1e5 * 0.99f64.powi(i);
            [[x, 0.0, 0.0], [x, size, 0.0], [x, 0.0, size]]
        })
        .collect();
    let scene = soup(&shrinking);
    let (fast, plain) = (MeshScene::new(&scene).unwrap(), BruteForceScene::new(&scene).unwrap());
    for triangle in shrinking.iter().step_by(50) {
        let origin = [triangle[0][0] + 1e-4, triangle[1][1] / 3.0, triangle[1][1] / 3.0];
        let hit = fast.closest_hit(origin, [-1.0, 0.0, 0.0], f64::INFINITY);
        assert!(hit.is_some());
        assert_eq!(hit, plain.closest_hit(origin, [-1.0, 0.0, 0.0], f64::INFINITY));
    }
}

/// parry shares nothing with this crate. It computes in single precision and may pass an edge on the other side: that
/// happens to rays within 1e-6 of an edge, about one in 1e5 here.
#[test]
fn parry_sees_the_same() {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(3);
    let mut point = |half: f64| -> [f64; 3] { std::array::from_fn(|_| random.random_range(-half..half)) };
    let corners: Vec<Corners> = (0..500)
        .map(|_| {
            let at = point(5.0);
            std::array::from_fn(|_| {
                let to = point(1.5);
                std::array::from_fn(|i| at[i] + to[i])
            })
        })
        .collect();
    let mesh = MeshScene::new(&soup(&corners)).unwrap();
    let vector = |v: [f64; 3]| Vector::new(v[0] as f32, v[1] as f32, v[2] as f32);
    let indices = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let peer = TriMesh::new(corners.as_flattened().iter().map(|&v| vector(v)).collect(), indices).unwrap();
    let (mut hits, mut differences) = (0, Vec::new());
    for _ in 0..20_000 {
        let (origin, direction) = (point(6.0), unit(point(1.0)));
        let ours = mesh.closest_hit(origin, direction, f64::INFINITY).map(|hit| hit.distance);
        let theirs = peer.cast_local_ray(&Ray::new(vector(origin), vector(direction)), f32::MAX, false);
        hits += usize::from(ours.is_some());
        match (ours, theirs) {
            (Some(a), Some(b)) if (a - f64::from(b)).abs() < 1e-3 => {}
            (None, None) => {}
            other => differences.push(other),
        }
    }
    assert!(hits > 10_000, "{hits}");
    assert!(differences.len() <= 3, "{differences:?}");
}
