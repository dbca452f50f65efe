//! Rooms of finely cut walls, and a plain search over their triangles that shares nothing with the crate.

use rand::Rng;
use sabine_acoustics::{Bands, Material};
use sabine_scene::{NamedMaterial, Scene, Triangle};

pub type Vec3 = [f64; 3];

pub fn minus(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|k| a[k] - b[k])
}

pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i] * b[j] - a[j] * b[i]
    })
}

pub fn unit(a: Vec3) -> Vec3 {
    let length = dot(a, a).sqrt();
    a.map(|c| c / length)
}

/// Triangles of four materials.
#[derive(Clone, Default)]
pub struct Model {
    pub vertices: Vec<Vec3>,
    pub triangles: Vec<Triangle>,
}

impl Model {
    /// A parallelogram cut into cells, each of the material that `material` says; `None` leaves it open. Diagonals run
    /// as `random` wants, and vertices inside move by up to `jitter` of a cell.
    pub fn patch(
        &mut self,
        [corner, u, v]: [Vec3; 3],
        [columns, rows]: [u32; 2],
        jitter: f64,
        random: &mut impl Rng,
        material: impl Fn(u32, u32) -> Option<u32>,
    ) {
        let first = self.vertices.len() as u32;
        for j in 0..=rows {
            for i in 0..=columns {
                let mut moved = || if jitter > 0.0 { random.random_range(-jitter..jitter) } else { 0.0 };
                let inside = i > 0 && i < columns && j > 0 && j < rows;
                let [di, dj] = if inside { [moved(), moved()] } else { [0.0; 2] };
                let (s, t) =
                    ((f64::from(i) + di) / f64::from(columns), (f64::from(j) + dj) / f64::from(rows));
                self.vertices.push(std::array::from_fn(|k| corner[k] + s * u[k] + t * v[k]));
            }
        }
        for j in 0..rows {
            for i in 0..columns {
                let Some(material) = material(i, j) else { continue };
                let at = |i: u32, j: u32| first + j * (columns + 1) + i;
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let halves = if random.random() { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
                self.triangles.extend(halves.map(|vertices| Triangle { vertices, material }));
            }
        }
    }

    /// The six faces of a block, of one material each, seen from inside (or outside, if turned).
    pub fn block(
        &mut self,
        [low, high]: [Vec3; 2],
        cells: u32,
        jitter: f64,
        random: &mut impl Rng,
        material: impl Fn(usize, u32, u32) -> Option<u32>,
    ) {
        for face in 0..6 {
            let (axis, upper) = (face / 2, face % 2 == 1);
            let side =
                |k: usize| -> Vec3 { std::array::from_fn(|i| if i == k { high[k] - low[k] } else { 0.0 }) };
            let (mut u, mut v) = (side((axis + 1) % 3), side((axis + 2) % 3));
            let mut corner = low;
            if upper {
                corner[axis] = high[axis];
                std::mem::swap(&mut u, &mut v);
            }
            self.patch([corner, u, v], [cells; 2], jitter, random, |i, j| material(face, i, j));
        }
    }

    /// A ball: nothing to merge in it.
    pub fn ball(&mut self, centre: Vec3, radius: f64, rows: u32) {
        let first = self.vertices.len() as u32;
        let columns = 2 * rows;
        for (i, j) in (0..=rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
            let polar = std::f64::consts::PI * f64::from(i) / f64::from(rows);
            let azimuth = std::f64::consts::TAU * f64::from(j) / f64::from(columns);
            let out = [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()];
            self.vertices.push(std::array::from_fn(|k| centre[k] + radius * out[k]));
        }
        for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| first + i * columns + j % columns;
            for vertices in
                [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
            {
                self.triangles.push(Triangle { vertices, material: 3 });
            }
        }
    }

    /// Turned about two axes and moved; rounded to single precision if wanted.
    pub fn turned(mut self, angles: [f64; 2], single: bool) -> Self {
        for p in &mut self.vertices {
            let [(s, c), (t, d)] = angles.map(f64::sin_cos);
            let [x, y, z] = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
            *p = [d * x - t * z + 3.0, y - 1.0, t * x + d * z];
            if single {
                *p = p.map(|c| f64::from(c as f32));
            }
        }
        self
    }

    pub fn scene(&self) -> Scene {
        let named = |name: &str, absorption: f64| NamedMaterial {
            name: name.into(),
            material: Material::uniform(Bands::T60, absorption, 0.2).unwrap(),
        };
        let materials = vec![named("a", 0.1), named("b", 0.3), named("c", 0.5), named("d", 0.2)];
        Scene::new(self.vertices.clone(), self.triangles.clone(), materials).unwrap()
    }
}

/// The triangles of a scene by corner, normal and edges.
pub struct PlainSearch {
    triangles: Vec<([Vec3; 3], Vec3)>,
}

/// What a ray meets.
pub struct Met {
    pub distance: f64,
    /// As [`PlainSearch::depth_m`] says.
    pub depth_m: f64,
    pub triangle: usize,
    pub cosine: f64,
}

impl PlainSearch {
    pub fn new(scene: &Scene) -> Self {
        let one = |i| {
            let [a, b, c] = scene.corners_m(i);
            ([a, b, c], unit(cross(minus(b, a), minus(c, a))))
        };
        Self { triangles: (0..scene.triangles().len()).map(one).collect() }
    }

    pub fn normal(&self, triangle: usize) -> Vec3 {
        self.triangles[triangle].1
    }

    /// Distance of a point from the plane of a triangle.
    pub fn height_m(&self, triangle: usize, point: Vec3) -> f64 {
        let ([a, ..], normal) = &self.triangles[triangle];
        dot(*normal, minus(point, *a)).abs()
    }

    /// Least distance of a point of its plane from the edges of a triangle, in metres: negative outside.
    pub fn depth_m(&self, triangle: usize, point: Vec3) -> f64 {
        let ([a, b, c], normal) = &self.triangles[triangle];
        let depth = |p: &Vec3, q: &Vec3| dot(cross(*normal, unit(minus(*q, *p))), minus(point, *p));
        depth(a, b).min(depth(b, c)).min(depth(c, a))
    }

    /// Everything that a ray meets, or passes no farther from than a micrometre.
    pub fn all(&self, origin: Vec3, direction: Vec3) -> Vec<Met> {
        let mut met = Vec::new();
        for (triangle, ([a, ..], normal)) in self.triangles.iter().enumerate() {
            let cosine = dot(*normal, direction);
            let distance = dot(*normal, minus(*a, origin)) / cosine;
            if cosine.abs() < 1e-9 || distance.is_nan() || distance <= 0.0 {
                continue;
            }
            let point: Vec3 = std::array::from_fn(|k| origin[k] + distance * direction[k]);
            let depth_m = self.depth_m(triangle, point);
            if depth_m > -1e-6 {
                met.push(Met { distance, depth_m, triangle, cosine: cosine.abs() });
            }
        }
        met
    }
}
