//! Whether a mesh lies on its side: a common slip, since many programs write y up.

use crate::error::Error;
use crate::mesh_file::up_axis::UpAxis;
use crate::scene::{Receiver, Scene, Source};
use crate::scene::{cross, sub};
use std::path::Path;

/// How far outside the box around the mesh a place may be (m): a matter for the tracer.
const MARGIN_M: f64 = 1e-3;
/// No common room is as high as this (m) ...
const HIGH_M: f64 = 4.5;
/// ... or as low as this (m).
const LOW_M: f64 = 2.0;

/// Refuses a mesh if a place is outside and all would be inside with the other axis up.
pub(super) fn check(
    path: &Path,
    scene: &Scene,
    up_axis: UpAxis,
    sources: &[Source],
    receivers: &[Receiver],
) -> Result<(), Error> {
    let box_m = scene.bounds_m();
    let fields = (0..sources.len()).map(|i| format!("sources[{i}].position_m"));
    let fields = fields.chain((0..receivers.len()).map(|i| format!("receivers[{i}].position_m")));
    let places = places(sources, receivers);
    let Some((field, position_m)) = fields.zip(&places).find(|(_, place)| !holds(box_m, **place)) else {
        return Ok(());
    };
    let (other, turned_m) = (up_axis.other(), turned_box(box_m, up_axis));
    if places.iter().any(|&place| !holds(turned_m, place)) {
        return Ok(());
    }
    let [low_m, high_m] = box_m;
    let error = Error::TurnedMesh { position_m: *position_m, low_m, high_m, up_axis: other };
    Err(error.in_file(path, field))
}

/// The axis that seems to point up although the mesh was read with another one, places being inside either way.
pub(super) fn suspected(
    scene: &Scene,
    up_axis: UpAxis,
    sources: &[Source],
    receivers: &[Receiver],
) -> Option<UpAxis> {
    let box_m = scene.bounds_m();
    let (other, turned_m) = (up_axis.other(), turned_box(box_m, up_axis));
    if places(sources, receivers).iter().any(|&place| !holds(turned_m, place)) {
        return None;
    }
    // Area by material of faces that would be level, as read and turned.
    let mut level_m2 = vec![[0.0; 2]; scene.materials().len()];
    for (i, triangle) in scene.triangles().iter().enumerate() {
        let [a, b, c] = scene.corners_m(i);
        let normal = cross(sub(b, a), sub(c, a)).map(|x| 0.5 * x.abs());
        let level = &mut level_m2[triangle.material as usize];
        for (sum, axis) in level.iter_mut().zip([2, 1]) {
            *sum += if normal[axis] > 10.0 * (normal[0] + normal[3 - axis]) { normal[axis] } else { 0.0 };
        }
    }
    let levels = |name: &str| ["floor", "ceiling"].iter().any(|word| name.to_lowercase().contains(word));
    let named = scene.materials().iter().zip(&level_m2).any(|(material, [as_read, turned])| {
        levels(&material.name) && *turned > 0.0 && *as_read <= 0.01 * turned
    });
    let sum = |k: usize| level_m2.iter().map(|level| level[k]).sum::<f64>();
    let extent = |box_m: [[f64; 3]; 2]| box_m[1][2] - box_m[0][2];
    let (height_m, turned_height_m) = (extent(box_m), extent(turned_m));
    let lies =
        sum(1) > 1.5 * sum(0) && height_m > HIGH_M && (LOW_M..=0.6 * height_m).contains(&turned_height_m);
    (named || lies).then_some(other)
}

fn places(sources: &[Source], receivers: &[Receiver]) -> Vec<[f64; 3]> {
    sources.iter().map(|s| s.position_m).chain(receivers.iter().map(|r| r.position_m)).collect()
}

fn holds([low, high]: [[f64; 3]; 2], place: [f64; 3]) -> bool {
    (0..3).all(|k| place[k] >= low[k] - MARGIN_M && place[k] <= high[k] + MARGIN_M)
}

fn turned_box(box_m: [[f64; 3]; 2], up_axis: UpAxis) -> [[f64; 3]; 2] {
    let [a, b] = box_m.map(|corner| up_axis.to_other(corner));
    [[0, 1, 2].map(|k| a[k].min(b[k])), [0, 1, 2].map(|k| a[k].max(b[k]))]
}
