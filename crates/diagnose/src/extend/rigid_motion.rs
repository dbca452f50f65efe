//! A rigid motion of all places: what one system of coordinates is in another.

use serde::{Deserialize, Serialize};

/// A turn about a vertical axis, then a shift: all distances between places stay as they are.
///
/// ```
/// use sabine_diagnose::RigidMotion;
/// let motion = RigidMotion::new([0.2, 0.0, -0.1], 90.0, [1.0, 1.0, 0.0]);
/// let [x, y, z] = motion.moved([2.0, 1.0, 1.5]);
/// assert!((x - 1.2).abs() < 1e-12 && (y - 2.0).abs() < 1e-12 && (z - 1.4).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RigidMotion {
    /// Shift along each axis of the mesh, in metres.
    pub shift_m: [f64; 3],
    /// Turn about the vertical through `about_m` in degrees, from x towards y: counter-clockwise from above.
    pub turn_deg: f64,
    /// A point on the vertical axis of the turn, in metres.
    pub about_m: [f64; 3],
}

impl RigidMotion {
    /// A turn in degrees about the vertical through a point, then a shift in metres.
    pub fn new(shift_m: [f64; 3], turn_deg: f64, about_m: [f64; 3]) -> Self {
        Self { shift_m, turn_deg, about_m }
    }

    /// Where a place comes to be.
    pub fn moved(&self, place_m: [f64; 3]) -> [f64; 3] {
        let [moved] = self.all_moved([place_m]);
        moved
    }

    /// Where several places come to be.
    pub(crate) fn all_moved<const N: usize>(&self, places_m: [[f64; 3]; N]) -> [[f64; 3]; N] {
        let (sin, cos) = self.turn_deg.to_radians().sin_cos();
        places_m.map(|place_m| {
            let [x, y, z] = std::array::from_fn(|k| place_m[k] - self.about_m[k]);
            let turned = [cos * x - sin * y, sin * x + cos * y, z];
            std::array::from_fn(|k| self.about_m[k] + turned[k] + self.shift_m[k])
        })
    }

    /// Where a direction comes to point.
    pub fn turned(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = self.turn_deg.to_radians().sin_cos();
        [cos * x - sin * y, sin * x + cos * y, z]
    }

    /// The place that comes to be here.
    pub(crate) fn before(&self, moved_m: [f64; 3]) -> [f64; 3] {
        let back = Self { turn_deg: -self.turn_deg, ..*self };
        let from_axis = back.turned(std::array::from_fn(|k| moved_m[k] - self.shift_m[k] - self.about_m[k]));
        std::array::from_fn(|k| self.about_m[k] + from_axis[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_stay_and_the_way_back_leads_back() {
        let motion = RigidMotion::new([0.4, -0.3, 0.2], 7.0, [2.0, 1.5, 1.1]);
        let places = [[0.3, 0.4, 1.0], [4.1, 2.2, 1.6], [2.0, 1.5, 0.0]];
        let far = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
        for a in places {
            for b in places {
                assert!((far(motion.moved(a), motion.moved(b)) - far(a, b)).abs() < 1e-12);
            }
            assert!(far(motion.before(motion.moved(a)), a) < 1e-12);
        }
        // What stands on the axis is shifted alone.
        assert!(far(motion.moved([2.0, 1.5, 0.0]), [2.4, 1.2, 0.2]) < 1e-12);
    }
}
