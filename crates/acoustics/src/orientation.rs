//! Which way a source or a listener faces.

use crate::error::Error;
use crate::out_of_range::OutOfRange;

/// The frame of a source or a listener in the room: x forward, y to the left, z up, right-handed and orthonormal.
///
/// ```
/// use sabine_acoustics::Orientation;
/// // A listener who looks along +y: what comes from +x is to the right.
/// let facing = Orientation::towards([0.0, 1.0, 0.0])?;
/// assert_eq!(facing.to_local([1.0, 0.0, 0.0]), [0.0, -1.0, 0.0]);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    forward: [f64; 3],
    left: [f64; 3],
    up: [f64; 3],
}

impl Default for Orientation {
    /// Forward is +x, up is +z of the room.
    fn default() -> Self {
        Self { forward: [1.0, 0.0, 0.0], left: [0.0, 1.0, 0.0], up: [0.0, 0.0, 1.0] }
    }
}

impl Orientation {
    /// Faces along `forward`; `up` is made perpendicular to it. Neither needs to be of unit length.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a vector that is zero or not finite, or two that are less than a thousandth of a radian from
    /// parallel.
    pub fn new(forward: [f64; 3], up: [f64; 3]) -> Result<Self, Error> {
        let forward = unit("length of the forward vector", forward)?;
        let up = unit("length of the up vector", up)?;
        let left = cross(up, forward);
        OutOfRange::check(
            "sine of the angle between forward and up",
            norm(left),
            1e-3,
            1.1,
            "at least 0.001",
        )?;
        let left = unit("length of the left vector", left)?;
        Ok(Self { forward, left, up: cross(forward, left) })
    }

    /// Faces along `forward` with +z of the room as nearly up as it can be; a vertical `forward` has +x up.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a vector that is zero or not finite.
    pub fn towards(forward: [f64; 3]) -> Result<Self, Error> {
        let forward = unit("length of the forward vector", forward)?;
        let upright = forward[2].abs() < 1.0 - 1e-6;
        Self::new(forward, if upright { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] })
    }

    /// Unit vector forward, in the room.
    pub fn forward(&self) -> [f64; 3] {
        self.forward
    }

    /// Unit vector to the left, in the room.
    pub fn left(&self) -> [f64; 3] {
        self.left
    }

    /// Unit vector upward, in the room.
    pub fn up(&self) -> [f64; 3] {
        self.up
    }

    /// Components of a room vector along forward, left and up.
    pub fn to_local(&self, room: [f64; 3]) -> [f64; 3] {
        [dot(room, self.forward), dot(room, self.left), dot(room, self.up)]
    }

    /// The room vector with these components along forward, left and up.
    pub fn to_room(&self, local: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| local[0] * self.forward[i] + local[1] * self.left[i] + local[2] * self.up[i])
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

fn unit(field: &'static str, a: [f64; 3]) -> Result<[f64; 3], Error> {
    let length = norm(a);
    OutOfRange::check(field, length, 1e-9, 1e9, "finite and not zero")?;
    Ok(a.map(|c| c / length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = [f64; 3]> {
        proptest::array::uniform3(-5.0f64..5.0).prop_filter("not zero", |v| norm(*v) > 1e-2)
    }

    proptest! {
        #[test]
        fn the_frame_is_a_rotation(forward in vector(), up in vector(), any in vector()) {
            let Ok(frame) = Orientation::new(forward, up) else { return Ok(()) };
            let axes = [frame.forward(), frame.left(), frame.up()];
            for i in 0..3 {
                for j in 0..3 {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    prop_assert!((dot(axes[i], axes[j]) - expected).abs() < 1e-12);
                }
            }
            prop_assert!((dot(cross(axes[0], axes[1]), axes[2]) - 1.0).abs() < 1e-12);
            let back = frame.to_room(frame.to_local(any));
            prop_assert!((0..3).all(|i| (back[i] - any[i]).abs() < 1e-10));
        }
    }

    #[test]
    fn what_is_no_direction_is_refused() {
        let x = [1.0, 0.0, 0.0];
        assert!(matches!(Orientation::new([0.0; 3], x), Err(Error::OutOfRange(_))));
        assert!(matches!(Orientation::new([f64::NAN, 0.0, 0.0], x), Err(Error::OutOfRange(_))));
        assert!(matches!(Orientation::new(x, [-2.0, 0.0, 0.0]), Err(Error::OutOfRange(_))));
        assert!(Orientation::towards([0.0, 0.0, -3.0]).is_ok());
    }
}
