//! A room drawn as a floor plan and a height.

use crate::error::Error;
use crate::mesh_file::triangulate;
use crate::scene::{NamedMaterial, Scene, Triangle};
use sabine_acoustics::{Error as ValueError, OutOfRange, read_text};
use std::path::Path;

/// Corners that a plan may have.
const MAX_CORNERS: usize = 1024;
/// Nearer than this, two corners are one, and two walls touch (m).
const CONTACT_M: f64 = 1e-3;
/// The least area (m2) and the bounds of a height (m).
const MIN_AREA_M2: f64 = 1e-2;
const HEIGHT_M: (f64, f64) = (0.1, 1000.0);

/// The outline of a room from above: corners in metres, in order, either way around. Wall 1 goes from corner 1 to corner 2.
///
/// ```
/// use sabine_scene::FloorPlan;
/// // An L of 6 x 5 m without a corner of 3 x 2 m.
/// let plan = FloorPlan::new(vec![[0., 0.], [6., 0.], [6., 3.], [3., 3.], [3., 5.], [0., 5.]])?;
/// assert_eq!((plan.area_m2(), plan.perimeter_m(), plan.walls()), (24.0, 22.0, 6));
/// assert!(plan.contains([1.0, 4.0], 0.5) && !plan.contains([4.0, 4.0], 0.0));
/// # Ok::<(), sabine_scene::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FloorPlan {
    corners_m: Vec<[f64; 2]>,
}

impl FloorPlan {
    /// Takes the corners; one that repeats the one before it, or the first at the end, is left out.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::OutOfRange`] for a coordinate that is not finite or beyond 100 km, fewer than 3 or more than 1024 corners, or
    /// an area below 0.01 m2; [`Error::CrossedPlan`] where walls cross, touch or fold back.
    pub fn new(mut corners_m: Vec<[f64; 2]>) -> Result<Self, Error> {
        for &coordinate in corners_m.iter().flatten() {
            OutOfRange::check("corner (m)", coordinate, -1e5, 1e5, "finite and within 100 km")?;
        }
        corners_m.dedup_by(|b, a| distance(*a, *b) < CONTACT_M);
        if corners_m.len() > 1 && distance(corners_m[0], corners_m[corners_m.len() - 1]) < CONTACT_M {
            corners_m.pop();
        }
        OutOfRange::check(
            "number of corners",
            corners_m.len() as f64,
            3.0,
            MAX_CORNERS as f64,
            "between 3 and 1024",
        )?;
        let plan = Self { corners_m };
        plan.check_walls()?;
        OutOfRange::check("area of the plan (m2)", plan.area_m2(), MIN_AREA_M2, 1e10, "at least 0.01 m2")?;
        Ok(plan)
    }

    /// A rectangle with one corner at the origin: wall 1 is y = 0, wall 2 x = length, wall 3 y = width, wall 4 x = 0.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::OutOfRange`] for a side below 0.1 m or beyond 100 km.
    pub fn rectangle(length_m: f64, width_m: f64) -> Result<Self, Error> {
        OutOfRange::check("length (m)", length_m, 0.1, 1e5, "between 0.1 m and 100 km")?;
        OutOfRange::check("width (m)", width_m, 0.1, 1e5, "between 0.1 m and 100 km")?;
        Self::new(vec![[0.0, 0.0], [length_m, 0.0], [length_m, width_m], [0.0, width_m]])
    }

    /// Reads a file with one corner in a line: `x y` in metres, with a comma between them or none. Empty lines and what
    /// follows `#` are skipped.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Io`]; [`Error::InFile`] naming the line, with the cause [`Error::TextLine`]; else as [`FloorPlan::new`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let text = read_text(path)?;
        let mut corners_m = Vec::new();
        for (number, line) in text.lines().enumerate() {
            let words = line.split('#').next().unwrap_or_default();
            let words: Vec<&str> =
                words.split([' ', '\t', ',', ';', '\r']).filter(|word| !word.is_empty()).collect();
            if words.is_empty() {
                continue;
            }
            let numbers = words.iter().map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>();
            let Some(Ok(corner)) = numbers.map(<[f64; 2]>::try_from) else {
                let text = line.chars().take(40).collect();
                let error = Error::TextLine { expected: "a corner: x y in metres", text };
                return Err(error.in_file(path, format!("line {}", number + 1)));
            };
            corners_m.push(corner);
        }
        Self::new(corners_m).map_err(|error| error.in_file(path, "corners"))
    }

    /// Corners in metres.
    pub fn corners_m(&self) -> &[[f64; 2]] {
        &self.corners_m
    }

    /// Number of walls.
    pub fn walls(&self) -> usize {
        self.corners_m.len()
    }

    /// Area in m2.
    pub fn area_m2(&self) -> f64 {
        self.signed_area_m2().abs()
    }

    /// Length of all walls in m.
    pub fn perimeter_m(&self) -> f64 {
        (0..self.walls()).map(|i| self.wall(i)).map(|[a, b]| distance(a, b)).sum()
    }

    /// Whether a point is inside and at least so far from every wall (m).
    pub fn contains(&self, point_m: [f64; 2], margin_m: f64) -> bool {
        let [x, y] = point_m;
        let crossed = (0..self.walls()).map(|i| self.wall(i)).filter(|&[a, b]| {
            (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        });
        let inside = crossed.count() % 2 == 1;
        inside && (0..self.walls()).all(|i| to_wall(point_m, self.wall(i)) >= margin_m)
    }

    /// The room below a level ceiling: floor, ceiling and walls with these indices into `materials`. Faces look inward.
    ///
    /// ```
    /// use sabine_acoustics::{Bands, Material};
    /// use sabine_scene::{FloorPlan, NamedMaterial};
    /// let plan = FloorPlan::new(vec![[0., 0.], [6., 0.], [6., 3.], [3., 3.], [3., 5.], [0., 5.]])?;
    /// let plaster = NamedMaterial { name: "plaster".into(), material: Material::uniform(Bands::T60, 0.05, 0.1)? };
    /// let room = plan.extruded(2.5, vec![plaster], [0, 0], &[0; 6])?;
    /// // Area times height, and twice the area plus perimeter times height.
    /// assert!((room.volume_m3() - 60.0).abs() < 1e-9 && (room.surface_m2() - 103.0).abs() < 1e-9);
    /// # Ok::<(), sabine_scene::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::OutOfRange`] for a height outside 0.1 to 1000 m; [`sabine_acoustics::Error::Length`] unless there is a material for each wall; else
    /// as [`Scene::new`].
    pub fn extruded(
        &self,
        height_m: f64,
        materials: Vec<NamedMaterial>,
        [floor, ceiling]: [u32; 2],
        walls: &[u32],
    ) -> Result<Scene, Error> {
        OutOfRange::check("height (m)", height_m, HEIGHT_M.0, HEIGHT_M.1, "between 0.1 and 1000 m")?;
        let n = self.walls();
        if walls.len() != n {
            return Err(ValueError::Length { expected: n, found: walls.len() }.into());
        }
        let level = |z: f64| self.corners_m.iter().map(move |&[x, y]| [x, y, z]);
        let vertices: Vec<[f64; 3]> = level(0.0).chain(level(height_m)).collect();
        let clockwise = self.signed_area_m2() < 0.0;
        // Given counter-clockwise as seen from within the room.
        let face = |[a, b, c]: [usize; 3], material: u32| {
            let corners = if clockwise { [a, c, b] } else { [a, b, c] };
            Triangle { vertices: corners.map(|v| v as u32), material }
        };
        let mut triangles = Vec::with_capacity(4 * n);
        for [a, b, c] in triangulate(&vertices[..n])? {
            // Triangles of a polygon turn as its outline does.
            triangles.push(face([a, b, c], floor));
            triangles.push(face([a, c, b].map(|v| v + n), ceiling));
        }
        for (i, &material) in walls.iter().enumerate() {
            let j = (i + 1) % n;
            triangles.push(face([i, j + n, j], material));
            triangles.push(face([i, i + n, j + n], material));
        }
        Ok(Scene::new(vertices, triangles, materials)?)
    }

    fn wall(&self, index: usize) -> [[f64; 2]; 2] {
        [self.corners_m[index], self.corners_m[(index + 1) % self.corners_m.len()]]
    }

    /// Shoelace formula, from the first corner; positive if the corners go counter-clockwise.
    fn signed_area_m2(&self) -> f64 {
        let from = self.corners_m[0];
        let cross =
            |[a, b]: [[f64; 2]; 2]| (a[0] - from[0]) * (b[1] - from[1]) - (a[1] - from[1]) * (b[0] - from[0]);
        0.5 * (0..self.walls()).map(|i| cross(self.wall(i))).sum::<f64>()
    }

    fn check_walls(&self) -> Result<(), Error> {
        let n = self.walls();
        for i in 0..n {
            for j in i + 1..n {
                let (one, other) = (self.wall(i), self.wall(j));
                // Neighbours share a corner; they fold back where a far end lies on the other wall.
                let touch = if j == i + 1 {
                    to_wall(other[1], one) < CONTACT_M || to_wall(one[0], other) < CONTACT_M
                } else if i == 0 && j == n - 1 {
                    to_wall(other[0], one) < CONTACT_M || to_wall(one[1], other) < CONTACT_M
                } else {
                    cross(one, other)
                        || one.into_iter().any(|end| to_wall(end, other) < CONTACT_M)
                        || other.into_iter().any(|end| to_wall(end, one) < CONTACT_M)
                };
                // In a triangle every wall neighbours both others.
                if touch {
                    return Err(Error::CrossedPlan { first: i + 1, second: j + 1 });
                }
            }
        }
        Ok(())
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Distance of a point from a wall.
fn to_wall(point: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
    let square = along[0] * along[0] + along[1] * along[1];
    let share = ((to[0] * along[0] + to[1] * along[1]) / square).clamp(0.0, 1.0);
    distance(point, [a[0] + share * along[0], a[1] + share * along[1]])
}

/// Whether the ends of each wall lie on different sides of the other.
fn cross(one: [[f64; 2]; 2], other: [[f64; 2]; 2]) -> bool {
    let side =
        |[a, b]: [[f64; 2]; 2], p: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    side(one, other[0]) * side(one, other[1]) < 0.0 && side(other, one[0]) * side(other, one[1]) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{cross as vector_product, sub};
    use proptest::prelude::*;
    use sabine_acoustics::{Bands, Material};

    fn scene(plan: &FloorPlan, height_m: f64) -> Scene {
        let material = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
        let named = |name: &str| NamedMaterial { name: name.into(), material: material.clone() };
        plan.extruded(
            height_m,
            ["floor", "ceiling", "walls"].map(named).into(),
            [0, 1],
            &vec![2; plan.walls()],
        )
        .unwrap()
    }

    fn check(corners: &[[f64; 2]], height_m: f64) {
        let plan = FloorPlan::new(corners.to_vec()).unwrap();
        let scene = scene(&plan, height_m);
        // Shoelace formula as in a textbook, about the origin.
        let next = |i: usize| corners[(i + 1) % corners.len()];
        let sum: f64 = corners.iter().enumerate().map(|(i, a)| a[0] * next(i)[1] - next(i)[0] * a[1]).sum();
        let area = 0.5 * sum.abs();
        let around: f64 = corners
            .iter()
            .enumerate()
            .map(|(i, a)| ((a[0] - next(i)[0]).powi(2) + (a[1] - next(i)[1]).powi(2)).sqrt())
            .sum();
        let near =
            |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        near(scene.volume_m3(), area * height_m);
        for (found, expected) in scene.material_areas_m2().into_iter().zip([area, area, around * height_m]) {
            near(found, expected);
        }
        // Every edge joins two faces that turn the same way: closed.
        let mut edges = std::collections::HashMap::new();
        for t in scene.triangles() {
            for k in 0..3 {
                *edges.entry((t.vertices[k], t.vertices[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1)));
        // The floor looks up.
        let [a, b, c] = scene.corners_m(0);
        assert!(vector_product(sub(b, a), sub(c, a))[2] > 0.0);
    }

    #[test]
    fn volume_and_areas_are_those_of_the_shoelace_formula() {
        let mut l = vec![[0., 0.], [6., 0.], [6., 3.], [3., 3.], [3., 5.], [0., 5.]];
        check(&l, 2.6);
        l.reverse();
        check(&l, 2.6);
        check(&[[0., 0.], [5., 0.], [5., 4.], [0., 4.]], 2.6);
        check(&[[-3., 1.], [4., -2.], [0.5, 7.]], 3.0);
        // A comb, and a corner in the middle of a wall.
        check(
            &[
                [0., 0.],
                [7., 0.],
                [7., 4.],
                [5., 4.],
                [5., 1.],
                [4., 1.],
                [4., 4.],
                [2., 4.],
                [2., 1.],
                [1., 1.],
                [1., 4.],
                [0., 4.],
                [0., 2.],
            ],
            2.0,
        );
    }

    #[test]
    fn what_is_no_plan_is_refused() {
        let crossed = |corners: &[[f64; 2]]| match FloorPlan::new(corners.to_vec()) {
            Err(Error::CrossedPlan { first, second }) => (first, second),
            other => panic!("{other:?}"),
        };
        assert_eq!(crossed(&[[0., 0.], [4., 4.], [4., 0.], [0., 3.]]), (1, 3));
        // A corner on another wall; a wall that folds back; two rooms that share a wall.
        assert_eq!(crossed(&[[0., 0.], [4., 0.], [4., 4.], [2., 0.], [0., 4.]]), (1, 3));
        assert_eq!(crossed(&[[0., 0.], [4., 0.], [2., 0.], [0., 3.]]), (1, 2));
        for corners in
            [vec![], vec![[0.; 2]; 9], vec![[0., 0.], [1., 0.]], vec![[0., 0.], [f64::NAN, 0.], [1., 1.]]]
        {
            assert!(matches!(FloorPlan::new(corners), Err(Error::Acoustics(ValueError::OutOfRange(_)))));
        }
        assert!(FloorPlan::new(vec![[0., 0.], [1., 0.], [2., 0.]]).is_err());
        assert!(FloorPlan::rectangle(0.0, 4.0).is_err() && FloorPlan::rectangle(5.0, -4.0).is_err());
        let plan = FloorPlan::rectangle(5.0, 4.0).unwrap();
        let wall =
            NamedMaterial { name: "a".into(), material: Material::uniform(Bands::T60, 0.1, 0.1).unwrap() };
        assert!(plan.extruded(0.0, vec![wall.clone()], [0, 0], &[0; 4]).is_err());
        assert!(plan.extruded(3.0, vec![wall], [0, 0], &[0; 3]).is_err());
    }

    #[test]
    fn a_file_gives_the_corners_or_the_line_at_fault() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.txt");
        std::fs::write(&path, "# living room\n0 0\r\n5, 0\n5 4 # door\n\n0\t4\n0 0\n").unwrap();
        assert_eq!(FloorPlan::read(&path).unwrap(), FloorPlan::rectangle(5.0, 4.0).unwrap());
        std::fs::write(&path, "0 0\n5 zero\n5 4\n").unwrap();
        let message = FloorPlan::read(&path).unwrap_err().to_string();
        assert!(
            message.ends_with("plan.txt: line 2: cannot read `5 zero` as a corner: x y in metres"),
            "{message}"
        );
        std::fs::write(&path, "0 0\n4 4\n4 0\n0 3\n").unwrap();
        let message = FloorPlan::read(&path).unwrap_err().to_string();
        assert!(
            message.ends_with("plan.txt: corners: wall 1 and wall 3 cross or touch each other"),
            "{message}"
        );
    }

    proptest! {
        /// Star-shaped outlines of random radii, either way around.
        #[test]
        fn stars_become_rooms(radii in prop::collection::vec(0.5f64..5.0, 3..30), height in 0.5f64..6.0, turn in any::<bool>()) {
            let n = radii.len() as f64;
            let mut corners: Vec<[f64; 2]> = radii.iter().enumerate().map(|(i, r)| {
                let angle = std::f64::consts::TAU * i as f64 / n;
                [r * angle.cos(), r * angle.sin()]
            }).collect();
            if turn {
                corners.reverse();
            }
            check(&corners, height);
        }
    }
}
