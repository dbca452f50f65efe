//! Where a microphone or a source may stand.

use crate::plan::error::PlanError;
use sabine_propagate::{MeshScene, check_placement};
use sabine_scene::{MeasuredRoom, Receiver};

/// By how much the grid grows until it has few enough places.
const GROWTH: f64 = 1.06;
/// Height of microphones where the room file has none: that of seated listeners (ISO 3382-1:2009, 4.3), in metres.
const SEATED_M: f64 = 1.2;
/// Finest grid, in metres.
const MIN_SPACING_M: f64 = 0.1;

/// Places of a square grid at one height.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    pub spacing_m: f64,
    pub places_m: Vec<[f64; 3]>,
}

/// Height at which microphones stand: the median of the room file's, or that of seated listeners above the lowest point of the mesh.
pub(crate) fn microphone_height_m(room: &MeasuredRoom) -> f64 {
    let mut heights: Vec<f64> = room.receivers().iter().map(|r| r.position_m[2]).collect();
    heights.sort_by(f64::total_cmp);
    heights.get(heights.len() / 2).copied().unwrap_or(room.scene().bounds_m()[0][2] + SEATED_M)
}

/// At most `most` places at a height in metres, in the room and at least `clearance_m` away from all surfaces and from the places `taken_m`,
/// on the finest grid that has so few.
pub(crate) fn grid(
    (room, mesh): (&MeasuredRoom, &MeshScene),
    taken_m: &[[f64; 3]],
    height_m: f64,
    clearance_m: f64,
    most: usize,
) -> Result<Grid, PlanError> {
    let [low, high] = room.scene().bounds_m();
    let sides_m = [0, 1].map(|k| high[k] - low[k]);
    let source = room.sources().first().ok_or(PlanError::NoSource)?;
    let is_free = |place_m: &[f64; 3]| -> bool {
        let apart = |other: &[f64; 3]| (0..3).map(|k| (place_m[k] - other[k]).powi(2)).sum::<f64>().sqrt();
        let receiver = Receiver { id: "planned".to_owned(), position_m: *place_m, axis: None };
        taken_m.iter().all(|other| apart(other) >= clearance_m)
            && check_placement(mesh, source, &receiver)
                .is_ok_and(|from_surface_m| from_surface_m >= clearance_m)
    };
    let mut spacing_m = (sides_m[0] * sides_m[1] / (2.0 * most as f64)).sqrt().max(MIN_SPACING_M);
    loop {
        let counts = sides_m.map(|side| (side / spacing_m).floor() as usize);
        // Centred: as far from one wall as from that opposite.
        let first =
            [0, 1].map(|k| low[k] + 0.5 * (sides_m[k] - spacing_m * counts[k].saturating_sub(1) as f64));
        let all = (0..counts[1]).flat_map(|j| (0..counts[0]).map(move |i| [i, j]));
        let places_m: Vec<[f64; 3]> = all
            .map(|[i, j]| [first[0] + i as f64 * spacing_m, first[1] + j as f64 * spacing_m, height_m])
            .filter(is_free)
            .collect();
        if places_m.is_empty() {
            return Err(PlanError::NoPlace { height_m: height_m - low[2], clearance_m });
        }
        if places_m.len() <= most {
            return Ok(Grid { spacing_m, places_m });
        }
        spacing_m *= GROWTH;
    }
}
