//! Where a box can stand: the floor of a mesh and the free height above it, in cells.

use crate::extend::standing_box::Solid;
use sabine_paths::RayScene;

/// Side of a cell in metres, and cells along a side of the room at most.
const CELL_M: f64 = 0.1;
const MAX_CELLS: usize = 160;
/// A ray goes on from this far beyond what it met, in metres.
const BEYOND_M: f64 = 1e-6;
/// Surfaces that are met over one cell at most.
const MAX_MET: usize = 64;
/// A floor is level to this, in metres.
const LEVEL_M: f64 = 0.03;
/// Cells are asked beside their middles: rays along the edges of triangles of round measures may slip through.
const ASIDE: [f64; 2] = [0.4871, 0.5113];

/// Floor and free height above it over the plan of a room.
pub(crate) struct FloorMap {
    low: [f64; 2],
    cell_m: [f64; 2],
    counts: [usize; 2],
    /// Height of the floor and free height above it, in metres; none outside the room and where the mesh is not closed.
    cells: Vec<Option<[f64; 2]>>,
}

impl FloorMap {
    /// The map of a mesh within a box.
    pub fn of(mesh: &dyn RayScene, box_m: [[f64; 3]; 2]) -> Self {
        let size: [f64; 2] = std::array::from_fn(|k| box_m[1][k] - box_m[0][k]);
        let counts = size.map(|side| ((side / CELL_M).ceil() as usize).clamp(1, MAX_CELLS));
        let cell_m = std::array::from_fn(|k| size[k] / counts[k] as f64);
        let low = [box_m[0][0], box_m[0][1]];
        let one = |index: usize| {
            let [x, y]: [f64; 2] = std::array::from_fn(|k| {
                let number = if k == 0 { index % counts[0] } else { index / counts[0] };
                low[k] + (number as f64 + ASIDE[k]) * cell_m[k]
            });
            lowest_gap(mesh, [x, y], [box_m[0][2], box_m[1][2]])
        };
        Self { low, cell_m, counts, cells: (0..counts[0] * counts[1]).map(one).collect() }
    }

    /// Height of the floor at a place; none outside the room.
    pub fn floor_m(&self, place: [f64; 2]) -> Option<f64> {
        self.cell(place).map(|[floor, _]| floor)
    }

    /// Whether anything can stand anywhere.
    pub fn is_empty(&self) -> bool {
        self.cells.iter().all(Option::is_none)
    }

    fn cell(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let at: [f64; 2] = std::array::from_fn(|k| (place[k] - self.low[k]) / self.cell_m[k]);
        if (0..2).any(|k| at[k] < 0.0 || at[k] >= self.counts[k] as f64) {
            return None;
        }
        self.cells[at[1] as usize * self.counts[0] + at[0] as usize]
    }

    /// Whether a box stands free on one level of the floor, to a cell.
    pub fn has_room_for(&self, solid: &Solid) -> bool {
        let floor_m = solid.top_m() - solid.height;
        let steps = solid.half.map(|half| (2.0 * half / CELL_M).ceil().max(1.0));
        (0..=steps[0] as usize).all(|i| {
            (0..=steps[1] as usize).all(|j| {
                let share = [i as f64 / steps[0], j as f64 / steps[1]];
                // Half a cell within its sides: the map is no finer.
                let at: [f64; 2] =
                    std::array::from_fn(|k| (2.0 * share[k] - 1.0) * (solid.half[k] - 0.5 * CELL_M).max(0.0));
                let [x, y, _] = solid.place([at[0], at[1], 0.0]);
                self.cell([x, y])
                    .is_some_and(|[floor, free]| (floor - floor_m).abs() < LEVEL_M && free >= solid.height)
            })
        })
    }
}

/// Floor and height of the lowest part of an upright line that lies in the room; none where surfaces do not come in pairs.
fn lowest_gap(mesh: &dyn RayScene, [x, y]: [f64; 2], [low, high]: [f64; 2]) -> Option<[f64; 2]> {
    let mut met: Vec<f64> = Vec::new();
    let mut from = low - 1.0;
    while let Some(hit) = mesh.closest_hit([x, y, from], [0.0, 0.0, 1.0], high + 1.0 - from) {
        met.push(from + hit.distance);
        if met.len() > MAX_MET {
            return None;
        }
        from += hit.distance + BEYOND_M;
    }
    (met.len() >= 2 && met.len().is_multiple_of(2)).then(|| [met[0], met[1] - met[0]])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::extend::standing_box::StandingBox;
    use sabine_acoustics::{Bands, Material};
    use sabine_propagate::MeshScene;
    use sabine_scene::Scene;

    #[test]
    fn boxes_stand_in_the_room_and_not_in_what_stands_there() {
        let hard = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        let room = Scene::shoebox([5.0, 4.0, 2.5], std::array::from_fn(|_| hard.clone())).unwrap();
        let cupboard = StandingBox::new([1.0, 1.0, 0.1], [1.0, 0.6, 1.8], 0.0, 0.1);
        let scene = cupboard.added_to(&room, 0).unwrap();
        let map = FloorMap::of(&MeshScene::new(&scene).unwrap(), scene.bounds_m());
        let stands = |x: f64, y: f64, sides: [f64; 3], yaw_deg: f64| {
            map.has_room_for(&Solid::of(&StandingBox::new([x, y, 0.0], sides, yaw_deg, 0.1)))
        };
        let sides = [2.0, 0.8, 1.0];
        assert!(stands(3.0, 2.5, sides, 0.0) && stands(3.0, 2.5, sides, 40.0));
        // Against a wall, but not through it; not too high; not where the cupboard stands, nor under it.
        assert!(stands(1.0, 3.6, sides, 0.0) && !stands(0.8, 3.6, sides, 0.0));
        assert!(!stands(3.0, 2.5, [2.0, 0.8, 2.6], 0.0));
        assert!(!stands(1.0, 1.0, [0.4, 0.3, 0.3], 0.0) && !stands(1.2, 1.0, sides, 0.0));
        assert_eq!(map.floor_m([5.2, 1.0]), None);
        assert!(map.floor_m([4.0, 1.0]).unwrap().abs() < 1e-9);
        // Without a ceiling nobody knows what is in the room.
        let open: Vec<_> = room
            .triangles()
            .iter()
            .copied()
            .filter(|t| !t.vertices.iter().all(|&v| room.vertices()[v as usize][2] > 2.0))
            .collect();
        let open = Scene::new(room.vertices().to_vec(), open, room.materials().to_vec()).unwrap();
        assert!(FloorMap::of(&MeshScene::new(&open).unwrap(), room.bounds_m()).is_empty());
    }
}
