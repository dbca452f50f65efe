//! Rooms of any number of triangles, and rays through them.
#![allow(dead_code)] // each bench takes what it needs

use rand::{Rng, SeedableRng};
use sabine_acoustics::*;
use sabine_scene::*;
use std::f64::consts::{PI, TAU};

/// All rooms here have these walls.
pub const SIZE_M: [f64; 3] = [10.0, 7.0, 3.0];

/// Collects triangles, each with one of six materials.
#[derive(Default)]
struct Model {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<Triangle>,
}

impl Model {
    /// A parallelogram, cut into `cells` x `cells` pieces.
    fn patch(&mut self, corner: [f64; 3], u: [f64; 3], v: [f64; 3], cells: u32, material: u32) {
        let first = self.vertices.len() as u32;
        let share = |i: u32| f64::from(i) / f64::from(cells);
        for (i, j) in (0..=cells).flat_map(|i| (0..=cells).map(move |j| (i, j))) {
            self.vertices.push(std::array::from_fn(|k| corner[k] + share(i) * u[k] + share(j) * v[k]));
        }
        self.grid(first, cells, cells, material);
    }

    /// The triangles between (rows + 1) x (columns + 1) vertices that stand in order.
    fn grid(&mut self, first: u32, rows: u32, columns: u32, material: u32) {
        for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| first + i * (columns + 1) + j;
            for vertices in
                [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
            {
                self.triangles.push(Triangle { vertices, material });
            }
        }
    }

    /// A block with its lowest corner at `at`; each face is cut into `cells` x `cells` pieces.
    fn block(&mut self, at: [f64; 3], size: [f64; 3], cells: u32) {
        for axis in 0..3 {
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            let side = |k: usize| -> [f64; 3] { std::array::from_fn(|i| if i == k { size[k] } else { 0.0 }) };
            let mut far = at;
            far[axis] += size[axis];
            self.patch(at, side(c), side(b), cells, 4);
            self.patch(far, side(b), side(c), cells, 4);
        }
    }

    fn ball(&mut self, centre: [f64; 3], radius: f64, rows: u32) {
        let columns = 2 * rows;
        let first = self.vertices.len() as u32;
        for (i, j) in (0..=rows).flat_map(|i| (0..=columns).map(move |j| (i, j))) {
            let polar = PI * f64::from(i) / f64::from(rows);
            let azimuth = TAU * f64::from(j % columns) / f64::from(columns);
            let out = [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()];
            self.vertices.push(std::array::from_fn(|k| centre[k] + radius * out[k]));
        }
        self.grid(first, rows, columns, 5);
    }

    fn scene(self, absorption: f64, scattering: f64) -> Scene {
        let material = Material::uniform(Bands::SIMULATION, absorption, scattering).unwrap();
        let materials = (0..6).map(|i| NamedMaterial { name: i.to_string(), material: material.clone() });
        Scene::new(self.vertices, self.triangles, materials.collect()).unwrap()
    }
}

fn walls(cells: u32) -> Model {
    let plain =
        Scene::shoebox(SIZE_M, std::array::from_fn(|_| Material::uniform(Bands::T60, 0.1, 0.1).unwrap()))
            .unwrap();
    let mut model = Model::default();
    for wall in 0..6 {
        let [a, b, _] = plain.corners_m(2 * wall);
        let [_, _, d] = plain.corners_m(2 * wall + 1);
        let minus = |p: [f64; 3]| std::array::from_fn(|k| p[k] - a[k]);
        model.patch(a, minus(b), minus(d), cells, wall as u32);
    }
    model
}

/// The box, each wall cut into a grid of `cells` x `cells` rectangles: 12 `cells`^2 triangles.
pub fn finely_meshed(cells: u32, absorption: f64, scattering: f64) -> Scene {
    walls(cells).scene(absorption, scattering)
}

/// The box with tables, chairs, shelves full of books and round lamps: 100,152 triangles, most of them in small things.
pub fn furnished(absorption: f64, scattering: f64) -> Scene {
    let mut model = walls(8);
    for (row, column) in (0..3).flat_map(|row| (0..4).map(move |column| (row, column))) {
        let (x, y) = (1.2 + 2.2 * f64::from(column), 1.1 + 1.7 * f64::from(row));
        model.block([x, y, 0.72], [1.4, 0.8, 0.03], 4);
        for leg in 0..4 {
            let (dx, dy) = (f64::from(leg % 2) * 1.34, f64::from(leg / 2) * 0.74);
            model.block([x + dx, y + dy, 0.0], [0.06, 0.06, 0.72], 1);
        }
        for seat in 0..2 {
            let (cx, cy) = (x + 0.15 + 0.7 * f64::from(seat), y - 0.45);
            model.block([cx, cy, 0.42], [0.4, 0.4, 0.04], 2);
            model.block([cx, cy, 0.46], [0.4, 0.04, 0.45], 2);
            for leg in 0..4 {
                let (dx, dy) = (f64::from(leg % 2) * 0.36, f64::from(leg / 2) * 0.36);
                model.block([cx + dx, cy + dy, 0.0], [0.04, 0.04, 0.42], 1);
            }
        }
        model.ball([x + 0.7, y + 0.4, 2.3], 0.22, 36);
        model.ball([x + 0.3, y + 0.3, 0.9], 0.12, 16);
    }
    for board in 0..7 {
        let z = 0.1 + 0.35 * f64::from(board);
        model.block([1.0, 6.68, z], [8.0, 0.3, 0.02], 4);
        for book in 0..145 {
            let height = 0.18 + 0.012 * f64::from(book * 7 % 11);
            model.block([1.02 + 0.055 * f64::from(book), 6.7, z + 0.02], [0.04, 0.2, height], 1);
        }
    }
    model.scene(absorption, scattering)
}

/// Rays from anywhere in the room into all directions, the same at every call.
pub fn rays(count: usize) -> Vec<([f64; 3], [f64; 3])> {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    (0..count)
        .map(|_| {
            let origin = std::array::from_fn(|i| random.random_range(0.01..SIZE_M[i] - 0.01));
            let z: f64 = random.random_range(-1.0..1.0);
            let azimuth = random.random_range(0.0..TAU);
            let r = (1.0 - z * z).sqrt();
            (origin, [r * azimuth.cos(), r * azimuth.sin(), z])
        })
        .collect()
}
