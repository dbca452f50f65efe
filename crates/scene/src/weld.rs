//! Repair of a mesh: vertices that are meant to be one, triangles that are none or there twice.

use crate::scene::{Scene, Triangle};
use crate::scene::{cross, norm, sub};
use sabine_acoustics::{Error, OutOfRange};
use std::collections::HashMap;
use std::fmt;

/// Triangles smaller than this have no normal that a tracer could use (m2).
const LEAST_AREA_M2: f64 = 1e-12;

/// What [`Scene::welded`] changed.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct WeldReport {
    /// Vertices that joined an earlier one.
    pub merged_vertices: usize,
    /// How far the farthest of them moved, in metres: at most the tolerance.
    pub farthest_m: f64,
    /// Triangles left out because they have no area, or lost it when their corners met.
    pub degenerate_triangles: usize,
    /// Triangles left out because an earlier one has the same three corners, in whatever order.
    pub duplicate_triangles: usize,
    /// Those among them whose material is not that of the triangle that stays.
    pub duplicates_of_other_material: usize,
    /// Vertices left out because no triangle that stays has them.
    pub unused_vertices: usize,
}

impl WeldReport {
    /// Whether the mesh came out as it went in.
    pub fn is_unchanged(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for WeldReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_unchanged() {
            return f.write_str("nothing to repair");
        }
        let moved = 1e3 * self.farthest_m;
        let parts = [
            (self.merged_vertices, format!("vertices joined others, moved by up to {moved:.3} mm")),
            (self.degenerate_triangles, "triangles without area left out".into()),
            (
                self.duplicate_triangles,
                format!(
                    "triangles that repeat others left out ({} of another material)",
                    self.duplicates_of_other_material
                ),
            ),
            (self.unused_vertices, "vertices without triangle left out".into()),
        ];
        let told: Vec<String> = parts
            .into_iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("{count} {what}"))
            .collect();
        f.write_str(&told.join("; "))
    }
}

impl Scene {
    /// Vertices within 0.1 mm are meant to be one: finer than rooms are drawn, coarser than what rounding to single precision
    /// or to four decimals leaves within a kilometre.
    pub const WELD_TOLERANCE_M: f64 = 1e-4;

    /// For each vertex the first one within a tolerance (1e-7 to 0.1 m), which is itself where there is no earlier one.
    ///
    /// Only vertices that stand for themselves attract others, so that chains of near neighbours do not wander. The time
    /// grows with the number of vertices, however they lie.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for the tolerance.
    pub fn vertex_twins(&self, tolerance_m: f64) -> Result<Vec<usize>, Error> {
        OutOfRange::check("tolerance (m)", tolerance_m, 1e-7, 0.1, "between 1e-7 and 0.1")?;
        // Wide cells have few neighbours within reach; small ones hold few vertices: a hundred or so that are apart.
        let cell_m = 4.0 * tolerance_m;
        let mut standing: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
        let twins = self.vertices().iter().enumerate().map(|(i, &vertex)| {
            let cell = |offset_m: f64| vertex.map(|c| ((c + offset_m) / cell_m).floor() as i64);
            let (low, high) = (cell(-tolerance_m), cell(tolerance_m));
            let mut twin = i;
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        for &j in standing.get(&[x, y, z]).into_iter().flatten() {
                            if j < twin && norm(sub(self.vertices()[j], vertex)) <= tolerance_m {
                                twin = j;
                            }
                        }
                    }
                }
            }
            if twin == i {
                standing.entry(cell(0.0)).or_default().push(i);
            }
            twin
        });
        Ok(twins.collect())
    }

    /// The same room, repaired: vertices within a tolerance (see [`Scene::WELD_TOLERANCE_M`]) become one, triangles without
    /// area (below 1e-12 m2) and repetitions of triangles are left out, and vertices that no triangle needs with them.
    ///
    /// Of triangles on the same corners the first stays, whatever its material. The order of what stays is kept, and so are
    /// all materials, even those that no triangle has any more.
    ///
    /// ```
    /// use sabine_acoustics::{Bands, Material};
    /// use sabine_scene::Scene;
    /// let wall = Material::uniform(Bands::SIMULATION, 0.1, 0.1)?;
    /// let room = Scene::shoebox([4.0, 3.0, 2.0], std::array::from_fn(|_| wall.clone()))?;
    /// let (same, report) = room.welded(Scene::WELD_TOLERANCE_M)?;
    /// assert_eq!(same, room);
    /// assert_eq!(report.to_string(), "nothing to repair");
    /// # Ok::<(), sabine_acoustics::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a tolerance outside 1e-7 to 0.1 m, [`Error::Empty`] if no triangle is left.
    pub fn welded(&self, tolerance_m: f64) -> Result<(Self, WeldReport), Error> {
        let twins = self.vertex_twins(tolerance_m)?;
        let mut report = WeldReport::default();
        for (i, &twin) in twins.iter().enumerate().filter(|&(i, &twin)| twin != i) {
            let moved_m = norm(sub(self.vertices()[i], self.vertices()[twin]));
            report.merged_vertices += 1;
            report.farthest_m = report.farthest_m.max(moved_m);
        }
        // The new index of each vertex that a triangle has.
        let mut index: Vec<Option<u32>> = vec![None; twins.len()];
        let mut first: HashMap<[usize; 3], u32> = HashMap::new();
        let mut triangles = Vec::with_capacity(self.triangles().len());
        for triangle in self.triangles() {
            let corners = triangle.vertices.map(|v| twins[v as usize]);
            let [a, b, c] = corners.map(|v| self.vertices()[v]);
            if 0.5 * norm(cross(sub(b, a), sub(c, a))) < LEAST_AREA_M2 {
                report.degenerate_triangles += 1;
                continue;
            }
            let mut key = corners;
            key.sort_unstable();
            if let Some(&material) = first.get(&key) {
                report.duplicate_triangles += 1;
                report.duplicates_of_other_material += usize::from(material != triangle.material);
                continue;
            }
            first.insert(key, triangle.material);
            corners.iter().for_each(|&v| index[v] = Some(0));
            triangles.push((corners, triangle.material));
        }
        let mut vertices = Vec::new();
        for (i, index) in index.iter_mut().enumerate() {
            if index.is_some() {
                *index = Some(vertices.len() as u32);
                vertices.push(self.vertices()[i]);
            } else if twins[i] == i {
                report.unused_vertices += 1;
            }
        }
        let renumbered = |(corners, material): ([usize; 3], u32)| Triangle {
            vertices: corners.map(|v| index[v].unwrap_or_default()),
            material,
        };
        let triangles = triangles.into_iter().map(renumbered).collect();
        Ok((Self::new(vertices, triangles, self.materials().to_vec())?, report))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::NamedMaterial;
    use proptest::prelude::*;
    use sabine_acoustics::{Bands, Material};

    fn scene(vertices: Vec<[f64; 3]>, triangles: &[([u32; 3], u32)]) -> Scene {
        let material = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
        let named = |name: &str| NamedMaterial { name: name.into(), material: material.clone() };
        let triangles =
            triangles.iter().map(|&(vertices, material)| Triangle { vertices, material }).collect();
        Scene::new(vertices, triangles, vec![named("a"), named("b")]).unwrap()
    }

    #[test]
    fn everything_odd_is_repaired_and_told() {
        let vertices = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 0.0, 5e-5],  // the second
            [9.0, 9.0, 9.0],   // nobody's
            [0.5, 0.5, 0.0],   // on an edge
            [1.0, -9e-5, 0.0], // the second
            [0.0, 0.0, 1.0],
        ];
        let odd = scene(
            vertices,
            &[
                ([0, 1, 2], 0),
                ([2, 3, 0], 1), // the first again, of another material, turned round
                ([0, 2, 6], 0), // and again
                ([1, 5, 2], 0), // a line
                ([1, 6, 7], 0), // collapses
                ([3, 7, 2], 1),
            ],
        );
        let (repaired, report) = odd.welded(Scene::WELD_TOLERANCE_M).unwrap();
        let expected = WeldReport {
            merged_vertices: 2,
            farthest_m: report.farthest_m,
            degenerate_triangles: 2,
            duplicate_triangles: 2,
            duplicates_of_other_material: 1,
            unused_vertices: 2,
        };
        assert_eq!(report, expected);
        assert!((report.farthest_m - 9e-5).abs() < 1e-12);
        assert_eq!(
            repaired.triangles(),
            [Triangle { vertices: [0, 1, 2], material: 0 }, Triangle { vertices: [1, 3, 2], material: 1 }]
        );
        assert_eq!(repaired.vertices().len(), 4);
        assert_eq!(
            report.to_string(),
            "2 vertices joined others, moved by up to 0.090 mm; 2 triangles without area left out; \
             2 triangles that repeat others left out (1 of another material); 2 vertices without triangle left out"
        );
        let (again, report) = repaired.welded(Scene::WELD_TOLERANCE_M).unwrap();
        assert!(again == repaired && report.is_unchanged());
    }

    #[test]
    fn what_vanishes_or_makes_no_sense_is_refused() {
        let line = scene(vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], &[([0, 1, 2], 0)]);
        assert!(matches!(line.welded(1e-4), Err(Error::Empty { what: "list of vertices" })));
        for tolerance in [0.0, -1.0, 1.0, f64::NAN] {
            assert!(matches!(line.welded(tolerance), Err(Error::OutOfRange(_))));
        }
    }

    proptest! {
        /// Against plain search, with vertices crowded about the corners of a grid as wide as a few tolerances.
        #[test]
        fn twins_are_those_that_plain_search_finds(
            places in prop::collection::vec((prop::array::uniform3(-3i32..3), prop::array::uniform3(-1.0f64..1.0)), 1..80),
        ) {
            let tolerance = 1e-3;
            let vertices: Vec<[f64; 3]> = places
                .iter()
                .map(|(at, off)| std::array::from_fn(|i| 7.0 + tolerance * (f64::from(at[i]) + off[i])))
                .collect();
            let mut expected: Vec<usize> = Vec::new();
            for (i, &v) in vertices.iter().enumerate() {
                let twin = (0..i).find(|&j| expected[j] == j && norm(sub(vertices[j], v)) <= tolerance);
                expected.push(twin.unwrap_or(i));
            }
            let found = scene(vertices, &[([0, 0, 0], 0)]).vertex_twins(tolerance).unwrap();
            prop_assert_eq!(found, expected);
        }
    }
}
