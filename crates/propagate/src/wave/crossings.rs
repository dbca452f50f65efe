//! Where the lines between the centres of neighbouring voxels cross the mesh.

use super::axes::Axes;
use crate::vector::{Vec3, cross, norm, sub};
use rayon::prelude::*;
use sabine_scene::Scene;

/// Triangles reach this much farther (m): cracks between neighbours are closed. Crossings found twice do no harm.
const REACH_M: f64 = 1e-5;
/// A centre this near to a surface, in voxels, is on it, and cut off on both sides: which side it would otherwise belong to
/// might differ from axis to axis.
const ON_SURFACE: f64 = 1e-6;

/// A line from a centre to the next one that meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crossing {
    /// The voxel at the lower end of the line.
    pub voxel: u32,
    /// Where on the line, in voxels: 0 to 1.
    pub at: f64,
    pub triangle: u32,
}

/// All crossings along one axis, sorted by voxel and place.
pub(crate) fn crossings(scene: &Scene, axes: &Axes, axis: usize) -> Vec<Crossing> {
    let mut found: Vec<Crossing> = (0..scene.triangles().len())
        .into_par_iter()
        .flat_map_iter(|triangle| of_triangle(axes, axis, triangle as u32, scene.corners_m(triangle)))
        .collect();
    let order = |c: &Crossing, d: &Crossing| {
        c.voxel.cmp(&d.voxel).then(c.at.total_cmp(&d.at)).then(c.triangle.cmp(&d.triangle))
    };
    found.par_sort_unstable_by(order);
    found
}

fn of_triangle(axes: &Axes, axis: usize, triangle: u32, corners: [Vec3; 3]) -> Vec<Crossing> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let flat = corners.map(|corner| [corner[u], corner[v]]);
    let doubled =
        |a: [f64; 2], b: [f64; 2], p: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let area = doubled(flat[0], flat[1], flat[2]);
    let whole = norm(cross(sub(corners[1], corners[0]), sub(corners[2], corners[0])));
    let mut found = Vec::new();
    // Seen edge-on it is crossed by nothing; its neighbours are.
    if whole <= 0.0 || area.abs() < 1e-9 * whole {
        return found;
    }
    let sides: [f64; 3] = std::array::from_fn(|i| {
        let (a, b) = (flat[(i + 1) % 3], flat[(i + 2) % 3]);
        (b[0] - a[0]).hypot(b[1] - a[1])
    });
    let range = |axis: usize| {
        let low = corners.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
        let high = corners.iter().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max);
        axes.between(axis, low, high, REACH_M)
    };
    let (lines_u, lines_v) = (range(u), range(v));
    for j in lines_v {
        let at_v = axes.low_m[v] + (j as f64 - 0.5) * axes.spacing_m[v];
        for i in lines_u.clone() {
            let point = [axes.low_m[u] + (i as f64 - 0.5) * axes.spacing_m[u], at_v];
            let weights: [f64; 3] =
                std::array::from_fn(|k| doubled(flat[(k + 1) % 3], flat[(k + 2) % 3], point) * area.signum());
            if (0..3).any(|k| weights[k] < -REACH_M * sides[k]) {
                continue;
            }
            // Within the triangle also where it reaches beyond: edge-on, its plane would lead far away.
            let weights = weights.map(|w| w.max(0.0));
            let sum: f64 = weights.iter().sum();
            let depth = (0..3).map(|k| weights[k] / sum * corners[k][axis]).sum::<f64>();
            let place = axes.coordinate(axis, depth);
            if place < 0.0 || place >= (axes.count[axis] - 1) as f64 {
                continue;
            }
            let mut cell = [0; 3];
            (cell[u], cell[v], cell[axis]) = (i, j, place as usize);
            let at = place - place.floor();
            let voxel = axes.index(cell);
            let stride = axes.strides()[axis];
            found.push(Crossing { voxel: voxel as u32, at, triangle });
            if at < ON_SURFACE && cell[axis] > 0 {
                found.push(Crossing { voxel: (voxel - stride) as u32, at: 1.0, triangle });
            }
            if at > 1.0 - ON_SURFACE && cell[axis] + 2 < axes.count[axis] {
                found.push(Crossing { voxel: (voxel + stride) as u32, at: 0.0, triangle });
            }
        }
    }
    found
}
