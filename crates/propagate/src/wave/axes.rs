//! The voxel grid: how many voxels, how large, and where.

use super::error::WaveError;
use crate::vector::Vec3;
use std::ops::Range;

/// Fewest voxels between two sides of the room: with less there is no inside to speak of.
const LEAST_VOXELS: f64 = 4.0;
/// Memory for each voxel of the grid (bytes): two pressures and a mark, and voxels with walls, a tenth of them in a room of
/// 170,000, 240 bytes each.
const BYTES_PER_VOXEL: u64 = 48;
/// Voxels that an index can name.
const MOST_VOXELS: f64 = 4e9;

/// Voxels that fill a box around the mesh, and one more layer around that: a wave that gets there has left the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axes {
    /// Corner of the mesh's box, in metres.
    pub low_m: Vec3,
    /// Sides of a voxel, in metres. They divide the box evenly: its sides are borders of voxels.
    pub spacing_m: Vec3,
    /// Voxels along each axis, with the outer layer.
    pub count: [usize; 3],
}

impl Axes {
    /// Voxels of at most `spacing_m`, within the budget. `limit_hz` is what the spacing was chosen for.
    pub fn new(
        low_m: Vec3,
        high_m: Vec3,
        spacing_m: f64,
        limit_hz: f64,
        budget_bytes: u64,
    ) -> Result<Self, WaveError> {
        let side_m: Vec3 = std::array::from_fn(|a| high_m[a] - low_m[a]);
        let shortest_m = side_m.into_iter().fold(f64::INFINITY, f64::min);
        if shortest_m < LEAST_VOXELS * spacing_m {
            return Err(WaveError::ThinRoom {
                side_m: shortest_m,
                spacing_m,
                needed_hz: limit_hz * LEAST_VOXELS * spacing_m / shortest_m.max(1e-9),
            });
        }
        let inner = side_m.map(|side| (side / spacing_m - 1e-9).ceil().max(1.0));
        let voxels: f64 = inner.iter().map(|n| n + 2.0).product();
        let bytes = voxels * BYTES_PER_VOXEL as f64;
        let most = (budget_bytes as f64).min(MOST_VOXELS * BYTES_PER_VOXEL as f64);
        if bytes > most {
            return Err(WaveError::GridTooLarge {
                limit_hz,
                voxels: voxels as u64,
                bytes: bytes as u64,
                budget_bytes,
                fitting_hz: fitting_hz(side_m, spacing_m, limit_hz, most),
            });
        }
        let spacing = std::array::from_fn(|a| side_m[a] / inner[a]);
        Ok(Self { low_m, spacing_m: spacing, count: inner.map(|n| n as usize + 2) })
    }

    /// Voxels, with the outer layer.
    pub fn voxels(&self) -> usize {
        self.count.iter().product()
    }

    /// Memory of a grid of this size, in bytes.
    pub fn bytes(&self) -> u64 {
        self.voxels() as u64 * BYTES_PER_VOXEL
    }

    /// Steps of the index along each axis.
    pub fn strides(&self) -> [usize; 3] {
        [1, self.count[0], self.count[0] * self.count[1]]
    }

    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.count[0] * (j + self.count[1] * k)
    }

    pub fn place(&self, index: usize) -> [usize; 3] {
        let [x, y, _] = self.count;
        [index % x, index / x % y, index / (x * y)]
    }

    /// Whether a voxel belongs to the outer layer.
    pub fn is_outer(&self, index: usize) -> bool {
        let place = self.place(index);
        (0..3).any(|a| place[a] == 0 || place[a] + 1 == self.count[a])
    }

    /// A coordinate in units of voxels, whole at the centres.
    pub fn coordinate(&self, axis: usize, position_m: f64) -> f64 {
        (position_m - self.low_m[axis]) / self.spacing_m[axis] + 0.5
    }

    /// Centre of a voxel in metres.
    pub fn centre_m(&self, index: usize) -> Vec3 {
        let place = self.place(index);
        std::array::from_fn(|a| self.low_m[a] + (place[a] as f64 - 0.5) * self.spacing_m[a])
    }

    /// Centres within a range of positions, widened by a distance.
    pub fn between(&self, axis: usize, low_m: f64, high_m: f64, wider_m: f64) -> Range<usize> {
        let last = self.count[axis] as f64;
        let first = self.coordinate(axis, low_m - wider_m).ceil().clamp(0.0, last);
        let end = (self.coordinate(axis, high_m + wider_m).floor() + 1.0).clamp(first, last);
        first as usize..end as usize
    }
}

/// The highest limit whose grid fits, to whole hertz.
fn fitting_hz(side_m: Vec3, spacing_m: f64, limit_hz: f64, most_bytes: f64) -> f64 {
    let fits = |hz: f64| {
        let spacing_m = spacing_m * limit_hz / hz;
        let voxels: f64 = side_m.iter().map(|side| (side / spacing_m - 1e-9).ceil().max(1.0) + 2.0).product();
        voxels * BYTES_PER_VOXEL as f64 <= most_bytes
    };
    let (mut low, mut high) = (0.0, limit_hz);
    while high - low > 0.5 {
        let middle = 0.5 * (low + high);
        if fits(middle) { low = middle } else { high = middle }
    }
    f64::floor(low)
}
